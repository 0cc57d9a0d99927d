"""Builds walls, which are rectangles with rectangular holes, and the reveals of the holes."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit
from vobench.scene.mesh import MeshArrays, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

# The distance of a lap behind the edge of a wall, and its extent to both sides of the edge.
LAP_BEHIND_M = 0.002
LAP_M = 0.01
Hole = tuple[float, float, float, float]  # first and last u, first and last v, in metres from the corner of a wall


def pierced(corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, holes: Sequence[Hole] = ()) -> "Trimesh":
    """A rectangle with rectangular holes, which is divided into a grid along their edges, with laps behind its borders.

    The laps block light that would otherwise leak through the line where two walls touch.
    """
    corner = np.asarray(corner_m, float)
    u = np.asarray(edge_u_m, float)
    v = np.asarray(edge_v_m, float)
    width_m = float(np.linalg.norm(u))
    height_m = float(np.linalg.norm(v))

    rectangles = [_rectangle(corner, u, v, cell) for cell in _solid_cells(width_m, height_m, holes)]
    behind = -LAP_BEHIND_M * unit(cross(u, v))
    laps = [_rectangle(corner + behind, u, v, cell) for cell in _lap_cells(width_m, height_m)]
    return joined_arrays(rectangles + laps).mesh()


def _solid_cells(width_m: float, height_m: float, holes: Sequence[Hole]) -> list[Hole]:
    """The cells outside of all holes, in the grid of lines through the edges of the holes."""
    lines_u = [0, width_m]
    lines_v = [0, height_m]
    for u0, u1, v0, v1 in holes:
        lines_u += [u0, u1]
        lines_v += [v0, v1]

    sorted_u = np.unique(lines_u)
    sorted_v = np.unique(lines_v)

    cells = []
    for u0, u1 in pairwise(sorted_u):
        for v0, v1 in pairwise(sorted_v):
            middle_u = (u0 + u1) / 2
            middle_v = (v0 + v1) / 2
            if not _is_in_hole(middle_u, middle_v, holes):
                cells.append((u0, u1, v0, v1))
    return cells


def _is_in_hole(u: float, v: float, holes: Sequence[Hole]) -> bool:
    return any(u0 < u < u1 and v0 < v < v1 for u0, u1, v0, v1 in holes)


def _lap_cells(width_m: float, height_m: float) -> list[Hole]:
    """A strip along each of the four borders: bottom, top, left and right."""
    full_u = (-LAP_M, width_m + LAP_M)
    full_v = (-LAP_M, height_m + LAP_M)
    return [
        (*full_u, -LAP_M, LAP_M),
        (*full_u, height_m - LAP_M, height_m + LAP_M),
        (-LAP_M, LAP_M, *full_v),
        (width_m - LAP_M, width_m + LAP_M, *full_v),
    ]


def _rectangle(corner: Array, u: Array, v: Array, cell: Hole) -> MeshArrays:
    """A cell of a wall, whose texture continues that of the neighbouring cells."""
    u0, u1, v0, v1 = cell
    axis_u = unit(u)
    axis_v = unit(v)
    cell_corner = corner + u0 * axis_u + v0 * axis_v
    edge_u = (u1 - u0) * axis_u
    edge_v = (v1 - v0) * axis_v
    return quad_arrays(cell_corner, edge_u, edge_v, (u0, v0))


def reveal(corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, hole: Hole, depth_m: float) -> "Trimesh":
    """The four inner sides of a hole in a wall, which end `depth_m` behind the face of the wall."""
    u = unit(edge_u_m)
    v = unit(edge_v_m)
    u0, u1, v0, v1 = hole

    corner = np.asarray(corner_m, float) + u0 * u + v0 * v
    across = (u1 - u0) * u
    along = (v1 - v0) * v
    inwards = -depth_m * cross(u, v)
    sides = [
        quad_arrays(corner, inwards, along),
        quad_arrays(corner + across, along, inwards),
        quad_arrays(corner, across, inwards),
        quad_arrays(corner + along, inwards, across),
    ]
    return joined_arrays(sides).mesh()
