"""IMU and stereo: the IMU says where to look and bridges what cannot be seen, stereo corrects it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.plugin import (
    STANDARD_GRAVITY_MPS2,
    Array,
    Frame,
    ImuReadings,
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
    unit,
)

from .filter import State, anchored, carried, corrected, started

CORRELATED = 4.0  # tracks near each other err alike: so many count as one
# what stereo errs by beyond the noise of its tracks
STEREO_M = 2e-5
STEREO_RAD = 2e-5
MOST_DOUBTS = 5  # frames after which stereo is right and the filter wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(TrackerSettings):
    """The parameters of the manifest."""

    keep_below_px: float
    gate: float


class ImuVisual:
    """The filter runs from reading to reading; poses from stereo are measured from the last view, whose pose holds."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the IMU's place and noise, and the cameras. Raises VobenchError where either is missing."""
        cv2.setRNGSeed(seed)
        if rig.imu is None:
            raise VobenchError("imu_visual needs an IMU, and this recording has none")
        self._imu = rig.imu
        self._settings = parameters(Settings, params, "imu_visual")
        self._pair = stereo_pair(rig, "imu_visual")
        self._tracker = StereoTracker(self._pair, self._settings)
        self._T_imu_left = se3.inverse(rig.imu.T_body_imu) @ rig.T_body_left
        self._T_imu_view = self._T_imu_left @ se3.inverse(self._pair.T_view_left)
        self._state: State | None = None
        self._reading: tuple[float, Array, Array] | None = None
        self._T_odom_anchor = np.eye(4)  # the IMU's pose when the view was taken
        self._doubts = 0

    def process(self, frame: Frame) -> Result:
        """Integrate the readings, look where that leads, correct, and take a new view when the old one is far away."""
        if frame.left is None or frame.right is None or frame.imu is None:
            return Result(None, Status.LOST, "no_reading")
        state = self._integrated(frame.imu, frame.t_ns)
        if not self._tracker.has_view:
            self._state = state
            return self._anchor(frame, Status.INIT, "")
        T_now_anchor = se3.inverse(state.T_odom_imu) @ self._T_odom_anchor
        T_now_view = se3.inverse(self._T_imu_view) @ T_now_anchor @ self._T_imu_view
        followed = self._tracker.follow(frame.left, frame.right, T_now_view)
        fit = self._tracker.fit(followed)
        after = None if fit is None else self._corrected(state, fit)
        self._state = after or state
        if fit is None or after is None:
            return self._anchor(frame, Status.DEGRADED, "inertial")
        if followed.flow_px >= self._settings.keep_below_px:
            self._tracker.learn(followed, fit.T_now_last)
            return self._anchor(frame, Status.OK, "")
        return self._said(Status.OK, "")

    def _integrated(self, readings: ImuReadings, t_ns: int) -> State:
        """The state at a frame. A reading is a mean: it holds from half-way to the last until half-way to the next."""
        rows = zip(readings.t_ns.tolist(), readings.gyro_radps, readings.accel_mps2, strict=True)
        if self._state is None:
            felt = readings.accel_mps2.mean(0) if len(readings.t_ns) else self._imu.T_body_imu[2, :3]
            state = started(float(t_ns), -STANDARD_GRAVITY_MPS2 * unit(felt))
        else:
            state = self._state
        for stamp, turn, force in rows:
            if self._reading is not None:
                state = carried(state, *self._reading[1:], (self._reading[0] + stamp) / 2, self._imu)
            self._reading = (float(stamp), turn, force)
        return state if self._reading is None else carried(state, *self._reading[1:], float(t_ns), self._imu)

    def _corrected(self, state: State, fit: PoseFit) -> State | None:
        """The state by what stereo saw since the view; None where the two contradict each other."""
        T_anchor_imu = self._T_imu_view @ se3.inverse(fit.T_now_last) @ se3.inverse(self._T_imu_view)
        to_imu = adjoint(self._T_imu_view)
        noise = CORRELATED * to_imu @ fit.covariance @ to_imu.T + np.diag(np.repeat([STEREO_M, STEREO_RAD], 3) ** 2)
        self._doubts += 1
        gate = self._settings.gate if self._doubts <= MOST_DOUBTS else np.inf
        after = corrected(state, self._T_odom_anchor @ T_anchor_imu, noise, gate=gate)
        self._doubts = self._doubts if after is None else 0
        return after

    def _anchor(self, frame: Frame, status: Status, reason: str) -> Result:
        """Take a new view here; where there is nothing to see, keep the old one."""
        assert self._state is not None
        if frame.left is not None and frame.right is not None and self._tracker.look(frame.left, frame.right):
            self._state = anchored(self._state)
            self._T_odom_anchor = self._state.T_odom_imu
        return self._said(status, reason)

    def _said(self, status: Status, reason: str) -> Result:
        """The left camera's pose in its own frame at the start."""
        assert self._state is not None
        T_odom_left = se3.inverse(self._T_imu_left) @ self._state.T_odom_imu @ self._T_imu_left
        bias_dps = float(np.rad2deg(np.linalg.norm(self._state.bias_radps)))
        stats = {"speed_mps": float(np.linalg.norm(self._state.v_mps)), "bias_dps": bias_dps}
        return Result(T_odom_left, status, reason, stats=stats | {"offset_px": self._tracker.offset.px})
