"""Wheel slip, patches of floor, and the pushes delta of (18)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, exp, radians, sin, sqrt, tan
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Le

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.setting import OneOf, Positive, settings

# The random streams, one for each process: switching one off leaves the others as they were.
SLIP_STREAMS = ("left", "right", "side")
Generators = Mapping[str, np.random.Generator]


@settings(kw_only=False)
class SlipSettings:
    """Three independent, stationary, zero-mean Ornstein-Uhlenbeck processes, and two deterministic terms.

    `ratio_std` is the standard deviation of both wheels' sigma, `angle_std_rad` that of beta,
    `correlation_s` the time over which they forget; `skid_s` is c and `traction_s2pm` kappa.
    Engineering choices: no published values exist.
    """

    ratio_std: Annotated[float, Ge(0), Le(0.1)] = 0.0
    angle_std_rad: Annotated[float, Ge(0), Le(0.15)] = 0.0
    skid_s: Annotated[float, Ge(0), Le(0.5)] = 0.0
    correlation_s: Positive = 0.3
    traction_s2pm: Annotated[float, Ge(0), Le(0.1)] = 0.0


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
        left = self.left
        right = self.right
        if self.traction_s2pm:
            # Acceleration along the way that a wheel goes: negative where it brakes.
            left += self.traction_s2pm * (driven_mps2[0] if left_mps > 0 else -driven_mps2[0])
            right += self.traction_s2pm * (driven_mps2[1] if right_mps > 0 else -driven_mps2[1])
        return left_mps / (radius_m * (1 - left)), right_mps / (radius_m * (1 - right))


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


Bias = Annotated[float, Ge(-0.3), Le(0.3)]


@settings(kw_only=False)
class Ground:
    """What a floor does to slip: it multiplies slip ratios and side-slip angle by `factor`, then adds to them.

    `ratio_bias`: both rims run ahead by that; `angle_bias_rad`: pulled to the left, as by a carpet's nap.
    """

    factor: Annotated[float, Ge(0), Le(50)] = 1.0
    ratio_bias: Bias = 0.0
    angle_bias_rad: Bias = 0.0


# Engineering choices: a wet patch spins the wheels, a carpet holds less well and pulls along its nap, a seam is a jolt.
SURFACES = {
    "wet": Ground(factor=6.0, ratio_bias=0.04),
    "carpet": Ground(factor=1.5, ratio_bias=0.01, angle_bias_rad=radians(1.0)),
    "seam": Ground(factor=10.0),
}


@settings()
class FloorPatch:
    """A rectangle of the floor that is wet, covered or a seam: slip is another there."""

    surface: Annotated[str, OneOf("surface", SURFACES)]
    center_m: tuple[float, float]
    size_m: tuple[Positive, Positive]
    yaw_deg: float = 0.0

    @property
    def corners_m(self) -> Array:
        """Its corners (4, 2) on the floor, in turn."""
        half = np.array(self.size_m) / 2 * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
        corners: Array = half @ se3.rotation_z(radians(self.yaw_deg))[:2, :2].T + self.center_m
        return corners

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a point of the floor is on it."""
        x = x_m - self.center_m[0]
        y = y_m - self.center_m[1]
        c = cos(radians(self.yaw_deg))
        s = sin(radians(self.yaw_deg))
        return abs(c * x + s * y) <= self.size_m[0] / 2 and abs(c * y - s * x) <= self.size_m[1] / 2


def under(patches: Sequence[FloorPatch], x_m: float, y_m: float) -> tuple[float, float, float]:
    """Factor, ratio bias and angle bias (rad) under a point: where patches overlap factors multiply, biases add."""
    factor = 1.0
    ratio_bias = 0.0
    angle_bias_rad = 0.0
    for patch in patches:
        if patch.holds(x_m, y_m):
            ground = SURFACES[patch.surface]
            factor *= ground.factor
            ratio_bias += ground.ratio_bias
            angle_bias_rad += ground.angle_bias_rad
    return factor, ratio_bias, angle_bias_rad


# The random streams of a drive: slip's three, delta's two, and the one that perturbs theta.
DELTA_STREAMS = ("delta_u", "delta_omega")
DISTURBANCE_STREAMS = (*SLIP_STREAMS, *DELTA_STREAMS, "theta")

# Beyond this a slip ratio or an angle (rad) is cut: nearer 1 and pi/2 the formulas lose their meaning.
MOST_SLIP = 0.5


@settings(kw_only=False)
class DeltaSettings:
    """The pushes delta_u (m/s^2) and delta_omega (rad/s^2) of (18) as Ornstein-Uhlenbeck processes.

    Standard deviations, and the time over which both forget.
    """

    speed_std_mps2: Annotated[float, Ge(0), Le(10)] = 0.0
    turn_std_radps2: Annotated[float, Ge(0), Le(50)] = 0.0
    correlation_s: Positive = 0.5


# Engineering choices: an even floor, and one whose bumps shove the robot as it goes.
DELTAS = {"none": DeltaSettings(), "nominal": DeltaSettings(0.05, 0.1), "bumpy": DeltaSettings(0.2, 0.5, 0.15)}


@dataclass(frozen=True, slots=True)
class Disturbances:
    """What disturbs a drive at its frames: rows (N, 5) of both sigmas, beta (rad) and both deltas as drawn.

    The floor changes the first three where the wheels are; between frames all run on straight lines,
    so that no velocity jumps. At the edge of a patch they take one frame to change.
    """

    rows: Array
    skid_s: float
    traction_s2pm: float
    floor: tuple[FloorPatch, ...]

    def at(self, frame: int, contacts_m: Sequence[tuple[float, float]]) -> SlipNow:
        """What disturbs at a frame with the left wheel, the right wheel and the axle's middle at these places."""
        left, right, beta, delta_u, delta_omega = self.rows[frame].tolist()
        if self.floor:
            on_left, on_right, on_middle = (under(self.floor, *place) for place in contacts_m)
            left = left * on_left[0] + on_left[1]
            right = right * on_right[0] + on_right[1]
            beta = beta * on_middle[0] + on_middle[2]
        return SlipNow(_cut(left), _cut(right), _cut(beta), self.skid_s, self.traction_s2pm, delta_u, delta_omega)


def drawn(
    count: int,
    slip: SlipSettings,
    delta: DeltaSettings,
    floor: Sequence[FloorPatch],
    *,
    step_s: float,
    rngs: Generators | None,
) -> Disturbances:
    """The disturbances of `count` frames. Raises MotionError where they ask for chance and a stream is missing."""
    stds = (slip.ratio_std, slip.ratio_std, slip.angle_std_rad, delta.speed_std_mps2, delta.turn_std_radps2)
    rows = np.zeros((count, len(stds)))
    for column, (stream, std) in enumerate(zip((*SLIP_STREAMS, *DELTA_STREAMS), stds, strict=True)):
        if std > 0:
            correlation_s = slip.correlation_s if stream in SLIP_STREAMS else delta.correlation_s
            rng = generator_of(rngs, stream)
            rows[:, column] = ornstein_uhlenbeck(count, std=std, step_s=step_s, correlation_s=correlation_s, rng=rng)
    return Disturbances(rows, slip.skid_s, slip.traction_s2pm, tuple(floor))


def _cut(value: float) -> float:
    return max(-MOST_SLIP, min(MOST_SLIP, value))
