"""Stereo visual odometry from points: where points in space are seen next says how the camera moved."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.plugin import (
    Followed,
    Frame,
    Image,
    PoseFit,
    Result,
    Rig,
    Status,
    StereoTracker,
    TrackerSettings,
    Tracks,
    carried_on,
    parameters,
    se3,
    stereo_pair,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(TrackerSettings):
    """The parameters of the manifest."""

    min_flow_px: float
    keep_below_px: float
    degraded_above_px: float


class StereoPnp:
    """Follows points of the last view into both new pictures, each from its own eye, and fits the motion to them."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is no stereo pair."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "stereo_pnp")
        self._pair = stereo_pair(rig, "stereo_pnp")
        self._tracker = StereoTracker(self._pair, self._settings)
        self._T_odom_view = np.eye(4)  # pose of the view that points are followed from, in the view's axes
        self._T_odom_before = self._T_odom_now = np.eye(4)  # the last two poses

    def process(self, frame: Frame) -> Result:
        """Follow the last view's points, find the motion that brings them there, look for new ones when it is far."""
        if frame.left is None or frame.right is None:
            return Result(None, Status.LOST, "no_picture")
        if not self._tracker.has_view:
            is_seen = self._tracker.look(frame.left, frame.right)
            return Result(np.eye(4), Status.INIT) if is_seen else Result(None, Status.LOST, "few_corners")

        # Points are looked for where they come to be if the camera goes on as it did.
        T_odom_guess = carried_on(self._T_odom_before, self._T_odom_now)
        followed = self._tracker.follow(frame.left, frame.right, se3.inverse(T_odom_guess) @ self._T_odom_view)

        # No flow, no motion; since the view is kept, creeping adds up until it shows.
        if len(followed.uv_px) >= self._settings.min_points and followed.flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_now = self._T_odom_view
            return Result(self._pair.T_left(self._T_odom_now), Status.STATIONARY, "no_flow")

        fit = self._tracker.fit(followed)
        if fit is None:
            return self._lost(frame.left, frame.right, followed)
        return self._step(frame.left, frame.right, followed, fit)

    def _step(self, left: Image, right: Image, followed: Followed, fit: PoseFit) -> Result:
        """Chain the motion on the pose of the view, and take a new view when the old one is far away."""
        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_view @ se3.inverse(fit.T_now_last)
        # Thousands of products drift off SO(3) by rounding.
        self._T_odom_now = se3.transform(se3.nearest_rotation(T_odom_now[:3, :3]), T_odom_now[:3, 3])
        if followed.flow_px >= self._settings.keep_below_px:
            self._tracker.learn(followed, fit.T_now_last)
            if self._tracker.look(left, right):
                self._T_odom_view = self._T_odom_now
        stats = {
            "tracks": len(followed.uv_px),
            "inliers": int(fit.inlier.sum()),
            "error_px": fit.error_px,
            "parallax_px": followed.flow_px,
            "offset_px": self._tracker.offset.px,
        }
        tracks = Tracks(followed.uv_last_px.astype(float), followed.uv_px.astype(float), fit.inlier)
        T_odom_left = self._pair.T_left(self._T_odom_now)
        if fit.error_px > self._settings.degraded_above_px:
            return Result(T_odom_left, Status.DEGRADED, "error", tracks, stats)
        return Result(T_odom_left, Status.OK, "", tracks, stats)

    def _lost(self, left: Image, right: Image, followed: Followed) -> Result:
        """No pose for this frame; the next one carries on from here with the last pose there was."""
        reason = "few_tracks" if len(followed.uv_px) < self._settings.min_points else "no_model"
        if self._tracker.look(left, right):
            self._T_odom_view = self._T_odom_now
        return Result(None, Status.LOST, reason, stats={"tracks": len(followed.uv_px)})
