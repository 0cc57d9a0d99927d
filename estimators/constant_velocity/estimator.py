"""Dead reckoning without a sensor after the first second: straight ahead at the mean speed of the wheels."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.plugin import EncoderReadings, Frame, Result, Rig, Status, VobenchError, se3


class ConstantVelocity:
    """Follows the wheels for `measure_s`, then keeps the last heading and the mean speed.

    Between two readings it drives the chord of an arc, along the heading in the arc's middle.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:  # noqa: ARG002
        """Take the nominal wheels, and how long to measure their speed."""
        wheels = rig.wheels
        if wheels is None:
            raise VobenchError("constant_velocity needs wheels, and this recording has none")
        self._metres_per_tick = 2 * np.pi * wheels.radius_m / wheels.ticks_per_revolution
        self._track_m = wheels.track_m
        self._measure_ns = round(float(params["measure_s"]) * 1e9)
        self._last: tuple[int, int] | None = None
        self._first_ns = 0
        self._known_ns = 0
        self._x_m = 0.0
        self._y_m = 0.0
        self._psi_rad = 0.0
        self._path_m = 0.0

    def process(self, frame: Frame) -> Result:
        """The wheels' pose; once the speed is measured, extrapolated to the frame."""
        if frame.encoders is None:
            return Result(None, Status.LOST, "no_encoders")
        self._measure(frame.encoders)
        ahead_m = 0.0
        if self._is_measured:
            duration_ns = self._known_ns - self._first_ns
            speed_mps = self._path_m * 1e9 / duration_ns
            ahead_m = speed_mps * (frame.t_ns - self._known_ns) * 1e-9
        x_m = self._x_m + ahead_m * np.cos(self._psi_rad)
        y_m = self._y_m + ahead_m * np.sin(self._psi_rad)
        return Result(se3.transform(se3.rotation_z(self._psi_rad), [x_m, y_m, 0.0]))

    @property
    def _is_measured(self) -> bool:
        return self._known_ns - self._first_ns >= max(self._measure_ns, 1)

    def _measure(self, readings: EncoderReadings) -> None:
        """Follow the wheels until the speed is measured."""
        rows = zip(readings.t_ns.tolist(), readings.ticks.tolist(), strict=True)
        for t_ns, (left, right) in rows:
            if self._is_measured:
                return
            if self._last is None:
                self._first_ns = t_ns
            else:
                self._roll(left - self._last[0], right - self._last[1])
            self._last = (left, right)
            self._known_ns = t_ns

    def _roll(self, left_ticks: int, right_ticks: int) -> None:
        left_m = left_ticks * self._metres_per_tick
        right_m = right_ticks * self._metres_per_tick
        ds = (left_m + right_m) / 2
        dpsi = (right_m - left_m) / self._track_m
        chord = ds * np.sinc(dpsi / 2 / np.pi)
        psi_middle = self._psi_rad + dpsi / 2
        self._x_m += chord * np.cos(psi_middle)
        self._y_m += chord * np.sin(psi_middle)
        self._psi_rad += dpsi
        self._path_m += ds
