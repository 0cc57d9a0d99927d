"""What the drive train can give: the largest accelerations of a robot, whatever its controller asks."""

from dataclasses import dataclass
from math import inf

import numpy as np

from vobench.errors import MotionError
from vobench.robot.pioneer import Number


@dataclass(frozen=True, slots=True)
class AccelerationLimits:
    """Largest |u'| in m/s^2 and |omega'| in rad/s^2 that (18) may give, before delta pushes.

    Where one is reached the equations have a corner: the integrator's order drops to 2 in that sub-step.
    Raises MotionError where one is not positive.
    """

    speed_mps2: float = inf
    turn_radps2: float = inf

    def __post_init__(self) -> None:
        for name in ("speed_mps2", "turn_radps2"):
            if not getattr(self, name) > 0:
                raise MotionError(f"the acceleration limit {name} must be positive, got {getattr(self, name)}")

    def held(self, u_rate: Number, omega_rate: Number) -> tuple[Number, Number]:
        """Both rates, each cut at its limit."""
        if self.speed_mps2 == self.turn_radps2 == inf:
            return u_rate, omega_rate
        return _cut(u_rate, self.speed_mps2), _cut(omega_rate, self.turn_radps2)


UNLIMITED = AccelerationLimits()
# Source: block defaults of Martins' Simulink toolbox. From .75 m/s they need .94 m to stop.
TOOLBOX = AccelerationLimits(0.3, 1.745)


def _cut(rate: Number, limit: float) -> Number:
    if isinstance(rate, np.ndarray):
        return np.clip(rate, -limit, limit)
    return max(-limit, min(limit, rate))
