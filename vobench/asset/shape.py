"""Shapes as meshes: lengths in metres, texture coordinates in metres, normals outward."""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from vobench.asset.polygon import oriented, triangulated
from vobench.asset.wall import Hole
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit
from vobench.scene.mesh import Faces, MeshArrays, face_normals, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

SMOOTH_DEG = 40.0  # a profile that bends by less is shaded as round there
LEAST_AREA_M2 = 1e-12  # twice the area below which a face of a grid is left out
WHOLE_PICTURE: Hole = (0.0, 1.0, 0.0, 1.0)
LARGEST_BEVEL = 0.45  # of half the shortest side of a block


def at(
    x_m: float = 0.0,
    y_m: float = 0.0,
    z_m: float = 0.0,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
) -> Array:
    """The pose (4, 4) at a position, rotated by Rz(yaw) Ry(pitch) Rx(roll) in degrees."""
    angles_rad = np.deg2rad([yaw, pitch, roll])
    cz, cy, cx = np.cos(angles_rad)
    sz, sy, sx = np.sin(angles_rad)
    Rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    Ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    Rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return se3.transform(Rz @ Ry @ Rx, [x_m, y_m, z_m])


def block(
    size_m: ArrayLike,
    *,
    bevel_m: float = 0.003,
    uv_m: ArrayLike = (0.0, 0.0),
    transform: Array | None = None,
) -> "Trimesh":
    """A box around the origin with bevelled edges, shaded as round; u runs along the longer side of each face.

    uv_m: where its texture begins; transform: the pose (4, 4) that it is moved to, if any.
    """
    arrays = block_arrays(size_m, bevel_m=bevel_m, uv_m=uv_m)
    return arrays.mesh() if transform is None else arrays.moved(transform).mesh()


def block_arrays(
    size_m: ArrayLike,
    *,
    bevel_m: float = 0.003,
    uv_m: ArrayLike = (0.0, 0.0),
) -> MeshArrays:
    """The arrays of `block`."""
    half_m = np.asarray(size_m, float) / 2
    bevel = min(bevel_m, LARGEST_BEVEL * half_m.min())
    if bevel > 0:
        cube = _bevelled_cube()
        vertices_m = cube.signs * (half_m - bevel * (1 - cube.sides))
    else:
        cube = _cube()
        vertices_m = cube.signs * half_m

    corners_m = vertices_m[cube.faces]
    normals = cube.normals if half_m.all() else _flat_normals(corners_m)  # those of a plate's rim are 0
    longest_first = tuple(np.argsort(-half_m, kind="stable").tolist())
    uv = corners_m[cube.uv_index(longest_first)] + np.asarray(uv_m, float)
    return MeshArrays(
        corners_m.reshape(-1, 3),
        np.arange(3 * len(corners_m)).reshape(-1, 3),
        uv.reshape(-1, 2),
        normals.reshape(-1, 3),
    )


def _flat_normals(corners_m: Array) -> Array:
    """The normal of each face at its three corners (F, 3, 3)."""
    return np.repeat(face_normals(corners_m)[:, None], 3, axis=1)


def _uv_axes(corners_m: Array, order: Sequence[int]) -> NDArray[np.int64]:
    """The two axes (F, 2) along which the texture of each face (F, 3, 3) runs.

    They are those of the axis that the face faces most; u is along the first in `order` that is not this one.
    """
    prefers_x = np.array([2e-6, 1e-6, 0])  # so that faces at 45° have one axis on every machine
    facing = np.argmax(np.abs(face_normals(corners_m)) + prefers_x, axis=1)
    axes_across = np.array([_others(order, normal) for normal in range(3)])
    return np.asarray(axes_across[facing])


def _others(order: Sequence[int], normal: int) -> list[int]:
    """The axes in `order` but one."""
    return [axis for axis in order if axis != normal]


