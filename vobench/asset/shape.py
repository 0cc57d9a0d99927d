"""Creates meshes of basic shapes. Lengths and texture coordinates are in metres, and normals point outwards.

In shapes of arrays, F is the number of faces, and R and C are the numbers of rows and columns of a grid of vertices.
A grid is visible from its front. Its front is the side to which cross(column direction, row direction) points.
"""

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

SMOOTH_DEG = 40.0  # corners of a profile with a smaller angle are shaded as round
MIN_DOUBLE_AREA_M2 = 1e-12  # faces of a grid are omitted if twice their area is smaller
WHOLE_PICTURE: Hole = (0.0, 1.0, 0.0, 1.0)
MAX_BEVEL = 0.45  # the largest bevel, relative to half the shortest side of a block
BEVEL_OF_CUBE = 0.1  # the bevel of the bevelled unit cube; its normals and uv axes do not depend on this value
LEVEL_COSINE = 0.9  # faces of a lathe are level, and have the texture of a disc, if the z of their normal is larger


def at(
    x_m: float = 0.0,
    y_m: float = 0.0,
    z_m: float = 0.0,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
) -> Array:
    """The pose (4, 4) with a position and the rotation Rz(yaw) Ry(pitch) Rx(roll), with angles in degrees."""
    angles_rad = np.deg2rad([yaw, pitch, roll])  # about z, y and x
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

    `size_m` (3,) is the size along x, y and z.
    `bevel_m` is the width of the bevels. It is reduced if the box is too thin for it.
    `uv_m` (2,) are the texture coordinates at the centre of the box.
    `upright` makes u run to the right and v run down on the sides, as on a printed carton. By default, u runs along
    the longest edge of each side.
    `transform` (4, 4) is the pose of the box; the identity by default.
    """
    arrays = block_arrays(size_m, bevel_m=bevel_m, uv_m=uv_m, upright=upright)
    if transform is not None:
        arrays = arrays.moved(transform)
    return as_mesh(arrays)


def block_arrays(
    size_m: ArrayLike,
    *,
    bevel_m: float = 0.003,
    uv_m: ArrayLike = (0.0, 0.0),
    upright: bool = False,
) -> MeshArrays:
    """The arrays of `block`."""
    half_m = np.asarray(size_m, float) / 2
    bevel = min(bevel_m, MAX_BEVEL * half_m.min())
    if bevel > 0:
        cube = _bevelled_cube()
        # A vertex touches its own side of the box, and is one bevel inside the box on the other two axes.
        inset_m = bevel * (1 - cube.sides)
        vertices_m = cube.signs * (half_m - inset_m)
    else:
        cube = _cube()
        vertices_m = cube.signs * half_m

    corners_m = vertices_m[cube.faces]
    has_thickness = half_m.all()
    # The sides of a box without thickness have no area, so their normals are 0.
    normals = cube.normals if has_thickness else _flat_normals(corners_m)

    if upright:
        uv = _upright_uv(corners_m)
    else:
        # u and v are the coordinates of the corners along two axes of the box, and u is along the longer one.
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
    """The texture coordinates (F, 3, 2) of the corners of the faces (F, 3, 3) of a box.

    Seen from outside, u runs to the right and v runs down. Upwards is z on the sides, and y on the top and the bottom.
    """
    axis = _projection_axes(corners_m)
    component_along_axis = np.take_along_axis(face_normals(corners_m), axis[:, None], axis=1)
    normals = np.eye(3)[axis] * np.sign(component_along_axis)
    is_side = axis < 2
    up = np.where(is_side[:, None], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    right = cross(up, normals)
    u = np.einsum("fij,fj->fi", corners_m, right)
    v = -np.einsum("fij,fj->fi", corners_m, up)
    return np.stack([u, v], axis=-1)


def _flat_normals(corners_m: Array) -> Array:
    """The normals (F, 3, 3) at the corners of faces (F, 3, 3). All corners of a face have the normal of the face."""
    return np.repeat(face_normals(corners_m)[:, None], 3, axis=1)


def _uv_axes(corners_m: Array, order: Sequence[int]) -> NDArray[np.int64]:
    """The axes (F, 2) along which u and v of each face (F, 3, 3) run, for a texture that is projected along x, y or z.

    The axis of projection is the one that is closest to the normal of the face. u runs along the first of the other
    two axes in `order`, and v runs along the second one.
    """
    uv_axes = np.array([_without(order, axis) for axis in range(3)])
    return np.asarray(uv_axes[_projection_axes(corners_m)])


def _projection_axes(corners_m: Array) -> NDArray[np.int64]:
    """The axis (F,) that is closest to the normal of each face (F, 3, 3)."""
    tie_breaker = np.array([2e-6, 1e-6, 0])  # makes the axis of faces at 45° independent of rounding
    alignment = np.abs(face_normals(corners_m)) + tie_breaker
    return np.asarray(np.argmax(alignment, axis=1))


def _without(axes: Sequence[int], excluded: int) -> list[int]:
    """All axes except the excluded one, in the same order."""
    return [axis for axis in axes if axis != excluded]


class _Cube:
    """A cube around the origin that determines the vertices, normals and texture axes of blocks of any size."""

    def __init__(self, signs: Array, faces: Faces, sides: Array) -> None:
        """Create a cube with V vertices. It is bevelled if `sides` are not 0.

        `signs` (V, 3) are the signs of the coordinates of each vertex.
        `faces` (F, 3) are the indices of the vertices of each face.
        `sides` (V, 3) are unit vectors along the axis of the side that contains each vertex.
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
        """The index that selects u and v (F, 3, 2) from the corners (F, 3, 3) of a block; see `_uv_axes`."""
        if order not in self._uv_indices:
            axes = _uv_axes(self._corners, order)
            face = np.arange(len(self.faces))[:, None, None]
            corner = np.arange(3)[None, :, None]
            self._uv_indices[order] = (face, corner, axes[:, None, :])
        return self._uv_indices[order]


