"""Disturbances of a drive: wheel slip, patches of floor that change it, and the disturbances of the dynamic model.

Source of the dynamic model: Bastos, Lima and Kurka, Virtual 3D environments for image-based navigation algorithms. Its
equation (18) gives the accelerations of a Pioneer and ends in the additive disturbances delta_u and delta_omega.

Terms: a wheel's slip ratio is 1 - ground speed / rim speed; the side-slip angle is that of the velocity to the left of
the heading.
"""

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

# The random streams, one for each process, so that switching one off does not change the others.
SLIP_STREAMS = ("left", "right", "side")
Generators = Mapping[str, np.random.Generator]


@settings(kw_only=False)
class SlipSettings:
    """Three independent, stationary, zero-mean Ornstein-Uhlenbeck processes, and two deterministic terms.

    Random are the slip ratio of each wheel, with standard deviation `ratio_std`, and the side-slip angle, with
    `angle_std_rad`; `correlation_s` is their correlation time. Deterministic are `skid_s`, the sideways speed to the
    outside of a bend per product of speed and turn rate, and `traction_s2pm`, the slip ratio per acceleration.
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
    "straining": SlipSettings(
        ratio_std=0.01,
        angle_std_rad=radians(0.5),
        skid_s=0.005,
        traction_s2pm=0.03,
    ),
}


class Disturbance(NamedTuple):
    """The disturbance at one instant.

    `left` and `right` are slip ratios, `beta` is the side-slip angle (rad), `skid_s` and `traction_s2pm` are as in
    SlipSettings, `delta_u` (m/s^2) and `delta_omega` (rad/s^2) are as in DeltaSettings.
    """

    left: float = 0.0
    right: float = 0.0
    beta: float = 0.0
    skid_s: float = 0.0
    traction_s2pm: float = 0.0
    delta_u: float = 0.0
    delta_omega: float = 0.0

    def towards(self, later: "Disturbance", share: float) -> "Disturbance":
        """The disturbance on the straight line from this (share 0) to a later one (share 1)."""
        values = (a + share * (b - a) for a, b in zip(self, later, strict=True))
        return Disturbance(*values)

    def side_speed(self, u: float, omega: float) -> float:
        """Speed of sliding to the left in m/s."""
        return u * tan(self.beta) - self.skid_s * u * omega

    def rim_rates(
        self,
        left_mps: float,
        right_mps: float,
        *,
        radius_m: float,
        driven_mps2: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[float, float]:
        """Angular rates of the left and right rim in rad/s for wheels at these ground speeds and accelerations."""
        left = self.left
        right = self.right
        if self.traction_s2pm:
            # Acceleration in the direction of a wheel's motion: negative while it brakes.
            left_mps2, right_mps2 = driven_mps2
            left += self.traction_s2pm * (left_mps2 if left_mps > 0 else -left_mps2)
            right += self.traction_s2pm * (right_mps2 if right_mps > 0 else -right_mps2)
        left_radps = left_mps / (radius_m * (1 - left))
        right_radps = right_mps / (radius_m * (1 - right))
        return left_radps, right_radps


def ornstein_uhlenbeck(
    count: int,
    *,
    std: float,
    step_s: float,
    correlation_s: float,
    rng: np.random.Generator,
) -> Array:
    """A stationary first-order Gauss-Markov path (count,), exact for any step: the variance does not depend on it.

    A longer path of the same generator begins with the same values. Source: Gillespie (1996).
    """
    correlation = exp(-step_s / correlation_s)  # of successive values
    shocks = std * rng.standard_normal(count)
    shocks[1:] *= sqrt(1 - correlation**2)

    def next_value(last: float, shock: float) -> float:
        return correlation * last + shock

    return np.array(list(accumulate(shocks.tolist(), next_value)))


def generator_of(rngs: Generators | None, stream: str) -> np.random.Generator:
    """The generator of a stream. Raises MotionError if it is missing."""
    if rngs is None or stream not in rngs:
        raise MotionError(f"this drive needs a random generator for {stream!r}, and rngs has none")
    return rngs[stream]


Bias = Annotated[float, Ge(-0.3), Le(0.3)]


@settings(kw_only=False)
class GroundSlip:
    """The effect of a floor on slip: a `factor` of slip ratios and side-slip angle, and a bias of each.

    `ratio_bias` is added to both ratios; `angle_bias_rad` slides the robot to the left, as a carpet's nap does.
    """

    factor: Annotated[float, Ge(0), Le(50)] = 1.0
    ratio_bias: Bias = 0.0
    angle_bias_rad: Bias = 0.0


# Engineering choices: a wet patch spins the wheels, a carpet holds less well and pulls along its nap, a seam is a jolt.
SURFACES = {
    "wet": GroundSlip(factor=6.0, ratio_bias=0.04),
    "carpet": GroundSlip(factor=1.5, ratio_bias=0.01, angle_bias_rad=radians(1.0)),
    "seam": GroundSlip(factor=10.0),
}


@settings()
class FloorPatch:
    """A rectangle of the floor that is wet, covered or a seam, with another slip."""

    surface: Annotated[str, OneOf("surface", SURFACES)]
    center_m: tuple[float, float]
    size_m: tuple[Positive, Positive]
    yaw_deg: float = 0.0

    @property
    def corners_m(self) -> Array:
        """The corners (4, 2) on the floor, counterclockwise."""
        half_m = np.array(self.size_m) / 2
        directions = [[1, 1], [-1, 1], [-1, -1], [1, -1]]
        R = se3.rotation_z(radians(self.yaw_deg))[:2, :2]
        offsets_m = (half_m * directions) @ R.T
        corners: Array = offsets_m + self.center_m
        return corners

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether a point of the floor is on the patch."""
        x = x_m - self.center_m[0]
        y = y_m - self.center_m[1]
        c = cos(radians(self.yaw_deg))
        s = sin(radians(self.yaw_deg))
        along_m = abs(c * x + s * y)
        across_m = abs(c * y - s * x)
        return along_m <= self.size_m[0] / 2 and across_m <= self.size_m[1] / 2


