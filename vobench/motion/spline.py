"""Pose splines: positions and rotations through or near given poses, twice smooth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
import scipy
from annotated_types import MinLen
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.wheeled import Rate
from vobench.setting import NonNegative, Triple, settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, TimeLaw, evenly, rest_to_rest


class Jet(NamedTuple):
    """Vectors (K, n) with their first and second derivatives (K, n)."""

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
    """Vectors (K, 3), each by its own rotation of (K, 3, 3)."""
    return (R @ vectors[..., None])[..., 0]


def unit(v: Jet) -> Jet:
    """The direction of v, which may nowhere be zero."""
    length = np.linalg.norm(v.value, axis=-1, keepdims=True)
    n = v.value / length
    length_rate = _dot(n, v.rate)
    rate = (v.rate - n * length_rate) / length
    length_change = _dot(rate, v.rate) + _dot(n, v.change)
    return Jet(n, rate, (v.change - 2 * rate * length_rate - n * length_change) / length)


def cross(a: Jet, b: Jet) -> Jet:
    """The product a × b."""
    rate = np.cross(a.rate, b.value) + np.cross(a.value, b.rate)
    change = np.cross(a.change, b.value) + 2 * np.cross(a.rate, b.rate) + np.cross(a.value, b.change)
    return Jet(np.cross(a.value, b.value), rate, change)


def of_axes(x: Jet, y: Jet, z: Jet) -> Attitude:
    """The attitude whose body axes are these unit vectors of the world, each square to the others."""
    turn = np.concatenate([_dot(z.value, y.rate), _dot(x.value, z.rate), _dot(y.value, x.rate)], -1)
    # y'' = R ([turn']x + [turn]x²) e_y, whose z part is turn_rate_x + turn_y turn_z; the others in turn.
    swept = np.concatenate([_dot(z.value, y.change), _dot(x.value, z.change), _dot(y.value, x.change)], -1)
    turn_rate = swept - np.roll(turn, -1, -1) * np.roll(turn, -2, -1)
    return Attitude(np.stack([x.value, y.value, z.value], -1), turn, turn_rate)


def of_quaternion(q_xyzw: Jet) -> Attitude:
    """The attitude of quaternions (K, 4) of any length above 0: turn = 2 vec(q* q'), turn_rate = 2 vec(q* q'')."""
    q = unit(q_xyzw)
    return Attitude(se3.from_quaternion(q.value), _seen(q.value, q.rate), _seen(q.value, q.change))


def _seen(q: Array, p: Array) -> Array:
    """2 vec(q* p)."""
    seen: Array = 2 * (q[:, 3:] * p[:, :3] - p[:, 3:] * q[:, :3] - np.cross(q[:, :3], p[:, :3]))
    return seen


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.sum(a * b, axis=-1, keepdims=True)
    return product


FEWEST = 3
WIDEST_TURN_RAD = np.deg2rad(175.0)  # beyond it rounding or noise decides which way round


@dataclass(frozen=True, slots=True)
class PoseCurve:
    """A Curve by time in s: positions of a spline (3 columns), attitudes of a function of time (K,).

    breaks: where the spline of rotations changes its piece.
    """

    position: "scipy.interpolate.BSpline"
    attitude: Callable[[Array], Attitude]
    breaks: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at s (K,) in s, with their velocities and accelerations."""
        held = self.attitude(s)
        return Kinematics(
            T_world_body=se3.transform(held.R, self.position(s)),
            velocity_mps=held.in_body(self.position(s, 1)),
            turn_radps=held.turn,
            acceleration_mps2=held.in_body(self.position(s, 2)),
            turn_rate_radps2=held.turn_rate,
        )


@settings()
class Pose:
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


Poses = Annotated[tuple[Pose, ...], MinLen(FEWEST)]


@settings()
class PoseSpline:
    """A smooth way through poses at given times; with ease_s from rest to rest."""

    kind: Literal["pose_spline"] = "pose_spline"
    poses: Poses
    ease_s: NonNegative = 0.0
    rate_hz: Rate = 30.0

    def motion(self) -> CurveMotion:
        """The motion. Raises MotionError."""
        return pose_spline(*columns(self.poses), ease_s=self.ease_s)


def columns(poses: Sequence[Pose]) -> tuple[Array, Array]:
    """Times (N,) from the first pose on, and poses (N, 4, 4). Raises MotionError where times do not rise."""
    return from_zero([pose.t_s for pose in poses], of="pose"), np.stack([pose.T_world_body for pose in poses])


def from_zero(t_s: Sequence[float], *, of: str) -> Array:
    """Times (N,) since the first; what is wrong with them is said in the times that were written."""
    written: Array = np.array(t_s)
    check_times(written, fewest=2, of=of)
    since: Array = written - written[0]
    return since


def pose_spline(t_s: ArrayLike, T_world_body: ArrayLike, *, ease_s: float = 0.0) -> CurveMotion:
    """Through N >= 3 poses (N, 4, 4) at rising times (N,) in s.

    With ease_s it starts and ends at rest: it takes that long to come to the poses' own pace and to leave it,
    so that all but the first pose are passed ease_s / 2 later, the last one ease_s.
    Raises MotionError naming the poses that are too few, not finite, no rotations or not in order.
    """
    times_s = np.atleast_1d(np.asarray(t_s, float))
    T = np.asarray(T_world_body, float)
    _check_poses(times_s, T)
    curve = through(times_s, T)
    return CurveMotion(
        curve, evenly(times_s[0], times_s[-1], begin=times_s[0]) if not ease_s else _eased(times_s, ease_s)
    )


def through(t_s: Array, T: Array) -> PoseCurve:
    """The curve through poses (N, 4, 4): SciPy's rotation spline, and positions of the least jerk."""
    from scipy.spatial.transform import Rotation, RotationSpline

    rotation = RotationSpline(t_s, Rotation.from_matrix(se3.nearest_rotation(T[:, :3, :3])))

    def turned(s: Array) -> Attitude:
        return Attitude(rotation(s).as_matrix(), rotation(s, 1), rotation(s, 2))

    return PoseCurve(quintic(t_s, T[:, :3, 3]), turned, t_s[1:-1])


def quintic(t: Array, values: Array) -> "scipy.interpolate.BSpline":
    """The natural quintic through values (N, n) at t (N,), N >= 3: of all curves through them the one of least jerk."""
    natural = [(3, np.zeros(values.shape[1:])), (4, np.zeros(values.shape[1:]))]
    return scipy.interpolate.make_interp_spline(t, values, k=5, bc_type=(natural, natural))


def check_times(t_s: Array, *, fewest: int, of: str) -> None:
    """Raise MotionError where times (N,) are too few, not finite or not rising; `of` names what is at them."""
    if len(t_s) < fewest:
        raise MotionError(
            f"a spline needs {fewest} {of}s or more, but there {'is' if len(t_s) == 1 else 'are'} {len(t_s)}"
        )
    if not np.isfinite(t_s).all():
        bad = int(np.flatnonzero(~np.isfinite(t_s))[0])
        raise MotionError(f"the time of {of} {bad} is {t_s[bad]:g}; it should be finite")
    late = np.flatnonzero(np.diff(t_s) <= 0)
    if late.size:
        k = int(late[0])
        how = "the same time as" if t_s[k + 1] == t_s[k] else "earlier than"
        raise MotionError(
            f"{of} {k + 1} is at {t_s[k + 1]:.12g} s, {how} {of} {k} at {t_s[k]:.12g} s; times should rise"
        )


def _check_poses(t_s: Array, T: Array) -> None:
    if T.shape != (len(t_s), 4, 4):
        raise MotionError(f"{len(t_s)} times need as many poses of 4 by 4, but they have the shape {T.shape}")
    check_times(t_s, fewest=FEWEST, of="pose")
    for k, pose in enumerate(T):
        if not np.isfinite(pose).all():
            raise MotionError(f"pose {k} at {t_s[k]:.12g} s is not finite")
        if not se3.is_rotation(pose[:3, :3]):
            raise MotionError(f"the rotation of pose {k} at {t_s[k]:.12g} s is none; it should be orthonormal")
    R = T[:, :3, :3]
    turned = se3.rotation_angle(np.swapaxes(R[:-1], -1, -2) @ R[1:])
    wide = np.flatnonzero(turned > WIDEST_TURN_RAD)
    if wide.size:
        k = int(wide[0])
        raise MotionError(
            f"pose {k + 1} is turned by {np.rad2deg(turned[k]):.0f} deg against the one before, "
            "which could be either way round; set a pose between them"
        )


def _eased(t_s: Array, ease_s: float) -> TimeLaw:
    lasts_s = t_s[-1] - t_s[0]
    if not 0 < ease_s <= lasts_s:
        raise MotionError(f"ease_s is {ease_s:g}; it should be from 0 to the {lasts_s:g} s that the poses last")
    progress = rest_to_rest(lasts_s, speed=1.0, acceleration=15 / 8 / ease_s).progress
    c = progress.c.copy()
    c[-1] += t_s[0]
    return TimeLaw(scipy.interpolate.PPoly(c, progress.x + t_s[0]))
