"""What YAML may say of ways over the floor: through waypoints, or along a curve from rest to rest."""

from collections.abc import Mapping
from math import radians
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from vobench.robot import planar
from vobench.suite.ground_spec import MOVER_KEYS, PIONEER_KEYS, GroundSpec, Mover
from vobench.suite.strict import Acceleration, Length, Pause, Point, Positive, Speed, wrong_key
from vobench.trajectory.curve import CurveMotion

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
        return planar.circle(
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
        return planar.square(
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
        return planar.figure_8(
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
        return planar.lissajous(
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
        return planar.stop_and_go(
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
        return planar.pure_rotation(
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
        return planar.reverse(
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
