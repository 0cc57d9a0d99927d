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
        """The view's points in a later pair; a predicted motion of the view is the guess."""
        view = self._view
        pair = self._pair
        s = self._settings
        assert view is not None
        rho = (view.disparity_px - self.offset.px) / pair.focal_baseline
        guess = predicted(pair.left, view.in_left, rho, T_now_last)

        earlier, now = comparable(view.left, left)
        there, found = follow_predicted(earlier, now, view.in_left, guess, window_px=s.window_px)
        good = found & inside(there, left, s.margin_px) & pair.seen(there)
        in_view = StereoView(view.left, view.right, view.in_left[good], view.in_right[good], view.disparity_px[good])
        disparity_px = self._present_disparity(in_view, right, there[good], T_now_last)
        return Followed(in_view.in_left, there[good], in_view.disparity_px, disparity_px)

    def _present_disparity(self, view: StereoView, right: Image, there: Points, T_now_last: Array) -> Array:
        """Disparities (N,) of a view's points, which are now at `there` (N, 2) in the left picture; NaN if lost.

        The predicted motion gives the guess.
        """
        pair = self._pair
        s = self._settings
        if not len(there):
            return np.zeros(0)
        offset_px = self.offset.px
        points_m = pair.points(view.in_left, view.disparity_px - offset_px)
        depth_m = se3.apply(T_now_last, points_m)[:, 2]
        predicted_px = pair.focal_baseline / depth_m + offset_px
        in_right_view = shifted_left(pair.left.in_view(there), predicted_px)
        in_right_guess = pair.right.from_view(in_right_view)
        guess = np.where(np.isfinite(in_right_guess), in_right_guess, view.in_right).astype(np.float32)

        # Not checked backwards: least squares shows whether both cameras agree.
        earlier, now = comparable(view.right, right)
        in_right, found = lucas_kanade(earlier, now, view.in_right, guess, window_px=s.window_px)
        disparity_px = pair.disparity(there, in_right)
        is_tracked = found & inside(in_right, right, s.margin_px)
        return np.where(is_tracked, disparity_px, np.nan)

    def fit(self, followed: Followed) -> PoseFit | None:
        """The motion T_now_last of the view that explains the points; None if there is none."""
        if len(followed.uv_px) < self._settings.min_points:
            return None
        true_last_px = followed.disparity_last_px - self.offset.px
        true_px = followed.disparity_px - self.offset.px
        return pose_from_points(
            self._pair.points(followed.uv_last_px, true_last_px),
            self._pair.left.in_view(followed.uv_px),
            self._pair.K,
            disparity_px=true_px,
            baseline_m=self._pair.baseline_m,
            ransac_px=self._settings.ransac_px,
        )

    def learn(self, followed: Followed, T_now_last: Array) -> None:
        """Update the pair's disparity offset from tracks over a motion that is known by now."""
        rays_last = self._pair.left.rays(followed.uv_last_px)
        rays_now = self._pair.left.rays(followed.uv_px)
        disparity_px = followed.disparity_last_px
        self.offset = self.offset.after(rays_last, rays_now, disparity_px, T_now_last, self._pair)
