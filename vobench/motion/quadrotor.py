"""A quadrotor that flies through points with the least snap, tilted as its thrust requires.

Source: Mellinger and Kumar (2011), minimum snap and differential flatness.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import radians
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Le, MaxLen, MinLen

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.rig import Mount
from vobench.geometry.se3 import Array
from vobench.motion.rail import check_apart
from vobench.motion.spline import Jet, from_zero, of_axes
from vobench.motion.wheeled import Rate, Speed
from vobench.setting import MOST_POINTS, Triple, settings
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2, CurveMotion, Kinematics, evenly
from vobench.trajectory.trajectory import step_lengths_m

HOVER_THRUST_MPS2 = np.array([0.0, 0.0, STANDARD_GRAVITY_MPS2])  # per mass: it balances the weight
LEAST_LIFT = 0.1  # of the weight: below it the rotors nearly stop, and the direction of thrust is undefined
CHECKS_PER_LEG = 64
LEAST_SPEED_SHARE = 1e-3  # of the largest ground speed: below it there is no heading
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # exact for the square of a cubic


@dataclass(frozen=True, slots=True)
class QuadrotorCurve:
    """A Curve by time in s: position (3 columns) of degree 7, yaw of degree 5."""

    position: "scipy.interpolate.BSpline"
    yaw_rad: "scipy.interpolate.BSpline"
    breaks: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at s (K,) in s: z along the thrust, x as near to the yaw's direction as possible."""
        velocity = self.position(s, 1)
        acceleration = self.position(s, 2)
        jerk = self.position(s, 3)
        snap = self.position(s, 4)
        thrust = Jet(acceleration + HOVER_THRUST_MPS2, jerk, snap)
        z = thrust.direction()
        y = z.cross(self._ahead(s)).direction()
        x = y.cross(z)
        attitude = of_axes(x, y, z)
        return Kinematics(
            T_world_body=se3.transform(attitude.R, self.position(s)),
            velocity_mps=attitude.in_body(velocity),
            angular_velocity_radps=attitude.turn,
            acceleration_mps2=attitude.in_body(acceleration),
            angular_acceleration_radps2=attitude.turn_rate,
        )

    def _ahead(self, s: Array) -> Jet:
        """The horizontal direction of the yaw."""
        yaw = self.yaw_rad(s)[:, None]
        rate = self.yaw_rad(s, 1)[:, None]
        change = self.yaw_rad(s, 2)[:, None]
        cosine = np.cos(yaw)
        sine = np.sin(yaw)
        zero = np.zeros_like(yaw)
        ahead = np.concatenate([cosine, sine, zero], -1)
        left = np.concatenate([-sine, cosine, zero], -1)
        ahead_change = left * change - ahead * rate**2
        return Jet(ahead, left * rate, ahead_change)


