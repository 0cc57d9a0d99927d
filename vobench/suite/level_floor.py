"""Finds the level floor of a scene: nearly level faces at the same height."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Mask
from vobench.scene.triangles import Triangles

LEVEL = 0.99  # cosine of the steepest level face
FLOOR_STEP_M = 0.02  # the unit in which heights are compared
FLOOR_SHARE = 0.4  # the smallest area of the floor, relative to the largest level area at any height


@dataclass(frozen=True, slots=True)
class LevelFloor:
    """The floor of a scene: its height, and the corners (N, 3, 3) of its faces.

    `is_floor` (F,) says which of the faces of the scene they are.
    """

    height_m: float
    corners_m: Array
    is_floor: Mask


def level_floor(faces: Triangles) -> LevelFloor | None:
    """The lowest height with a large level area; None if the scene has no level face.

    Roofs and upper storeys may be larger than the floor, and pits are lower, but small.
    """
    is_level = _is_level(faces)
    if not is_level.any():
        return None
    corners_m = faces.corners_m[is_level]  # (F, 3, 3)
    steps = height_steps(corners_m)

    lowest_step = steps.min()
    area_by_step_m2 = np.bincount(steps - lowest_step, areas_m2(corners_m))
    large_steps = np.flatnonzero(area_by_step_m2 > FLOOR_SHARE * area_by_step_m2.max())
    height_m = float((large_steps[0] + lowest_step) * FLOOR_STEP_M)

    is_at_height = np.abs(steps * FLOOR_STEP_M - height_m) < FLOOR_STEP_M
    is_floor = is_level.copy()
    is_floor[is_level] = is_at_height
    return LevelFloor(height_m, corners_m[is_at_height], is_floor)


def floor_height_m(faces: Triangles) -> float | None:
    """The height of the level floor of a scene; None if the scene has no level face."""
    floor = level_floor(faces)
    return floor.height_m if floor else None


def height_steps(corners_m: Array) -> NDArray[np.int_]:
    """The heights (F,) of the middles of faces (F, 3, 3), in units of FLOOR_STEP_M."""
    heights_m = corners_m.mean(1)[:, 2]
    steps: NDArray[np.int_] = np.rint(heights_m / FLOOR_STEP_M).astype(int)
    return steps


def _is_level(faces: Triangles) -> Mask:
    """Whether each face (F,) is stationary, nearly level, and faces up."""
    is_level: Mask = (faces.plane[:, 2] > LEVEL) & (faces.mover < 0)
    return is_level
