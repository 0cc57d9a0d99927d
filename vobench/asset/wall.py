"""Walls: rectangles with rectangular holes, and the reveals of these holes."""

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

# A lap lies this far behind a wall's edge and reaches this far to both sides of it.
LAP_BEHIND_M = 0.002
LAP_M = 0.01
Hole = tuple[float, float, float, float]  # first and last u, first and last v, in metres from a wall's corner


def pierced(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    holes: Sequence[Hole] = (),
) -> "Trimesh":
    """A rectangle less rectangular holes, cut into a grid along their edges, with laps behind its four borders.

    The laps stop the light that would pass where two walls only touch.
    """
    corner = np.asarray(corner_m, float)
    u = np.asarray(edge_u_m, float)
    v = np.asarray(edge_v_m, float)
    width_m = float(np.linalg.norm(u))
    height_m = float(np.linalg.norm(v))

    behind = -LAP_BEHIND_M * unit(cross(u, v))
    cells = [_rectangle(corner, u, v, cell) for cell in _solid_cells(width_m, height_m, holes)]
    laps = [_rectangle(corner + behind, u, v, lap) for lap in _laps(width_m, height_m)]
    return joined_arrays(cells + laps).mesh()


def _solid_cells(
    width_m: float,
    height_m: float,
    holes: Sequence[Hole],
) -> list[Hole]:
    """The cells of the grid through all edges of the holes that lie in no hole."""
    edges_u = [edge for hole in holes for edge in hole[:2]]
    edges_v = [edge for hole in holes for edge in hole[2:]]
    lines_u = np.unique([0, width_m, *edges_u])
    lines_v = np.unique([0, height_m, *edges_v])

    cells = []
    for u0, u1 in pairwise(lines_u):
        for v0, v1 in pairwise(lines_v):
            if not _is_in_hole((u0 + u1) / 2, (v0 + v1) / 2, holes):
                cells.append((u0, u1, v0, v1))
    return cells


def _is_in_hole(u: float, v: float, holes: Sequence[Hole]) -> bool:
    return any(u0 < u < u1 and v0 < v < v1 for u0, u1, v0, v1 in holes)


def _laps(width_m: float, height_m: float) -> list[Hole]:
    """Strips along the four borders of a rectangle, as cells of it."""
    inner = -LAP_M
    outer = LAP_M
    along_u = [(inner, width_m - inner, edge + inner, edge + outer) for edge in (0, height_m)]
    along_v = [(edge + inner, edge + outer, inner, height_m - inner) for edge in (0, width_m)]
    return along_u + along_v


def _rectangle(
    corner: Array,
    u: Array,
    v: Array,
    cell: Hole,
) -> MeshArrays:
    """A cell of a wall, whose texture continues that of its neighbours."""
    u0, u1, v0, v1 = cell
    axis_u = unit(u)
    axis_v = unit(v)
    cell_corner = corner + u0 * axis_u + v0 * axis_v
    return quad_arrays(cell_corner, (u1 - u0) * axis_u, (v1 - v0) * axis_v, (u0, v0))


def reveal(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    hole: Hole,
    depth_m: float,
) -> "Trimesh":
    """The four sides of a rectangle's hole, down to depth_m behind its face."""
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
