"""Dead reckoning from the wheels of a differential drive, with its nominal geometry."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.plugin import Frame, Result, Rig, Status, VobenchError, se3


class WheelOdometry:
    """Between two readings the robot drives an arc, which is integrated exactly.

    With the wheels' paths l and r and the track d: ds = (l + r) / 2, dpsi = (r - l) / d, and the
    chord of the arc is ds sinc(dpsi / 2) long and points along psi + dpsi / 2.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:  # noqa: ARG002
        """Take the nominal radius, track and resolution; counts start at zero."""
        wheels = rig.wheels
        if wheels is None:
            raise VobenchError("wheel_odometry needs wheels, and this recording has none")
        self._metres_per_tick = 2 * np.pi * wheels.radius_m / wheels.ticks_per_revolution
        self._track_m = wheels.track_m
        self._ticks: NDArray[np.int64] = np.zeros((1, 2), np.int64)
        self._x_m = 0.0
        self._y_m = 0.0
        self._psi_rad = 0.0

    def process(self, frame: Frame) -> Result:
        """Integrate all readings since the last frame."""
        if frame.encoders is None:
            return Result(None, Status.LOST, "no_encoders")
        self._integrate(frame.encoders.ticks)
        T_odom_body = se3.transform(se3.rotation_z(self._psi_rad), [self._x_m, self._y_m, 0.0])
        return Result(T_odom_body, stats={"readings": len(frame.encoders.ticks)})

    def _integrate(self, ticks: NDArray[np.int64]) -> None:
        """Add the arcs from the last reading to the last of these (M, 2), left and right."""
        counts = np.concatenate([self._ticks, ticks])
        steps_m = np.diff(counts, axis=0) * self._metres_per_tick
        left_m, right_m = steps_m.T
        ds = (left_m + right_m) / 2
        dpsi = (right_m - left_m) / self._track_m
        psi_middle = self._psi_rad + np.cumsum(dpsi) - dpsi / 2  # in the middle of each arc
        chord = ds * np.sinc(dpsi / 2 / np.pi)
        self._x_m += float(chord @ np.cos(psi_middle))
        self._y_m += float(chord @ np.sin(psi_middle))
        self._psi_rad += float(dpsi.sum())
        self._ticks = counts[-1:]
