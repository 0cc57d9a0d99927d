"""What YAML may say of trajectories: over the floor, through space, replayed."""

from collections.abc import Mapping, Sequence
from math import inf, radians
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from vobench.errors import InputError, SuiteError, TrajectoryError, unknown
from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion import course, replay
from vobench.motion.ackermann import ACKERMANNS
from vobench.motion.controller import CONTROLLERS
from vobench.motion.handheld import SHAKES, HandheldMotion, handheld
from vobench.motion.pioneer import INTEGRATORS, THETAS, AccelerationLimits
from vobench.motion.quadrotor import quadrotor
from vobench.motion.rail import rail
from vobench.motion.replay import AXES
from vobench.motion.slip import DELTAS, SLIPS, SURFACES, FloorPatch
from vobench.motion.spline import check_times, pose_spline
from vobench.sensor.encoder import ENCODERS
from vobench.setting import NonNegative, Positive, Triple, tupled
from vobench.suite.yaml_file import (
    Acceleration,
    Length,
    Pause,
    Point,
    Rate,
    Speed,
    Strict,
    one_of,
    wrong_key,
)
from vobench.trajectory.formats import NS_PER_S, Parsed, format_tum, parse_any, parse_times, parse_tum
from vobench.trajectory.kinematics import CurveMotion
from vobench.trajectory.trajectory import Move, Stamps, Trajectory, parse_move

Mover = Literal["pioneer", "unicycle", "ackermann"]

# Which keys are of some movers only; a kind of trajectory may leave out more.
PIONEER_KEYS = (
    *("robot", "robot_spread", "controller", "max_accel_mps2", "max_turn_accel_radps2"),
    *("slip", "floor", "delta", "integrator", "substeps"),
)
ACKERMANN_KEYS = ("car",)
MOVER_KEYS: dict[Mover, tuple[str, ...]] = {"pioneer": PIONEER_KEYS, "unicycle": (), "ackermann": ACKERMANN_KEYS}
# The wheels of each car that turn without being steered. The large one's are a Passat's (205/55 R16); those of
# the small one, and how finely both count, are engineering choices.
CAR_WHEELS = {
    "kitti_like": WheelGeometry(radius_m=0.316, track_m=1.55, ticks_per_revolution=4096),
    "small_robot": WheelGeometry(radius_m=0.05, track_m=0.25, ticks_per_revolution=4096),
}
SOME_MOVERS = {key for keys in MOVER_KEYS.values() for key in keys}


class FloorPatchSpec(Strict):
    """A rectangle of the floor that is wet, covered or a seam: slip is another there."""

    surface: Annotated[str, one_of("surface", SURFACES)]
    center_m: Point
    size_m: tuple[Positive, Positive]
    yaw_deg: float = 0.0

    @property
    def corners_m(self) -> Array:
        """Its corners (4, 2) on the floor, in turn."""
        half = np.array(self.size_m) / 2 * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
        corners: Array = half @ se3.rotation_z(radians(self.yaw_deg))[:2, :2].T + self.center_m
        return corners

    def build(self) -> FloorPatch:
        """The patch."""
        return FloorPatch(SURFACES[self.surface], self.center_m, self.size_m, radians(self.yaw_deg))