@settings()
class Quadrotor:
    """A flight through points with the least snap, from hover to hover, tilted as the thrust requires.

    Without `t_s` the legs have the durations of least snap at the mean speed; without `yaw_deg` it faces the
    direction of flight.
    """

    kind: Literal["quadrotor"] = "quadrotor"
    points_m: Annotated[tuple[Triple, ...], MinLen(2), MaxLen(MOST_POINTS)]
    t_s: tuple[float, ...] | None = None
    speed_mps: Speed = 0.5
    yaw_deg: Annotated[float, Ge(-360), Le(360)] | None = None
    rate_hz: Rate = 30.0
    mount: Mount | None = None

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError for invalid points or times, and for rotors that would have to pull."""
        points_m = np.array(self.points_m)
        check_apart(points_m, of="flight")
        t_s = self._times(points_m)
        if len(t_s) != len(points_m):
            raise MotionError(f"there are {len(t_s)} times for {len(points_m)} points; each point needs one")
        position = minimum_snap(t_s, points_m)
        yaw = _headings(position, t_s, points_m)
        if self.yaw_deg is not None:
            yaw = np.full(len(t_s), radians(self.yaw_deg))
        rest = [(1, 0.0), (2, 0.0)]  # derivatives at both ends
        yaw_rad = scipy.interpolate.make_interp_spline(t_s, yaw, k=5, bc_type=(rest, rest))
        curve = QuadrotorCurve(position, yaw_rad, t_s[1:-1])
        _check_lift(curve, t_s)
        curve_time = evenly(t_s[0], t_s[-1], begin=t_s[0])  # the curve's parameter is the time itself
        return CurveMotion(curve, curve_time)

    def _times(self, points_m: Array) -> Array:
        """Times (N,) in s since the first point."""
        if self.t_s is None:
            return _least_snap_times(points_m, self.speed_mps)
        return from_zero(self.t_s, of="point")


def minimum_snap(t_s: Array, points_m: Array) -> "scipy.interpolate.BSpline":
    """Of all paths through points (N, 3) at t_s (N,), from hover to hover, the one of the least integral of snap².

    That is the interpolating spline of degree 7 with velocity, acceleration and jerk 0 at both ends.
    Source: the optimality of odd-degree splines, de Boor (1963).
    """
    hover = [(order, np.zeros(3)) for order in (1, 2, 3)]
    return scipy.interpolate.make_interp_spline(t_s, points_m, k=7, bc_type=(hover, hover))


def snap_cost(position: "scipy.interpolate.BSpline", t_s: Array) -> float:
    """∫ |snap|² dt between the times t_s (N,) that are its knots."""
    half_s = np.diff(t_s) / 2
    middle_s = t_s[:-1] + half_s
    nodes_s = middle_s[:, None] + half_s[:, None] * NODES
    snap = position(nodes_s.ravel(), 4)
    squared = np.sum(snap**2, axis=-1).reshape(nodes_s.shape)
    return float(squared @ WEIGHTS @ half_s)


def _least_snap_times(points_m: Array, speed_mps: float) -> Array:
    """Times (N,) of the points that give the least snap, for a flight at a mean speed."""
    legs_m = step_lengths_m(points_m)

    def times(log_shares: Array) -> Array:
        """Times from 0 to 1."""
        weights = np.exp(log_shares - log_shares.max())
        shares = weights / weights.sum()
        return np.concatenate([[0.0], np.cumsum(shares)])

    def log_cost(log_shares: Array) -> float:
        t = times(log_shares)
        cost = snap_cost(minimum_snap(t, points_m), t)
        return float(np.log(cost))

    start = np.log(legs_m) / 2
    optimum = scipy.optimize.minimize(log_cost, start, method="L-BFGS-B")
    duration_s: float = legs_m.sum() / speed_mps
    return times(optimum.x) * duration_s


def _headings(position: "scipy.interpolate.BSpline", t_s: Array, points_m: Array) -> Array:
    """The direction of flight (N,) over ground at each point, unwrapped; while it is undefined, the last one."""
    velocities = position(t_s, 1)
    velocities[0] = points_m[1] - points_m[0]
    velocities[-1] = points_m[-1] - points_m[-2]
    ground_speed = np.hypot(velocities[:, 0], velocities[:, 1])
    fastest = max(ground_speed.max(), np.finfo(float).tiny)
    has_heading = ground_speed > LEAST_SPEED_SHARE * fastest
    if not has_heading.any():
        return np.zeros(len(t_s))

    # The last point with a heading up to each point, or else the first one.
    first_known = int(np.argmax(has_heading))
    known = np.where(has_heading, np.arange(len(t_s)), first_known)
    known = np.maximum.accumulate(known)
    angles_rad = np.arctan2(velocities[known, 1], velocities[known, 0])
    headings: Array = np.unwrap(angles_rad)
    return headings


def _check_lift(curve: QuadrotorCurve, t_s: Array) -> None:
    """Raise MotionError if the thrust does not point up."""
    legs_s = [np.linspace(start_s, end_s, CHECKS_PER_LEG) for start_s, end_s in pairwise(t_s)]
    checked_s = np.concatenate(legs_s)
    vertical_mps2 = curve.position(checked_s, 2)[:, 2]
    lift = 1 + vertical_mps2 / STANDARD_GRAVITY_MPS2
    if lift.min() < LEAST_LIFT:
        k = int(np.argmin(lift))
        raise MotionError(
            f"after {checked_s[k] - t_s[0]:.2f} s the rotors would lift {lift[k]:.2g} of the weight; "
            f"allow more time, so that it is {LEAST_LIFT:g} or more"
        )
