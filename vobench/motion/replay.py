"""A recorded trajectory as a motion: through its very poses for cameras, or smoothed where accelerations count."""

from math import radians
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le

from vobench.errors import InputError, MotionError, SettingError, unknown
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.spline import FEWEST, Attitude, Jet, PoseCurve, of_quaternion, through
from vobench.motion.wheeled import Rate
from vobench.setting import Positive, Triple, settings
from vobench.trajectory.kinematics import CurveMotion, evenly
from vobench.trajectory.trajectory import Move, Trajectory, parse_move

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


@settings()
class Replay:
    """The poses of a TUM, EuRoC, KITTI or TartanAir file, told by content, and how the body goes through them.

    Smoothed by a least-squares spline with knots at `knot_hz`, or `exact`, which is for cameras alone. Files
    without stamps need `times`, a file of them, or `recorded_hz`. Without `start_m` it starts as recorded.
    """

    kind: Literal["replay"] = "replay"
    file: str
    times: str | None = None
    recorded_hz: Positive | None = None
    axes: str = "body"
    exact: bool = False
    knot_hz: Annotated[float, Gt(0), Le(1000)] = 10.0
    speed: Annotated[float, Ge(0.01), Le(100)] = 1.0
    max_gap_s: Positive = 1.0
    start_m: Triple | None = None
    start_heading_deg: float = 0.0
    rate_hz: Rate = 30.0

    def __post_init__(self) -> None:
        try:
            self.move()
        except InputError as error:
            raise SettingError(str(error), "axes") from None
        if self.start_m is None and self.start_heading_deg:
            raise SettingError("belongs to start_m; without it the body starts as recorded", "start_heading_deg")

    def move(self) -> Move | None:
        """What takes the file's poses to the body's."""
        if self.axes in AXES:
            return AXES[self.axes]
        if ":" not in self.axes:
            raise InputError(unknown("convention of axes", self.axes, list(AXES)))
        return parse_move(self.axes)

    def motion(self, recorded: Trajectory) -> CurveMotion:
        """The motion through, or near, recorded poses of the body. Raises MotionError for what makes no motion."""
        fewest = FEWEST if self.exact else FEWEST_SMOOTHED
        t_s, T = _recorded(recorded, fewest=fewest, max_gap_s=self.max_gap_s)
        curve = through(t_s, T) if self.exact else _smoothed(t_s, T, knot_hz=self.knot_hz)
        law = evenly(0.0, t_s[-1] / self.speed, rate=self.speed)
        return CurveMotion(curve, law, self._placed(curve.at(np.zeros(1)).T_world_body[0]))

    def _placed(self, T_first: Array) -> Array:
        """T_world_start (4, 4) that brings the first pose to the start, turning about the vertical alone."""
        if self.start_m is None:
            return np.eye(4)
        R = se3.rotation_z(radians(self.start_heading_deg) - np.arctan2(T_first[1, 0], T_first[0, 0]))
        return se3.transform(R, np.array(self.start_m) - R @ T_first[:3, 3])


def _smoothed(t_s: Array, T: Array, *, knot_hz: float) -> PoseCurve:
    """The quintic B-spline of least squares, of positions and of quaternions, with knots at knot_hz or fewer.

    Knots are left out until two poses lie between each two, so that a gap is one stretch of the spline.
    """
    q_xyzw = se3.to_quaternion(T[:, :3, :3])
    flips = np.where(np.sum(q_xyzw[1:] * q_xyzw[:-1], axis=1) < 0, -1.0, 1.0)
    signs = np.concatenate([[1.0], np.cumprod(flips)])  # each that is nearer to the one before
    columns = np.column_stack([T[:, :3, 3], q_xyzw * signs[:, None]])
    spline = _least_squares(t_s, columns, knot_hz=knot_hz)
    position, quaternion = (
        scipy.interpolate.BSpline(spline.t, spline.c[:, part], DEGREE) for part in (slice(3), slice(3, 7))
    )

    def attitude(s: Array) -> Attitude:
        return of_quaternion(Jet(*(quaternion(s, order) for order in range(3))))

    return PoseCurve(position, attitude, breaks=np.zeros(0))


def _recorded(trajectory: Trajectory, *, fewest: int, max_gap_s: float) -> tuple[Array, Array]:
    """Times (N,) in s from 0, and poses (N, 4, 4). Raises MotionError where they are too few or too far apart."""
    if len(trajectory) < fewest:
        raise MotionError(f"a replay needs {fewest} poses or more, but the recording has {len(trajectory)}")
    t_s = (trajectory.t_ns - trajectory.t_ns[0]) / 1e9
    T = trajectory.T_world_frame
    lasts_s = np.diff(t_s)
    worst = int(np.argmax(lasts_s))
    if not lasts_s[worst] <= max_gap_s:
        raise MotionError(
            f"the recording has no pose from {t_s[worst]:.3f} s to {t_s[worst + 1]:.3f} s after its start; "
            f"a gap may last max_gap_s {max_gap_s:g}: replay one side of it, or allow more"
        )
    return t_s, se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])


def _least_squares(t_s: Array, columns: Array, *, knot_hz: float) -> "scipy.interpolate.BSpline":
    """The spline (7 columns) nearest to rows (N, 7)."""
    wanted_s = np.arange(1, int(t_s[-1] * knot_hz) + 1) / knot_hz
    before = np.searchsorted(t_s, wanted_s)  # poses before each knot wanted
    kept = []
    last = 0
    for knot_s, count in zip(wanted_s.tolist(), before.tolist(), strict=True):
        if count - last >= 2 and len(t_s) - count >= 2:
            kept.append(knot_s)
            last = count
    knots = np.concatenate([np.full(DEGREE + 1, t_s[0]), kept, np.full(DEGREE + 1, t_s[-1])])
    return scipy.interpolate.make_lsq_spline(t_s, columns, knots, k=DEGREE)
