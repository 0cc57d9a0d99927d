"""Creates meshes of basic shapes. Lengths and texture coordinates are in metres, and normals point outwards."""

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
from vobench.geometry.triangle import face_normals
from vobench.geometry.vector import cross, unit
from vobench.scene.mesh import as_mesh
from vobench.scene.mesh_arrays import Faces, MeshArrays, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

SMOOTH_DEG = 40.0  # a corner of a profile with a smaller angle is shaded as round
LEAST_AREA_M2 = 1e-12  # faces of a grid are omitted if twice their area is smaller
WHOLE_PICTURE: Hole = (0.0, 1.0, 0.0, 1.0)
LARGEST_BEVEL = 0.45  # the largest bevel, relative to half the shortest side of a block
BEVEL_OF_CUBE = 0.1  # the bevel of the bevelled unit cube, whose normals and uv axes do not depend on it
LEVEL_COSINE = 0.9  # faces of a lathe whose normals are closer to z have the texture of a disc


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
    upright: bool = False,
    transform: Array | None = None,
) -> "Trimesh":
    """A box around the origin with bevelled edges that are shaded as round.

    uv_m: the texture coordinates at its centre. upright: on the sides, u runs to the right and v down instead, as on a
    printed carton. transform: the pose (4, 4) of the box; the identity by default.
    """
    arrays = block_arrays(size_m, bevel_m=bevel_m, uv_m=uv_m, upright=upright)
    return as_mesh(arrays if transform is None else arrays.moved(transform))


