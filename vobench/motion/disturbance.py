"""The disturbances of a drive: slip, and the additive disturbances of the dynamic model.

Source of the dynamic model: Bastos, Lima and Kurka, Virtual 3D environments for image-based navigation algorithms. Its
equation (18) gives the accelerations of a Pioneer and ends in the additive disturbances delta_u and delta_omega.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import exp, sqrt, tan
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Le

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.motion.floor_patch import FloorPatch, ground_effect
from vobench.motion.slip import SLIP_STREAMS, SlipSettings
from vobench.setting import Positive, settings

# The random streams of a drive: three of slip, two of delta, and the one that perturbs theta.
DELTA_STREAMS = ("delta_u", "delta_omega")
DISTURBANCE_STREAMS = (*SLIP_STREAMS, *DELTA_STREAMS, "theta")
Generators = Mapping[str, np.random.Generator]  # by stream

# Slip ratios and side-slip angles (rad) are clipped at this limit, because the formulas are invalid near 1 and pi / 2.
MAX_SLIP = 0.5


@settings(kw_only=False)
class DeltaSettings:
    """The disturbances delta_u (m/s^2) and delta_omega (rad/s^2) of equation (18) as Ornstein-Uhlenbeck processes.

    `speed_std_mps2` and `turn_std_radps2` are their standard deviations, `correlation_s` is their correlation time.
    """

    speed_std_mps2: Annotated[float, Ge(0), Le(10)] = 0.0
    turn_std_radps2: Annotated[float, Ge(0), Le(50)] = 0.0
    correlation_s: Positive = 0.5


# Engineering choices: no disturbance, an even floor, and a floor whose bumps push the robot.
DELTAS = {
    "none": DeltaSettings(),
    "nominal": DeltaSettings(0.05, 0.1),
    "bumpy": DeltaSettings(0.2, 0.5, 0.15),
}


class Disturbance(NamedTuple):
    """The disturbance at one instant.

    `left` and `right` are the slip ratios of the wheels, and `beta` is the side-slip angle (rad).
    `skid_s` and `traction_s2pm` are as in `SlipSettings`.
    `delta_u` (m/s^2) and `delta_omega` (rad/s^2) are as in `DeltaSettings`.
    """

    left: float = 0.0
    right: float = 0.0
    beta: float = 0.0
    skid_s: float = 0.0
    traction_s2pm: float = 0.0
    delta_u: float = 0.0
    delta_omega: float = 0.0

    def towards(self, later: "Disturbance", share: float) -> "Disturbance":
        """Interpolate linearly between this disturbance (share 0) and a later one (share 1)."""
        values = (a + share * (b - a) for a, b in zip(self, later, strict=True))
        return Disturbance(*values)

    def side_speed(self, u: float, omega: float) -> float:
        """The speed in m/s at which the robot slides to the left, if it moves at the speed u and turns at omega."""
        return u * tan(self.beta) - self.skid_s * u * omega

    def rim_rates(
        self,
        left_mps: float,
        right_mps: float,
        *,
        radius_m: float,
        driven_mps2: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[float, float]:
        """The angular rates in rad/s of the rims of the left and the right wheel.

        `left_mps` and `right_mps` are the ground speeds of the wheels, `driven_mps2` are their accelerations.
        """
        left_mps2, right_mps2 = driven_mps2
        left_ratio = self.left + self._traction_ratio(left_mps, left_mps2)
        right_ratio = self.right + self._traction_ratio(right_mps, right_mps2)
        left_radps = left_mps / (radius_m * (1 - left_ratio))
        right_radps = right_mps / (radius_m * (1 - right_ratio))
        return left_radps, right_radps

    def _traction_ratio(self, speed_mps: float, acceleration_mps2: float) -> float:
        """The slip ratio due to the acceleration of a wheel. It is negative while the wheel brakes."""
        forward_mps2 = acceleration_mps2 if speed_mps > 0 else -acceleration_mps2
        return self.traction_s2pm * forward_mps2


@dataclass(frozen=True, slots=True)
class Disturbances:
    """The disturbances of a drive at its frames.

    `rows` (N, 5) has the columns left, right, beta, delta_u and delta_omega of `Disturbance`, on a plain floor. A patch
    of the floor under the wheels changes the first three.
    Between frames a drive interpolates linearly, so that no velocity jumps. A change at the edge of a patch therefore
    takes one frame.
    """

    rows: Array
    skid_s: float
    traction_s2pm: float
    floor: tuple[FloorPatch, ...]

    def at(self, frame: int, contacts_m: Sequence[tuple[float, float]]) -> Disturbance:
        """The disturbance at a frame.

        `contacts_m` are the points of the floor under the left wheel, the right wheel and the middle of the axle.
        """
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


def ornstein_uhlenbeck(
    count: int,
    *,
    std: float,
    step_s: float,
    correlation_s: float,
    rng: np.random.Generator,
) -> Array:
    """Values (count,) of a stationary Ornstein-Uhlenbeck process. Source: Gillespie (1996).

    The simulation is exact, so that the standard deviation does not depend on the step. With an equal generator, a
    longer path begins with the same values.
    """
    correlation = exp(-step_s / correlation_s)  # between successive values
    shocks = std * rng.standard_normal(count)
    shocks[1:] *= sqrt(1 - correlation**2)

    def next_value(last: float, shock: float) -> float:
        return correlation * last + shock

    return np.array(list(accumulate(shocks.tolist(), next_value)))


def generator_of(rngs: Generators | None, stream: str) -> np.random.Generator:
    """The generator of a random stream. Raises MotionError if it is missing."""
    if rngs is None or stream not in rngs:
        raise MotionError(f"this drive needs a random generator for {stream!r}, and rngs has none")
    return rngs[stream]