class _Cube:
    """The faces of a cube around the origin, whose size does not matter to its normals and directions."""

    def __init__(self, signs: Array, faces: Faces, sides: Array) -> None:
        """Signs (V, 3) of its corners, faces (F, 3), and the axis (V, 3) of the side that each vertex is on, or 0."""
        self.signs = signs
        self.faces = faces
        self.sides = sides
        self._corners = (signs * (1 - 0.1 * (1 - sides)))[faces] if sides.any() else signs[faces]
        self.normals = (signs * sides)[faces] if sides.any() else _flat_normals(self._corners)
        self._uv_indices: dict[tuple[int, ...], tuple[NDArray[np.int64], ...]] = {}

    def uv_index(
        self,
        order: tuple[int, ...],
    ) -> tuple[NDArray[np.int64], ...]:
        """The index of u and v (F, 3, 2) in corners (F, 3, 3), as `_uv_axes` has them."""
        if order not in self._uv_indices:
            axes = _uv_axes(self._corners, order)
            face = np.arange(len(self.faces))[:, None, None]
            corner = np.arange(3)[None, :, None]
            self._uv_indices[order] = (face, corner, axes[:, None, :])
        return self._uv_indices[order]


@cache
def _bevelled_cube() -> _Cube:
    """A cube of 24 vertices, each of its corners three times, and 44 faces; vertex 3 c + a is on the side of axis a."""
    signs = np.repeat(_cube().signs, 3, axis=0)
    sides = np.eye(3)[np.arange(24) % 3]
    vertices = signs * (1 - 0.1 * (1 - sides))
    hull = scipy.spatial.ConvexHull(vertices)
    return _Cube(signs, _outward(vertices, hull.simplices), sides)


@cache
def _cube() -> _Cube:
    """A cube of 8 vertices and 12 faces."""
    grid = np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0], indexing="ij")
    signs = np.stack(grid, axis=-1).reshape(-1, 3)
    quadrilaterals = np.array(
        [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ]
    )
    halves = [[0, 1, 2], [0, 2, 3]]
    faces = _outward(signs, quadrilaterals[:, halves].reshape(-1, 3))
    return _Cube(signs, faces, np.zeros((8, 3)))


def _outward(vertices: Array, faces: Faces) -> Faces:
    """The faces of a convex body around the origin, counter-clockwise from outside."""
    corners = vertices[faces]
    a = corners[:, 0]
    area_vectors = cross(corners[:, 1] - a, corners[:, 2] - a)
    is_inward = np.einsum("fk,fk->f", area_vectors, a) < 0
    return np.where(is_inward[:, None], faces[:, ::-1], faces).astype(np.int64)


def _grids(points_m: Array, normals: Array, uv: Array) -> MeshArrays:
    """Grids (B, R, C, 3) of vertices, seen from the side of columns × rows, without faces that have no area."""
    grids, rows, columns = points_m.shape[:3]
    index = np.arange(grids * rows * columns).reshape(grids, rows, columns)
    a = index[:, :-1, :-1].ravel()
    b = index[:, :-1, 1:].ravel()
    c = index[:, 1:, 1:].ravel()
    d = index[:, 1:, :-1].ravel()
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)

    vertices_m = points_m.reshape(-1, 3)
    p = vertices_m[faces[:, 0]]
    q = vertices_m[faces[:, 1]]
    r = vertices_m[faces[:, 2]]
    has_area = np.linalg.norm(cross(q - p, r - p), axis=1) > LEAST_AREA_M2
    return MeshArrays(vertices_m, faces[has_area], uv.reshape(-1, 2), normals.reshape(-1, 3))


def _circle(sections: int) -> tuple[Array, Array]:
    """Angles (sections + 1,) of a full turn and points (sections + 1, 2) of the unit circle, the last as the first."""
    angle_rad = np.linspace(0, 2 * np.pi, sections + 1)
    points = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
    points[-1] = points[0]
    return angle_rad, points


