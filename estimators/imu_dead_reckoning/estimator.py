"""Dead reckoning from an IMU alone: gravity and the gyroscopes' bias from a standstill, then strapdown integration."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.plugin import Array, Frame, ImuReadings, Result, Rig, Status, VobenchError, se3

from .standstill import Rest, Standstill
from .strapdown import State, carried


class ImuDeadReckoning:
    """Starts at rest half a reading before the first frame, and from then on adds up what the IMU says.

    A reading holds from half-way to the one before until half-way to the next: it is a mean over that time.
    While it is not yet clear whether the body stands still at the start, the answer is that it has not moved.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:  # noqa: ARG002
        """Take the IMU's place and its noise."""
        if rig.imu is None:
            raise VobenchError("imu_dead_reckoning needs an IMU, and this recording has none")
        self._T_body_imu = rig.imu.T_body_imu
        self._half_step_ns = 0.5e9 / rig.imu.rate_hz
        self._standstill = Standstill(rig.imu, float(params["standstill_s"]))
        self._rest: Rest | None = None
        self._state: State | None = None
        self._reading: tuple[int, Array, Array] | None = None

    def process(self, frame: Frame) -> Result:
        """Integrate all readings since the last frame, and the last of them up to this one."""
        if frame.imu is None:
            return Result(None, Status.LOST, "no_imu")
        self._state = self._state or State(frame.t_ns - self._half_step_ns, np.eye(4), np.zeros(3))
        if self._rest is None:
            self._standstill.take(frame.imu)
            self._rest = self._standstill.verdict()
            if self._rest is None:
                return Result(np.eye(4), Status.INIT, "standing")
            self._integrate(self._standstill.readings)
        else:
            self._integrate(frame.imu)
        now = self._carried(float(frame.t_ns))
        T_odom_body = self._T_body_imu @ now.T_odom_imu @ se3.inverse(self._T_body_imu)
        return Result(T_odom_body, stats={"speed_mps": float(np.linalg.norm(now.v_mps))})

    def _integrate(self, readings: ImuReadings) -> None:
        """Let each reading take over from the one before half-way between their stamps."""
        rows = zip(readings.t_ns.tolist(), readings.gyro_radps, readings.accel_mps2, strict=True)
        for t_ns, turn, force in rows:
            if self._reading is not None:
                self._state = self._carried((self._reading[0] + t_ns) / 2)
            self._reading = (t_ns, turn, force)

    def _carried(self, until_ns: float) -> State:
        """The state at an instant by the last reading; no reading yet: as it was."""
        assert self._state is not None
        assert self._rest is not None
        if self._reading is None or until_ns <= self._state.t_ns:
            return self._state
        _, turn, force = self._reading
        turn = turn - self._rest.gyro_bias_radps
        return carried(self._state, turn, force, gravity_mps2=self._rest.gravity_mps2, until_ns=until_ns)
