"""Finds the uneven ground of a scene outdoors, and its height at any place."""

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Mask
from vobench.rendering.geometry import RayCaster
from vobench.scene.triangles import Triangles
from vobench.suite.level_floor import height_steps

GENTLE = 0.97  # cosine of the steepest ground on which a body moves, 14 degrees
UNEVEN_SHARE = 0.2  # the largest share of the area of uneven ground that is at any one height
# A further thing belongs to the ground if it is large, relative to the largest uneven thing.
GROUND_AREA_SHARE = 0.05
GROUND_EXTENT_SHARE = 0.3  # of the longer side in plan: the leaves of a tree may have a large area


def uneven_ground(faces: Triangles) -> Mask:
    """Whether each face (F,) belongs to uneven ground; all False if the ground is level.

    The ground is the stationary thing with the largest area of gentle slopes that face up, and other large things of
    this kind.
    """
    is_gentle: Mask = (faces.plane[:, 2] > GENTLE) & (faces.mover < 0) & (faces.thing >= 0)
    if not is_gentle.any():
        return is_gentle
    # (G,): one row for each gentle face
    things = faces.thing[is_gentle]
    corners_m = faces.corners_m[is_gentle]
    area_m2 = areas_m2(corners_m)
    steps = height_steps(corners_m)

    area_by_thing_m2 = np.bincount(things, area_m2)
    largest = int(area_by_thing_m2.argmax())
    is_of_largest = things == largest
    if not _is_uneven(steps[is_of_largest], area_m2[is_of_largest]):
        return np.zeros(len(faces.thing), bool)

    least_area_m2 = GROUND_AREA_SHARE * area_by_thing_m2[largest]
    least_extent_m = GROUND_EXTENT_SHARE * _extent_m(corners_m[is_of_largest])
    ground = []
    for thing in np.flatnonzero(area_by_thing_m2 > least_area_m2).tolist():
        is_of_thing = things == thing
        is_wide = _extent_m(corners_m[is_of_thing]) > least_extent_m
        if is_wide and _is_uneven(steps[is_of_thing], area_m2[is_of_thing]):
            ground.append(thing)
    is_ground: Mask = is_gentle & np.isin(faces.thing, ground)
    return is_ground


def is_under_sheet(faces: Triangles, points_m: Array) -> Mask:
    """Whether each point (N, 3) is below a sheet, such as the surface of water.

    A sheet is a stationary thing without sides or a bottom: all of its faces are gentle slopes that face up.
    """
    is_other = (faces.plane[:, 2] <= GENTLE) | (faces.mover >= 0)
    other_faces_by_thing = np.bincount(faces.thing[is_other], minlength=len(faces.things))
    is_sheet = (other_faces_by_thing == 0)[faces.thing] & ~is_other
    if not is_sheet.any():
        return np.zeros(len(points_m), bool)
    sheet_caster = RayCaster(faces, np.flatnonzero(is_sheet))
    hits = sheet_caster.hits(points_m, np.tile([0.0, 0.0, 1.0], (len(points_m), 1)))
    is_under: Mask = hits.face >= 0
    return is_under


def _extent_m(corners_m: Array) -> float:
    """The longer side of the box in plan around faces (F, 3, 3)."""
    points_m = corners_m.reshape(-1, 3)[:, :2]
    sides_m = points_m.max(0) - points_m.min(0)
    return float(sides_m.max())


def _is_uneven(steps: NDArray[np.int_], area_m2: Array) -> bool:
    """Whether no height has a large share of the area (F,) of faces. `steps` (F,) are their heights."""
    area_by_step_m2 = np.bincount(steps - steps.min(), area_m2)
    return bool(area_by_step_m2.max() < UNEVEN_SHARE * area_by_step_m2.sum())


def ground_heights_m(faces: Triangles, is_ground: Mask, places_m: Array) -> Array:
    """The height (N,) of the ground at places (N, 2), which consists of some of the faces (F,); NaN beside it."""
    ground_caster = RayCaster(faces, np.flatnonzero(is_ground))
    top_m = float(faces.corners_m[is_ground][:, :, 2].max()) + 1.0
    starts_m = np.column_stack([places_m, np.full(len(places_m), top_m)])
    downwards = np.tile([0.0, 0.0, -1.0], (len(places_m), 1))
    hits = ground_caster.hits(starts_m, downwards)
    return np.where(hits.face >= 0, top_m - hits.distance, np.nan)
