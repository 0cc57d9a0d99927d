"""Planar courses that are laid over uneven ground: with the ground, as on wheels, or level, as a person walks."""

from dataclasses import dataclass

import numpy as np
import scipy

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.course import Course
from vobench.motion.spline import Jet, of_axes, quintic
from vobench.trajectory.kinematics import Kinematics

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class GroundCurve:
    """A Curve over ground by the arc length in m of a planar course, of which it is the projection.

    height_m: a spline (one column) of the height above the frame of the course. With is_level, the body stays upright;
    else x is along the curve and y level. The height is four times smooth, so that breaks are those of the course.
    """

    course: Course
    height_m: "scipy.interpolate.BSpline"
    is_level: bool

    @property
    def breaks(self) -> Array:
        """The progress values (B,) at which the second derivative of the pose may jump."""
        return self.course.breaks

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at s (K,), and their derivatives by s."""
        planar = self.course.at(s)
        rise = np.stack([self.height_m(s, order)[:, 0] for order in range(4)])  # (4, K), with derivatives
        if self.is_level:
            return _lifted(planar, rise)

        ahead = planar.T_world_body[:, :3, 0]
        left = planar.T_world_body[:, :3, 1]
        bend = planar.angular_velocity_radps[:, 2:]
        bend_rate = planar.angular_acceleration_radps2[:, 2:]
        first = ahead + rise[1][:, None] * UP
        second = bend * left + rise[2][:, None] * UP
        third = bend_rate * left - bend**2 * ahead + rise[3][:, None] * UP

        zero = np.zeros_like(first)
        up = Jet(np.broadcast_to(UP, first.shape), zero, zero)
        x = Jet(first, second, third).direction()
        y = up.cross(x).direction()
        z = x.cross(y)
        attitude = of_axes(x, y, z)
        position_m = planar.T_world_body[:, :3, 3] + rise[0][:, None] * UP
        return Kinematics(
            T_world_body=se3.transform(attitude.R, position_m),
            velocity_mps=attitude.in_body(first),
            angular_velocity_radps=attitude.turn,
            acceleration_mps2=attitude.in_body(second),
            angular_acceleration_radps2=attitude.turn_rate,
        )


def _lifted(planar: Kinematics, rise: Array) -> Kinematics:
    """The kinematics of a level body whose height, with its derivatives (4, K), is added."""
    T_world_body = planar.T_world_body.copy()
    T_world_body[:, 2, 3] += rise[0]
    return Kinematics(
        T_world_body=T_world_body,
        velocity_mps=planar.velocity_mps + rise[1][:, None] * UP,
        angular_velocity_radps=planar.angular_velocity_radps,
        acceleration_mps2=planar.acceleration_mps2 + rise[2][:, None] * UP,
        angular_acceleration_radps2=planar.angular_acceleration_radps2,
    )


def over_ground(course: Course, stops_m: Array, heights_m: Array, *, is_level: bool) -> GroundCurve:
    """A course over ground with heights (N,) at N >= 3 of its arc lengths (N,), which are smoothed.

    Each height counts half, and the two beside it a quarter each.
    """
    padded_m = np.pad(heights_m, 1, mode="edge")
    smoothed_m = (padded_m[:-2] + 2 * padded_m[1:-1] + padded_m[2:]) / 4
    return GroundCurve(course, quintic(stops_m, smoothed_m[:, None]), is_level)
