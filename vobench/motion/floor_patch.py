"""Patches of the floor on which wheels slip differently: wet, covered by a carpet, or with a seam."""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.setting import OneOf, Positive, settings

Bias = Annotated[float, Ge(-0.3), Le(0.3)]


@settings(kw_only=False)
class GroundSlip:
    """The effect of a floor on slip.

    The slip ratios of both wheels and the side-slip angle are multiplied by `factor`. Then `ratio_bias` is added to the
    ratios, and `angle_bias_rad` to the angle. A positive angle moves the robot to the left, as the nap of a carpet can.
    """

    factor: Annotated[float, Ge(0), Le(50)] = 1.0
    ratio_bias: Bias = 0.0
    angle_bias_rad: Bias = 0.0


# Engineering choices: wheels spin on a wet patch; a carpet has less grip and pulls along its nap; a seam is a jolt.
SURFACES = {
    "wet": GroundSlip(factor=6.0, ratio_bias=0.04),
    "carpet": GroundSlip(factor=1.5, ratio_bias=0.01, angle_bias_rad=radians(1.0)),
    "seam": GroundSlip(factor=10.0),
}


@settings()
class FloorPatch:
    """A rectangle of the floor with another surface, and therefore with other slip."""

    surface: Annotated[str, OneOf("surface", SURFACES)]
    center_m: tuple[float, float]
    size_m: tuple[Positive, Positive]
    yaw_deg: float = 0.0

    @property
    def corners_m(self) -> Array:
        """The corners (4, 2) on the floor, counterclockwise."""
        half_m = np.array(self.size_m) / 2
        directions = [[1, 1], [-1, 1], [-1, -1], [1, -1]]
        R = se3.rotation_z(radians(self.yaw_deg))[:2, :2]
        offsets_m = (half_m * directions) @ R.T
        corners: Array = offsets_m + self.center_m
        return corners

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether a point of the floor is on the patch."""
        offset_x_m = x_m - self.center_m[0]
        offset_y_m = y_m - self.center_m[1]
        yaw_cos = cos(radians(self.yaw_deg))
        yaw_sin = sin(radians(self.yaw_deg))
        along_m = yaw_cos * offset_x_m + yaw_sin * offset_y_m
        across_m = yaw_cos * offset_y_m - yaw_sin * offset_x_m
        half_length_m = self.size_m[0] / 2
        half_width_m = self.size_m[1] / 2
        return abs(along_m) <= half_length_m and abs(across_m) <= half_width_m


def ground_effect(patches: Sequence[FloorPatch], x_m: float, y_m: float) -> tuple[float, float, float]:
    """The factor, the ratio bias and the angle bias (rad) of `GroundSlip` at a point of the floor.

    Where patches overlap, their factors are multiplied and their biases are added.
    """
    factor = 1.0
    ratio_bias = 0.0
    angle_bias_rad = 0.0
    for patch in patches:
        if patch.contains(x_m, y_m):
            ground = SURFACES[patch.surface]
            factor *= ground.factor
            ratio_bias += ground.ratio_bias
            angle_bias_rad += ground.angle_bias_rad
    return factor, ratio_bias, angle_bias_rad
