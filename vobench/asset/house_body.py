"""The body of a house behind its front: the sides, the back, the foundation and the roof, in the frame of its lot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vobench.asset import picture
from vobench.asset.front_style import FrontStyle
from vobench.asset.furniture import DARK, Part, matt, stood
from vobench.asset.picture import Rng, one_of
from vobench.asset.street_plan import KERB_M, Lot
from vobench.geometry.se3 import Array
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

FOUNDATION_M = KERB_M + 0.02  # of a house below the pavement
EAVES_M = 0.25  # by which a pitched roof projects over the front
RIDGE_M = (2.2, 3.4)  # height of the ridge above the walls
ROOF_TINTS = ("#b98d7c", "#8a8f94", "#6f7276", "#a86a52", "#5d5f62")
CHIMNEY_M = (0.5, 0.9, 1.5)
CHIMNEY_SHARE = 0.7  # of houses with a pitched roof
CHIMNEY_TINT = "#b98d7c"


def house_body(rng: Rng, lot: Lot, style: FrontStyle, high_m: float) -> list[Part]:
    """The sides that nobody sees well, the back, the foundation and the roof; `high_m` is the height of the walls."""
    right, left, back_left, back_right = (np.array([x, y, 0.0]) for x, y in lot.local_corners_m.tolist())
    up = np.array([0.0, 0.0, high_m])
    is_right_open, is_left_open = lot.is_open
    walls = [quad_arrays(back_left, back_right - back_left, up)]
    if not is_left_open:
        walls.append(quad_arrays(left, back_left - left, up))
    if not is_right_open:
        walls.append(quad_arrays(back_right, right - back_right, up))
    ceiling = _quadrilateral([right + up, left + up, back_left + up, back_right + up])
    parts = [
        Part(joined_arrays(walls), style.wall),
        Part(_foundation(right, left, back_left, back_right), style.trim),
        Part(ceiling, DARK),
    ]
    if style.roof == "flat":
        parapet_m = (0.3, lot.width_m, 0.3)
        return [*parts, stood(parapet_m, style.trim, -0.06, z=high_m - 0.06, bevel=0)]
    eaves_m = (0.5, lot.width_m, 0.14)
    eaves = stood(eaves_m, style.trim, 0.1, z=high_m - 0.16, bevel=0)
    return [*parts, eaves, *_pitched_roof(rng, lot, style, high_m)]


def _foundation(right: Array, left: Array, back_left: Array, back_right: Array) -> MeshArrays:
    """The front and the sides down to the road, for houses at the end of a road, where there is no pavement."""
    up = np.array([0.0, 0.0, FOUNDATION_M])
    down = -up
    sides = [
        quad_arrays(right + down, left - right, up),
        quad_arrays(left + down, back_left - left, up),
        quad_arrays(back_right + down, right - back_right, up),
    ]
    return joined_arrays(sides)


def _pitched_roof(rng: Rng, lot: Lot, style: FrontStyle, high_m: float) -> list[Part]:
    """Two slopes with a ridge along the street, gables, and on some houses a chimney."""
    right, left, back_left, back_right = lot.local_corners_m
    ridge_m = high_m + float(rng.uniform(*RIDGE_M))
    ridge_right = np.array([*((right + back_right) / 2), ridge_m])
    ridge_left = np.array([*((left + back_left) / 2), ridge_m])

    projection = np.array([EAVES_M, 0.0])
    eaves_z_m = high_m - 0.02
    eave_right = np.array([*(right + projection), eaves_z_m])
    eave_left = np.array([*(left + projection), eaves_z_m])
    back_eave_right = np.array([*back_right, eaves_z_m])
    back_eave_left = np.array([*back_left, eaves_z_m])
    tiles = matt(one_of(rng, *ROOF_TINTS), picture.masonry("tile", 1, 512, 2.0, rows=12, columns=8))
    slopes = [
        _slope(eave_right, eave_left, ridge_left, ridge_right),
        _slope(back_eave_left, back_eave_right, ridge_right, ridge_left),
    ]
    gables = [
        _triangle(np.array([*left, high_m]), np.array([*back_left, high_m]), ridge_left),
        _triangle(np.array([*back_right, high_m]), np.array([*right, high_m]), ridge_right),
    ]
    parts = [Part(joined_arrays(slopes), tiles), Part(joined_arrays(gables), style.wall)]
    has_chimney = rng.random() < CHIMNEY_SHARE
    if has_chimney:
        middle_m = (ridge_left + ridge_right) / 2
        x_m = float(middle_m[0])
        y_m = float(middle_m[1] + rng.uniform(-0.3, 0.3) * lot.width_m)
        bricks = matt(CHIMNEY_TINT, picture.masonry("brick", 1))
        parts.append(stood(CHIMNEY_M, bricks, x_m, y_m, ridge_m - 0.6, bevel=0))
    return parts


def _quadrilateral(corners_m: Sequence[Array]) -> MeshArrays:
    """A flat quadrilateral."""
    vertices_m = np.array(corners_m)
    a, b, c = vertices_m[:3]
    normal = np.cross(b - a, c - a)
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    return MeshArrays(vertices_m, np.array([[0, 1, 2], [0, 2, 3]]), vertices_m[:, :2].copy(), normals)


def _slope(a: Array, b: Array, c: Array, d: Array) -> MeshArrays:
    """A quadrilateral with texture coordinates along its first side and up the slope."""
    mesh = _quadrilateral([a, b, c, d])
    along = (b - a) / np.linalg.norm(b - a)
    normal = mesh.normals[0]
    upwards = np.cross(normal, along)
    uv = np.column_stack([(mesh.vertices_m - a) @ along, -((mesh.vertices_m - a) @ upwards)])
    return replace(mesh, uv=uv)


def _triangle(a: Array, b: Array, c: Array) -> MeshArrays:
    """A triangle, which is visible from the side from which its corners are counter-clockwise."""
    normal = np.cross(b - a, c - a)
    normals = np.tile(normal / np.linalg.norm(normal), (3, 1))
    vertices_m = np.array([a, b, c])
    along = (b - a) / np.linalg.norm(b - a)
    uv = np.column_stack([(vertices_m - a) @ along, -vertices_m[:, 2]])
    return MeshArrays(vertices_m, np.array([[0, 1, 2]]), uv, normals)
