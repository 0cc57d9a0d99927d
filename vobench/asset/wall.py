"""Walls and floors: rectangles with rectangular holes, the reveals of the holes, and floors of planks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit
from vobench.scene.mesh import as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

# The distance of a lap behind the edge of a wall, and its extent to both sides of the edge.
LAP_BEHIND_M = 0.002
LAP_M = 0.01
Hole = tuple[float, float, float, float]  # first and last u, first and last v, in metres from the corner of a wall


def pierced(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    holes: Sequence[Hole] = (),
    *,
    doors: Sequence[Hole] = (),
) -> "Trimesh":
    """A rectangle with rectangular holes, which is divided into a grid along their edges, with laps behind its borders.

    The laps block light that would otherwise leak through the line where two walls touch. `doors` are further holes,
    which reach the lower border and interrupt the lap there.
    """
    corner = np.asarray(corner_m, float)
    u = np.asarray(edge_u_m, float)
    v = np.asarray(edge_v_m, float)
    width_m = float(np.linalg.norm(u))
    height_m = float(np.linalg.norm(v))

    rectangles = [_rectangle(corner, u, v, cell) for cell in _solid_cells(width_m, height_m, [*holes, *doors])]
    return as_mesh(joined_arrays(rectangles + _laps(corner, u, v, doors)))


def _laps(corner: Array, u: Array, v: Array, doors: Sequence[Hole] = ()) -> list[MeshArrays]:
    """A lap behind each of the four borders of a rectangle."""
    behind = -LAP_BEHIND_M * unit(cross(u, v))
    cells = _lap_cells(float(np.linalg.norm(u)), float(np.linalg.norm(v)), doors)
    return [_rectangle(corner + behind, u, v, cell) for cell in cells]


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


def _lap_cells(width_m: float, height_m: float, doors: Sequence[Hole]) -> list[Hole]:
    """A strip along each of the four borders: bottom, top, left and right."""
    full_u = (-LAP_M, width_m + LAP_M)
    full_v = (-LAP_M, height_m + LAP_M)
    door_spans = sorted((u0, u1) for u0, u1, _, _ in doors)
    starts = [full_u[0], *(u1 for _, u1 in door_spans)]
    ends = [*(u0 for u0, _ in door_spans), full_u[1]]
    bottom = [(start, end, -LAP_M, LAP_M) for start, end in zip(starts, ends, strict=True)]
    top = (*full_u, height_m - LAP_M, height_m + LAP_M)
    left = (-LAP_M, LAP_M, *full_v)
    right = (width_m - LAP_M, width_m + LAP_M, *full_v)
    return [*bottom, top, left, right]


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
    return as_mesh(joined_arrays(sides))


# --- Planks ---

Planks = Sequence[Sequence[float]]
SHORTEST_PLANK_M = 0.25
CUT_GRID_M = 0.01  # of the ends of planks, so that ends in neighbouring rows are at one place or well apart


@dataclass(frozen=True, slots=True)
class _Plank:
    """A plank of a floor from u0 to u1, and where its picture begins in the texture (u, v)."""

    u0: float
    u1: float
    texture_u_m: float
    texture_v_m: float


def planked(
    corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, planks: Planks, tile_m: float, *, seed: int = 0
) -> "Trimesh":
    """A rectangle like that of `pierced`, whose planks along u are those of a texture in random order.

    The planks of a tile would otherwise form the same pattern in every repeat. `planks` is that of
    `picture.LazyTexture`. Each plank is used once before any is used again.
    """
    corner = np.asarray(corner_m, float)
    u = np.asarray(edge_u_m, float)
    v = np.asarray(edge_v_m, float)
    width_m = float(np.linalg.norm(u))
    height_m = float(np.linalg.norm(v))
    row_m = tile_m / len(planks)
    lines_v = np.append(np.arange(0.0, height_m - CUT_GRID_M, row_m), height_m)

    rng = np.random.default_rng(seed)
    supply = _supply(planks, tile_m, rng)
    rows = [_plank_row(supply, width_m, rng) for _ in range(len(lines_v) - 1)]
    ends = [_ends(row) for row in rows]

    # Along a line between two rows, the corners of both are vertices, so that no seam opens between them.
    vertices_uv = list[Array]()
    texture_uv = list[Array]()
    for index, row in enumerate(rows):
        below = np.union1d(ends[max(index - 1, 0)], ends[index])
        above = np.union1d(ends[index], ends[min(index + 1, len(rows) - 1)])
        v0, v1 = lines_v[index : index + 2]
        for plank in row:
            triangles_uv = _plank_triangles(plank, below, above, v0=v0, v1=v1)
            in_texture = [plank.texture_u_m - plank.u0, plank.texture_v_m - v0]
            vertices_uv.append(triangles_uv)
            texture_uv.append(triangles_uv + in_texture)

    places_uv = np.concatenate(vertices_uv)  # (V, 2)
    vertices_m = corner + places_uv @ np.stack([unit(u), unit(v)])
    faces = np.arange(len(places_uv)).reshape(-1, 3)
    normals = np.tile(unit(cross(u, v)), (len(places_uv), 1))
    floor = MeshArrays(vertices_m, faces, np.concatenate(texture_uv), normals)
    return as_mesh(joined_arrays([floor, *_laps(corner, u, v)]))


def _ends(row: Sequence[_Plank]) -> Array:
    """The places along u where the planks of a row begin and end."""
    return np.array([row[0].u0, *(plank.u1 for plank in row)])


def _supply(planks: Planks, tile_m: float, rng: np.random.Generator) -> Iterator[tuple[float, float, float]]:
    """Planks without end: where each begins in the texture, (u, v), and its length."""
    row_m = tile_m / len(planks)
    known = list[tuple[float, float, float]]()
    for number, cuts in enumerate(planks):
        for begin, end in pairwise([*cuts, cuts[0] + 1]):
            length_m = np.floor((end - begin) * tile_m / CUT_GRID_M) * CUT_GRID_M
            if length_m >= SHORTEST_PLANK_M:
                known.append((begin * tile_m, number * row_m, float(length_m)))
    while True:
        for index in rng.permutation(len(known)).tolist():
            yield known[index]


def _plank_row(supply: Iterator[tuple[float, float, float]], width_m: float, rng: np.random.Generator) -> list[_Plank]:
    """The planks of a row from 0 to `width_m`, of which the first and the last one are sawn off."""
    row = list[_Plank]()
    end_m = 0.0
    while end_m < width_m:
        texture_u_m, texture_v_m, length_m = next(supply)
        sawn_m = 0.0
        if not row:
            sawn_m = CUT_GRID_M * float(rng.integers(round((length_m - SHORTEST_PLANK_M / 2) / CUT_GRID_M)))
        begin_m = end_m
        end_m = round((begin_m + length_m - sawn_m) / CUT_GRID_M) * CUT_GRID_M
        row.append(_Plank(begin_m, min(end_m, width_m), texture_u_m + sawn_m, texture_v_m))
        if width_m - end_m < CUT_GRID_M:
            break
    row[-1] = replace(row[-1], u1=width_m)
    return row


def _plank_triangles(plank: _Plank, below: Array, above: Array, *, v0: float, v1: float) -> Array:
    """The corners (3 F, 2) of a plank's triangles, with vertices at places along its lower and its upper side."""
    lower = below[(below >= plank.u0) & (below <= plank.u1)]
    upper = above[(above >= plank.u0) & (above <= plank.u1)]
    corners = list[tuple[float, float]]()
    i = 0
    j = 0
    while i < len(lower) - 1 or j < len(upper) - 1:
        has_upper_left = j < len(upper) - 1
        advances_lower = i < len(lower) - 1 and not (has_upper_left and upper[j + 1] < lower[i + 1])
        if advances_lower:
            corners += [(lower[i], v0), (lower[i + 1], v0), (upper[j], v1)]
            i += 1
        else:
            corners += [(lower[i], v0), (upper[j + 1], v1), (upper[j], v1)]
            j += 1
    return np.array(corners)