@cache
def _bevelled_cube() -> _Cube:
    """A bevelled cube with 44 faces and 24 vertices. Vertex 3 c + a is at corner c, on the side of axis a."""
    signs = np.repeat(_cube().signs, 3, axis=0)
    sides = np.eye(3)[np.arange(24) % 3]
    vertices = _bevelled_vertices(signs, sides)
    hull = scipy.spatial.ConvexHull(vertices)
    return _Cube(signs, _outward(vertices, hull.simplices), sides)


def _bevelled_vertices(signs: Array, sides: Array) -> Array:
    """The vertices (V, 3) of a bevelled cube whose sides are at -1 and 1."""
    return np.asarray(signs * (1 - BEVEL_OF_CUBE * (1 - sides)))


@cache
def _cube() -> _Cube:
    """A cube without bevels, with 8 vertices and 12 faces."""
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
    """The faces (F, 3) of a convex body that contains the origin, oriented so that they are visible from outside."""
    corners = vertices[faces]
    a = corners[:, 0]
    b = corners[:, 1]
    c = corners[:, 2]
    area_vectors = cross(b - a, c - a)
    is_inward = np.einsum("fk,fk->f", area_vectors, a) < 0
    reversed_faces = faces[:, ::-1]
    return np.where(is_inward[:, None], reversed_faces, faces).astype(np.int64)


def _grids(points_m: Array, normals: Array, uv: Array) -> MeshArrays:
    """A mesh of B grids of vertices, with two faces per cell. Faces without an area are omitted.

    `points_m` (B, R, C, 3) are the positions of the vertices.
    `normals` (B, R, C, 3) are their normals.
    `uv` (B, R, C, 2) are their texture coordinates.
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
    has_area = double_area_m2 > MIN_DOUBLE_AREA_M2
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
    """The distance (N + 1,) of each vertex from the start, along a polyline with segments `steps_m` (N, K)."""
    lengths_m = np.linalg.norm(steps_m, axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths_m)])


def lathe(profile_m: ArrayLike, *, sections: int = 24) -> "Trimesh":
    """A solid of revolution about z.

    `profile_m` (K, 2) are points (radius, height). They run from the bottom along the outside to the top, and start and
    end on the axis.
    `sections` is the number of faces around the axis.
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
    """Vectors in a profile, rotated around z by C angles. Returns vectors (K, 2, C, 3).

    `vectors` (K, 2, 2) are the components along the radius and the height.
    `circle` (C, 2) are the directions of the radius at the C angles.
    """
    radius = vectors[..., None, :1]
    height = vectors[..., None, 1:]
    xy = radius * circle
    z = np.broadcast_to(height, (*xy.shape[:-1], 1))
    return np.concatenate([xy, z], axis=-1)


def spline(points_m: ArrayLike, count: int = 16) -> Array:
    """Points (count, 3) on a cubic spline through the points (N, 3).

    The spacing of the given points is uniform in the parameter of the spline, and so is that of the result.
    """
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
    """A disc that is visible from the side to which its normal points.

    `center_m` (3,) is its centre.
    `ring_m` (C, 3) are the vertices on its edge.
    `normal` (3,) is its unit normal.
    `uv` (C, 2) are the texture coordinates of the vertices on its edge; those of the centre are 0.
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

    `size_m` (3,) is its size along x, y and z, which is 2a, 2b and 2c.
    `power` is p. The shape is an ellipsoid with p = 2, and is closer to a box with a larger p.
    `cells` is the number of cells along each edge of the cube that is projected onto it.
    """
    half_m = np.asarray(size_m, float) / 2
    steps = np.linspace(-1, 1, cells + 1)
    v, u = np.meshgrid(steps, steps, indexing="ij")

    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            # The side that is perpendicular to z. Rolling its coordinates makes it perpendicular to another axis.
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
    """A smooth surface through a grid of points (R, C, 3). It is visible only from its front; see the module."""
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
    """An upright rectangle around the origin that faces x and shows a rectangular part of a picture.

    `size_m` is its width along y and its height along z.
    `cell` is the part of the picture: the first u, last u, first v and last v, as shares of the picture.
    """
    return as_mesh(card_arrays(size_m, cell=cell))


