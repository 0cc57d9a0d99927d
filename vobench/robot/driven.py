"""The motion of a drive: the axle's middle at any instant, from the states that the integrator left behind."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.vehicle import Vehicle
from vobench.trajectory.kinematics import Kinematics, level
from vobench.trajectory.trajectory import Stamps


@dataclass(frozen=True, slots=True)
class DriveMotion:
    """A Motion of the axle's middle: at rest before its start, and goes on with the last references after its end.

    It meets every recorded state; pose, velocity and acceleration are each other's derivatives to rounding.
    pieces (P, 3, 6): coefficients in the share 0..1 of each sub-step, of x and y in m and heading in rad:
    quintics that have at both its ends the velocities and accelerations of (18)-(19), sliding included.
    Euler's positions lag behind their own speeds: there acceleration swings within a step.
    """

    start_ns: int
    end_ns: int
    rate_hz: float
    substeps: int
    pieces: Array

    @property
    def breaks_ns(self) -> Array:
        """The control instants, those after the end included."""
        return np.arange(len(self.pieces) // self.substeps + 1, dtype=float) * (1e9 / self.rate_hz)

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """Where the axle's middle is and how it moves at instants (K,).

        Raises MotionError for an instant more than a second after the end, or not finite.
        """
        index, share = self._places(np.asarray(t_ns, float))
        per_s = self.rate_hz * self.substeps
        place, speed, rate = _derivatives(self.pieces[index], share[:, None])
        before = np.asarray(t_ns) < 0
        speed[before], rate[before] = 0.0, 0.0
        return _kinematics(place, speed * per_s, rate * per_s**2)

    def _places(self, t_ns: Array) -> tuple[NDArray[np.int64], Array]:
        """The piece that each instant (K,) is in, and its share of it."""
        step_ns = 1e9 / self.rate_hz / self.substeps
        known_ns = len(self.pieces) * step_ns + 1
        if not (t_ns <= known_ns).all():
            wrong = t_ns[~(t_ns <= known_ns)][0]
            raise MotionError(f"the drive ends at {self.end_ns} ns, and is asked where it is at {wrong:.0f} ns")
        index = np.clip(np.floor(t_ns / step_ns), 0, len(self.pieces) - 1)
        return index.astype(np.int64), np.maximum(t_ns / step_ns - index, 0.0)


def motion_of(
    fine: Array, asked: Array, disturbed: Array, *, frames: int, vehicle: Vehicle, skid_s: float
) -> DriveMotion:
    """The motion through states (P + 1, 7) of all sub-steps, with references (Q, 2) of their P / substeps periods.

    disturbed (Q + 1, 3) is beta in rad, delta_u and delta_omega at the periods' ends; `frames` of them were driven.
    """
    period, step = np.divmod(np.arange(len(fine) - 1), vehicle.substeps)
    began = fine[period * vehicle.substeps, 3:5]
    change = disturbed[period + 1] - disturbed[period]

    def seen(state: Array, share: Array) -> Array:
        disturbance = disturbed[period] + share[:, None] * change
        return _derived(state, asked[period], began, disturbance, change[:, 0], vehicle=vehicle, skid_s=skid_s)

    ends = seen(fine[:-1], step / vehicle.substeps), seen(fine[1:], (step + 1) / vehicle.substeps)
    end_ns = round((frames - 1) * 1e9 / vehicle.rate_hz)
    pieces = _quintics(*ends, step_s=1 / vehicle.rate_hz / vehicle.substeps)
    return DriveMotion(0, end_ns, vehicle.rate_hz, vehicle.substeps, pieces)


def _derived(
    state: Array, asked: Array, began: Array, disturbed: Array, beta_change: Array, *, vehicle: Vehicle, skid_s: float
) -> Array:
    """x, y, psi of the axle's middle, their first and their second derivatives in the world, (P, 3, 3)."""
    x_h, y_h, psi, u, omega = state.T[:5]
    u_rate, omega_rate = vehicle.speed_rates(
        u, omega, (asked[:, 0], asked[:, 1]), (began[:, 0], began[:, 1]), (disturbed[:, 1], disturbed[:, 2])
    )
    slope, a = np.tan(disturbed[:, 0]), vehicle.controller.a_m
    slope_rate = (1 + slope**2) * beta_change * vehicle.rate_hz
    side = u * slope - skid_s * u * omega
    side_rate = u_rate * slope + u * slope_rate - skid_s * (u_rate * omega + u * omega_rate)
    c, s = np.cos(psi), np.sin(psi)
    ahead, left = u_rate - side * omega, side_rate + u * omega
    place = np.stack([x_h - a * c, y_h - a * s, psi], -1)
    speed = np.stack([c * u - s * side, s * u + c * side, omega], -1)
    rate = np.stack([c * ahead - s * left, s * ahead + c * left, omega_rate], -1)
    return np.stack([place, speed, rate], 1)


def _quintics(begin: Array, end: Array, *, step_s: float) -> Array:
    """Coefficients (P, 3, 6) of the quintics with these values and two derivatives (P, 3, 3) at share 0 and 1."""
    scale = np.array([1.0, step_s, step_s**2])[:, None]
    p0, v0, a0 = np.moveaxis(begin * scale, 1, 0)
    p1, v1, a1 = np.moveaxis(end * scale, 1, 0)
    p, v, a = p1 - p0 - v0 - a0 / 2, v1 - v0 - a0, (a1 - a0) / 2
    return np.stack([p0, v0, a0 / 2, 10 * p - 4 * v + a, -15 * p + 7 * v - 2 * a, 6 * p - 3 * v + a], -1)


def _derivatives(c: Array, s: Array) -> tuple[Array, Array, Array]:
    """Value, first and second derivative (K, 3) by s (K, 1) of the quintics c (K, 3, 6)."""
    c0, c1, c2, c3, c4, c5 = np.moveaxis(c, -1, 0)
    value = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    first = c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * (5 * c5))))
    second = 2 * c2 + s * (6 * c3 + s * (12 * c4 + s * (20 * c5)))
    return value, first, second


def _kinematics(place: Array, speed: Array, rate: Array) -> Kinematics:
    """From x, y, psi and their derivatives (K, 3) in the world to body axes."""
    cos_psi, sin_psi, still = np.cos(place[:, 2]), np.sin(place[:, 2]), np.zeros(len(place))

    def in_body(world: Array) -> Array:
        x, y, _ = world.T
        return np.stack([cos_psi * x + sin_psi * y, cos_psi * y - sin_psi * x, still], -1)

    def upright(about_z: Array) -> Array:
        return np.stack([still, still, about_z], -1)

    return Kinematics(level(*place.T), in_body(speed), upright(speed[:, 2]), in_body(rate), upright(rate[:, 2]))
