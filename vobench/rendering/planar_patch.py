"""Planar patches: the faces of a thing that lie in one plane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices
from vobench.scene.triangles import Triangles
from vobench.scene.weld import distinct_rows

# Faces are in one plane if their normals and their offsets from the origin differ by no more than about this.
FLAT_RAD = 1e-3
FLAT_M = 1e-3


@dataclass(frozen=True, slots=True)
class PlanarPatch:
    """Faces (K,) of a table in one plane that face the same side: their corners (K, 3, 3) and normal (3,)."""

    faces: Indices
    corners_m: Array
    normal: Array

    def height_m(self, points_m: Floats) -> Floats:
        """The heights (...) of points (..., 3) above the plane, in m."""
        return np.asarray((points_m - self.corners_m[0, 0]) @ self.normal)

    def coincides(self, other: "PlanarPatch") -> bool:
        """Whether they are the front and the back of one sheet."""
        middle_m = self.corners_m.mean((0, 1))
        other_middle_m = other.corners_m.mean((0, 1))
        apart_m = np.abs(middle_m - other_middle_m).max()
        return bool(apart_m < FLAT_M and self.normal @ other.normal < 0)


def planar_patches(
    faces: Triangles,
    among: ArrayLike,
    *,
    at_least_m2: float = 0.0,
) -> list[PlanarPatch]:
    """The faces `among` (K,) of a table as patches, one for each plane of each thing, without smaller ones."""
    rows = np.asarray(among, np.int32)
    offset = np.einsum("ij,ij->i", faces.plane[rows], faces.corners_m[rows, 0])
    normal_cells = faces.plane[rows] / FLAT_RAD
    cells = np.column_stack([normal_cells, offset / FLAT_M, faces.thing[rows]])
    group = distinct_rows(np.rint(cells).astype(np.int64)).inverse
    patches = []
    for number in range(group.max(initial=-1) + 1):
        members = rows[group == number]
        normal = unit(faces.plane[members].mean(0))
        patches.append(PlanarPatch(members, faces.corners_m[members], normal))
    return [patch for patch in patches if areas_m2(patch.corners_m).sum() >= at_least_m2]
