"""Wheels and stereo on a level floor: the wheels say where to look, both say how far, and the surer one counts more."""

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

CORRELATED = 4.0  # tracks near each other err alike: so many count as one
PLANE = (0, 1, 5)  # of a small translation and rotation: along x and y, about z
# what stereo errs by beyond the noise of its tracks
STEREO_RATIO = 0.002
STEREO_M = 5e-5
STEREO_RAD = 1e-4
# about a count
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
    """What the wheels say since the view: the pose (3,) x, y, psi, the path in m, and the turns' sizes added in rad."""

    pose: Array
    path_m: float = 0.0
    turned_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Gain:
    """A ratio of stereo to wheels, learnt from step to step under a prior of 1."""

    information: float = 1 / GAIN_SIGMA**2
    weighted: float = 1 / GAIN_SIGMA**2

    @property
    def value(self) -> float:
        """The best guess."""
        return self.weighted / self.information

    def after(self, wheels: float, stereo: float, sigma: float) -> "Gain":
        """What is known after one more step that both measured."""
        return Gain(self.information + (wheels / sigma) ** 2, self.weighted + wheels * stereo / sigma**2)


class WheelVisual:
    """Pose on the plane; steps from stereo and from the wheels since the same view, joined by their covariances."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the nominal wheels and the cameras. Raises VobenchError where either is missing."""
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
        self._view_pose = np.zeros(3)  # x, y, psi of the view that points are followed from, in odom
        self._rolled = Rolled(np.zeros(3))

    def process(self, frame: Frame) -> Result:
        """Roll on by the wheels, look where that leads, and join what both say."""
        if frame.left is None or frame.right is None or frame.encoders is None:
            return Result(None, Status.LOST, "no_reading")
        self._roll(frame.encoders)
        if not self._tracker.has_view:
            return self._look(frame, self._rolled.pose, Status.INIT, "")
        T_now_view = se3.inverse(self._in_cameras(self._rolled.pose))
        followed = self._tracker.follow(frame.left, frame.right, T_now_view)
        fit = self._tracker.fit(followed)
        if fit is None:
            return self._look(frame, self._rolled.pose, Status.DEGRADED, "wheels")
        pose, slips = self._joined(fit)
        stats = {"tracks": len(followed.uv_px), "slip": float(slips), "length_gain": self._length.value}
        if followed.flow_px >= self._settings.keep_below_px:
            self._tracker.learn(followed, fit.T_now_last)
            return replace(self._look(frame, pose, Status.OK, ""), stats=stats)
        return Result(placed(compose(self._view_pose, pose)), stats=stats)

    def _roll(self, readings: EncoderReadings) -> None:
        """Add the arcs from the last reading through these."""
        counts = np.concatenate([self._ticks, readings.ticks])
        left_m, right_m = np.diff(counts, axis=0).T * self._metres_per_tick
        ds = self._length.value * (left_m + right_m) / 2
        dpsi = self._turn.value * (right_m - left_m) / self._track_m
        pose = self._rolled.pose
        for length, turn in zip(ds, dpsi, strict=True):
            chord = length * np.sinc(turn / 2 / np.pi)
            pose = compose(pose, np.array([chord * np.cos(turn / 2), chord * np.sin(turn / 2), turn]))
        path_m = np.abs(ds).sum()
        turned = np.abs(dpsi).sum()
        self._rolled = Rolled(pose, self._rolled.path_m + path_m, self._rolled.turned_rad + turned)
        self._ticks = counts[-1:]

    def _in_cameras(self, pose: Array) -> Array:
        """A step of the body as T_view_now, in the rectified view's axes."""
        return se3.inverse(self._T_body_view) @ placed(pose) @ self._T_body_view

    def _joined(self, fit: PoseFit) -> tuple[Array, bool]:
        """The step (3,) since the view by both, and whether the wheels slip, so that stereo alone is believed."""
        T_view_now = self._T_body_view @ se3.inverse(fit.T_now_last) @ se3.inverse(self._T_body_view)
        seen = np.array([*T_view_now[:2, 3], np.arctan2(T_view_now[1, 0], T_view_now[0, 0])])
        to_plane = adjoint(self._T_body_view)[PLANE, :]
        size_m = STEREO_M + STEREO_RATIO * float(np.hypot(*seen[:2]))
        of_stereo = CORRELATED * to_plane @ fit.covariance @ to_plane.T + np.diag([size_m, size_m, STEREO_RAD]) ** 2
        s = self._settings
        rolled = self._rolled
        length_m = WHEEL_M + s.slip_ratio * rolled.path_m
        turn_rad = WHEEL_RAD + s.slip_turn_ratio * rolled.turned_rad + s.slip_ratio * rolled.path_m / self._track_m / 4
        of_wheels = np.diag([length_m, length_m, turn_rad]) ** 2
        difference = seen - rolled.pose
        both = of_stereo + of_wheels
        if difference @ np.linalg.solve(both, difference) > s.gate:
            return seen, True
        self._length = self._length.after(rolled.pose[0], self._length.value * seen[0], length_m)
        self._turn = self._turn.after(rolled.pose[2], self._turn.value * seen[2], turn_rad)
        return rolled.pose + of_wheels @ np.linalg.solve(both, difference), False

    def _look(self, frame: Frame, pose: Array, status: Status, reason: str) -> Result:
        """Take a new view at this step from the old one; where there is nothing to see, keep the old one."""
        now = compose(self._view_pose, pose)
        if frame.left is not None and frame.right is not None and self._tracker.look(frame.left, frame.right):
            self._view_pose = now
            self._rolled = Rolled(np.zeros(3))
        return Result(placed(now), status, reason)


def compose(pose: Array, step: Array) -> Array:
    """x, y, psi after a step (3,) in the pose's own axes."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    moved: Array = pose + np.array([c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]])
    return moved


def placed(pose: Array) -> Array:
    """The transform of x, y, psi on the plane."""
    return se3.transform(se3.rotation_z(pose[2]), [pose[0], pose[1], 0.0])
