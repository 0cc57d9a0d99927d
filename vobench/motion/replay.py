"""A recorded trajectory as a motion: exactly through its poses for cameras, or smoothed for accelerations."""

from math import radians
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le

from vobench.errors import InputError, MotionError, SettingError, unknown_name_sentence
from vobench.geometry import se3
from vobench.geometry.rig import Mount
from vobench.geometry.se3 import Array
from vobench.motion.spline import FEWEST, Attitude, Jet, PoseCurve, of_quaternion, through
from vobench.motion.wheeled import Rate
from vobench.setting import Positive, Triple, settings
from vobench.trajectory.kinematics import CurveMotion, evenly
from vobench.trajectory.trajectory import PoseConvention, Trajectory, parse_pose_convention

DEGREE = 5
FEWEST_SMOOTHED = 2 * (DEGREE + 1)
MIN_POSES_PER_PIECE = 2

# The move from a recording's poses to a body with x ahead, y left and z up, in a world with z up. camera: an optical
# frame in such a world, as TUM RGB-D; kitti: an optical frame in the first one, assumed level. In both the body's
# origin is the camera's. EuRoC's body is its IMU: x up, y right, z ahead. TartanAir is x ahead, y right, z down.
AXES: dict[str, PoseConvention | None] = {
    "body": None,
    "camera": parse_pose_convention("mount:0,0,0,0.5,-0.5,0.5,0.5"),
    "kitti": parse_pose_convention("axes:z,-x,-y"),
    "euroc": parse_pose_convention("mount:0,0,0,0.70710678118654752,0,0.70710678118654752,0"),
    "tartanair": parse_pose_convention("axes:x,-y,-z"),
}


@settings()
class Replay:
    """The motion through the poses of a TUM, EuRoC, KITTI or TartanAir file, whose format follows from its content.

    It is smoothed by a least-squares spline with knots at `knot_hz`, or `exact`, which is for cameras alone. Files
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
    mount: Mount | None = None

    def __post_init__(self) -> None:
        try:
            self.move()
        except InputError as error:
            raise SettingError(str(error), "axes") from None
        if self.start_m is None and self.start_heading_deg:
            raise SettingError("belongs to start_m; without it the body starts as recorded", "start_heading_deg")

    def move(self) -> PoseConvention | None:
        """The move from the file's poses to the body's."""
        if self.axes in AXES:
            return AXES[self.axes]
        if ":" not in self.axes:
            raise InputError(unknown_name_sentence("convention of axes", self.axes, list(AXES)))
        return parse_pose_convention(self.axes)

    def motion(self, recorded: Trajectory) -> CurveMotion:
        """The motion through, or near, recorded poses of the body. Raises MotionError for unsuitable poses."""
        fewest = FEWEST if self.exact else FEWEST_SMOOTHED
        t_s, T = _recorded(recorded, fewest=fewest, max_gap_s=self.max_gap_s)
        curve = through(t_s, T) if self.exact else _smoothed(t_s, T, knot_hz=self.knot_hz)
        duration_s = t_s[-1] / self.speed
        law = evenly(0.0, duration_s, rate=self.speed)
        T_first = curve.at(np.zeros(1)).T_world_body[0]
        return CurveMotion(curve, law, self._placed(T_first))

    def _placed(self, T_first: Array) -> Array:
        """T_world_start (4, 4) that moves the first pose to the start, turning about the vertical alone."""
        if self.start_m is None:
            return np.eye(4)
        first_heading_rad = np.arctan2(T_first[1, 0], T_first[0, 0])
        R = se3.rotation_z(radians(self.start_heading_deg) - first_heading_rad)
        translation_m = np.array(self.start_m) - R @ T_first[:3, 3]
        return se3.transform(R, translation_m)


def _smoothed(t_s: Array, T: Array, *, knot_hz: float) -> PoseCurve:
    """The quintic B-spline of least squares, of positions and of quaternions, with knots at knot_hz or fewer.

    Knots are left out until two poses lie between successive knots, so that a gap is one piece of the spline.
    """
    # Each quaternion takes the sign that is nearer to the one before.
    q_xyzw = se3.to_quaternion(T[:, :3, :3])
    products = np.sum(q_xyzw[1:] * q_xyzw[:-1], axis=1)
    flips = np.where(products < 0, -1.0, 1.0)
    signs = np.concatenate([[1.0], np.cumprod(flips)])
    rows = np.column_stack([T[:, :3, 3], q_xyzw * signs[:, None]])
    spline = _least_squares(t_s, rows, knot_hz=knot_hz)
    position = scipy.interpolate.BSpline(spline.t, spline.c[:, :3], DEGREE)
    quaternion = scipy.interpolate.BSpline(spline.t, spline.c[:, 3:7], DEGREE)

    def attitude(s: Array) -> Attitude:
        jet = Jet(quaternion(s), quaternion(s, 1), quaternion(s, 2))
        return of_quaternion(jet)

    return PoseCurve(position, attitude, breaks=np.zeros(0))


def _recorded(
    trajectory: Trajectory,
    *,
    fewest: int,
    max_gap_s: float,
) -> tuple[Array, Array]:
    """Times (N,) in s from 0, and poses (N, 4, 4). Raises MotionError for too few poses, or too long a gap."""
    if len(trajectory) < fewest:
        raise MotionError(f"a replay needs {fewest} poses or more, but the recording has {len(trajectory)}")
    t_s = (trajectory.t_ns - trajectory.t_ns[0]) / 1e9
    steps_s = np.diff(t_s)
    longest = int(np.argmax(steps_s))
    if not steps_s[longest] <= max_gap_s:
        raise MotionError(
            f"the recording has no pose from {t_s[longest]:.3f} s to {t_s[longest + 1]:.3f} s after its start; "
            f"a gap may last max_gap_s {max_gap_s:g}: replay one side of it, or allow more"
        )
    T = trajectory.T_world_frame
    R = se3.nearest_rotation(T[:, :3, :3])
    return t_s, se3.transform(R, T[:, :3, 3])


def _least_squares(t_s: Array, rows: Array, *, knot_hz: float) -> "scipy.interpolate.BSpline":
    """The spline (7 columns) nearest to rows (N, 7)."""
    n_knots = int(t_s[-1] * knot_hz)
    even_knots_s = np.arange(1, n_knots + 1) / knot_hz
    poses_before = np.searchsorted(t_s, even_knots_s)
    inner_knots_s = []
    last = 0
    for knot_s, before in zip(even_knots_s.tolist(), poses_before.tolist(), strict=True):
        after = len(t_s) - before
        if before - last >= MIN_POSES_PER_PIECE and after >= MIN_POSES_PER_PIECE:
            inner_knots_s.append(knot_s)
            last = before
    start_s = np.full(DEGREE + 1, t_s[0])
    end_s = np.full(DEGREE + 1, t_s[-1])
    knots_s = np.concatenate([start_s, inner_knots_s, end_s])
    return scipy.interpolate.make_lsq_spline(t_s, rows, knots_s, k=DEGREE)