def _arc_length_m(steps_m: Array) -> Array:
    """Distances (N + 1,) along a polyline of N steps (N, K) from its start."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps_m, axis=1))])


def lathe(profile_m: ArrayLike, *, sections: int = 24) -> "Trimesh":
    """A solid of revolution about z; its profile (K, 2) of radius and height runs from the axis below to that above."""
    profile = np.asarray(profile_m, float)
    segments = np.stack([profile[:-1], profile[1:]], axis=1)  # (K - 1, 2, 2), both ends of each
    steps = np.diff(profile, axis=0)
    outward = unit(np.stack([steps[:, 1], -steps[:, 0]], axis=1))  # (K - 1, 2)

    angle_rad, circle = _circle(sections)
    points = _revolved(segments, circle)
    normals = _revolved(_profile_normals(outward), circle)

    length = _arc_length_m(steps)
    ends = np.stack([length[:-1], length[1:]], axis=1)
    along = np.broadcast_to(ends[..., None], points.shape[:3])
    around = np.broadcast_to(angle_rad * profile[:, 0].max(), along.shape)
    is_level = (np.abs(outward[:, 1]) > 0.9)[:, None, None, None]
    wrapped = np.stack([around, along], axis=-1)
    uv = np.where(is_level, points[..., :2], wrapped)
    return _grids(points, normals, uv).mesh()


def _profile_normals(outward: Array) -> Array:
    """Normals (K, 2, 2) at both ends of a profile's segments, the mean of both segments' where it is smooth."""
    normals = np.stack([outward, outward], axis=1)
    cosine = np.einsum("kj,kj->k", outward[:-1], outward[1:])
    is_smooth = cosine > np.cos(np.deg2rad(SMOOTH_DEG))
    mean = unit(outward[:-1] + outward[1:])[is_smooth]
    normals[1:, 0][is_smooth] = mean
    normals[:-1, 1][is_smooth] = mean
    return normals


def _revolved(pairs: Array, circle: Array) -> Array:
    """Vectors (K, 2, 2) of radius and height, at every point of a circle (C, 2): (K, 2, C, 3)."""
    level = pairs[..., None, :1] * circle
    height = np.broadcast_to(pairs[..., None, 1:], (*level.shape[:-1], 1))
    return np.concatenate([level, height], axis=-1)


def spline(points_m: ArrayLike, count: int = 16) -> Array:
    """Points (count, 3) of a smooth curve through the given ones, which are evenly spaced in its parameter."""
    points = np.asarray(points_m, float)
    t = np.linspace(0, 1, count)
    if len(points) == 3:
        # A parabola, for which the spline would call a solver of dense systems.
        weights = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=1)
        return np.asarray(weights @ points)
    knots = np.linspace(0, 1, len(points))
    return np.asarray(scipy.interpolate.CubicSpline(knots, points)(t))


def tube(
    path_m: ArrayLike,
    radius_m: float,
    *,
    sections: int = 8,
) -> "Trimesh":
    """A round rod along a polyline (N, 3), closed by flat ends."""
    return tube_arrays(path_m, radius_m, sections=sections).mesh()


def tube_arrays(
    path_m: ArrayLike,
    radius_m: float,
    *,
    sections: int = 8,
) -> MeshArrays:
    """The arrays of `tube`."""
    path = np.asarray(path_m, float)
    steps = np.diff(path, axis=0)
    tangents = _tangents(unit(steps))
    axes = _cross_section_axes(tangents)

    angle_rad, circle = _circle(sections)
    normals = np.einsum("cj,njk->nck", circle, axes)
    rings = path[:, None] + radius_m * normals  # (N, C, 3)
    along, around = np.broadcast_arrays(_arc_length_m(steps)[:, None], angle_rad * radius_m)
    uv = np.stack([along, around], axis=-1)

    end_uv = circle * radius_m
    return joined_arrays(
        [
            _grids(rings[None], normals[None], uv[None]),
            _disc(path[0], rings[0], -tangents[0], end_uv),
            _disc(path[-1], rings[-1], tangents[-1], end_uv),
        ]
    )


def _tangents(directions: Array) -> Array:
    """Unit tangents (N, 3) at the vertices of a polyline with segments along (N - 1, 3)."""
    inner = directions[:-1] + directions[1:]
    return unit(np.concatenate([directions[:1], inner, directions[-1:]]))


def _cross_section_axes(tangents: Array) -> Array:
    """Two axes (N, 2, 3) across each of the tangents (N, 3) that twist as little as they can from one to the next."""
    least_aligned = np.abs(tangents[0]).argmin()
    axes = [unit(cross(tangents[0], np.eye(3)[least_aligned]))]
    for tangent in tangents[1:]:
        along = tangent * (axes[-1] @ tangent)
        axes.append(unit(axes[-1] - along))
    first = np.array(axes)
    return np.stack([first, cross(tangents, first)], axis=1)


def _disc(
    center_m: Array,
    ring_m: Array,
    normal: Array,
    uv: Array,
) -> MeshArrays:
    """The flat end of a tube within a ring (C, 3) of vertices, seen from the side of its normal."""
    rows = np.stack([np.broadcast_to(center_m, ring_m.shape), ring_m])
    places = np.stack([0 * uv, uv])
    if cross(ring_m[1] - ring_m[0], ring_m[0] - center_m) @ normal < 0:
        rows = rows[::-1]
        places = places[::-1]
    normals = np.broadcast_to(normal, (1, *rows.shape))
    return _grids(rows[None], normals, places[None])


def cushion(
    size_m: ArrayLike,
    *,
    power: float = 5.0,
    cells: int = 6,
) -> "Trimesh":
    """A superellipsoid around the origin: |x/a|^p + |y/b|^p + |z/c|^p = 1; 2 is an ellipsoid, more is boxier."""
    half_m = np.asarray(size_m, float) / 2
    steps = np.linspace(-1, 1, cells + 1)
    v, u = np.meshgrid(steps, steps, indexing="ij")

    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.stack([u * sign, v, sign + 0 * u], axis=-1)
            sides.append(np.roll(side, axis, axis=-1))
    cube = np.stack(sides)  # (6, R, C, 3)

    # The cube's points, projected onto the superellipsoid from its centre; normals are the equation's gradient.
    radius = np.linalg.norm(cube, ord=power, axis=-1, keepdims=True)
    points = cube / radius
    gradient = np.sign(points) * np.abs(points) ** (power - 1) / half_m
    points_m = points * half_m
    uv = [np.roll(points_m[k], -(k // 2), axis=-1)[..., :2] for k in range(6)]
    return _grids(points_m, unit(gradient), np.stack(uv)).mesh()


def sheet(points_m: ArrayLike) -> "Trimesh":
    """A smooth surface through a grid (R, C, 3), seen from the side of columns × rows."""
    return sheet_arrays(points_m).mesh()


def sheet_arrays(points_m: ArrayLike) -> MeshArrays:
    """The arrays of `sheet`."""
    points = np.asarray(points_m, float)
    along_rows = np.gradient(points, axis=0)
    along_columns = np.gradient(points, axis=1)
    normals = unit(cross(along_columns, along_rows))
    uv = np.stack([_grid_length_m(points, 1), _grid_length_m(points, 0)], axis=-1)
    return _grids(points[None], normals[None], uv[None])


def _grid_length_m(points_m: Array, axis: int) -> Array:
    """Distances (R, C) along the lines of a grid (R, C, 3) that run along an axis, from its border."""
    border = np.take(points_m, [0], axis)
    steps = np.diff(points_m, axis=axis, prepend=border)
    return np.cumsum(np.linalg.norm(steps, axis=2), axis=axis)


def card(
    size_m: tuple[float, float],
    *,
    cell: Hole = WHOLE_PICTURE,
) -> "Trimesh":
    """An upright rectangle around the origin that faces x and shows a cell of a picture, in shares of its sides."""
    return card_arrays(size_m, cell=cell).mesh()


def card_arrays(
    size_m: tuple[float, float],
    *,
    cell: Hole = WHOLE_PICTURE,
) -> MeshArrays:
    """The arrays of `card`."""
    width, height = size_m
    u0, u1, v0, v1 = cell
    rectangle = quad_arrays((0, -width / 2, -height / 2), (0, width, 0), (0, 0, height))
    uv = np.array([[u0, v1], [u1, v1], [u1, v0], [u0, v0]])
    return MeshArrays(rectangle.vertices_m, rectangle.faces, uv, rectangle.normals)


def cards(sizes_m: ArrayLike, poses: ArrayLike) -> "Trimesh":
    """Rectangles as of `card`, of sizes (N, 2) and at rigid poses (N, 4, 4), seen from both sides, as one mesh."""
    return cards_arrays(sizes_m, poses).mesh()


def cards_arrays(sizes_m: ArrayLike, poses: ArrayLike) -> MeshArrays:
    """The arrays of `cards`."""
    sizes = np.asarray(sizes_m, float).reshape(-1, 2)
    T = np.asarray(poses, float).reshape(-1, 4, 4)
    R = T[:, :3, :3]
    one = card_arrays((1.0, 1.0))
    width = sizes[:, 0, None]
    height = sizes[:, 1, None]
    y = -width / 2 + [0.0, 1.0, 1.0, 0.0] * width
    z = -height / 2 + [0.0, 0.0, 1.0, 1.0] * height
    corners_m = np.stack([0 * y, y, z], axis=-1)  # (N, 4, 3)

    front = corners_m @ R.swapaxes(1, 2) + T[:, None, :3, 3]
    normals = unit(one.normals @ np.linalg.inv(R))
    vertices_m = np.stack([front, front], axis=1)  # (N, 2, 4, 3), front and back
    both_normals = np.stack([normals, -normals], axis=1)
    faces = np.concatenate([one.faces, one.faces[:, ::-1] + 4])
    first_vertex = 8 * np.arange(len(sizes))
    return MeshArrays(
        vertices_m.reshape(-1, 3),
        (first_vertex[:, None, None] + faces).reshape(-1, 3),
        np.tile(one.uv, (2 * len(sizes), 1)),
        both_normals.reshape(-1, 3),
    )


def extrusion(
    polygon_m: ArrayLike,
    height_m: float,
    *,
    holes_m: Sequence[ArrayLike] = (),
) -> "Trimesh":
    """A prism between z = 0 and height_m over a polygon (N, 2) less holes within it, in any orientation."""
    outline = oriented(polygon_m, counter_clockwise=True)
    holes = [oriented(hole, counter_clockwise=False) for hole in holes_m]
    rings = [outline, *holes]

    triangles = triangulated(rings)
    heights = np.full((*triangles.shape[:2], 1), height_m)
    top = np.concatenate([triangles, heights], axis=-1)
    bottom = top[:, ::-1] * [1, 1, 0]

    parts = [_cap(top), _cap(bottom)]
    for ring in rings:
        for start, end in pairwise([*ring, ring[0]]):
            parts.append(quad_arrays((*start, 0), (*(end - start), 0), (0, 0, height_m)))
    return joined_arrays(parts).mesh()


def _cap(corners_m: Array) -> MeshArrays:
    """Level faces (F, 3, 3), textured in x and y."""
    uv = np.take_along_axis(corners_m, _uv_axes(corners_m, range(3))[:, None, :], axis=2)
    return MeshArrays(
        corners_m.reshape(-1, 3),
        np.arange(3 * len(corners_m)).reshape(-1, 3),
        uv.reshape(-1, 2),
        _flat_normals(corners_m).reshape(-1, 3),
    )
