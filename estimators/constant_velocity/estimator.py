"""Dead reckoning without a sensor: straight ahead, at one speed."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.estimator import Frame, Result
from vobench.geometry import se3
from vobench.geometry.rig import Rig


class ConstantVelocity:
    """Knows the clock and nothing else."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:  # noqa: ARG002
        """Take the speed."""
        self._speed_mps = float(params["speed_mps"])
        self._first_ns: int | None = None

    def process(self, frame: Frame) -> Result:
        """As far ahead as the time since the first frame allows."""
        if self._first_ns is None:
            self._first_ns = frame.t_ns
        distance_m = self._speed_mps * (frame.t_ns - self._first_ns) * 1e-9
        return Result(se3.transform(np.eye(3), [distance_m, 0, 0]))
