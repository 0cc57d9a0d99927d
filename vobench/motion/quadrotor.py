"""A quadrotor through points on the way of least snap, tilted as its thrust must be.

Source: Mellinger and Kumar (2011), minimum snap and differential flatness.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import radians
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Le, MinLen

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.rail import check_apart
from vobench.motion.spline import Jet, cross, from_zero, of_axes, unit
from vobench.motion.wheeled import Rate, Speed
from vobench.setting import Triple, settings
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2, CurveMotion, Kinematics, evenly

HELD_MPS2 = np.array([0.0, 0.0, STANDARD_GRAVITY_MPS2])  # what the rotors give beyond the acceleration
LEAST_LIFT = 0.1  # of the weight: below it the rotors all but stop, and which way is up is lost
LOOKS_PER_LEG = 64
SLOW = 1e-3  # of the way's mean speed: what moves slower over ground has no heading
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # exact for the square of a cubic


@dataclass(frozen=True, slots=True)
class QuadrotorCurve:
    """A Curve by time in s: position (3 columns) of degree 7, yaw of degree 5."""

    position: "scipy.interpolate.BSpline"
    yaw_rad: "scipy.interpolate.BSpline"
    breaks: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at s (K,) in s: z along the thrust, x as near to the yaw's direction as that allows."""
        p, v, a, jerk, snap = (self.position(s, order) for order in range(5))
        z = unit(Jet(a + HELD_MPS2, jerk, snap))
        y = unit(cross(z, self._ahead(s)))
        held = of_axes(cross(y, z), y, z)
        return Kinematics(se3.transform(held.R, p), held.in_body(v), held.turn, held.in_body(a), held.turn_rate)

    def _ahead(self, s: Array) -> Jet:
        """The level direction of the yaw."""
        yaw, rate, change = (self.yaw_rad(s, order)[:, None] for order in range(3))
        still = np.zeros_like(yaw)
        ahead = np.concatenate([np.cos(yaw), np.sin(yaw), still], -1)
        left = np.concatenate([-np.sin(yaw), np.cos(yaw), still], -1)
        return Jet(ahead, left * rate, left * change - ahead * rate**2)


@settings()
class Quadrotor:
    """Through points on the way of least snap, from hover to hover, tilted as thrust must be.

    Without `t_s` each leg has the time that snap asks for, and all of them the mean speed; without `yaw_deg`
    it looks the way it flies.
    """

    kind: Literal["quadrotor"] = "quadrotor"
    points_m: Annotated[tuple[Triple, ...], MinLen(2)]
    t_s: tuple[float, ...] | None = None
    speed_mps: Speed = 0.5
    yaw_deg: Annotated[float, Ge(-360), Le(360)] | None = None
    rate_hz: Rate = 30.0

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError for points or times that make no way, or rotors that would have to pull."""
        points = np.array(self.points_m)
        check_apart(points, of="flight")
        t_s = _least_snap_times(points, self.speed_mps) if self.t_s is None else from_zero(self.t_s, of="point")
        if len(t_s) != len(points):
            raise MotionError(f"there are {len(t_s)} times for {len(points)} points; each point needs one")
        position = minimum_snap(t_s, points)
        yaw = _headings(position, t_s, points)
        if self.yaw_deg is not None:
            yaw = np.full(len(t_s), radians(self.yaw_deg))
        rest = [(1, 0.0), (2, 0.0)]
        yaw_rad = scipy.interpolate.make_interp_spline(t_s, yaw, k=5, bc_type=(rest, rest))
        curve = QuadrotorCurve(position, yaw_rad, t_s[1:-1])
        _check_lift(curve, t_s)
        return CurveMotion(curve, evenly(t_s[0], t_s[-1], begin=t_s[0]))


def minimum_snap(t_s: Array, points_m: Array) -> "scipy.interpolate.BSpline":
    """Of all ways through points (N, 3) at t_s (N,), from hover to hover, the one of the least integral of snap².

    That is the interpolating spline of degree 7 with velocity, acceleration and jerk 0 at both ends.
    Source: the optimality of odd-degree splines, de Boor (1963).
    """
    hover = [(order, np.zeros(3)) for order in (1, 2, 3)]
    return scipy.interpolate.make_interp_spline(t_s, points_m, k=7, bc_type=(hover, hover))


def snap_cost(position: "scipy.interpolate.BSpline", t_s: Array) -> float:
    """∫ |snap|² dt between the times t_s (N,) that are its knots."""
    half = np.diff(t_s) / 2
    at_s = (t_s[:-1] + half)[:, None] + half[:, None] * NODES
    squared = np.sum(position(at_s.ravel(), 4) ** 2, axis=-1).reshape(at_s.shape)
    return float(squared @ WEIGHTS @ half)


def _least_snap_times(points: Array, speed_mps: float) -> Array:
    """Times of the points, the whole as long as `speed_mps` asks, shared out so that snap is least."""
    legs_m = np.linalg.norm(np.diff(points, axis=0), axis=1)

    def times(log_shares: Array) -> Array:
        shares = np.exp(log_shares - log_shares.max())
        return np.concatenate([[0.0], np.cumsum(shares / shares.sum())])

    def cost(log_shares: Array) -> float:
        t = times(log_shares)
        return float(np.log(snap_cost(minimum_snap(t, points), t)))

    found = scipy.optimize.minimize(cost, np.log(legs_m) / 2, method="L-BFGS-B")
    lasts_s: float = legs_m.sum() / speed_mps
    return times(found.x) * lasts_s


def _headings(position: "scipy.interpolate.BSpline", t_s: Array, points: Array) -> Array:
    """The direction of flight (N,) over ground at each point, turning the shorter way; where it has none, the last."""
    ways = position(t_s, 1)
    ways[0] = points[1] - points[0]
    ways[-1] = points[-1] - points[-2]
    level = np.hypot(ways[:, 0], ways[:, 1])
    has_heading = level > SLOW * max(level.max(), np.finfo(float).tiny)
    if not has_heading.any():
        return np.zeros(len(t_s))
    known = np.maximum.accumulate(np.where(has_heading, np.arange(len(t_s)), int(np.argmax(has_heading))))
    headings: Array = np.unwrap(np.arctan2(ways[known, 1], ways[known, 0]))
    return headings


def _check_lift(curve: QuadrotorCurve, t_s: Array) -> None:
    """Raise MotionError where the thrust does not point up."""
    look_s = np.concatenate([np.linspace(a, b, LOOKS_PER_LEG) for a, b in pairwise(t_s)])
    lift = 1 + curve.position(look_s, 2)[:, 2] / STANDARD_GRAVITY_MPS2
    if lift.min() < LEAST_LIFT:
        k = int(np.argmin(lift))
        raise MotionError(
            f"after {look_s[k] - t_s[0]:.2f} s the rotors would lift {lift[k]:.2g} of the weight; "
            f"allow more time, so that it is {LEAST_LIFT:g} or more"
        )