def block_arrays(
    size_m: ArrayLike,
    *,
    bevel_m: float = 0.003,
    uv_m: ArrayLike = (0.0, 0.0),
    upright: bool = False,
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
    has_thickness = half_m.all()
    # The rim of a plate without thickness has no area, so its normals are 0.
    normals = cube.normals if has_thickness else _flat_normals(corners_m)

    if upright:
        uv = _upright_uv(corners_m)
    else:
        longest_first = tuple(np.argsort(-half_m, kind="stable").tolist())
        uv = corners_m[cube.uv_index(longest_first)]
    uv = uv + np.asarray(uv_m, float)
    return MeshArrays(
        corners_m.reshape(-1, 3),
        np.arange(3 * len(corners_m)).reshape(-1, 3),
        uv.reshape(-1, 2),
        normals.reshape(-1, 3),
    )


def _upright_uv(corners_m: Array) -> Array:
    """The texture coordinates (F, 3, 2) of faces (F, 3, 3) of a box: u to the right and v down, seen from outside.

    Upwards is z on the sides, and y on the top and the bottom.
    """
    axis = _projection_axes(corners_m)
    normals = np.eye(3)[axis] * np.sign(np.take_along_axis(face_normals(corners_m), axis[:, None], axis=1))
    is_side = axis < 2
    up = np.where(is_side[:, None], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    right = cross(up, normals)
    u = np.einsum("fij,fj->fi", corners_m, right)
    v = -np.einsum("fij,fj->fi", corners_m, up)
    return np.stack([u, v], axis=-1)


def _flat_normals(corners_m: Array) -> Array:
    """The normal of each face, repeated for its three corners (F, 3, 3)."""
    return np.repeat(face_normals(corners_m)[:, None], 3, axis=1)


def _uv_axes(corners_m: Array, order: Sequence[int]) -> NDArray[np.int64]:
    """The axes (F, 2) of u and v of each face (F, 3, 3), for a texture that is projected along x, y or z.

    The axis of projection is the one closest to the normal of the face. u and v run along the other two, in `order`.
    """
    uv_axes = np.array([_without(order, axis) for axis in range(3)])
    return np.asarray(uv_axes[_projection_axes(corners_m)])


def _projection_axes(corners_m: Array) -> NDArray[np.int64]:
    """The axis (F,) that is closest to the normal of each face (F, 3, 3)."""
    prefers_x = np.array([2e-6, 1e-6, 0])  # so that faces at 45° have the same axis on every machine
    alignment = np.abs(face_normals(corners_m)) + prefers_x
    return np.asarray(np.argmax(alignment, axis=1))


def _without(axes: Sequence[int], excluded: int) -> list[int]:
    """All axes except the excluded one, in the same order."""
    return [axis for axis in axes if axis != excluded]


class _Cube:
    """A cube around the origin that determines the vertices, normals and texture axes of blocks of any size."""

    def __init__(self, signs: Array, faces: Faces, sides: Array) -> None:
        """Create a cube, which is bevelled if `sides` are not 0.

        `signs` (V, 3) are the octants of the vertices, ±1 per axis. `faces` are (F, 3). `sides` (V, 3) are unit vectors
        along the axis of the side that contains a vertex.
        """
        self.signs = signs
        self.faces = faces
        self.sides = sides
        is_bevelled = sides.any()
        if is_bevelled:
            self._corners = _bevelled_vertices(signs, sides)[faces]
            self.normals = (signs * sides)[faces]
        else:
            self._corners = signs[faces]
            self.normals = _flat_normals(self._corners)
        self._uv_indices: dict[tuple[int, ...], tuple[NDArray[np.int64], ...]] = {}

    def uv_index(self, order: tuple[int, ...]) -> tuple[NDArray[np.int64], ...]:
        """The index that selects u and v (F, 3, 2) from the corners (F, 3, 3) of a block, as in `_uv_axes`."""
        if order not in self._uv_indices:
            axes = _uv_axes(self._corners, order)
            face = np.arange(len(self.faces))[:, None, None]
            corner = np.arange(3)[None, :, None]
            self._uv_indices[order] = (face, corner, axes[:, None, :])
        return self._uv_indices[order]


@cache
def _bevelled_cube() -> _Cube:
    """A cube with 44 faces and 24 vertices, three at each corner. Vertex 3 c + a is on the side of axis a."""
    signs = np.repeat(_cube().signs, 3, axis=0)
    sides = np.eye(3)[np.arange(24) % 3]
    vertices = _bevelled_vertices(signs, sides)
    hull = scipy.spatial.ConvexHull(vertices)
    return _Cube(signs, _outward(vertices, hull.simplices), sides)


def _bevelled_vertices(signs: Array, sides: Array) -> Array:
    """Vertices (V, 3) of a bevelled cube from -1 to 1."""
    return np.asarray(signs * (1 - BEVEL_OF_CUBE * (1 - sides)))


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
    """The faces of a convex body around the origin, with the orientation that makes them visible from outside."""
    corners = vertices[faces]
    a = corners[:, 0]
    b = corners[:, 1]
    c = corners[:, 2]
    area_vectors = cross(b - a, c - a)
    is_inward = np.einsum("fk,fk->f", area_vectors, a) < 0
    turned = faces[:, ::-1]
    return np.where(is_inward[:, None], turned, faces).astype(np.int64)


def _grids(points_m: Array, normals: Array, uv: Array) -> MeshArrays:
    """Two faces per cell of B grids of vertices (B, R, C, 3), without those that have no area.

    The faces are visible from the side to which the cross product of the column and the row direction points.
    """
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
    double_area_m2 = np.linalg.norm(cross(q - p, r - p), axis=1)
    has_area = double_area_m2 > LEAST_AREA_M2
    return MeshArrays(vertices_m, faces[has_area], uv.reshape(-1, 2), normals.reshape(-1, 3))


def _circle(sections: int) -> tuple[Array, Array]:
    """The angles (sections + 1,) of a full turn, and the points (sections + 1, 2) on the unit circle.

    The last point is equal to the first one.
    """
    angle_rad = np.linspace(0, 2 * np.pi, sections + 1)
    points = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
    points[-1] = points[0]
    return angle_rad, points


def _arc_length_m(steps_m: Array) -> Array:
    """The distances (N + 1,) along a polyline with segments `steps_m` (N, K) of its vertices from its start."""
    lengths_m = np.linalg.norm(steps_m, axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths_m)])


def lathe(profile_m: ArrayLike, *, sections: int = 24) -> "Trimesh":
    """A solid of revolution about z.

    `profile_m` (K, 2) are points (radius, height), from the bottom on the axis, along the outside, to the top on the
    axis.
    """
    profile = np.asarray(profile_m, float)
    segments = np.stack([profile[:-1], profile[1:]], axis=1)  # (K - 1, 2, 2), both ends of each segment
    steps = np.diff(profile, axis=0)
    outward = unit(np.stack([steps[:, 1], -steps[:, 0]], axis=1))  # (K - 1, 2), the normals of the segments

    angle_rad, circle = _circle(sections)
    points = _revolved(segments, circle)
    normals = _revolved(_profile_normals(outward), circle)

    # The texture is wrapped around the solid, except on level faces, on which it is projected along z.
    distance_m = _arc_length_m(steps)
    segment_distances_m = np.stack([distance_m[:-1], distance_m[1:]], axis=1)
    along = np.broadcast_to(segment_distances_m[..., None], points.shape[:3])
    around = np.broadcast_to(angle_rad * profile[:, 0].max(), along.shape)
    wrapped_uv = np.stack([around, along], axis=-1)
    level_uv = points[..., :2]
    is_level = np.abs(outward[:, 1]) > LEVEL_COSINE
    uv = np.where(is_level[:, None, None, None], level_uv, wrapped_uv)
    return as_mesh(_grids(points, normals, uv))


