"""How a body moves at any instant: pose, velocities and accelerations that agree with each other."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps

STANDARD_GRAVITY_MPS2 = 9.80665  # exact by definition (3rd CGPM, 1901); it pulls down the world's z axis


@dataclass(frozen=True, slots=True)
class Kinematics:
    """A body at K instants; velocities and accelerations are of its origin, against the world, in its own axes.

    T_world_body (K, 4, 4); velocity_mps (K, 3) and acceleration_mps2 (K, 3): the first and second derivative
    of its position in the world, turned into body axes (so without gravity); turn_radps (K, 3): angular
    velocity, with R' = R [turn]x; turn_rate_radps2 (K, 3): its derivative.
    """

    T_world_body: Array
    velocity_mps: Array
    turn_radps: Array
    acceleration_mps2: Array
    turn_rate_radps2: Array

    @property
    def twist(self) -> Array:
        """Velocities (K, 6): linear, then angular."""
        return np.concatenate([self.velocity_mps, self.turn_radps], -1)

    def of_mounted(self, T_body_sensor: Array) -> "Kinematics":
        """The same of something fixed to the body, in that thing's axes: the lever arm's share is added."""
        R_sensor_body, lever_m = T_body_sensor[:3, :3].T, T_body_sensor[:3, 3]
        w, dw = self.turn_radps, self.turn_rate_radps2
        swung_mps = np.cross(w, lever_m)
        swung_mps2 = np.cross(dw, lever_m) + np.cross(w, swung_mps)

        def seen(vectors: Array) -> Array:
            turned: Array = vectors @ R_sensor_body.T
            return turned

        return Kinematics(
            self.T_world_body @ T_body_sensor,
            seen(self.velocity_mps + swung_mps),
            seen(w),
            seen(self.acceleration_mps2 + swung_mps2),
            seen(dw),
        )


class Motion(Protocol):
    """A body's way through the world, exact at any instant.

    Goes on evenly for a little before `start_ns` and after `end_ns`, for shutters that are open there.
    """

    @property
    def start_ns(self) -> int:
        """The first instant."""

    @property
    def end_ns(self) -> int:
        """The last instant."""

    @property
    def breaks_ns(self) -> Array:
        """Instants (B,) float64 in ns, rising, between which acceleration is smooth: where it may jump."""

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """Where the body is and how it moves at instants (K,), whole nanoseconds or fractions of them."""


def level(x_m: Array, y_m: Array, heading_rad: Array) -> Array:
    """T_world_body (K, 4, 4) of a body that stays level on the floor."""
    return se3.transform(se3.rotation_z(heading_rad), np.stack([x_m, y_m, np.zeros_like(x_m)], -1))
