"""Replaces the material of the floor of a place."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vobench.errors import SuiteError
from vobench.geometry.triangle import areas_m2
from vobench.scene.triangles import Thing, triangle_table
from vobench.suite.level_floor import level_floor

FLOOR = "floor"  # the name of its material
DOWNWARD = -0.99  # the normal's z of faces that face down, which nobody sees of a floor
FLOOR_SHARE = 0.5  # of the other faces' area of a thing: if more is at the floor's height, the thing belongs to it


def with_floor(things: Sequence[Thing]) -> tuple[Thing, ...]:
    """Things of which those that form the level floor have the material FLOOR. So do rugs and markings on it.

    The lining of a doorway, of which only a strip is floor, keeps its material.

    Raises SuiteError if there is no level floor.
    """
    stationary = [-1] * len(things)
    faces = triangle_table(things, mover=stationary, lamp=stationary)
    floor = level_floor(faces)
    if floor is None:
        raise SuiteError("the scene has no level floor, whose material could be replaced")

    areas = areas_m2(faces.corners_m)
    is_seen = faces.plane[:, 2] > DOWNWARD
    seen_m2 = np.bincount(faces.thing, areas * is_seen, minlength=len(things))
    floor_m2 = np.bincount(faces.thing, areas * floor.is_floor, minlength=len(things))
    belongs = floor_m2 > FLOOR_SHARE * seen_m2
    return tuple(
        replace(thing, material=FLOOR) if is_floor else thing for thing, is_floor in zip(things, belongs, strict=True)
    )