def ground_effect(patches: Sequence[FloorPatch], x_m: float, y_m: float) -> tuple[float, float, float]:
    """Factor, ratio bias and angle bias (rad) at a point: of overlapping patches factors multiply, biases add."""
    factor = 1.0
    ratio_bias = 0.0
    angle_bias_rad = 0.0
    for patch in patches:
        if patch.contains(x_m, y_m):
            ground = SURFACES[patch.surface]
            factor *= ground.factor
            ratio_bias += ground.ratio_bias
            angle_bias_rad += ground.angle_bias_rad
    return factor, ratio_bias, angle_bias_rad


# The random streams of a drive: three of slip, two of delta, and the one that perturbs theta.
DELTA_STREAMS = ("delta_u", "delta_omega")
DISTURBANCE_STREAMS = (*SLIP_STREAMS, *DELTA_STREAMS, "theta")

# A slip ratio or an angle (rad) is clipped at this limit: nearer to 1 and pi/2 the formulas are invalid.
MAX_SLIP = 0.5


@settings(kw_only=False)
class DeltaSettings:
    """The disturbances delta_u (m/s^2) and delta_omega (rad/s^2) of equation (18) as Ornstein-Uhlenbeck processes.

    They have standard deviations, and a common correlation time.
    """

    speed_std_mps2: Annotated[float, Ge(0), Le(10)] = 0.0
    turn_std_radps2: Annotated[float, Ge(0), Le(50)] = 0.0
    correlation_s: Positive = 0.5


# Engineering choices: an even floor, and one whose bumps push the robot.
DELTAS = {
    "none": DeltaSettings(),
    "nominal": DeltaSettings(0.05, 0.1),
    "bumpy": DeltaSettings(0.2, 0.5, 0.15),
}


@dataclass(frozen=True, slots=True)
class Disturbances:
    """The disturbances of a drive at its frames: rows (N, 5) of left, right, beta and both deltas.

    Rows are those on a plain floor; a patch under the wheels changes the first three columns. Between frames all change
    linearly, so that no velocity jumps; at the edge of a patch they take one frame to change.
    """

    rows: Array
    skid_s: float
    traction_s2pm: float
    floor: tuple[FloorPatch, ...]

    def at(self, frame: int, contacts_m: Sequence[tuple[float, float]]) -> Disturbance:
        """The disturbance at a frame, with the left wheel, the right wheel and the axle's middle at these points."""
        left, right, beta, delta_u, delta_omega = self.rows[frame].tolist()
        if self.floor:
            left_m, right_m, middle_m = contacts_m
            left_factor, left_bias, _ = ground_effect(self.floor, *left_m)
            right_factor, right_bias, _ = ground_effect(self.floor, *right_m)
            middle_factor, _, angle_bias_rad = ground_effect(self.floor, *middle_m)
            left = left * left_factor + left_bias
            right = right * right_factor + right_bias
            beta = beta * middle_factor + angle_bias_rad
        return Disturbance(
            left=_clipped(left),
            right=_clipped(right),
            beta=_clipped(beta),
            skid_s=self.skid_s,
            traction_s2pm=self.traction_s2pm,
            delta_u=delta_u,
            delta_omega=delta_omega,
        )


def random_disturbances(
    count: int,
    slip: SlipSettings,
    delta: DeltaSettings,
    floor: Sequence[FloorPatch],
    *,
    step_s: float,
    rngs: Generators | None,
) -> Disturbances:
    """The disturbances of `count` frames. Raises MotionError if they are random and a stream is missing."""
    processes = {
        "left": (slip.ratio_std, slip.correlation_s),
        "right": (slip.ratio_std, slip.correlation_s),
        "side": (slip.angle_std_rad, slip.correlation_s),
        "delta_u": (delta.speed_std_mps2, delta.correlation_s),
        "delta_omega": (delta.turn_std_radps2, delta.correlation_s),
    }
    rows = np.zeros((count, len(processes)))
    for column, (stream, (std, correlation_s)) in enumerate(processes.items()):
        if std > 0:
            rows[:, column] = ornstein_uhlenbeck(
                count,
                std=std,
                step_s=step_s,
                correlation_s=correlation_s,
                rng=generator_of(rngs, stream),
            )
    return Disturbances(rows, slip.skid_s, slip.traction_s2pm, tuple(floor))


def _clipped(value: float) -> float:
    """A slip ratio or an angle within the limits of the formulas."""
    return max(-MAX_SLIP, min(MAX_SLIP, value))
