"""Pose splines: positions and rotations through or near given poses, twice smooth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
import scipy
from annotated_types import Ge, Le, MaxLen, MinLen
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.rig import Mount
from vobench.geometry.se3 import Array
from vobench.motion.wheeled import Rate
from vobench.setting import MOST_POINTS, NonNegative, Triple, settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, TimeLaw, evenly, rest_to_rest


class Jet(NamedTuple):
    """Vectors (K, n) with their first and second derivatives (K, n)."""

    def direction(self) -> "Jet":
        """The unit vectors of these, which may nowhere be zero."""
        length = np.linalg.norm(self.value, axis=-1, keepdims=True)
        direction = self.value / length
        length_rate = _dot(direction, self.rate)
        rate = (self.rate - direction * length_rate) / length
        length_change = _dot(rate, self.rate) + _dot(direction, self.change)
        scaled_change = self.change - 2 * rate * length_rate - direction * length_change
        return Jet(direction, rate, scaled_change / length)

    def cross(self, other: "Jet") -> "Jet":
        """The cross product with other vectors (K, 3)."""
        rate = np.cross(self.rate, other.value) + np.cross(self.value, other.rate)
        outer_change = np.cross(self.change, other.value) + 2 * np.cross(self.rate, other.rate)
        change = outer_change + np.cross(self.value, other.change)
        return Jet(np.cross(self.value, other.value), rate, change)

    value: Array
    rate: Array
    change: Array


class Attitude(NamedTuple):
    """Rotations R (K, 3, 3), body to world, with R' = R [turn]x and turn_rate = turn', both (K, 3) in body axes."""

    R: Array
    turn: Array
    turn_rate: Array

    def in_body(self, vectors: Array) -> Array:
        """Vectors (K, 3) of the world in body axes."""
        return turned(np.swapaxes(self.R, -1, -2), vectors)


def turned(R: Array, vectors: Array) -> Array:
    """Vectors (K, 3), each rotated by its matrix of R (K, 3, 3)."""
    return (R @ vectors[..., None])[..., 0]


def of_axes(x: Jet, y: Jet, z: Jet) -> Attitude:
    """The attitude whose body axes are these orthogonal unit vectors of the world."""
    turn_x = _dot(z.value, y.rate)
    turn_y = _dot(x.value, z.rate)
    turn_z = _dot(y.value, x.rate)
    turn = np.concatenate([turn_x, turn_y, turn_z], -1)

    # y'' = R ([turn']x + [turn]x²) e_y, whose z part is turn_rate_x + turn_y turn_z; the others in turn.
    part_x = _dot(z.value, y.change)
    part_y = _dot(x.value, z.change)
    part_z = _dot(y.value, x.change)
    parts = np.concatenate([part_x, part_y, part_z], -1)
    turn_rate = parts - np.roll(turn, -1, -1) * np.roll(turn, -2, -1)
    R = np.stack([x.value, y.value, z.value], -1)
    return Attitude(R, turn, turn_rate)


def of_quaternion(q_xyzw: Jet) -> Attitude:
    """The attitude of quaternions (K, 4) of any length above 0: turn = 2 vec(q* q'), turn_rate = 2 vec(q* q'')."""
    q = q_xyzw.direction()
    R = se3.from_quaternion(q.value)
    turn = _twice_vector_part(q.value, q.rate)
    turn_rate = _twice_vector_part(q.value, q.change)
    return Attitude(R, turn, turn_rate)


def _twice_vector_part(q: Array, p: Array) -> Array:
    """2 vec(q* p) of quaternions (K, 4)."""
    q_vector = q[:, :3]
    p_vector = p[:, :3]
    q_scalar = q[:, 3:]
    p_scalar = p[:, 3:]
    vector = q_scalar * p_vector - p_scalar * q_vector - np.cross(q_vector, p_vector)
    return np.asarray(2 * vector)


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.sum(a * b, axis=-1, keepdims=True)
    return product


FEWEST = 3
WIDEST_TURN_RAD = np.deg2rad(175.0)  # beyond it rounding or noise decides the direction


@dataclass(frozen=True, slots=True)
class PoseCurve:
    """A Curve by time in s: positions of a spline (3 columns), attitudes of a function of time (K,).

    breaks: the times at which the spline of rotations changes its piece.
    """

    position: "scipy.interpolate.BSpline"
    attitude: Callable[[Array], Attitude]
    breaks: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at s (K,) in s, with their velocities and accelerations."""
        attitude = self.attitude(s)
        return Kinematics(
            T_world_body=se3.transform(attitude.R, self.position(s)),
            velocity_mps=attitude.in_body(self.position(s, 1)),
            angular_velocity_radps=attitude.turn,
            acceleration_mps2=attitude.in_body(self.position(s, 2)),
            angular_acceleration_radps2=attitude.turn_rate,
        )


@settings()
class Pose:
    """Time, position and attitude of the body: yaw to the left, pitch down, roll to the right."""

    t_s: float
    position_m: Triple
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    @property
    def T_world_body(self) -> Array:
        """The pose (4, 4): rolled about x first, then pitched about y, then turned about z."""
        from scipy.spatial.transform import Rotation

        angles_deg = (self.roll_deg, self.pitch_deg, self.yaw_deg)
        R = Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix()
        return se3.transform(R, np.array(self.position_m))


Poses = Annotated[tuple[Pose, ...], MinLen(FEWEST), MaxLen(MOST_POINTS)]


@settings()
class PoseSpline:
    """A smooth path through poses at given times; with ease_s from rest to rest.

    With `start_seed`, all poses are moved and turned about the vertical together, so that a robot on the path keeps
    clear of everything in its place (module `free_start`).
    """

    kind: Literal["pose_spline"] = "pose_spline"
    poses: Poses
    ease_s: NonNegative = 0.0
    rate_hz: Rate = 30.0
    start_seed: Annotated[int, Ge(0), Le(2**31 - 1)] | None = None
    mount: Mount | None = None

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError."""
        t_s, T_world_body = columns(self.poses)
        return pose_spline(t_s, T_world_body, ease_s=self.ease_s)


def columns(poses: Sequence[Pose]) -> tuple[Array, Array]:
    """Times (N,) since the first pose, and poses (N, 4, 4). Raises MotionError for times that do not increase."""
    t_s = from_zero([pose.t_s for pose in poses], of="pose")
    T_world_body = np.stack([pose.T_world_body for pose in poses])
    return t_s, T_world_body


def from_zero(t_s: Sequence[float], *, of: str) -> Array:
    """Times (N,) since the first. Raises MotionError as `check_times`, whose message has the times as given."""
    times_s: Array = np.array(t_s)
    check_times(times_s, fewest=2, of=of)
    since_first_s: Array = times_s - times_s[0]
    return since_first_s


def pose_spline(t_s: ArrayLike, T_world_body: ArrayLike, *, ease_s: float = 0.0) -> CurveMotion:
    """The motion through N >= 3 poses (N, 4, 4) at increasing times (N,) in s.

    With ease_s it starts and ends at rest: it takes that long to accelerate to the pace of the poses and to stop,
    so that all but the first pose are passed ease_s / 2 later, the last one ease_s.
    Raises MotionError for poses that are too few, not finite, no rotations or not in order.
    """
    times_s = np.atleast_1d(np.asarray(t_s, float))
    T = np.asarray(T_world_body, float)
    _check_poses(times_s, T)
    law = evenly(times_s[0], times_s[-1], begin=times_s[0])
    if ease_s:
        law = _eased(times_s, ease_s)
    return CurveMotion(through(times_s, T), law)


def through(t_s: Array, T: Array) -> PoseCurve:
    """The curve through poses (N, 4, 4): SciPy's rotation spline, and positions of the least jerk."""
    from scipy.spatial.transform import Rotation, RotationSpline

    R = se3.nearest_rotation(T[:, :3, :3])
    spline = RotationSpline(t_s, Rotation.from_matrix(R))

    def attitude(s: Array) -> Attitude:
        return Attitude(spline(s).as_matrix(), spline(s, 1), spline(s, 2))

    position = quintic(t_s, T[:, :3, 3])
    return PoseCurve(position, attitude, breaks=t_s[1:-1])


def quintic(t: Array, values: Array) -> "scipy.interpolate.BSpline":
    """The natural quintic through values (N, n) at t (N,), N >= 3: of all curves through them the one of least jerk."""
    zero = np.zeros(values.shape[1:])
    natural = [(3, zero), (4, zero)]  # derivatives at both ends
    return scipy.interpolate.make_interp_spline(t, values, k=5, bc_type=(natural, natural))


def check_times(t_s: Array, *, fewest: int, of: str) -> None:
    """Raise MotionError for times (N,) that are too few, not finite or not increasing; `of` is what they belong to."""
    if len(t_s) < fewest:
        count = "is 1" if len(t_s) == 1 else f"are {len(t_s)}"
        raise MotionError(f"a spline needs {fewest} {of}s or more, but there {count}")
    bad = np.flatnonzero(~np.isfinite(t_s))
    if bad.size:
        k = int(bad[0])
        raise MotionError(f"the time of {of} {k} is {t_s[k]:g}; it should be finite")
    late = np.flatnonzero(np.diff(t_s) <= 0)
    if late.size:
        k = int(late[0])
        relation = "the same time as" if t_s[k + 1] == t_s[k] else "earlier than"
        raise MotionError(
            f"{of} {k + 1} is at {t_s[k + 1]:.12g} s, {relation} {of} {k} at {t_s[k]:.12g} s; times should increase"
        )


def _check_poses(t_s: Array, T: Array) -> None:
    """Raise MotionError for poses that a spline cannot go through."""
    if T.shape != (len(t_s), 4, 4):
        raise MotionError(f"{len(t_s)} times need as many poses of 4 by 4, but they have the shape {T.shape}")
    check_times(t_s, fewest=FEWEST, of="pose")
    for k, pose in enumerate(T):
        if not np.isfinite(pose).all():
            raise MotionError(f"pose {k} at {t_s[k]:.12g} s is not finite")
        if not se3.is_rotation(pose[:3, :3]):
            raise MotionError(f"the rotation of pose {k} at {t_s[k]:.12g} s is invalid; it should be orthonormal")
    R = T[:, :3, :3]
    turns_rad = se3.rotation_angle(se3.transposed(R[:-1]) @ R[1:])
    wide = np.flatnonzero(turns_rad > WIDEST_TURN_RAD)
    if wide.size:
        k = int(wide[0])
        raise MotionError(
            f"pose {k + 1} is turned by {np.rad2deg(turns_rad[k]):.0f} deg from the one before, "
            "which could be in either direction; add a pose between them"
        )


def _eased(t_s: Array, ease_s: float) -> TimeLaw:
    """The law from the first to the last of times (N,), from rest to rest. Raises MotionError for `ease_s`."""
    duration_s = t_s[-1] - t_s[0]
    if not 0 < ease_s <= duration_s:
        raise MotionError(f"ease_s is {ease_s:g}; it should be from 0 to the {duration_s:g} s that the poses last")
    acceleration = 15 / 8 / ease_s
    progress = rest_to_rest(duration_s, speed=1.0, acceleration=acceleration).progress
    coefficients = progress.c.copy()
    coefficients[-1] += t_s[0]
    return TimeLaw(scipy.interpolate.PPoly(coefficients, progress.x + t_s[0]))
