"""What the floor does to slip: patches that are wet or covered, each a rectangle on the ground."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from math import cos, isfinite, radians, sin

from vobench.errors import MotionError


@dataclass(frozen=True, slots=True)
class Surface:
    """What a floor does to slip: it multiplies slip ratios and side-slip angle by `factor`, then adds to them.

    `ratio_bias`: both rims run ahead by that; `angle_bias_rad`: pulled to the left, as by a carpet's nap.
    """

    factor: float = 1.0
    ratio_bias: float = 0.0
    angle_bias_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.factor <= 50 and abs(self.ratio_bias) <= 0.3 and abs(self.angle_bias_rad) <= 0.3):
            raise MotionError(
                f"a surface needs a factor in 0..50, ratio_bias and angle_bias_rad within 0.3, got {astuple(self)}"
            )


# Engineering choices: a wet patch spins the wheels, a carpet holds less well and pulls along its nap, a seam is a jolt.
SURFACES = {
    "wet": Surface(factor=6.0, ratio_bias=0.04),
    "carpet": Surface(factor=1.5, ratio_bias=0.01, angle_bias_rad=radians(1.0)),
    "seam": Surface(factor=10.0),
}


@dataclass(frozen=True, slots=True)
class FloorPatch:
    """A rectangle (two sides in m, turned by yaw) around a point of the floor, all of one surface.

    Raises MotionError where it has no area or a value is not finite.
    """

    surface: Surface
    center_m: tuple[float, float]
    size_m: tuple[float, float]
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (all(map(isfinite, (*self.center_m, *self.size_m, self.yaw_rad))) and min(self.size_m) > 0):
            raise MotionError(
                f"a floor patch needs a finite center_m, yaw and positive size_m, "
                f"got {self.center_m}, {self.yaw_rad} and {self.size_m}"
            )

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a point of the floor is on it."""
        x, y = x_m - self.center_m[0], y_m - self.center_m[1]
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        return abs(c * x + s * y) <= self.size_m[0] / 2 and abs(c * y - s * x) <= self.size_m[1] / 2


def under(patches: Sequence[FloorPatch], x_m: float, y_m: float) -> tuple[float, float, float]:
    """Factor, ratio bias and angle bias (rad) under a point: where patches overlap factors multiply, biases add."""
    factor, ratio_bias, angle_bias_rad = 1.0, 0.0, 0.0
    for patch in patches:
        if patch.holds(x_m, y_m):
            factor *= patch.surface.factor
            ratio_bias += patch.surface.ratio_bias
            angle_bias_rad += patch.surface.angle_bias_rad
    return factor, ratio_bias, angle_bias_rad