def _profile_normals(outward: Array) -> Array:
    """The normals (K, 2, 2) at both ends of the K segments of a profile, from the normals of the segments (K, 2).

    At a smooth corner, both segments have the mean of their normals.
    """
    normals = np.stack([outward, outward], axis=1)
    cosine = np.einsum("kj,kj->k", outward[:-1], outward[1:])
    is_smooth = cosine > np.cos(np.deg2rad(SMOOTH_DEG))
    mean = unit(outward[:-1] + outward[1:])[is_smooth]
    segment_starts = normals[1:, 0]
    segment_ends = normals[:-1, 1]
    segment_starts[is_smooth] = mean
    segment_ends[is_smooth] = mean
    return normals


def _revolved(vectors: Array, circle: Array) -> Array:
    """The vectors (K, 2, C, 3) from turning vectors (K, 2, 2), which are radius and height, around z.

    `circle` (C, 2) are the directions of the radius.
    """
    radius = vectors[..., None, :1]
    height = vectors[..., None, 1:]
    xy = radius * circle
    z = np.broadcast_to(height, (*xy.shape[:-1], 1))
    return np.concatenate([xy, z], axis=-1)


def spline(points_m: ArrayLike, count: int = 16) -> Array:
    """Points (count, 3) on a cubic spline through the given points (N, 3), which are evenly spaced in its parameter."""
    points = np.asarray(points_m, float)
    t = np.linspace(0, 1, count)
    if len(points) == 3:
        # The spline is a parabola. Its Lagrange form avoids the dense solver that SciPy would use.
        first = (1 - t) * (1 - 2 * t)
        middle = 4 * t * (1 - t)
        last = t * (2 * t - 1)
        weights = np.stack([first, middle, last], axis=1)
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
    return as_mesh(tube_arrays(path_m, radius_m, sections=sections))


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
    distance_m = _arc_length_m(steps)
    along, around = np.broadcast_arrays(distance_m[:, None], angle_rad * radius_m)
    uv = np.stack([along, around], axis=-1)

    disc_uv = circle * radius_m
    rod = _grids(rings[None], normals[None], uv[None])
    first_end = _disc(path[0], rings[0], -tangents[0], disc_uv)
    last_end = _disc(path[-1], rings[-1], tangents[-1], disc_uv)
    return joined_arrays([rod, first_end, last_end])


def _tangents(directions: Array) -> Array:
    """The unit tangents (N, 3) at the vertices of a polyline, from the directions (N - 1, 3) of its segments."""
    inner = directions[:-1] + directions[1:]
    return unit(np.concatenate([directions[:1], inner, directions[-1:]]))


def _cross_section_axes(tangents: Array) -> Array:
    """Two unit axes (N, 2, 3) perpendicular to each tangent (N, 3), with minimal twist between neighbours."""
    least_aligned = np.abs(tangents[0]).argmin()
    start = unit(cross(tangents[0], np.eye(3)[least_aligned]))
    axes = [start]
    for tangent in tangents[1:]:
        previous = axes[-1]
        along_tangent = tangent * (previous @ tangent)
        axes.append(unit(previous - along_tangent))
    first_axes = np.array(axes)
    second_axes = cross(tangents, first_axes)
    return np.stack([first_axes, second_axes], axis=1)


def _disc(center_m: Array, ring_m: Array, normal: Array, uv: Array) -> MeshArrays:
    """A disc that fills a ring (C, 3) of vertices, which have texture coordinates uv (C, 2).

    It is visible from the side to which the normal points.
    """
    rows = np.stack([np.broadcast_to(center_m, ring_m.shape), ring_m])
    rows_uv = np.stack([0 * uv, uv])
    area_vector = cross(ring_m[1] - ring_m[0], ring_m[0] - center_m)
    is_seen_from_behind = area_vector @ normal < 0
    if is_seen_from_behind:
        rows = rows[::-1]
        rows_uv = rows_uv[::-1]
    normals = np.broadcast_to(normal, (1, *rows.shape))
    return _grids(rows[None], normals, rows_uv[None])


def cushion(size_m: ArrayLike, *, power: float = 5.0, cells: int = 6) -> "Trimesh":
    """A superellipsoid around the origin: |x/a|^p + |y/b|^p + |z/c|^p = 1.

    `power` is p: 2 gives an ellipsoid, and a larger value a shape closer to a box. `cells` is the number of cells
    along each edge of the cube that is projected onto it.
    """
    half_m = np.asarray(size_m, float) / 2
    steps = np.linspace(-1, 1, cells + 1)
    v, u = np.meshgrid(steps, steps, indexing="ij")

    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.stack([u * sign, v, sign + 0 * u], axis=-1)
            sides.append(np.roll(side, axis, axis=-1))
    cube = np.stack(sides)  # (6, R, C, 3)

    # The points of the cube are projected from the centre; the normal is the gradient of the equation.
    radius = np.linalg.norm(cube, ord=power, axis=-1, keepdims=True)
    points = cube / radius
    gradient = np.sign(points) * np.abs(points) ** (power - 1) / half_m
    points_m = points * half_m

    uv = []
    for k, side_m in enumerate(points_m):
        axis = k // 2
        uv.append(np.roll(side_m, -axis, axis=-1)[..., :2])
    return as_mesh(_grids(points_m, unit(gradient), np.stack(uv)))


