"""Points of a stereo view, followed in both eyes until the view is too far away and a new one takes its place."""

from dataclasses import dataclass

import numpy as np

from vobench.estimator.pose import DisparityOffset, PoseFit, pose_from_points
from vobench.estimator.protocol import Image
from vobench.estimator.tools import (
    Mask,
    Points,
    StereoPair,
    comparable,
    corners_per_cell,
    follow_predicted,
    inside,
    lucas_kanade,
    predicted,
)
from vobench.geometry import se3
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSettings:
    """What a tracker looks for: corners in each of 6 x 4 cells, and how they are followed."""

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int  # corners closer to the border lose part of their window
    window_px: int
    min_points: int
    ransac_px: float


@dataclass(frozen=True, slots=True)
class StereoView:
    """A stereo pair, the pixels (N, 2) of its points in both pictures, and their disparities (N,) in px as measured."""

    left: Image
    right: Image
    in_left: Points
    in_right: Points
    disparity_px: Array


@dataclass(frozen=True, slots=True)
class Followed:
    """Points found again: where (N, 2) then and now in the left picture, and disparities (N,) then and now, in px.

    Disparities are as measured; the later one is NaN where the right eye lost the point.
    """

    uv_last_px: Points
    uv_px: Points
    disparity_last_px: Array
    disparity_px: Array

    @property
    def flow_px(self) -> float:
        """Median length of the tracks; 0 where there is none."""
        flow = np.linalg.norm(self.uv_px - self.uv_last_px, axis=1)
        return float(np.median(flow)) if len(flow) else 0.0


class StereoTracker:
    """Holds one view and follows its points into later pictures, each from its own eye: the eyes' errors cancel."""

    def __init__(self, pair: StereoPair, settings: TrackerSettings) -> None:
        self._pair = pair
        self._settings = settings
        self._view: StereoView | None = None
        self.offset = DisparityOffset()

    @property
    def has_view(self) -> bool:
        """Whether there is a view to follow points from."""
        return self._view is not None

    def look(self, left: Image, right: Image) -> bool:
        """Take this pair as the view; False, and nothing happens, where it has too few points with a depth."""
        s = self._settings
        pair = self._pair
        corners = corners_per_cell(left, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        corners = corners[pair.seen(corners)]
        in_right, disparity_px = pair.match(
            left, right, corners, margin_px=s.margin_px, window_px=s.window_px, with_edges=False
        )
        known = np.isfinite(disparity_px)
        if known.sum() < s.min_points:
            return False
        self._view = StereoView(left, right, corners[known], in_right[known], disparity_px[known])
        return True

    def follow(self, left: Image, right: Image, T_now_last: Array) -> Followed:
        """The view's points in a later pair, looked for where a predicted motion of the view would bring them."""
        view = self._view
        s = self._settings
        assert view is not None
        rho = (view.disparity_px - self.offset.px) / self._pair.focal_baseline
        guess = predicted(self._pair.left, view.in_left, rho, T_now_last)
        there, found = follow_predicted(*comparable(view.left, left), view.in_left, guess, window_px=s.window_px)
        good = found & inside(there, left, s.margin_px) & self._pair.seen(there)
        return Followed(
            view.in_left[good], there[good], view.disparity_px[good], self._in_right(right, there, good, T_now_last)
        )

    def _in_right(self, right: Image, there: Points, good: Mask, T_now_last: Array) -> Array:
        """Disparities (M,) now of the good ones, NaN for those lost: as much nearer as the prediction says, first."""
        view = self._view
        pair = self._pair
        s = self._settings
        assert view is not None
        if not good.any():
            return np.zeros(0)
        points_m = pair.points(view.in_left[good], view.disparity_px[good] - self.offset.px)
        shift_px = pair.focal_baseline / se3.apply(T_now_last, points_m)[:, 2] + self.offset.px
        beside = pair.right.from_view(pair.left.in_view(there[good]) - np.c_[shift_px, np.zeros_like(shift_px)])
        start = view.in_right[good]
        guess = np.where(np.isfinite(beside), beside, start).astype(np.float32)
        # One way only: least squares sees whether both eyes agree.
        in_right, found = lucas_kanade(*comparable(view.right, right), start, guess, window_px=s.window_px)
        disparity_px = pair.disparity(there[good], in_right)
        return np.where(found & inside(in_right, right, s.margin_px), disparity_px, np.nan)

    def fit(self, followed: Followed) -> PoseFit | None:
        """The motion T_now_last of the view that explains the points; None where there is none."""
        if len(followed.uv_px) < self._settings.min_points:
            return None
        return pose_from_points(
            self._pair.points(followed.uv_last_px, followed.disparity_last_px - self.offset.px),
            self._pair.left.in_view(followed.uv_px),
            self._pair.K,
            disparity_px=followed.disparity_px - self.offset.px,
            baseline_m=self._pair.baseline_m,
            ransac_px=self._settings.ransac_px,
        )

    def learn(self, followed: Followed, T_now_last: Array) -> None:
        """Learn the pair's offset of disparity from points followed over a motion that is known by now."""
        rays0 = self._pair.left.rays(followed.uv_last_px)
        rays1 = self._pair.left.rays(followed.uv_px)
        self.offset = self.offset.after(rays0, rays1, followed.disparity_last_px, T_now_last, self._pair)