class GroundSpec(Strict):
    """A robot on the floor, and how it is driven; `mover` says which of the keys belong here."""

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = MOVER_KEYS

    mover: Mover = "pioneer"
    start_m: Point = (0.0, 0.0)
    start_heading_deg: float = 0.0
    rate_hz: Rate = 30.0
    encoders: Annotated[str, one_of("encoder error set", ENCODERS)] = "nominal"
    car: Annotated[str, one_of("car", ACKERMANNS)] = "small_robot"
    robot: Annotated[str, one_of("robot parameter set", THETAS)] = "pioneer_3dx"
    robot_spread: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    controller: Annotated[str, one_of("controller", CONTROLLERS)] = "smooth"
    max_accel_mps2: Acceleration | None = None
    max_turn_accel_radps2: Acceleration | None = None
    slip: Annotated[str, one_of("slip", SLIPS)] = "nominal"
    floor: tuple[FloorPatchSpec, ...] = ()
    delta: Annotated[str, one_of("disturbance", DELTAS)] = "none"
    integrator: Annotated[str, one_of("integrator", INTEGRATORS)] = "rk4"
    substeps: Annotated[int, Field(ge=1, le=64)] = 4

    @model_validator(mode="after")
    def _fits_mover(self) -> Self:
        if self.mover not in self.mover_keys:
            raise wrong_key("mover", f"should be one of {', '.join(self.mover_keys)} here (got {self.mover!r})")
        for key in sorted(self.model_fields_set - self._known()):
            raise wrong_key(
                key, f"does not belong to mover '{self.mover}', which has {', '.join(sorted(self._known()))}"
            )
        return self

    @model_serializer(mode="wrap")
    def _what_fits(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What belongs to the mover: all that its motion depends on, and what can be read again."""
        known, dumped = self._known(), dump(self)
        return {key: value for key, value in dumped.items() if key in known}

    def _known(self) -> set[str]:
        """The keys that this mover takes."""
        return set(type(self).model_fields) - SOME_MOVERS | set(self.mover_keys[self.mover])

    @property
    def start(self) -> tuple[float, float, float]:
        """x, y in m and heading in rad."""
        return (*self.start_m, radians(self.start_heading_deg))

    @property
    def wheels(self) -> WheelGeometry:
        """The wheels that turn without being steered, as an odometer believes them."""
        return CAR_WHEELS[self.car] if self.mover == "ackermann" else PIONEER_WHEELS

    def build_limits(self) -> AccelerationLimits:
        """What the drive train can give."""
        return AccelerationLimits(self.max_accel_mps2 or inf, self.max_turn_accel_radps2 or inf)


Laps = Annotated[int, Field(ge=1, le=1000)]
# Where the Pioneer is told its speeds beforehand, no controller leads it.
UNLED_KEYS = tuple(key for key in PIONEER_KEYS if key != "controller")


class WaypointsSpec(GroundSpec):
    """Targets that the paper's controller steers the point h through, `start_m` being h's."""

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {
        "pioneer": PIONEER_KEYS,
        "unicycle": ("controller", "max_accel_mps2", "max_turn_accel_radps2", "integrator", "substeps"),
    }

    kind: Literal["waypoints"] = "waypoints"
    targets_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    tolerance_m: Positive = 0.01
    leg_s: Annotated[float, Field(gt=0, le=3600)] | None = None
    max_time_s: Annotated[float, Field(gt=0, le=3600)] = 60.0


class CircleSpec(GroundSpec):
    """A circle to the left, or clockwise to the right."""

    kind: Literal["circle"] = "circle"
    radius_m: Length
    laps: Annotated[float, Field(gt=0, le=1000)] = 1.0
    clockwise: bool = False
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.circle(
            self.radius_m,
            speed_mps=self.speed_mps,
            laps=self.laps,
            clockwise=self.clockwise,
            accel_mps2=self.accel_mps2,
            start=self.start,
        )


class SquareSpec(GroundSpec):
    """A square: it turns on the spot at each corner, or goes round it where corner_radius_m is given."""

    kind: Literal["square"] = "square"
    side_m: Length
    corner_radius_m: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    laps: Laps = 1
    clockwise: bool = False
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5
    turn_radps: Speed = 1.0
    turn_accel_radps2: Acceleration = 2.0

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.square(
            self.side_m,
            speed_mps=self.speed_mps,
            laps=self.laps,
            corner_radius_m=self.corner_radius_m,
            turn_radps=self.turn_radps,
            clockwise=self.clockwise,
            accel_mps2=self.accel_mps2,
            turn_accel_radps2=self.turn_accel_radps2,
            start=self.start,
        )


class Figure8Spec(GroundSpec):
    """A figure of eight from its crossing; half as wide as long where no width is given."""

    kind: Literal["figure_8"] = "figure_8"
    length_m: Length
    width_m: Length | None = None
    laps: Laps = 1
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.figure_8(
            self.length_m,
            width_m=self.width_m,
            speed_mps=self.speed_mps,
            laps=self.laps,
            accel_mps2=self.accel_mps2,
            start=self.start,
        )


class LissajousSpec(GroundSpec):
    """The closed curve x = A sin(a φ + phase), y = B sin(b φ), of length 2A and width 2B, ratio [a, b]."""

    kind: Literal["lissajous"] = "lissajous"
    size_m: tuple[Length, Length]
    ratio: tuple[int, int] = (1, 2)
    phase_deg: float = 0.0
    laps: Laps = 1
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.lissajous(
            self.size_m,
            ratio=self.ratio,
            phase_rad=radians(self.phase_deg),
            speed_mps=self.speed_mps,
            laps=self.laps,
            accel_mps2=self.accel_mps2,
            start=self.start,
        )


class StopAndGoSpec(GroundSpec):
    """Straight ahead by each length in turn, with a pause between them."""

    kind: Literal["stop_and_go"] = "stop_and_go"
    legs_m: Annotated[tuple[Length, ...], Field(min_length=1)]
    pause_s: Pause = 1.0
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.stop_and_go(
            self.legs_m, speed_mps=self.speed_mps, pause_s=self.pause_s, accel_mps2=self.accel_mps2, start=self.start
        )


class PureRotationSpec(GroundSpec):
    """A turn on the spot about the middle of the axle, to the left; to the right for a negative angle.

    The Pioneer does it without feedback: its controller holds the point h, not the axle.
    """

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {"pioneer": UNLED_KEYS, "unicycle": ()}

    kind: Literal["pure_rotation"] = "pure_rotation"
    angle_deg: Annotated[float, Field(ge=-36_000, le=36_000)]
    turn_radps: Speed = 1.0
    turn_accel_radps2: Acceleration = 2.0

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if self.angle_deg == 0:
            raise wrong_key("angle_deg", "should be another angle than 0, or less than 0 for right")
        return self

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.pure_rotation(
            radians(self.angle_deg), rate_radps=self.turn_radps, accel_radps2=self.turn_accel_radps2, start=self.start
        )


class ReverseSpec(GroundSpec):
    """Ahead and back to the start, straight or on an arc to the left (radius_m < 0: to the right).

    The Pioneer does it without feedback: led backwards by a point ahead of its axle it would swing round.
    """

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {**MOVER_KEYS, "pioneer": UNLED_KEYS}

    kind: Literal["reverse"] = "reverse"
    length_m: Length
    radius_m: float | None = None
    pause_s: Pause = 0.0
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    @model_validator(mode="after")
    def _bends_sensibly(self) -> Self:
        if self.radius_m is not None and not 0.01 <= abs(self.radius_m) <= 1e5:
            raise wrong_key("radius_m", f"should be from 0.01 to 1e5, or less than 0 for right (got {self.radius_m:g})")
        return self

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        return course.reverse(
            self.length_m,
            speed_mps=self.speed_mps,
            radius_m=self.radius_m,
            pause_s=self.pause_s,
            accel_mps2=self.accel_mps2,
            start=self.start,
        )


# Where no point ahead of the axle can lead a robot.
UnledSpec = PureRotationSpec | ReverseSpec
CurveSpec = CircleSpec | SquareSpec | Figure8Spec | LissajousSpec | StopAndGoSpec | UnledSpec


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


def _known_axes(word: str) -> str:
    """A name of AXES, or words that `parse_move` reads. Raises ValueError."""
    try:
        _move(word)
    except InputError as error:
        raise ValueError(str(error)) from None
    return word


def _move(word: str) -> Move | None:
    if word in AXES:
        return AXES[word]
    if ":" not in word:
        raise InputError(unknown("convention of axes", word, list(AXES)))
    return parse_move(word)


class ReplaySpec(Strict):
    """The poses of a TUM, EuRoC, KITTI or TartanAir file, told by content, and how the body goes through them.

    Smoothed by a least-squares spline with knots at `knot_hz`, or `exact`, which is for cameras alone. Files
    without stamps need `times`, a file of them, or `recorded_hz`. Without `start_m` it starts as recorded.
    """

    kind: Literal["replay"] = "replay"
    file: str
    times: str | None = None
    recorded_hz: Positive | None = None
    axes: Annotated[str, AfterValidator(_known_axes)] = "body"
    exact: bool = False
    knot_hz: Annotated[float, Field(gt=0, le=1000)] = 10.0
    speed: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    max_gap_s: Positive = 1.0
    start_m: Triple | None = None
    start_heading_deg: float = 0.0
    rate_hz: Rate = 30.0

    @model_validator(mode="after")
    def _heading_with_place(self) -> Self:
        if self.start_m is None and self.start_heading_deg:
            raise wrong_key("start_heading_deg", "belongs to start_m; without it the body starts as recorded")
        return self

    def motion(self, replayed: str) -> CurveMotion:
        """The motion through what `read_replayed` gave. Raises MotionError."""
        recorded = parse_tum(replayed, name=self.file)
        start = (*self.start_m, radians(self.start_heading_deg)) if self.start_m else None
        if self.exact:
            return replay.interpolated(recorded, start=start, speed=self.speed, max_gap_s=self.max_gap_s)
        return replay.smoothed(recorded, knot_hz=self.knot_hz, start=start, speed=self.speed, max_gap_s=self.max_gap_s)


def read_times(spec: ReplaySpec, folder: Path) -> Stamps | None:
    """The stamps in the file `times`, where there is one. Raises InputError."""
    path = folder / spec.times if spec.times else None
    return parse_times(_text(path), name=str(path)) if path else None


def read_replayed(spec: ReplaySpec, folder: Path, times: Stamps | None) -> str:
    """The poses of the file as TUM text, in our axes; relative paths start in `folder`. Raises InputError."""
    path = folder / spec.file
    parsed = parse_any(_text(path), name=str(path))
    t_ns = parsed.t_ns if parsed.t_ns is not None else _stamps(spec, times, parsed)
    if parsed.t_ns is not None and (spec.times or spec.recorded_hz):
        raise SuiteError(f"times and recorded_hz are for files without stamps, but this one has its own: {path}")
    move = _move(spec.axes)
    T = move.apply(parsed.T) if move else parsed.T
    # KITTI's six digits are made rotations again.
    return format_tum(Trajectory(t_ns, se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])))


def _stamps(spec: ReplaySpec, times: Stamps | None, parsed: Parsed) -> Stamps:
    if times is not None:
        t_ns = parsed.stamped_by(times)
        if t_ns is None:
            raise TrajectoryError(f"{len(times)} stamps in {spec.times} for {len(parsed.T)} poses in {spec.file}")
        return t_ns
    if spec.recorded_hz:
        frames = np.arange(len(parsed.T)) if parsed.frames is None else parsed.frames
        return np.rint(frames * NS_PER_S / spec.recorded_hz).astype(np.int64)
    raise SuiteError(f"no stamps in {spec.file}; give times, a file that has them, or recorded_hz")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SuiteError(f"not a text file in UTF-8: {path}") from None


DEFAULT_KIND = "waypoints"


def _of_a_kind(value: Any) -> Any:
    """Keys with their kind. Raises ValidationError where there is none such, or a key is of other kinds."""
    if not isinstance(value, dict):
        return value
    kind = value.get("kind", DEFAULT_KIND)
    if not isinstance(kind, str) or kind not in KINDS:
        raise wrong_key("kind", unknown("kind of trajectory", str(kind), list(KINDS)))
    for key in sorted(set(value) - set(KINDS[kind].model_fields)):
        _refuse_of_others(key, kind, is_said="kind" in value)
    return {**tupled(value), "kind": kind}


def _refuse_of_others(key: str, kind: str, *, is_said: bool) -> None:
    """Raise ValidationError for a key that other kinds have, if it is not one of this kind's without its unit."""
    owners = [name for name, spec in KINDS.items() if key in spec.model_fields]
    if owners and not any(own.startswith(f"{key}_") for own in KINDS[kind].model_fields):
        this = f"this is {kind}" if is_said else f"without a kind this is {kind}"
        raise wrong_key(key, f"belongs to {', '.join(owners)}; {this}")


SpatialSpec = PoseSplineSpec | HandheldSpec | RailSpec | QuadrotorSpec
AnySpec = WaypointsSpec | CurveSpec | SpatialSpec | ReplaySpec
KINDS = {spec.model_fields["kind"].default: spec for spec in get_args(AnySpec)}
TrajectorySpec = Annotated[AnySpec, Field(discriminator="kind"), BeforeValidator(_of_a_kind)]


def wheels_of(spec: AnySpec) -> WheelGeometry | None:
    """The wheels of the body that goes there, None for one that leaves the floor."""
    return spec.wheels if isinstance(spec, GroundSpec) else None
