"""Wheel slip: what makes the robot move other than its wheels say.

sigma    longitudinal slip ratio of one wheel: rim speed = ground speed / (1 - sigma)
beta     side-slip angle (rad): the robot slides left at u tan(beta)
c        skid (s): in a turn it slides outwards at c u omega
kappa    traction (s^2/m): each wheel's sigma grows by kappa for every m/s^2 at which it is driven on
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from math import exp, radians, sqrt, tan
from typing import NamedTuple

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array

# The random streams, one for each process: switching one off leaves the others as they were.
STREAMS = ("left", "right", "side")
Generators = Mapping[str, np.random.Generator]


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """Three independent, stationary, zero-mean Ornstein-Uhlenbeck processes, and two deterministic terms.

    `ratio_std` is the standard deviation of both wheels' sigma, `angle_std_rad` that of beta,
    `correlation_s` the time over which they forget; `skid_s` is c and `traction_s2pm` kappa.
    Engineering choices: no published values exist.
    """

    ratio_std: float = 0.0
    angle_std_rad: float = 0.0
    skid_s: float = 0.0
    correlation_s: float = 0.3
    traction_s2pm: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.skid_s <= 0.5 and 0 <= self.traction_s2pm <= 0.1):
            raise MotionError(
                f"slip needs skid_s in 0..0.5 and traction_s2pm in 0..0.1, got {self.skid_s} and {self.traction_s2pm}"
            )
        if not (0 <= self.ratio_std <= 0.1 and 0 <= self.angle_std_rad <= 0.15 and self.correlation_s > 0):
            raise MotionError(
                f"slip needs ratio_std in 0..0.1, angle_std_rad in 0..0.15 and correlation_s > 0, "
                f"got {self.ratio_std}, {self.angle_std_rad} and {self.correlation_s}"
            )


SLIPS = {
    "none": SlipSettings(),
    "nominal": SlipSettings(ratio_std=0.01, angle_std_rad=radians(0.5), skid_s=0.005),
    "slippery": SlipSettings(ratio_std=0.05, angle_std_rad=radians(2.0), skid_s=0.02),
    "straining": SlipSettings(ratio_std=0.01, angle_std_rad=radians(0.5), skid_s=0.005, traction_s2pm=0.03),
}


class SlipNow(NamedTuple):
    """What disturbs the robot at one instant: both sigmas, beta (rad), c (s), kappa (s^2/m), and the delta of (18)."""

    left: float = 0.0
    right: float = 0.0
    beta: float = 0.0
    skid_s: float = 0.0
    traction_s2pm: float = 0.0
    delta_u: float = 0.0
    delta_omega: float = 0.0

    def towards(self, later: "SlipNow", share: float) -> "SlipNow":
        """On the straight line from this (share 0) to a later one (share 1)."""
        return SlipNow(*[a + share * (b - a) for a, b in zip(self, later, strict=True)])

    def side_speed(self, u: float, omega: float) -> float:
        """Speed of sliding to the left in m/s."""
        return u * tan(self.beta) - self.skid_s * u * omega

    def rim_rates(
        self, left_mps: float, right_mps: float, *, radius_m: float, driven_mps2: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[float, float]:
        """Angular rates of the left and right rim in rad/s that carry the wheels at these speeds and accelerations."""
        left, right = self.left, self.right
        if self.traction_s2pm:
            left += self.traction_s2pm * _driven_on(left_mps, driven_mps2[0])
            right += self.traction_s2pm * _driven_on(right_mps, driven_mps2[1])
        return left_mps / (radius_m * (1 - left)), right_mps / (radius_m * (1 - right))


def _driven_on(speed_mps: float, rate_mps2: float) -> float:
    """Acceleration along the way that a wheel goes: negative where it brakes."""
    return rate_mps2 if speed_mps > 0 else -rate_mps2


def ornstein_uhlenbeck(
    count: int, *, std: float, step_s: float, correlation_s: float, rng: np.random.Generator
) -> Array:
    """A stationary first-order Gauss-Markov path (count,), exact for any step: the variance does not depend on it.

    A longer path of the same generator begins with the same values. Source: Gillespie (1996).
    """
    keep = exp(-step_s / correlation_s)
    shocks = std * rng.standard_normal(count)
    shocks[1:] *= sqrt(1 - keep**2)
    return np.array(list(accumulate(shocks.tolist(), lambda last, shock: keep * last + shock)))


def generator_of(rngs: Generators | None, stream: str) -> np.random.Generator:
    """The generator of a stream. Raises MotionError where it is missing."""
    if rngs is None or stream not in rngs:
        raise MotionError(f"this drive needs a random generator for {stream!r}, and rngs has none")
    return rngs[stream]


def slip_path(count: int, settings: SlipSettings, *, step_s: float, rngs: Generators | None) -> Array:
    """Slip ratios of the left and right wheel and beta in rad, (count, 3), each from its own generator in `rngs`.

    Raises MotionError where the settings ask for chance and a generator is missing.
    """
    stds = (settings.ratio_std, settings.ratio_std, settings.angle_std_rad)
    path = np.zeros((count, 3))
    for column, (stream, std) in enumerate(zip(STREAMS, stds, strict=True)):
        if std > 0:
            path[:, column] = ornstein_uhlenbeck(
                count, std=std, step_s=step_s, correlation_s=settings.correlation_s, rng=generator_of(rngs, stream)
            )
    return path
