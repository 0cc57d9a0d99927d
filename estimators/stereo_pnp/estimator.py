"""Stereo visual odometry from points: the camera's motion is fitted to the pixels that known points move to."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.plugin import (
    Frame,
    Image,
    PoseFit,
    Result,
    Rig,
    Status,
    StereoTracker,
    StereoTracks,
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
    """Tracks points of the last view in both cameras and fits the motion to them."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is not a stereo pair."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "stereo_pnp")
        self._pair = stereo_pair(rig, "stereo_pnp")
        self._tracker = StereoTracker(self._pair, self._settings)
        # The pose of the view that points are tracked from, and the last two poses, in the view's axes.
        self._T_odom_view = np.eye(4)
        self._T_odom_before = np.eye(4)
        self._T_odom_now = np.eye(4)

    def process(self, frame: Frame) -> Result:
        """Track the last view's points, fit the motion to them, and take a new view if the old one is far away."""
        if frame.left is None or frame.right is None:
            return Result(None, Status.LOST, "no_picture")
        if not self._tracker.has_keyframe:
            if self._tracker.set_keyframe(frame.left, frame.right):
                return Result(np.eye(4), Status.INIT)
            return Result(None, Status.LOST, "few_corners")

        # The guess is that the camera goes on as it did.
        T_odom_guess = carried_on(self._T_odom_before, self._T_odom_now)
        T_guess_view = se3.inverse(T_odom_guess) @ self._T_odom_view
        tracks = self._tracker.follow(frame.left, frame.right, T_guess_view)

        # No flow, no motion. The view stays, so a slow motion adds up until it shows.
        has_tracks = len(tracks.left_px) >= self._settings.min_points
        if has_tracks and tracks.flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_view
            self._T_odom_now = self._T_odom_view
            return Result(self._pair.T_left(self._T_odom_now), Status.STATIONARY, "no_flow")

        fit = self._tracker.fit(tracks)
        if fit is None:
            return self._lost(frame.left, frame.right, tracks)
        return self._step(frame.left, frame.right, tracks, fit)

    def _step(self, left: Image, right: Image, tracks: StereoTracks, fit: PoseFit) -> Result:
        """Chain the motion onto the pose of the view; take a new view if that one is far away."""
        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_view @ se3.inverse(fit.T_now_last)
        # Thousands of products drift off SO(3) by rounding.
        R_odom_now = se3.nearest_rotation(T_odom_now[:3, :3])
        self._T_odom_now = se3.transform(R_odom_now, T_odom_now[:3, 3])
        if tracks.flow_px >= self._settings.keep_below_px:
            self._tracker.update_offset(tracks, fit.T_now_last)
            if self._tracker.set_keyframe(left, right):
                self._T_odom_view = self._T_odom_now

        stats = {
            "tracks": len(tracks.left_px),
            "inliers": int(fit.inlier.sum()),
            "error_px": fit.error_px,
            "parallax_px": tracks.flow_px,
            "offset_px": self._tracker.offset.px,
        }
        reported_tracks = Tracks(tracks.keyframe_left_px.astype(float), tracks.left_px.astype(float), fit.inlier)
        T_odom_left = self._pair.T_left(self._T_odom_now)
        if fit.error_px > self._settings.degraded_above_px:
            return Result(T_odom_left, Status.DEGRADED, "error", reported_tracks, stats)
        return Result(T_odom_left, Status.OK, "", reported_tracks, stats)

    def _lost(self, left: Image, right: Image, tracks: StereoTracks) -> Result:
        """No pose for this frame; the next frame starts from a view of this one at the last known pose."""
        reason = "few_tracks" if len(tracks.left_px) < self._settings.min_points else "no_model"
        if self._tracker.set_keyframe(left, right):
            self._T_odom_view = self._T_odom_now
        return Result(None, Status.LOST, reason, stats={"tracks": len(tracks.left_px)})
