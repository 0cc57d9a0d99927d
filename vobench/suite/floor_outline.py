"""The floor plan of a place as lines: the outlines of what stands on its floor, cut at some heights."""

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.scene.scene import triangles
from vobench.scene.triangles import Triangles
from vobench.suite.level_floor import floor_height_m
from vobench.suite.scene_build import build
from vobench.suite.scene_spec import SceneFile

CUT_HEIGHTS_M = (0.15, 0.45, 1.2)  # above the floor: low things, seats and tables, walls and windows


def floor_outlines_m(scene: SceneFile) -> Array:
    """The outlines of a scene as segments (S, 2, 2) in the plane. Movers are left out, as they do not stay.

    There are none if the scene has no level floor. Raises SuiteError or ModelError if the scene cannot be built.
    """
    faces = triangles(build(scene, {}), t_ns=0)
    floor_m = floor_height_m(faces)
    if floor_m is None:
        return np.zeros((0, 2, 2))
    cuts = [section_m(faces, floor_m + height_m) for height_m in CUT_HEIGHTS_M]
    return np.concatenate(cuts)


def section_m(faces: Triangles, height_m: float) -> Array:
    """The segments (S, 2, 2) in which the stationary faces meet the level plane at a height."""
    corners_m = faces.corners_m[faces.mover < 0]  # (F, 3, 3)
    above_m = corners_m[:, :, 2] - height_m  # (F, 3)
    is_above = above_m > 0
    corners_above = is_above.sum(1)
    is_cut = (corners_above == 1) | (corners_above == 2)

    # A face that is cut has one corner alone on its side of the plane. Two of its edges leave from there.
    is_alone = is_above[is_cut] == (corners_above[is_cut] == 1)[:, None]
    alone = is_alone.argmax(1)
    ends = [_crossing_m(corners_m[is_cut], above_m[is_cut], alone, (alone + step) % 3) for step in (1, 2)]
    return np.stack(ends, 1)


def _crossing_m(corners_m: Array, above_m: Array, start: NDArray[np.int_], end: NDArray[np.int_]) -> Array:
    """The points (F, 2) at which edges of faces (F, 3, 3), between two of their corners, meet the plane."""
    rows = np.arange(len(corners_m))
    start_above_m = above_m[rows, start]
    share = start_above_m / (start_above_m - above_m[rows, end])
    start_m = corners_m[rows, start, :2]
    end_m = corners_m[rows, end, :2]
    points_m: Array = start_m + share[:, None] * (end_m - start_m)
    return points_m
