"""A recorded trajectory as a motion: through its very poses for cameras, or smoothed where accelerations count.

AXES: what a recording's axes are, by name. interpolated, smoothed: the motions.
"""

from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.spline import FEWEST, PoseCurve, by_quaternion, through
from vobench.trajectory.kinematics import CurveMotion, evenly
from vobench.trajectory.trajectory import Move, Trajectory, parse_move

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
FEWEST_SMOOTHED = 2 * (DEGREE + 1)

# What takes a recording's poses to a body with x ahead, y left and z up, in a world with z up. camera: an optical one
# in such a world, as TUM RGB-D; kitti: an optical one in the axes of the first, taken for level. In both the body's
# origin is the camera's. EuRoC's body is its IMU: x up, y right, z ahead. TartanAir is x ahead, y right, z down.
AXES: dict[str, Move | None] = {
    "body": None,
    "camera": parse_move("mount:0,0,0,0.5,-0.5,0.5,0.5"),
    "kitti": parse_move("axes:z,-x,-y"),
    "euroc": parse_move("mount:0,0,0,0.70710678118654752,0,0.70710678118654752,0"),
    "tartanair": parse_move("axes:x,-y,-z"),
}


def interpolated(
    trajectory: Trajectory,
    *,
    start: tuple[float, float, float, float] | None = None,
    speed: float = 1.0,
    max_gap_s: float = 1.0,
) -> CurveMotion:
    """Through every pose, for cameras only: the noise of a recording becomes metres per second squared.

    start: the body's x, y, z in m and heading in rad at first, else as recorded; the vertical stays.
    speed: how many times as fast as recorded. Raises MotionError for what makes no motion.
    """
    t_s, T = _recorded(trajectory, fewest=FEWEST, max_gap_s=max_gap_s)
    return _replayed(through(t_s, T), t_s[-1], start=start, speed=speed)


def smoothed(
    trajectory: Trajectory,
    *,
    knot_hz: float = 10.0,
    start: tuple[float, float, float, float] | None = None,
    speed: float = 1.0,
    max_gap_s: float = 1.0,
) -> CurveMotion:
    """The quintic B-spline of least squares, of positions and of quaternions, with knots at knot_hz or fewer.

    Knots are left out until two poses lie between each two, so that a gap is one stretch of the spline.
    `start`, `speed` and errors are as `interpolated` has them.
    """
    if not (np.isfinite(knot_hz) and knot_hz > 0):
        raise MotionError(f"knot_hz is {knot_hz:g}; it should be a finite number above 0")
    t_s, T = _recorded(trajectory, fewest=FEWEST_SMOOTHED, max_gap_s=max_gap_s)
    columns = np.column_stack([T[:, :3, 3], _unbroken(se3.to_quaternion(T[:, :3, :3]))])
    spline = _least_squares(t_s, columns, knot_hz=knot_hz)
    position, quaternion = (
        scipy.interpolate.BSpline(spline.t, spline.c[:, part], DEGREE) for part in (slice(3), slice(3, 7))
    )
    curve = PoseCurve(position, by_quaternion(quaternion), breaks=np.zeros(0))
    return _replayed(curve, t_s[-1], start=start, speed=speed)


def _recorded(trajectory: Trajectory, *, fewest: int, max_gap_s: float) -> tuple[Array, Array]:
    """Times (N,) in s from 0, and poses (N, 4, 4). Raises MotionError where they are too few or too far apart."""
    if len(trajectory) < fewest:
        raise MotionError(f"a replay needs {fewest} poses or more, but the recording has {len(trajectory)}")
    t_s, T = (trajectory.t_ns - trajectory.t_ns[0]) / 1e9, trajectory.T_world_frame
    lasts_s = np.diff(t_s)
    worst = int(np.argmax(lasts_s))
    if not lasts_s[worst] <= max_gap_s:
        raise MotionError(
            f"the recording has no pose from {t_s[worst]:.3f} s to {t_s[worst + 1]:.3f} s after its start; "
            f"a gap may last max_gap_s {max_gap_s:g}: replay one side of it, or allow more"
        )
    return t_s, se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])


def _replayed(
    curve: PoseCurve, lasts_s: float, *, start: tuple[float, float, float, float] | None, speed: float
) -> CurveMotion:
    if not (np.isfinite(speed) and speed > 0):
        raise MotionError(f"speed is {speed:g}; it should be a finite factor above 0")
    law = evenly(0.0, lasts_s / speed, rate=speed)
    return CurveMotion(curve, law, _placed(curve.at(np.zeros(1)).T_world_body[0], start))


def _placed(T_first: Array, start: tuple[float, float, float, float] | None) -> Array:
    """T_world_start (4, 4) that brings the first pose to the start, turning about the vertical alone."""
    if start is None:
        return np.eye(4)
    if np.shape(start) != (4,) or not np.isfinite(start).all():
        raise MotionError(f"start is {tuple(start)}; it should be four finite numbers: x, y, z in m, heading in rad")
    R = se3.rotation_z(start[3] - np.arctan2(T_first[1, 0], T_first[0, 0]))
    return se3.transform(R, np.array(start[:3]) - R @ T_first[:3, 3])


def _unbroken(q_xyzw: Array) -> Array:
    """Quaternions (N, 4), each with the sign that is nearer to the one before."""
    flips = np.where(np.sum(q_xyzw[1:] * q_xyzw[:-1], axis=1) < 0, -1.0, 1.0)
    signs = np.concatenate([[1.0], np.cumprod(flips)])
    unbroken: Array = q_xyzw * signs[:, None]
    return unbroken


def _least_squares(t_s: Array, columns: Array, *, knot_hz: float) -> "BSpline":
    """The spline (7 columns) nearest to rows (N, 7)."""
    wanted_s = np.arange(1, int(t_s[-1] * knot_hz) + 1) / knot_hz
    before = np.searchsorted(t_s, wanted_s)  # poses before each knot wanted
    kept, last = [], 0
    for knot_s, count in zip(wanted_s.tolist(), before.tolist(), strict=True):
        if count - last >= 2 and len(t_s) - count >= 2:
            kept.append(knot_s)
            last = count
    knots = np.concatenate([np.full(DEGREE + 1, t_s[0]), kept, np.full(DEGREE + 1, t_s[-1])])
    return scipy.interpolate.make_lsq_spline(t_s, columns, knots, k=DEGREE)
