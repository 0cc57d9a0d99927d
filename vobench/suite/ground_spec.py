"""What YAML may say of a body on wheels: which robot it is, and what controller and floor do to it."""

from collections.abc import Mapping
from math import inf, radians
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.robot.ackermann import ACKERMANNS
from vobench.robot.controller import CONTROLLERS
from vobench.robot.disturbance import DELTAS
from vobench.robot.floor import SURFACES, FloorPatch
from vobench.robot.integrate import INTEGRATORS
from vobench.robot.limits import AccelerationLimits
from vobench.robot.pioneer import THETAS
from vobench.robot.slip import SLIPS
from vobench.sensor.encoder import ENCODERS
from vobench.suite.strict import Acceleration, Point, Positive, Rate, Strict, one_of, wrong_key

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
