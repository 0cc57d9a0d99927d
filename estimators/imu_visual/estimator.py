"""IMU and stereo: the IMU predicts the motion and bridges dark frames, and stereo corrects it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.plugin import (
    STANDARD_GRAVITY_MPS2,
    Frame,
    Image,
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

from .filter import LEAST_ACCEL, LEAST_GYRO, Reading, State, anchored, carried, corrected, started
from .noise import MeasuredNoise

CORRELATED = 4.0  # errors of near tracks are correlated: so many count as one
# Standard deviations of stereo beyond the noise of its tracks.
STEREO_M = 2e-5
STEREO_RAD = 2e-5
MOST_REJECTED = 5  # successive frames; after these stereo is taken as right and the filter as wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(TrackerSettings):
    """The parameters of the manifest."""

    keep_below_px: float
    gate: float


class ImuVisual:
    """A filter advanced by IMU readings and corrected by stereo poses relative to the last view (the anchor).

    Readings have the noise that the data sheet states, unless the measured noise is well above it (vibration, touches).
    Then the measured one counts, and readings do not reject stereo.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the IMU's mount and noise, and the cameras. Raises VobenchError if either is missing."""
        cv2.setRNGSeed(seed)
        if rig.imu is None:
            raise VobenchError("imu_visual needs an IMU, and this recording has none")
        self._imu = rig.imu
        self._noise = MeasuredNoise(rig.imu, least_gyro=LEAST_GYRO, least_accel=LEAST_ACCEL)
        self._settings = parameters(Settings, params, "imu_visual")
        self._pair = stereo_pair(rig, "imu_visual")
        self._tracker = StereoTracker(self._pair, self._settings)
        self._T_imu_left = se3.inverse(rig.imu.T_body_imu) @ rig.T_body_left
        self._T_imu_view = self._T_imu_left @ se3.inverse(self._pair.T_view_left)
        self._state: State | None = None
        self._reading: Reading | None = None
        self._T_odom_anchor = np.eye(4)  # the IMU's pose when the view was taken
        self._rejected = 0
        self._vibrates = False

    def process(self, frame: Frame) -> Result:
        """Integrate the readings, track from the predicted pose, correct it; take a new view if the old one is far."""
        left = frame.left
        right = frame.right
        if left is None or right is None or frame.imu is None:
            return Result(None, Status.LOST, "no_reading")
        state = self._integrated(frame.imu, frame.t_ns)
        if not self._tracker.has_keyframe:
            return self._anchor(left, right, state, Status.INIT)

        T_now_anchor = se3.inverse(state.T_odom_imu) @ self._T_odom_anchor
        T_now_view = se3.inverse(self._T_imu_view) @ T_now_anchor @ self._T_imu_view
        tracks = self._tracker.follow(left, right, T_now_view)
        fit = self._tracker.fit(tracks)
        after = None if fit is None else self._corrected(state, fit)
        if fit is None or after is None:
            return self._anchor(left, right, state, Status.DEGRADED, "inertial")

        if tracks.flow_px >= self._settings.keep_below_px:
            self._tracker.update_offset(tracks, fit.T_now_last)
            return self._anchor(left, right, after, Status.OK)
        self._state = after
        return self._result(after, Status.OK)

    def _integrated(self, readings: ImuReadings, t_ns: int) -> State:
        """The state at a frame.

        A reading is a mean over time: it holds from the middle between its stamp and the one before to the middle
        between its stamp and the next.
        """
        imu = self._noise.after(readings)
        self._vibrates = imu != self._imu
        state = self._state or self._first_state(readings, t_ns)
        rows = zip(readings.t_ns.tolist(), readings.gyro_radps, readings.accel_mps2, strict=True)
        for stamp_ns, gyro_radps, accel_mps2 in rows:
            if self._reading is not None:
                middle_ns = (self._reading.t_ns + stamp_ns) / 2
                state = carried(state, self._reading, middle_ns, imu)
            self._reading = Reading(float(stamp_ns), gyro_radps, accel_mps2)
        if self._reading is None:
            return state
        return carried(state, self._reading, float(t_ns), imu)

    def _first_state(self, readings: ImuReadings, t_ns: int) -> State:
        """The state at the first frame: up is the mean specific force or, without readings, the body's z."""
        up = self._imu.T_body_imu[2, :3]
        if len(readings.t_ns):
            up = readings.accel_mps2.mean(0)
        return started(float(t_ns), -STANDARD_GRAVITY_MPS2 * unit(up))

    def _corrected(self, state: State, fit: PoseFit) -> State | None:
        """The state corrected by stereo's motion since the view; None if the gate rejects it."""
        T_anchor_imu = self._T_imu_view @ se3.inverse(fit.T_now_last) @ se3.inverse(self._T_imu_view)
        to_imu = adjoint(self._T_imu_view)
        of_tracks = CORRELATED * to_imu @ fit.covariance @ to_imu.T
        sigmas = np.repeat([STEREO_M, STEREO_RAD], 3)
        noise = of_tracks + np.diag(sigmas**2)

        self._rejected += 1
        is_gated = self._rejected <= MOST_REJECTED and not self._vibrates
        gate = self._settings.gate if is_gated else np.inf
        after = corrected(state, self._T_odom_anchor @ T_anchor_imu, noise, gate=gate)
        if after is not None:
            self._rejected = 0
        return after

    def _anchor(self, left: Image, right: Image, state: State, status: Status, reason: str = "") -> Result:
        """Take a new view at a state; if it has too few points, keep the old one."""
        if self._tracker.set_keyframe(left, right):
            state = anchored(state)
            self._T_odom_anchor = state.T_odom_imu
        self._state = state
        return self._result(state, status, reason)

    def _result(self, state: State, status: Status, reason: str = "") -> Result:
        """The pose of the left camera in its own frame at the start."""
        T_odom_left = se3.inverse(self._T_imu_left) @ state.T_odom_imu @ self._T_imu_left
        speed_mps = np.linalg.norm(state.v_mps)
        bias_dps = np.rad2deg(np.linalg.norm(state.bias_radps))
        stats = {
            "speed_mps": float(speed_mps),
            "bias_dps": float(bias_dps),
            "offset_px": self._tracker.offset.px,
        }
        return Result(T_odom_left, status, reason, stats=stats)
