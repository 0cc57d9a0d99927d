"""Dead reckoning from an IMU: gravity and the gyroscopes' bias from a standstill, then strapdown integration."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.plugin import Array, Frame, ImuReadings, Result, Rig, Status, VobenchError, se3

from .picture_motion import PictureMotion
from .standstill import Rest, Standstill
from .strapdown import State, carried


class ImuDeadReckoning:
    """Integrates the readings of the IMU, once pictures or readings show whether the body stands still at the start.

    A reading is a mean over time: it holds from the middle between its stamp and the one before to the middle
    between its stamp and the next. While the body seems to stand still, the pose is that of the start. Pictures are
    used for nothing else.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:  # noqa: ARG002
        """Take the IMU's mount and its noise."""
        if rig.imu is None:
            raise VobenchError("imu_dead_reckoning needs an IMU, and this recording has none")
        self._imu = rig.imu
        self._T_body_imu = rig.imu.T_body_imu
        self._standstill_s = float(params["standstill_s"])
        self._pictures = PictureMotion()
        self._standstill: Standstill | None = None
        self._rest: Rest | None = None
        self._state: State | None = None
        self._reading: tuple[int, Array, Array] | None = None

    def process(self, frame: Frame) -> Result:
        """Integrate all readings since the last frame, and the last of them up to this one."""
        if frame.imu is None:
            return Result(None, Status.LOST, "no_imu")
        if self._standstill is None:
            half_step_ns = 0.5e9 / self._imu.rate_hz
            start_ns = frame.t_ns - half_step_ns
            self._standstill = Standstill(self._imu, start_ns=start_ns, duration_s=self._standstill_s)

        if self._standstill.is_over:
            self._integrate(frame.imu)
        else:
            moved_px = self._pictures.moved_px(frame.left)
            self._standstill.take(frame.imu, moved_px)
            rest = self._standstill.verdict()
            if rest is None:
                return Result(np.eye(4), Status.INIT, "standing")
            self._begin(rest, self._standstill.readings)
        now = self._carried(float(frame.t_ns))
        T_odom_body = self._T_body_imu @ now.T_odom_imu @ se3.inverse(self._T_body_imu)
        speed_mps = float(np.linalg.norm(now.v_mps))
        return Result(T_odom_body, stats={"speed_mps": speed_mps})

    def _begin(self, rest: Rest, readings: ImuReadings) -> None:
        """Integrate the first readings by a verdict, which may differ from that of the last frame."""
        self._rest = rest
        self._state = State(rest.stood_until_ns, np.eye(4), np.zeros(3))
        self._reading = None
        self._integrate(readings)

    def _integrate(self, readings: ImuReadings) -> None:
        """Advance the state through all of these; each reading takes over midway between its stamp and the last."""
        rows = zip(readings.t_ns.tolist(), readings.gyro_radps, readings.accel_mps2, strict=True)
        for t_ns, gyro_radps, accel_mps2 in rows:
            if self._reading is not None:
                middle_ns = (self._reading[0] + t_ns) / 2
                self._state = self._carried(middle_ns)
            self._reading = (t_ns, gyro_radps, accel_mps2)

    def _carried(self, until_ns: float) -> State:
        """The state at an instant by the last reading; unchanged without a reading."""
        state = self._state
        rest = self._rest
        assert state is not None
        assert rest is not None
        if self._reading is None or until_ns <= state.t_ns:
            return state
        _, gyro_radps, accel_mps2 = self._reading
        turn_radps = gyro_radps - rest.gyro_bias_radps
        return carried(state, turn_radps, accel_mps2, gravity_mps2=rest.gravity_mps2, until_ns=until_ns)
