"""Stereo visual odometry from points: where a point in space is seen next says how the camera moved."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.estimator import Frame, Result, Status, Tracks
from vobench.estimator.protocol import Image
from vobench.estimator.tools import (
    DisparityOffset,
    Points,
    PoseFit,
    carried_on,
    comparable,
    corners_per_cell,
    follow_predicted,
    inside,
    lucas_kanade,
    parameters,
    pose_from_points,
    predicted,
    stereo_pair,
)
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters of the manifest."""

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int
    window_px: int
    min_points: int
    min_flow_px: float
    keep_below_px: float
    ransac_px: float
    degraded_above_px: float


@dataclass(frozen=True, slots=True)
class View:
    """A stereo pair, the pixels (N, 2) of its points in both pictures, and their disparities (N,) in px."""

    left: Image
    right: Image
    in_left: Points
    in_right: Points
    disparity_px: Array


@dataclass(frozen=True, slots=True)
class Followed:
    """Points of the last view found again: which (N,), where (N, 2), and with which disparity (N,), NaN for none."""

    kept: Points
    there: Points
    index: Array
    disparity_px: Array

    @property
    def flow_px(self) -> float:
        """Median length of the tracks."""
        return float(np.median(np.linalg.norm(self.there - self.kept, axis=1)))


class StereoPnp:
    """Follows points of the last view into both new pictures, each from its own eye, and fits the motion to them."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is no stereo pair."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "stereo_pnp")
        self._pair = stereo_pair(rig, "stereo_pnp")
        self._offset = DisparityOffset()
        self._last: View | None = None
        self._T_odom_last = np.eye(4)  # pose of the view that points are followed from, in the view's axes
        self._T_odom_before = self._T_odom_now = np.eye(4)  # the last two poses

    def process(self, frame: Frame) -> Result:
        """Follow the last view's points, find the motion that brings them there, look for new ones when it is far."""
        if frame.left is None or frame.right is None:
            return Result(None, Status.LOST, "no_picture")
        if self._last is None:
            is_seen = self._remember(frame.left, frame.right)
            return Result(self._pose, Status.INIT) if is_seen else Result(None, Status.LOST, "few_corners")

        followed = self._follow(self._last, frame.left, frame.right)
        if len(followed.kept) < self._settings.min_points:
            return self._lost(frame, "few_tracks")
        if followed.flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_now = self._T_odom_last
            return Result(self._pose, Status.STATIONARY, "no_flow")

        points_m = self._pair.points(followed.kept, self._last.disparity_px[followed.index] - self._offset.px)
        disparity_px = followed.disparity_px - self._offset.px
        uv_px = self._pair.left.in_view(followed.there)
        fit = pose_from_points(points_m, uv_px, disparity_px, self._pair, ransac_px=self._settings.ransac_px)
        if fit is None:
            return self._lost(frame, "no_model")
        return self._step(frame.left, frame.right, followed, fit)

    @property
    def _pose(self) -> Array:
        return self._pair.T_left(self._T_odom_now)

    def _follow(self, last: View, left: Image, right: Image) -> Followed:
        """Tracks in the left eye, there and back, and of these in the right eye, there only: stereo judges them."""
        pair, s = self._pair, self._settings
        rho = (last.disparity_px - self._offset.px) / pair.focal_baseline
        T_now_last = se3.inverse(carried_on(self._T_odom_before, self._T_odom_now)) @ self._T_odom_last
        guess = predicted(pair.left, last.in_left, rho, T_now_last)
        there, found = follow_predicted(*comparable(last.left, left), last.in_left, guess, window_px=s.window_px)
        index = np.flatnonzero(found & inside(there, left, s.margin_px) & pair.seen(there))
        if not len(index):
            return Followed(last.in_left[index], there[index], index, np.zeros(0))
        # The right eye sees what the left one does, as much nearer as the prediction says.
        points_m = pair.left.rays(last.in_left[index]) / rho[index, None]
        disparity_px = pair.focal_baseline / se3.apply(T_now_last, points_m)[:, 2]
        beside = pair.right.from_view(pair.left.in_view(there[index]) - np.c_[disparity_px, 0 * disparity_px])
        guess = np.where(np.isfinite(beside), beside, last.in_right[index]).astype(np.float32)
        pictures, start = comparable(last.right, right), last.in_right[index]
        in_right, found = lucas_kanade(*pictures, start, guess, window_px=s.window_px)
        good = found & inside(in_right, right, s.margin_px)
        disparity_px = np.where(good, pair.disparity(there[index], in_right), np.nan)
        return Followed(last.in_left[index], there[index], index, disparity_px)

    def _step(self, left: Image, right: Image, followed: Followed, fit: PoseFit) -> Result:
        """Chain the motion on the pose of the last view."""
        assert self._last is not None
        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_last @ se3.inverse(fit.T_now_last)
        self._T_odom_now = se3.transform(se3.nearest_rotation(T_odom_now[:3, :3]), T_odom_now[:3, 3])
        stats = {"tracks": len(followed.kept), "inliers": int(fit.inlier.sum()), "error_px": fit.error_px}
        if followed.flow_px >= self._settings.keep_below_px:
            rays = (self._pair.left.rays(uv) for uv in (followed.kept, followed.there))
            raw_px = self._last.disparity_px[followed.index]
            self._offset = self._offset.after(*rays, raw_px, fit.T_now_last, self._pair)
            self._remember(left, right)
        stats |= {"parallax_px": followed.flow_px, "offset_px": self._offset.px}
        tracks = Tracks(followed.kept.astype(float), followed.there.astype(float), fit.inlier)
        if fit.error_px > self._settings.degraded_above_px:
            return Result(self._pose, Status.DEGRADED, "error", tracks, stats)
        return Result(self._pose, Status.OK, "", tracks, stats)

    def _remember(self, left: Image, right: Image) -> bool:
        """Follow the next frame from this view; False where it has too few points to be worth it."""
        s, pair = self._settings, self._pair
        corners = corners_per_cell(left, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        corners = corners[pair.seen(corners)]
        if len(corners) < s.min_points:
            return False
        in_right, disparity_px = pair.match(left, right, corners, margin_px=s.margin_px, window_px=s.window_px)
        known = np.isfinite(disparity_px)
        self._last = View(left, right, corners[known], in_right[known], disparity_px[known])
        self._T_odom_last = self._T_odom_now
        return True

    def _lost(self, frame: Frame, reason: str) -> Result:
        """No pose for this frame; the next one carries on from here with the last pose there was."""
        assert frame.left is not None
        assert frame.right is not None
        is_seen = self._remember(frame.left, frame.right)
        return Result(None, Status.LOST, reason if is_seen else "few_corners")
