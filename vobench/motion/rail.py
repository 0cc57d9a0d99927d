"""A carriage on a rail through points in space: it faces along the rail, without roll."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import MaxLen, MinLen
from numpy.typing import NDArray

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.rig import Mount
from vobench.geometry.se3 import Array
from vobench.motion.course import BLUNT, ArcLength, arc_length
from vobench.motion.spline import Jet, of_axes, quintic
from vobench.motion.wheeled import Acceleration, Rate, Speed
from vobench.setting import MOST_POINTS, Triple, settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, rest_to_rest
from vobench.trajectory.trajectory import path_lengths_m, step_lengths_m

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
        d1 = self.position(u, 1)
        d2 = self.position(u, 2)
        d3 = self.position(u, 3)
        zero = np.zeros_like(d1)
        up = Jet(np.broadcast_to(UP, d1.shape), zero, zero)
        x = Jet(d1, d2, d3).direction()
        y = up.cross(x).direction()
        z = x.cross(y)
        by_u = of_axes(x, y, z)

        # From derivatives by the parameter u to derivatives by arc length.
        speed = np.linalg.norm(d1, axis=-1, keepdims=True)
        speed_rate = np.sum(x.value * d2, axis=-1, keepdims=True)
        turn_change = by_u.turn_rate - by_u.turn * speed_rate / speed
        ahead = np.broadcast_to([1.0, 0.0, 0.0], (len(u), 3))
        return Kinematics(
            T_world_body=se3.transform(by_u.R, self.position(u)),
            velocity_mps=ahead,
            angular_velocity_radps=by_u.turn / speed,
            acceleration_mps2=by_u.in_body(x.rate) / speed,
            angular_acceleration_radps2=turn_change / speed**2,
        )


@settings()
class Rail:
    """A motion along a rail through points from rest to rest, facing along it, without roll."""

    kind: Literal["rail"] = "rail"
    points_m: Annotated[tuple[Triple, ...], MinLen(2), MaxLen(MOST_POINTS)]
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5
    rate_hz: Rate = 30.0
    mount: Mount | None = None

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError for two equal points, and for a rail that is too steep or turns back."""
        points_m = np.array(self.points_m)
        check_apart(points_m, of="rail")
        if len(points_m) == 2:
            points_m = np.insert(points_m, 1, points_m.mean(0), axis=0)
        u = path_lengths_m(points_m)
        position = quintic(u, points_m)

        def speed(parameter: Array) -> Array:
            return np.asarray(np.linalg.norm(position(parameter, 1), axis=-1))

        shares = np.arange(KNOTS_PER_POINT) / KNOTS_PER_POINT
        starts = u[:-1, None]
        spans = np.diff(u)[:, None]
        knots = np.append((starts + spans * shares).ravel(), u[-1])
        _require_rideable(position(knots, 1), position(knots))
        arc = arc_length(speed, knots)
        law = rest_to_rest(arc.length, speed=self.speed_mps, acceleration=self.accel_mps2)
        curve = RailCurve(position, arc, breaks=np.zeros(0))
        return CurveMotion(curve, law)


def check_apart(points: Array, *, of: str) -> None:
    """Raise MotionError for two successive points (N, 3) that are equal; `of` is what passes through them."""
    same = np.flatnonzero(step_lengths_m(points) == 0)
    if same.size:
        raise MotionError(f"points {same[0]} and {same[0] + 1} of the {of} are the same; leave one of them out")


def _require_rideable(tangents: Array, points_m: Array) -> None:
    """Raise MotionError for a rail, of derivatives and points (K, 3), that turns back or is too steep."""
    speed = np.linalg.norm(tangents, axis=1)
    tiny = np.finfo(float).tiny
    slope_rad = np.arcsin(np.abs(tangents[:, 2]) / np.maximum(speed, tiny))
    turns_back = speed < BLUNT * speed.max()
    if turns_back.any():
        point = _first_point(points_m, turns_back)
        raise MotionError(f"near {point} m the rail turns back on itself; set its points wider apart there")
    is_steep = slope_rad > STEEPEST_RAD
    if is_steep.any():
        point = _first_point(points_m, is_steep)
        steepest_deg = np.rad2deg(STEEPEST_RAD)
        raise MotionError(f"near {point} m the rail is steeper than {steepest_deg:.0f} deg, where level has no meaning")


def _first_point(points_m: Array, mask: NDArray[np.bool_]) -> str:
    """The first of points (K, 3) that a mask selects, for messages."""
    rounded_m = points_m[mask][0].round(2)
    x, y, z = rounded_m + 0.0  # which changes -0 to 0
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
