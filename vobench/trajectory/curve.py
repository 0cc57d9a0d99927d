"""A way through the world and the law of time by which a body goes along it: together a motion."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from vobench.geometry.se3 import Array
from vobench.trajectory.kinematics import Kinematics
from vobench.trajectory.time_law import TimeLaw
from vobench.trajectory.trajectory import Stamps

AT_REST = 1e-9  # progress per second: slower than that, a break of the curve is also one of the law


class Curve(Protocol):
    """Poses by progress s along a way: metres of a path, radians of a turn, seconds of a recording."""

    @property
    def breaks(self) -> Array:
        """Progress (B,), rising, between which the second derivative of the pose is smooth."""

    def at(self, s: Array) -> Kinematics:
        """Poses at s (K,) with velocities and accelerations as if s were seconds: derivatives by s."""


@dataclass(frozen=True, slots=True)
class CurveMotion:
    """A body on a curve by a law of time; T_world_start lays the curve's own frame in the world."""

    curve: Curve
    law: TimeLaw
    T_world_start: Array = field(default_factory=lambda: np.eye(4))

    @property
    def start_ns(self) -> int:
        """The first instant."""
        return round(self.law.start_s * 1e9)

    @property
    def end_ns(self) -> int:
        """The last instant."""
        return round(self.law.end_s * 1e9)

    @property
    def breaks_ns(self) -> Array:
        """Where the law changes its polynomial, and where the body passes a break of the curve, unless at rest."""
        passed_s = self.law.when(self.curve.breaks)
        rate = self.law.at(passed_s)[1]
        passed_s = passed_s[(rate > AT_REST) & (passed_s > self.law.start_s) & (passed_s < self.law.end_s)]
        return np.unique(np.concatenate([self.law.breaks_s, passed_s])) * 1e9

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The curve where the law says, by the chain rule."""
        s, rate, change = self.law.at(np.asarray(t_ns, float) / 1e9)
        by_s, rate, change = self.curve.at(s), rate[:, None], change[:, None]
        return Kinematics(
            T_world_body=self.T_world_start @ by_s.T_world_body,
            velocity_mps=by_s.velocity_mps * rate,
            turn_radps=by_s.turn_radps * rate,
            acceleration_mps2=by_s.acceleration_mps2 * rate**2 + by_s.velocity_mps * change,
            turn_rate_radps2=by_s.turn_rate_radps2 * rate**2 + by_s.turn_radps * change,
        )
