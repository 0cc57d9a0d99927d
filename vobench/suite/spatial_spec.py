"""What YAML may say of ways through space, which nothing on wheels could go."""

from collections.abc import Sequence
from math import radians
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.robot.handheld import SHAKES, HandheldMotion, handheld
from vobench.robot.quadrotor import quadrotor
from vobench.robot.rail import rail
from vobench.suite.strict import Acceleration, NonNegative, Rate, Speed, Strict, Triple, one_of
from vobench.trajectory.curve import CurveMotion
from vobench.trajectory.spline import check_times, pose_spline


class PoseSpec(Strict):
    """Where the body is at a time, and how it is turned: yaw to the left, pitch down, roll to the right."""

    t_s: float
    position_m: Triple
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    @property
    def T_world_body(self) -> Array:
        """The pose (4, 4): rolled about x first, then pitched about y, then turned about z."""
        from scipy.spatial.transform import Rotation

        angles = (self.roll_deg, self.pitch_deg, self.yaw_deg)
        return se3.transform(Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), np.array(self.position_m))


Poses = Annotated[tuple[PoseSpec, ...], Field(min_length=3)]


class PoseSplineSpec(Strict):
    """A smooth way through poses at given times; with ease_s from rest to rest."""

    kind: Literal["pose_spline"] = "pose_spline"
    poses: Poses
    ease_s: NonNegative = 0.0
    rate_hz: Rate = 30.0

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError."""
        return pose_spline(*_columns(self.poses), ease_s=self.ease_s)


class HandheldSpec(Strict):
    """The same, carried by somebody whose hands shake."""

    kind: Literal["handheld"] = "handheld"
    poses: Poses
    shake: Annotated[str, one_of("shake", SHAKES)] = "walking"
    ease_s: NonNegative = 0.0
    rate_hz: Rate = 30.0

    def motion(self, rng: np.random.Generator) -> HandheldMotion:
        """The motion with its shake drawn from `rng`. Raises MotionError."""
        return handheld(*_columns(self.poses), rng=rng, shake=SHAKES[self.shake], ease_s=self.ease_s)


class RailSpec(Strict):
    """Along a rail through points from rest to rest, looking along it, level from side to side."""

    kind: Literal["rail"] = "rail"
    points_m: Annotated[tuple[Triple, ...], Field(min_length=2)]
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5
    rate_hz: Rate = 30.0

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError."""
        return rail(self.points_m, speed_mps=self.speed_mps, accel_mps2=self.accel_mps2)


class QuadrotorSpec(Strict):
    """Through points on the way of least snap, from hover to hover, tilted as thrust must be.

    Without `t_s` each leg has the time that snap asks for, and all of them the mean speed; without `yaw_deg`
    it looks the way it flies.
    """

    kind: Literal["quadrotor"] = "quadrotor"
    points_m: Annotated[tuple[Triple, ...], Field(min_length=2)]
    t_s: tuple[float, ...] | None = None
    speed_mps: Speed = 0.5
    yaw_deg: Annotated[float, Field(ge=-360, le=360)] | None = None
    rate_hz: Rate = 30.0

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError."""
        yaw_rad = None if self.yaw_deg is None else radians(self.yaw_deg)
        t_s = None if self.t_s is None else _from_zero(self.t_s, of="point")
        return quadrotor(self.points_m, t_s=t_s, speed_mps=self.speed_mps, yaw_rad=yaw_rad)


def _columns(poses: tuple[PoseSpec, ...]) -> tuple[Array, Array]:
    """Times (N,) from the first pose on, and poses (N, 4, 4). Raises MotionError where times do not rise."""
    return _from_zero([pose.t_s for pose in poses], of="pose"), np.stack([pose.T_world_body for pose in poses])


def _from_zero(t_s: Sequence[float], *, of: str) -> Array:
    """Times (N,) since the first; what is wrong with them is said in the times that were written."""
    written: Array = np.array(t_s)
    check_times(written, fewest=2, of=of)
    since: Array = written - written[0]
    return since
