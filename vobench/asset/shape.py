"""Shapes as meshes: lengths in metres, texture coordinates in metres, normals outward."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.mesh import Faces, Mesh, cross, face_normals, joined, quad, unit

# A lap lies this far behind a wall's joint and reaches this far to both of its sides.
LAP_BEHIND_M = 0.002
LAP_M = 0.01
SMOOTH_DEG = 40.0  # a profile that bends by less is round there
Hole = tuple[float, float, float, float]  # first and last u, first and last v, in metres from a wall's corner


def at(
    x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0, *, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0
) -> Array:
    """The pose (4, 4) at a place, turned by Rz(yaw) Ry(pitch) Rx(roll) in degrees."""
    (cz, cy, cx), (sz, sy, sx) = (f(np.deg2rad([yaw, pitch, roll])) for f in (np.cos, np.sin))
    Rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    Ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    R = Rz @ Ry @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return se3.transform(R, [x_m, y_m, z_m])


def block(size_m: ArrayLike, *, bevel_m: float = 0.003, uv_m: ArrayLike = (0.0, 0.0)) -> Mesh:
    """A box around the origin with bevelled edges, shaded as round; u runs along the longer side of each face."""
    half = np.asarray(size_m, float) / 2
    bevel = min(bevel_m, 0.45 * half.min())
    signs, faces = _bevelled() if bevel > 0 else _sharp()
    axis = np.arange(len(signs)) % 3
    points = signs * (half - bevel * (1 - np.eye(3)[axis]) if bevel > 0 else half)
    corners = points[faces]
    flat = face_normals(corners)
    normals = (signs * np.eye(3)[axis])[faces] if bevel > 0 else np.repeat(flat[:, None], 3, axis=1)
    return _mapped(corners, normals, np.argsort(-half, kind="stable"), np.asarray(uv_m, float))


def _mapped(corners_m: Array, normals: Array, order: NDArray[np.int64], uv_m: Array) -> Mesh:
    """Faces whose texture is laid on along the axis they face most; u is the first in `order` of the other two."""
    facing = np.argmax(np.abs(face_normals(corners_m)) + np.array([2e-6, 1e-6, 0]), axis=1)
    across = np.array([[a for a in order if a != axis] for axis in range(3)])[facing]
    uv = np.take_along_axis(corners_m, across[:, None, :], axis=2) + uv_m
    own = np.arange(len(corners_m) * 3, dtype=np.int32).reshape(-1, 3)
    return Mesh(corners_m.reshape(-1, 3), own, uv.reshape(-1, 2), normals.reshape(-1, 3))


@lru_cache
def _bevelled() -> tuple[Array, Faces]:
    """Signs (24, 3) of a block's corners, three times each, and faces (44, 3); 3 c + a is on the side of axis a."""
    signs = np.repeat(_sharp()[0], 3, axis=0)
    points = signs * (1 - 0.1 * (1 - np.eye(3)[np.arange(24) % 3]))
    return signs, _outward(points, scipy.spatial.ConvexHull(points).simplices)


@lru_cache
def _sharp() -> tuple[Array, Faces]:
    signs = np.stack(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0], indexing="ij"), axis=-1).reshape(-1, 3)
    sides = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])
    return signs, _outward(signs, sides[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3))


def _outward(points: Array, faces: Faces) -> Faces:
    """The faces of a convex body around the origin, counter-clockwise from outside."""
    corners = points[faces]
    inward = np.einsum("fk,fk->f", cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), corners[:, 0])
    return np.where((inward < 0)[:, None], faces[:, ::-1], faces).astype(np.int32)


def _patches(points_m: Array, normals: Array, uv: Array) -> Mesh:
    """Grids (B, R, C, 3) of points, seen from the side of columns × rows; faces without an area are left out."""
    grids, rows, columns = points_m.shape[:3]
    index = np.arange(grids * rows * columns, dtype=np.int32).reshape(grids, rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:, :-1, :-1], index[:, :-1, 1:], index[:, 1:, 1:], index[:, 1:, :-1]))
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    vertices = points_m.reshape(-1, 3)
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    has_area = np.linalg.norm(cross(q - p, r - p), axis=1) > 1e-12
    return Mesh(vertices, faces[has_area], uv.reshape(-1, 2), normals.reshape(-1, 3))


