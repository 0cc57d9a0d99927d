"""Settings of all trajectories on wheels: the robot, its start, the floor, and the control."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf, radians
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from vobench.errors import SettingError
from vobench.geometry.rig import PIONEER_WHEELS, Mount, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.ackermann import ACKERMANNS
from vobench.motion.controller import CONTROLLERS
from vobench.motion.disturbance import DELTAS
from vobench.motion.floor_patch import FloorPatch
from vobench.motion.motor import MotorConstants, theta_of
from vobench.motion.pioneer import INTEGRATORS, THETAS, AccelerationLimits, Theta
from vobench.motion.slip import SLIPS
from vobench.setting import OneOf, settings
from vobench.trajectory.kinematics import level

# Wide enough for a car on a motorway, and narrow enough that no square of one overflows.
Length = Annotated[float, Gt(0), Le(1e5)]
Speed = Annotated[float, Gt(0), Le(100)]
Acceleration = Annotated[float, Gt(0), Le(1000)]
Rate = Annotated[float, Gt(0), Le(1000)]
Pause = Annotated[float, Ge(0), Le(3600)]

Mover = Literal["pioneer", "unicycle", "ackermann"]
# The keys of single movers; a kind of trajectory may leave out more.
PIONEER_KEYS = (
    "robot",
    "motors",
    "robot_spread",
    "controller",
    "max_accel_mps2",
    "max_turn_accel_radps2",
    "slip",
    "floor",
    "delta",
    "integrator",
    "substeps",
)
MOVER_KEYS: dict[Mover, tuple[str, ...]] = {
    "pioneer": PIONEER_KEYS,
    "unicycle": (),
    "ackermann": ("car",),
}
# A Pioneer that follows given speeds needs no controller.
KEYS_WITHOUT_CONTROLLER = tuple(key for key in PIONEER_KEYS if key != "controller")
# The wheels of each car that are not steered. The large car's are those of a Passat (205/55 R16); those of the small
# one, and the resolution of both encoders, are engineering choices.
CAR_WHEELS = {
    "kitti_like": WheelGeometry(radius_m=0.316, track_m=1.55, ticks_per_revolution=4096),
    "small_robot": WheelGeometry(radius_m=0.05, track_m=0.25, ticks_per_revolution=4096),
}


@settings()
class Wheeled:
    """A robot on the floor and its control; `mover` determines which of the keys apply."""

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = MOVER_KEYS

    mover: Mover = "pioneer"
    start_m: tuple[float, float] = (0.0, 0.0)
    start_heading_deg: float = 0.0
    rate_hz: Rate = 30.0
    encoders: Literal["exact", "nominal"] = "nominal"
    car: Annotated[str, OneOf("car", ACKERMANNS)] = "small_robot"
    robot: Annotated[str, OneOf("robot parameter set", THETAS)] = "pioneer_3dx"
    motors: MotorConstants | None = None
    robot_spread: Annotated[float, Ge(0), Le(0.5)] = 0.0
    controller: Annotated[str, OneOf("controller", CONTROLLERS)] = "smooth"
    max_accel_mps2: Acceleration | None = None
    max_turn_accel_radps2: Acceleration | None = None
    slip: Annotated[str, OneOf("slip", SLIPS)] = "nominal"
    floor: tuple[FloorPatch, ...] = ()
    delta: Annotated[str, OneOf("disturbance", DELTAS)] = "none"
    integrator: Annotated[str, OneOf("integrator", INTEGRATORS)] = "rk4"
    substeps: Annotated[int, Ge(1), Le(64)] = 4
    mount: Mount | None = None

    def __post_init__(self) -> None:
        if self.mover not in self.mover_keys:
            raise SettingError(f"should be one of {', '.join(self.mover_keys)} here (got {self.mover!r})", "mover")

    @property
    def start(self) -> tuple[float, float, float]:
        """x, y in m and heading in rad."""
        return (*self.start_m, radians(self.start_heading_deg))

    @property
    def T_world_start(self) -> Array:
        """The pose (4, 4) at the start."""
        x_m, y_m, heading_rad = np.array(self.start, float)[:, None]  # (1,) each, since `level` creates (M, 4, 4)
        poses: Array = level(x_m, y_m, heading_rad)
        T_world_start: Array = poses[0]
        return T_world_start

    @property
    def wheels(self) -> WheelGeometry:
        """The nominal geometry of the wheels that are not steered."""
        if self.mover == "ackermann":
            return CAR_WHEELS[self.car]
        if self.motors:
            return replace(PIONEER_WHEELS, radius_m=self.motors.r_m, track_m=self.motors.d_m)
        return PIONEER_WHEELS

    @property
    def theta(self) -> Theta:
        """The parameters of the Pioneer's dynamics: computed from `motors` if given, otherwise those of `robot`.

        `theta` and the equations are those of the paper, see docs/paper.md; `motor.theta_of` has (12) to (17).
        """
        return theta_of(self.motors) if self.motors else THETAS[self.robot]

    @property
    def limits(self) -> AccelerationLimits:
        """The limits of the drive train."""
        linear_mps2 = self.max_accel_mps2 or inf
        angular_radps2 = self.max_turn_accel_radps2 or inf
        return AccelerationLimits(linear_mps2, angular_radps2)
