"""A carriage on a rail through points in space: it looks along the rail, level from side to side."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import MinLen

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.course import BLUNT, ArcLength, arc_length
from vobench.motion.spline import Jet, cross, of_axes, quintic, unit
from vobench.motion.wheeled import Acceleration, Rate, Speed
from vobench.setting import Triple, settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, rest_to_rest

KNOTS_PER_POINT = 256
STEEPEST_RAD = np.deg2rad(85.0)
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class RailCurve:
    """A Curve by arc length in m: x along the rail, y level."""

    position: "scipy.interpolate.BSpline"
    arc: ArcLength
    breaks: Array  # none: positions are four times smooth at the points

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at arc length s (K,), and their derivatives by s."""
        u = self.arc.parameter(s)
        d1, d2, d3 = (self.position(u, order) for order in (1, 2, 3))
        x = unit(Jet(d1, d2, d3))
        still = np.zeros_like(d1)
        y = unit(cross(Jet(np.broadcast_to(UP, d1.shape), still, still), x))
        by_u = of_axes(x, y, cross(x, y))
        speed = np.linalg.norm(d1, axis=-1, keepdims=True)
        speed_rate = np.sum(x.value * d2, axis=-1, keepdims=True)
        return Kinematics(
            T_world_body=se3.transform(by_u.R, self.position(u)),
            velocity_mps=np.broadcast_to([1.0, 0.0, 0.0], (len(u), 3)),
            turn_radps=by_u.turn / speed,
            acceleration_mps2=by_u.in_body(x.rate) / speed,
            turn_rate_radps2=(by_u.turn_rate - by_u.turn * speed_rate / speed) / speed**2,
        )


@settings()
class Rail:
    """Along a rail through points from rest to rest, looking along it, level from side to side."""

    kind: Literal["rail"] = "rail"
    points_m: Annotated[tuple[Triple, ...], MinLen(2)]
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5
    rate_hz: Rate = 30.0

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError where two points are the same, or the rail stands on end or turns back."""
        points = np.array(self.points_m)
        check_apart(points, of="rail")
        if len(points) == 2:
            points = np.insert(points, 1, points.mean(0), axis=0)
        u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        position = quintic(u, points)
        parts = np.arange(KNOTS_PER_POINT) / KNOTS_PER_POINT
        knots = np.append((u[:-1, None] + np.diff(u)[:, None] * parts).ravel(), u[-1])
        _check_way(position(knots, 1), position(knots))
        arc = arc_length(lambda at: np.linalg.norm(position(at, 1), axis=-1), knots)
        law = rest_to_rest(arc.length, speed=self.speed_mps, acceleration=self.accel_mps2)
        return CurveMotion(RailCurve(position, arc, np.zeros(0)), law)


def check_apart(points: Array, *, of: str) -> None:
    """Raise MotionError where two points (N, 3) in a row are the same; `of` names what goes through them."""
    same = np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) == 0)
    if same.size:
        raise MotionError(f"points {same[0]} and {same[0] + 1} of the {of} are the same; leave one of them out")


def _check_way(tangents: Array, at_m: Array) -> None:
    """Raise MotionError where the rail, of derivative (K, 3), is a point or stands on end."""
    speed = np.linalg.norm(tangents, axis=1)
    slope_rad = np.arcsin(np.abs(tangents[:, 2]) / np.maximum(speed, np.finfo(float).tiny))
    for wrong, what in (
        (speed < BLUNT * speed.max(), "turns back on itself; set its points wider apart there"),
        (slope_rad > STEEPEST_RAD, f"is steeper than {np.rad2deg(STEEPEST_RAD):.0f} deg, where level has no meaning"),
    ):
        if wrong.any():
            x, y, z = at_m[int(np.flatnonzero(wrong)[0])].round(2) + 0.0  # which makes -0 a 0
            raise MotionError(f"near ({x:.2f}, {y:.2f}, {z:.2f}) m the rail {what}")