def _circle(sections: int) -> tuple[Array, Array]:
    """Angles (sections + 1,) of a full turn and their cosines and sines (sections + 1, 2), the last as the first."""
    angle = np.linspace(0, 2 * np.pi, sections + 1)
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    turn[-1] = turn[0]
    return angle, turn


def lathe(profile_m: ArrayLike, *, sections: int = 24) -> Mesh:
    """A solid of revolution about z; its profile (K, 2) of radius and height runs from the axis below to that above."""
    p = np.asarray(profile_m, float)
    ends = np.stack([p[:-1], p[1:]], axis=1)  # (K - 1, 2, 2)
    step = np.diff(p, axis=0)
    out = unit(np.stack([step[:, 1], -step[:, 0]], axis=1))
    across = np.stack([out, out], axis=1)
    is_round = np.einsum("kj,kj->k", out[:-1], out[1:]) > np.cos(np.deg2rad(SMOOTH_DEG))
    middle = unit(out[:-1] + out[1:])[is_round]
    across[1:, 0][is_round] = middle
    across[:-1, 1][is_round] = middle
    angle, turn = _circle(sections)
    points, normals = (_revolved(part, turn) for part in (ends, across))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(step, axis=1))])
    along = np.broadcast_to(np.stack([length[:-1], length[1:]], axis=1)[..., None], points.shape[:3])
    around = np.broadcast_to(angle * p[:, 0].max(), along.shape)
    is_level = (np.abs(out[:, 1]) > 0.9)[:, None, None, None]
    return _patches(points, normals, np.where(is_level, points[..., :2], np.stack([around, along], axis=-1)))


def _revolved(pairs: Array, turn: Array) -> Array:
    """Points (K, 2, 2) of radius and height, at every turn (C, 2): (K, 2, C, 3)."""
    flat = pairs[..., None, :1] * turn
    return np.concatenate([flat, np.broadcast_to(pairs[..., None, 1:], (*flat.shape[:-1], 1))], axis=-1)


def spline(points_m: ArrayLike, count: int = 16) -> Array:
    """Points (count, 3) of a smooth curve through some."""
    p = np.asarray(points_m, float)
    t = np.linspace(0, 1, count)
    if len(p) == 3:  # a parabola, for which the spline would call a solver of dense systems
        return np.asarray(np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=1) @ p)
    return np.asarray(scipy.interpolate.CubicSpline(np.linspace(0, 1, len(p)), p)(t))


def tube(path_m: ArrayLike, radius_m: float, *, sections: int = 8) -> Mesh:
    """A round rod along a polyline (N, 3), closed by flat ends."""
    path = np.asarray(path_m, float)
    step = np.diff(path, axis=0)
    ahead = unit(step)
    tangent = unit(np.concatenate([ahead[:1], ahead[:-1] + ahead[1:], ahead[-1:]]))
    side = [unit(cross(tangent[0], np.eye(3)[np.abs(tangent[0]).argmin()]))]
    for t in tangent[1:]:
        side.append(unit(side[-1] - t * (side[-1] @ t)))
    across = np.stack([np.array(side), cross(tangent, np.array(side))], axis=1)  # (N, 2, 3)
    angle, turn = _circle(sections)
    normals = np.einsum("cj,njk->nck", turn, across)
    ring = path[:, None] + radius_m * normals
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(step, axis=1))])
    uv = np.stack(np.broadcast_arrays(length[:, None], angle * radius_m), axis=-1)
    ends = [
        _end(path[0], ring[0], -tangent[0], turn * radius_m),
        _end(path[-1], ring[-1], tangent[-1], turn * radius_m),
    ]
    return joined([_patches(ring[None], normals[None], uv[None]), ends[0], ends[1]])


