"""Points of a stereo view, tracked in both cameras until the view is too far away and a new one replaces it."""

from dataclasses import dataclass

import numpy as np

from vobench.estimator.disparity_offset import DisparityOffset
from vobench.estimator.pose import PoseFit, pose_from_points
from vobench.estimator.protocol import Image
from vobench.estimator.stereo import StereoPair, predicted, shifted_left
from vobench.estimator.tracking import (
    Points,
    comparable,
    corners_per_cell,
    follow_predicted,
    inside,
    lucas_kanade,
)
from vobench.geometry import se3
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSettings:
    """How many corners each of 6 x 4 cells has, and how they are tracked."""

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int  # corners closer to the border lose part of their window
    window_px: int
    min_points: int
    ransac_px: float


@dataclass(frozen=True, slots=True)
class StereoView:
    """A stereo pair, the pixels (N, 2) of its points in both pictures, and their measured disparities (N,) in px."""

    left: Image
    right: Image
    in_left: Points
    in_right: Points
    disparity_px: Array


@dataclass(frozen=True, slots=True)
class Followed:
    """Tracks from the view: pixels (N, 2) in the left pictures and disparities (N,) in px, in the view and now.

    Disparities are as measured; the present one is NaN if the right camera lost the point.
    """

    uv_last_px: Points
    uv_px: Points
    disparity_last_px: Array
    disparity_px: Array

    @property
    def flow_px(self) -> float:
        """Median length of the tracks; 0 without tracks."""
        if not len(self.uv_px):
            return 0.0
        lengths_px = np.linalg.norm(self.uv_px - self.uv_last_px, axis=1)
        return float(np.median(lengths_px))


class StereoTracker:
    """Holds one view and tracks its points, left to left and right to right, so that the cameras' errors cancel."""

    def __init__(self, pair: StereoPair, settings: TrackerSettings) -> None:
        self._pair = pair
        self._settings = settings
        self._view: StereoView | None = None
        self.offset = DisparityOffset()

    @property
    def has_view(self) -> bool:
        """Whether there is a view to track points from."""
        return self._view is not None

    def look(self, left: Image, right: Image) -> bool:
        """Take this pair as the view; return False, and keep the old view, if it has too few points with a depth."""
        s = self._settings
        corners = corners_per_cell(left, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        corners = corners[self._pair.seen(corners)]
        in_right, disparity_px = self._pair.match(
            left, right, corners, margin_px=s.margin_px, window_px=s.window_px, with_edges=False
        )
        known = np.isfinite(disparity_px)
        if known.sum() < s.min_points:
            return False
        self._view = StereoView(left, right, corners[known], in_right[known], disparity_px[known])
        return True

    def follow(self, left: Image, right: Image, T_now_last: Array) -> Followed:
        """Track the view's points into a later pair, from where the predicted motion of the view puts them."""
        view = self._view
        assert view is not None
        pair = self._pair
        margin_px = self._settings.margin_px

        inverse_depth = (view.disparity_px - self.offset.px) / pair.focal_baseline  # (N,), 1/m
        guess_px = predicted(pair.left, view.in_left, inverse_depth, T_now_last)
        before, now = comparable(view.left, left)
        uv_px, is_found = follow_predicted(before, now, view.in_left, guess_px, window_px=self._settings.window_px)
        is_tracked = is_found & inside(uv_px, left, margin_px) & pair.seen(uv_px)

        tracked_px = uv_px[is_tracked]
        tracked = StereoView(
            view.left,
            view.right,
            view.in_left[is_tracked],
            view.in_right[is_tracked],
            view.disparity_px[is_tracked],
        )
        disparity_px = self._present_disparity(tracked, right, tracked_px, T_now_last)
        return Followed(tracked.in_left, tracked_px, tracked.disparity_px, disparity_px)

    def _present_disparity(self, view: StereoView, right: Image, uv_px: Points, T_now_last: Array) -> Array:
        """Disparities (N,) of a view's points, which are now at uv_px (N, 2) in the left picture; NaN if lost.

        The search in the right picture starts where the predicted motion puts each point.
        """
        if not len(uv_px):
            return np.zeros(0)
        pair = self._pair
        offset_px = self.offset.px

        points_m = pair.points(view.in_left, view.disparity_px - offset_px)
        depth_m = se3.apply(T_now_last, points_m)[:, 2]
        predicted_disparity_px = pair.focal_baseline / depth_m + offset_px
        in_right_view = shifted_left(pair.left.in_view(uv_px), predicted_disparity_px)
        predicted_right_px = pair.right.from_view(in_right_view)
        is_predicted = np.isfinite(predicted_right_px)
        guess_px = np.where(is_predicted, predicted_right_px, view.in_right).astype(np.float32)

        # Not checked backwards: least squares shows whether both cameras agree.
        before, now = comparable(view.right, right)
        in_right, is_found = lucas_kanade(before, now, view.in_right, guess_px, window_px=self._settings.window_px)
        is_tracked = is_found & inside(in_right, right, self._settings.margin_px)
        return np.where(is_tracked, pair.disparity(uv_px, in_right), np.nan)

    def fit(self, followed: Followed) -> PoseFit | None:
        """The motion T_now_last of the view that explains the points; None if there is none."""
        if len(followed.uv_px) < self._settings.min_points:
            return None
        corrected_last_px = followed.disparity_last_px - self.offset.px
        corrected_px = followed.disparity_px - self.offset.px
        return pose_from_points(
            self._pair.points(followed.uv_last_px, corrected_last_px),
            self._pair.left.in_view(followed.uv_px),
            self._pair.K,
            disparity_px=corrected_px,
            baseline_m=self._pair.baseline_m,
            ransac_px=self._settings.ransac_px,
        )

    def learn(self, followed: Followed, T_now_last: Array) -> None:
        """Update the pair's disparity offset from tracks over a motion that is known by now."""
        rays_last = self._pair.left.rays(followed.uv_last_px)
        rays_now = self._pair.left.rays(followed.uv_px)
        disparity_px = followed.disparity_last_px
        self.offset = self.offset.after(rays_last, rays_now, disparity_px, T_now_last, self._pair)