def sheet(points_m: ArrayLike) -> "Trimesh":
    """A smooth surface through a grid of points (R, C, 3). It is visible from the side of column × row direction."""
    return as_mesh(sheet_arrays(points_m))


def sheet_arrays(points_m: ArrayLike) -> MeshArrays:
    """The arrays of `sheet`."""
    points = np.asarray(points_m, float)
    along_rows = np.gradient(points, axis=0)
    along_columns = np.gradient(points, axis=1)
    normals = unit(cross(along_columns, along_rows))
    uv = np.stack([_grid_length_m(points, 1), _grid_length_m(points, 0)], axis=-1)
    return _grids(points[None], normals[None], uv[None])


def _grid_length_m(points_m: Array, axis: int) -> Array:
    """The distances (R, C) of the points of a grid (R, C, 3) from its border, along the grid lines of an axis."""
    border = np.take(points_m, [0], axis)
    steps = np.diff(points_m, axis=axis, prepend=border)
    lengths_m = np.linalg.norm(steps, axis=2)
    return np.cumsum(lengths_m, axis=axis)


def card(size_m: tuple[float, float], *, cell: Hole = WHOLE_PICTURE) -> "Trimesh":
    """An upright rectangle around the origin that faces x and shows a cell of a picture.

    `cell` is the first and last u, and the first and last v, as shares of the picture.
    """
    return as_mesh(card_arrays(size_m, cell=cell))


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
    """One mesh of rectangles with sizes (N, 2) at rigid poses (N, 4, 4), visible from both sides; see `card`."""
    return as_mesh(cards_arrays(sizes_m, poses))


def cards_arrays(sizes_m: ArrayLike, poses: ArrayLike) -> MeshArrays:
    """The arrays of `cards`."""
    sizes = np.asarray(sizes_m, float).reshape(-1, 2)
    T = np.asarray(poses, float).reshape(-1, 4, 4)
    R = T[:, :3, :3]
    unit_card = card_arrays((1.0, 1.0))
    width = sizes[:, 0, None]
    height = sizes[:, 1, None]
    y = -width / 2 + [0.0, 1.0, 1.0, 0.0] * width
    z = -height / 2 + [0.0, 0.0, 1.0, 1.0] * height
    corners_m = np.stack([0 * y, y, z], axis=-1)  # (N, 4, 3)

    moved_m = corners_m @ R.swapaxes(1, 2) + T[:, None, :3, 3]
    front_normals = unit(unit_card.normals @ np.linalg.inv(R))
    vertices_m = np.stack([moved_m, moved_m], axis=1)  # (N, 2, 4, 3), front and back
    normals = np.stack([front_normals, -front_normals], axis=1)

    front_faces = unit_card.faces
    back_faces = front_faces[:, ::-1] + 4
    faces_of_card = np.concatenate([front_faces, back_faces])
    first_vertex = 8 * np.arange(len(sizes))
    faces = first_vertex[:, None, None] + faces_of_card
    return MeshArrays(
        vertices_m.reshape(-1, 3),
        faces.reshape(-1, 3),
        np.tile(unit_card.uv, (2 * len(sizes), 1)),
        normals.reshape(-1, 3),
    )


def extrusion(polygon_m: ArrayLike, height_m: float, *, holes_m: Sequence[ArrayLike] = ()) -> "Trimesh":
    """A prism from z = 0 to `height_m` over a polygon (N, 2) with holes. Polygons can have either orientation."""
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
            edge = end - start
            parts.append(quad_arrays((*start, 0), (*edge, 0), (0, 0, height_m)))
    return as_mesh(joined_arrays(parts))


def _cap(corners_m: Array) -> MeshArrays:
    """The mesh of level faces (F, 3, 3), with x and y as texture coordinates."""
    axes = _uv_axes(corners_m, range(3))
    uv = np.take_along_axis(corners_m, axes[:, None, :], axis=2)
    return MeshArrays(
        corners_m.reshape(-1, 3),
        np.arange(3 * len(corners_m)).reshape(-1, 3),
        uv.reshape(-1, 2),
        _flat_normals(corners_m).reshape(-1, 3),
    )