def _end(middle_m: Array, ring_m: Array, normal: Array, uv: Array) -> Mesh:
    rows = np.stack([np.broadcast_to(middle_m, ring_m.shape), ring_m])
    places = np.stack([0 * uv, uv])
    if cross(ring_m[1] - ring_m[0], ring_m[0] - middle_m) @ normal < 0:
        rows = rows[::-1]
        places = places[::-1]
    return _patches(rows[None], np.broadcast_to(normal, (1, *rows.shape)), places[None])


def cushion(size_m: ArrayLike, *, power: float = 5.0, cells: int = 6) -> Mesh:
    """A pillow around the origin: |x/a|^p + |y/b|^p + |z/c|^p = 1; 2 is an ellipsoid, more is boxier."""
    half = np.asarray(size_m, float) / 2
    s = np.linspace(-1, 1, cells + 1)
    v, u = np.meshgrid(s, s, indexing="ij")
    sides = [np.roll(np.stack([u * w, v, w + 0 * u], axis=-1), axis, axis=-1) for axis in range(3) for w in (1.0, -1.0)]
    cube = np.stack(sides)
    p = cube / np.linalg.norm(cube, ord=power, axis=-1, keepdims=True)
    normals = unit(np.sign(p) * np.abs(p) ** (power - 1) / half)
    points = p * half
    uv = np.stack([np.roll(points[k], -(k // 2), axis=-1)[..., :2] for k in range(6)])
    return _patches(points, normals, uv)


def sheet(points_m: ArrayLike) -> Mesh:
    """A smooth surface through a grid (R, C, 3), seen from the side of columns × rows."""
    p = np.asarray(points_m, float)
    rows = np.gradient(p, axis=0)
    columns = np.gradient(p, axis=1)
    u, v = (np.cumsum(np.linalg.norm(np.diff(p, axis=k, prepend=np.take(p, [0], k)), axis=2), axis=k) for k in (1, 0))
    return _patches(p[None], unit(cross(columns, rows))[None], np.stack([u, v], axis=-1)[None])


def card(size_m: tuple[float, float], *, cell: Hole = (0.0, 1.0, 0.0, 1.0)) -> Mesh:
    """An upright rectangle around the origin that faces x and shows a cell of a picture, in shares of its sides."""
    (w, h) = size_m
    (u0, u1, v0, v1) = cell
    mesh = quad((0, -w / 2, -h / 2), (0, w, 0), (0, 0, h))
    return Mesh(mesh.vertices_m, mesh.faces, np.array([[u0, v1], [u1, v1], [u1, v0], [u0, v0]]), mesh.normals)


def extrusion(polygon_m: ArrayLike, height_m: float, *, holes_m: Sequence[ArrayLike] = ()) -> Mesh:
    """A prism between z = 0 and height_m over a polygon (N, 2), less some others within it, in either order."""
    rings = [_turned(ring, left=k == 0) for k, ring in enumerate([polygon_m, *holes_m])]
    flat = triangulated(rings)
    top = np.concatenate([flat, np.full((*flat.shape[:2], 1), height_m)], axis=-1)
    below = top[:, ::-1] * [1, 1, 0]
    sides = [quad((*a, 0), (*(b - a), 0), (0, 0, height_m)) for r in rings for a, b in pairwise([*r, r[0]])]
    caps = [_mapped(c, np.repeat(face_normals(c)[:, None], 3, 1), np.arange(3), np.zeros(2)) for c in (top, below)]
    return joined([*caps, *sides])


def _turned(ring: ArrayLike, *, left: bool) -> Array:
    p = np.asarray(ring, float)
    return p if (_area(p) > 0) == left else p[::-1]


def _area(p: Array) -> float:
    return float(np.sum(_cross(p, np.roll(p, -1, axis=0)))) / 2


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def triangulated(rings: Sequence[Array]) -> Array:
    """Triangles (F, 3, 2) of a polygon that turns left, less holes that turn right, by cutting ears."""
    loop = rings[0]
    for hole in sorted(rings[1:], key=lambda ring: -float(ring[:, 0].max())):
        start = int(hole[:, 0].argmax())
        near = np.argsort(np.linalg.norm(loop - hole[start], axis=1), kind="stable")
        edges = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in (loop, *rings[1:])]
        bridge = next(int(k) for k in near if not _crosses(loop[k], hole[start], np.concatenate(edges)))
        loop = np.concatenate([loop[: bridge + 1], np.roll(hole, -start, axis=0), hole[[start]], loop[bridge:]])
    corners = list(range(len(loop)))
    ears = []
    while len(corners) > 3:
        k = next((k for k in range(len(corners)) if _is_ear(loop, corners, k)), 0)
        ears.append([corners[k - 1], corners[k], corners[(k + 1) % len(corners)]])
        del corners[k]
    triangles = loop[np.array([*ears, corners])]
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    return np.asarray(triangles[_cross(b - a, c - a) > 0])


def _crosses(a: Array, b: Array, edges: Array) -> bool:
    p = edges[:, 0]
    q = edges[:, 1]
    split = _cross(b - a, p - a) * _cross(b - a, q - a) < 0
    return bool(np.any(split & (_cross(q - p, a - p) * _cross(q - p, b - p) < 0)))


def _is_ear(loop: Array, corners: list[int], k: int) -> bool:
    triangle = loop[[corners[k - 1], corners[k], corners[(k + 1) % len(corners)]]]
    if _cross(triangle[1] - triangle[0], triangle[2] - triangle[0]) <= 0:
        return False
    others = loop[corners]
    others = others[(others[:, None] != triangle).any(axis=2).all(axis=1)]
    return not np.all([_cross(triangle[i - 2] - triangle[i], others - triangle[i]) >= 0 for i in range(3)], 0).any()


def pierced(corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, holes: Sequence[Hole] = ()) -> Mesh:
    """A rectangle less some rectangles, as a grid whose lines run through, with laps behind its four borders.

    The laps stop the light that would pass where two walls only touch.
    """
    corner, u, v = (np.asarray(part, float) for part in (corner_m, edge_u_m, edge_v_m))
    width = float(np.linalg.norm(u))
    height = float(np.linalg.norm(v))
    cuts_u = np.unique([0, width, *(edge for hole in holes for edge in hole[:2])])
    cuts_v = np.unique([0, height, *(edge for hole in holes for edge in hole[2:])])
    cells = [(*us, *vs) for us in pairwise(cuts_u) for vs in pairwise(cuts_v) if not _in_any(holes, us, vs)]
    near = -LAP_M
    far = LAP_M
    laps = [(near, width - near, e + near, e + far) for e in (0, height)]
    laps += [(e + near, e + far, near, height - near) for e in (0, width)]
    behind = -LAP_BEHIND_M * unit(cross(u, v))
    return joined([_part(corner, u, v, cell) for cell in cells] + [_part(corner + behind, u, v, lap) for lap in laps])


def _in_any(holes: Sequence[Hole], us: tuple[float, float], vs: tuple[float, float]) -> bool:
    u = sum(us) / 2
    v = sum(vs) / 2
    return any(u0 < u < u1 and v0 < v < v1 for u0, u1, v0, v1 in holes)


def _part(corner: Array, u: Array, v: Array, cell: Hole) -> Mesh:
    (u0, u1, v0, v1) = cell
    axis_u = unit(u)
    axis_v = unit(v)
    return quad(corner + u0 * axis_u + v0 * axis_v, (u1 - u0) * axis_u, (v1 - v0) * axis_v, uv_m=(u0, v0))


def reveal(corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, hole: Hole, depth_m: float) -> Mesh:
    """The four sides of a rectangle's hole, down to depth_m behind its face."""
    u = unit(edge_u_m)
    v = unit(edge_v_m)
    u0, u1, v0, v1 = hole
    near = np.asarray(corner_m, float) + u0 * u + v0 * v
    across = (u1 - u0) * u
    along = (v1 - v0) * v
    deep = -depth_m * cross(u, v)
    sides = [(near, deep, along), (near + across, along, deep), (near, across, deep), (near + along, deep, across)]
    return joined([quad(*side) for side in sides])