def card_arrays(
    size_m: tuple[float, float],
    *,
    cell: Hole = WHOLE_PICTURE,
) -> MeshArrays:
    """The arrays of `card`."""
    width, height = size_m
    first_u, last_u, first_v, last_v = cell
    rectangle = quad_arrays((0, -width / 2, -height / 2), (0, width, 0), (0, 0, height))
    uv = np.array([[first_u, last_v], [last_u, last_v], [last_u, first_v], [first_u, first_v]])
    return MeshArrays(rectangle.vertices_m, rectangle.faces, uv, rectangle.normals)


def cards(sizes_m: ArrayLike, poses: ArrayLike) -> "Trimesh":
    """One mesh of N rectangles that are visible from both sides; see `card`.

    `sizes_m` (N, 2) are their widths and heights.
    `poses` (N, 4, 4) are their poses, which must be rigid.
    """
    return as_mesh(cards_arrays(sizes_m, poses))


def cards_arrays(sizes_m: ArrayLike, poses: ArrayLike) -> MeshArrays:
    """The arrays of `cards`."""
    sizes = np.asarray(sizes_m, float).reshape(-1, 2)
    T = np.asarray(poses, float).reshape(-1, 4, 4)
    R = T[:, :3, :3]
    unit_card = card_arrays((1.0, 1.0))
    width_m = sizes[:, 0, None]
    height_m = sizes[:, 1, None]
    # The corners of a card, counter-clockwise from the lower left one, as shares of its width and height.
    y_share = np.array([0.0, 1.0, 1.0, 0.0])
    z_share = np.array([0.0, 0.0, 1.0, 1.0])
    y_m = -width_m / 2 + y_share * width_m
    z_m = -height_m / 2 + z_share * height_m
    corners_m = np.stack([0 * y_m, y_m, z_m], axis=-1)  # (N, 4, 3)

    moved_m = corners_m @ R.swapaxes(1, 2) + T[:, None, :3, 3]
    front_normals = unit(unit_card.normals @ np.linalg.inv(R))
    vertices_m = np.stack([moved_m, moved_m], axis=1)  # (N, 2, 4, 3), front and back
    normals = np.stack([front_normals, -front_normals], axis=1)

    front_faces = unit_card.faces
    back_faces = front_faces[:, ::-1] + 4
    faces_of_card = np.concatenate([front_faces, back_faces])
    first_vertex = 8 * np.arange(len(sizes))  # a card has 4 vertices in front and 4 at the back
    faces = first_vertex[:, None, None] + faces_of_card
    return MeshArrays(
        vertices_m.reshape(-1, 3),
        faces.reshape(-1, 3),
        np.tile(unit_card.uv, (2 * len(sizes), 1)),
        normals.reshape(-1, 3),
    )


def extrusion(polygon_m: ArrayLike, height_m: float, *, holes_m: Sequence[ArrayLike] = ()) -> "Trimesh":
    """A prism from z = 0 to `height_m` over a polygon with holes.

    `polygon_m` (N, 2) are the vertices of the polygon.
    `holes_m` are the vertices of each hole. All polygons can have either orientation.
    """
    outline = oriented(polygon_m, counter_clockwise=True)
    holes = [oriented(hole, counter_clockwise=False) for hole in holes_m]
    rings = [outline, *holes]

    triangles = triangulated(rings)
    heights = np.full((*triangles.shape[:2], 1), height_m)
    top = np.concatenate([triangles, heights], axis=-1)
    bottom = top[:, ::-1] * [1, 1, 0]  # reversed, so that it is visible from below, and at z = 0

    parts = [_cap(top), _cap(bottom)]
    for ring in rings:
        for start, end in pairwise([*ring, ring[0]]):
            edge = end - start
            parts.append(quad_arrays((*start, 0), (*edge, 0), (0, 0, height_m)))
    return as_mesh(joined_arrays(parts))


def _cap(corners_m: Array) -> MeshArrays:
    """The mesh of horizontal faces (F, 3, 3). Its texture coordinates are x and y."""
    axes = _uv_axes(corners_m, range(3))
    uv = np.take_along_axis(corners_m, axes[:, None, :], axis=2)
    return MeshArrays(
        corners_m.reshape(-1, 3),
        np.arange(3 * len(corners_m)).reshape(-1, 3),
        uv.reshape(-1, 2),
        _flat_normals(corners_m).reshape(-1, 3),
    )
