"""Wheels and stereo on a level floor: wheels predict the tracks, and both measured steps are fused by covariance."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.plugin import (
    Array,
    EncoderReadings,
    Frame,
    Image,
    PoseFit,
    Result,
    Rig,
    Status,
    StereoTracker,
    TrackerSettings,
    VobenchError,
    adjoint,
    parameters,
    se3,
    stereo_pair,
)

CORRELATED = 4.0  # errors of near tracks are correlated: so many count as one
PLANE = (0, 1, 5)  # of a small translation and rotation: along x and y, about z
# Standard deviations of stereo beyond the noise of its tracks.
STEREO_RATIO = 0.002
STEREO_M = 5e-5
STEREO_RAD = 1e-4
# About one encoder count.
WHEEL_M = 2e-4
WHEEL_RAD = 2e-4
GAIN_SIGMA = 0.03  # of a wheel's nominal radius, and of the track


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(TrackerSettings):
    """The parameters of the manifest."""

    keep_below_px: float
    slip_ratio: float
    slip_turn_ratio: float
    gate: float


@dataclass(frozen=True, slots=True)
class Rolled:
    """Wheel odometry since the view: the pose (3,) x, y, psi, the path in m, and the sum of absolute turns in rad."""

    pose: Array
    path_m: float = 0.0
    turned_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Gain:
    """The ratio of stereo to wheels, estimated step by step from a prior of 1."""

    information: float = 1 / GAIN_SIGMA**2
    weighted: float = 1 / GAIN_SIGMA**2

    @property
    def value(self) -> float:
        """The estimate."""
        return self.weighted / self.information

    def after(self, wheels: float, stereo: float, sigma: float) -> "Gain":
        """The gain after one more step that both measured."""
        information = self.information + (wheels / sigma) ** 2
        weighted = self.weighted + wheels * stereo / sigma**2
        return Gain(information, weighted)


class WheelVisual:
    """Fuses the steps that stereo and wheels measure since the same view, on the plane, by their covariances."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the nominal wheels and the cameras. Raises VobenchError if either is missing."""
        cv2.setRNGSeed(seed)
        if rig.wheels is None:
            raise VobenchError("wheel_visual needs wheels, and this recording has none")
        self._settings = parameters(Settings, params, "wheel_visual")
        self._metres_per_tick = 2 * np.pi * rig.wheels.radius_m / rig.wheels.ticks_per_revolution
        self._track_m = rig.wheels.track_m
        pair = stereo_pair(rig, "wheel_visual")
        self._tracker = StereoTracker(pair, self._settings)
        self._T_body_view = rig.T_body_left @ se3.inverse(pair.T_view_left)
        self._ticks: NDArray[np.int64] = np.zeros((1, 2), np.int64)
        self._length = Gain()
        self._turn = Gain()
        self._view_pose = np.zeros(3)  # x, y, psi of the view that points are tracked from, in odom
        self._rolled = Rolled(np.zeros(3))

    def process(self, frame: Frame) -> Result:
        """Advance by the wheels, track from the predicted pose, and fuse both steps."""
        left = frame.left
        right = frame.right
        if left is None or right is None or frame.encoders is None:
            return Result(None, Status.LOST, "no_reading")
        self._roll(frame.encoders)
        rolled = self._rolled.pose
        if not self._tracker.has_keyframe:
            return self._look(left, right, rolled, Status.INIT)

        T_view_now = se3.inverse(self._T_body_view) @ pose_matrix(rolled) @ self._T_body_view
        tracks = self._tracker.follow(left, right, se3.inverse(T_view_now))
        fit = self._tracker.fit(tracks)
        if fit is None:
            return self._look(left, right, rolled, Status.DEGRADED, "wheels")

        step, is_slipping = self._fused(fit)
        stats = {
            "tracks": len(tracks.left_px),
            "slip": float(is_slipping),
            "length_gain": self._length.value,
        }
        if tracks.flow_px >= self._settings.keep_below_px:
            self._tracker.update_offset(tracks, fit.T_now_last)
            result = self._look(left, right, step, Status.OK)
            return replace(result, stats=stats)
        return Result(pose_matrix(compose(self._view_pose, step)), stats=stats)

    def _roll(self, readings: EncoderReadings) -> None:
        """Add the arcs from the last reading to the last of these."""
        counts = np.concatenate([self._ticks, readings.ticks])
        left_m, right_m = np.diff(counts, axis=0).T * self._metres_per_tick
        lengths_m = self._length.value * (left_m + right_m) / 2
        turns_rad = self._turn.value * (right_m - left_m) / self._track_m

        pose = self._rolled.pose
        for length_m, turn_rad in zip(lengths_m, turns_rad, strict=True):
            chord_m = length_m * np.sinc(turn_rad / 2 / np.pi)
            forward_m = chord_m * np.cos(turn_rad / 2)
            sideways_m = chord_m * np.sin(turn_rad / 2)
            pose = compose(pose, np.array([forward_m, sideways_m, turn_rad]))
        path_m = self._rolled.path_m + np.abs(lengths_m).sum()
        turned_rad = self._rolled.turned_rad + np.abs(turns_rad).sum()
        self._rolled = Rolled(pose, path_m, turned_rad)
        self._ticks = counts[-1:]

    def _fused(self, fit: PoseFit) -> tuple[Array, bool]:
        """The step (3,) since the view, and whether the wheels slip; if they do, the step is that of stereo alone."""
        by_stereo, covariance_stereo = self._stereo_step(fit)
        by_wheels = self._rolled.pose
        sigma_m, sigma_rad = self._wheel_sigmas()
        covariance_wheels = np.diag([sigma_m, sigma_m, sigma_rad]) ** 2

        difference = by_stereo - by_wheels
        innovation = covariance_stereo + covariance_wheels
        normalized = np.linalg.solve(innovation, difference)
        if difference @ normalized > self._settings.gate:
            return by_stereo, True

        # The wheels' step has the gains in it already.
        length_by_stereo = self._length.value * by_stereo[0]
        turn_by_stereo = self._turn.value * by_stereo[2]
        self._length = self._length.after(by_wheels[0], length_by_stereo, sigma_m)
        self._turn = self._turn.after(by_wheels[2], turn_by_stereo, sigma_rad)
        return by_wheels + covariance_wheels @ normalized, False

    def _stereo_step(self, fit: PoseFit) -> tuple[Array, Array]:
        """The body's step (3,) since the view as stereo measures it, and its covariance (3, 3)."""
        T_last_now = self._T_body_view @ se3.inverse(fit.T_now_last) @ se3.inverse(self._T_body_view)
        turn_rad = np.arctan2(T_last_now[1, 0], T_last_now[0, 0])
        step = np.array([*T_last_now[:2, 3], turn_rad])

        to_plane = adjoint(self._T_body_view)[PLANE, :]
        of_tracks = CORRELATED * to_plane @ fit.covariance @ to_plane.T
        sigma_m = STEREO_M + STEREO_RATIO * float(np.hypot(*step[:2]))
        of_model = np.diag([sigma_m, sigma_m, STEREO_RAD]) ** 2
        return step, of_tracks + of_model

    def _wheel_sigmas(self) -> tuple[float, float]:
        """Standard deviations of the wheels' step: of its length in m, and of its turn in rad."""
        s = self._settings
        rolled = self._rolled
        sigma_m = WHEEL_M + s.slip_ratio * rolled.path_m
        slip_of_turns = s.slip_turn_ratio * rolled.turned_rad
        slip_of_path = s.slip_ratio * rolled.path_m / self._track_m / 4
        return sigma_m, WHEEL_RAD + slip_of_turns + slip_of_path

    def _look(self, left: Image, right: Image, step: Array, status: Status, reason: str = "") -> Result:
        """Take a new view at this step from the old one; if it has too few points, keep the old one."""
        now = compose(self._view_pose, step)
        if self._tracker.set_keyframe(left, right):
            self._view_pose = now
            self._rolled = Rolled(np.zeros(3))
        return Result(pose_matrix(now), status, reason)


def compose(pose: Array, step: Array) -> Array:
    """x, y, psi after a step (3,) in the pose's own axes."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    dx, dy, turn = step
    along_x = c * dx - s * dy
    along_y = s * dx + c * dy
    after: Array = pose + np.array([along_x, along_y, turn])
    return after


def pose_matrix(pose: Array) -> Array:
    """The transform (4, 4) of x, y, psi on the plane."""
    x, y, psi = pose
    return se3.transform(se3.rotation_z(psi), [x, y, 0.0])
