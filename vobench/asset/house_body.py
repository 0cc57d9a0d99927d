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

FOUNDATION_M = KERB_M + 0.02  # the depth of the foundation below the pavement
EAVES_M = 0.25  # the distance by which a pitched roof projects over the front
EAVES_DROP_M = 0.02  # the distance of the eaves below the top of the walls
RIDGE_M = (2.2, 3.4)  # the range of the height of the ridge above the walls
ROOF_TINTS = ("#b98d7c", "#8a8f94", "#6f7276", "#a86a52", "#5d5f62")
CHIMNEY_M = (0.5, 0.9, 1.5)  # the depth, width and height
CHIMNEY_DEPTH_M = 0.6  # the distance from the ridge down to the foot of the chimney
CHIMNEY_SHARE = 0.7  # the share of houses with a pitched roof that have a chimney
CHIMNEY_TINT = "#b98d7c"


def house_body(rng: Rng, lot: Lot, style: FrontStyle, wall_height_m: float) -> list[Part]:
    """The sides, the back, the foundation and the roof of a house, in the frame of its lot.

    `wall_height_m` is the height of the walls. The roof is above them.
    """
    right, left, back_left, back_right = [_at_height(corner, 0.0) for corner in lot.local_corners_m]
    up = np.array([0.0, 0.0, wall_height_m])
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
        parapet = stood(parapet_m, style.trim, -0.06, z=wall_height_m - 0.06, bevel=0)
        return [*parts, parapet]

    eaves_m = (0.5, lot.width_m, 0.14)
    eaves = stood(eaves_m, style.trim, 0.1, z=wall_height_m - 0.16, bevel=0)
    return [*parts, eaves, *_pitched_roof(rng, lot, style, wall_height_m)]


def _foundation(right: Array, left: Array, back_left: Array, back_right: Array) -> MeshArrays:
    """The walls below the pavement. They are visible at the end of a road, where there is no pavement."""
    up = np.array([0.0, 0.0, FOUNDATION_M])
    down = -up
    sides = [
        quad_arrays(right + down, left - right, up),
        quad_arrays(left + down, back_left - left, up),
        quad_arrays(back_right + down, right - back_right, up),
    ]
    return joined_arrays(sides)


def _pitched_roof(rng: Rng, lot: Lot, style: FrontStyle, wall_height_m: float) -> list[Part]:
    """Two slopes with a ridge parallel to the street, two gables and, on some houses, a chimney."""
    right, left, back_left, back_right = lot.local_corners_m
    ridge_m = wall_height_m + float(rng.uniform(*RIDGE_M))
    middle_right = (right + back_right) / 2
    middle_left = (left + back_left) / 2
    ridge_right = _at_height(middle_right, ridge_m)
    ridge_left = _at_height(middle_left, ridge_m)

    projection = np.array([EAVES_M, 0.0])
    eaves_z_m = wall_height_m - EAVES_DROP_M
    eave_right = _at_height(right + projection, eaves_z_m)
    eave_left = _at_height(left + projection, eaves_z_m)
    back_eave_right = _at_height(back_right, eaves_z_m)
    back_eave_left = _at_height(back_left, eaves_z_m)
    tiles = matt(one_of(rng, *ROOF_TINTS), picture.masonry("tile", 1, 512, 2.0, rows=12, columns=8))
    slopes = [
        _slope(eave_right, eave_left, ridge_left, ridge_right),
        _slope(back_eave_left, back_eave_right, ridge_right, ridge_left),
    ]

    wall_right = _at_height(right, wall_height_m)
    wall_left = _at_height(left, wall_height_m)
    back_wall_right = _at_height(back_right, wall_height_m)
    back_wall_left = _at_height(back_left, wall_height_m)
    gables = [
        _triangle(wall_left, back_wall_left, ridge_left),
        _triangle(back_wall_right, wall_right, ridge_right),
    ]
    parts = [Part(joined_arrays(slopes), tiles), Part(joined_arrays(gables), style.wall)]
    has_chimney = rng.random() < CHIMNEY_SHARE
    if has_chimney:
        ridge_middle = (ridge_left + ridge_right) / 2
        along_ridge_m = rng.uniform(-0.3, 0.3) * lot.width_m
        x_m = float(ridge_middle[0])
        y_m = float(ridge_middle[1] + along_ridge_m)
        bricks = matt(CHIMNEY_TINT, picture.masonry("brick", 1))
        parts.append(stood(CHIMNEY_M, bricks, x_m, y_m, ridge_m - CHIMNEY_DEPTH_M, bevel=0))
    return parts


def _at_height(point_m: Array, z_m: float) -> Array:
    """The point (3,) above a point (2,) of the ground plan, at a height."""
    return np.array([*point_m, z_m])


def _quadrilateral(corners_m: Sequence[Array]) -> MeshArrays:
    """A flat quadrilateral with corners (4, 3). It is visible from the side where they are counter-clockwise."""
    vertices_m = np.array(corners_m)
    a, b, c = vertices_m[:3]
    normal = np.cross(b - a, c - a)
    unit_normal = normal / np.linalg.norm(normal)
    normals = np.tile(unit_normal, (4, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = vertices_m[:, :2].copy()
    return MeshArrays(vertices_m, faces, uv, normals)


def _slope(a: Array, b: Array, c: Array, d: Array) -> MeshArrays:
    """A quadrilateral whose texture coordinates run along the side from a to b, and down the slope."""
    mesh = _quadrilateral([a, b, c, d])
    along = (b - a) / np.linalg.norm(b - a)
    normal = mesh.normals[0]
    upwards = np.cross(normal, along)
    from_a_m = mesh.vertices_m - a
    u = from_a_m @ along
    v = -(from_a_m @ upwards)
    uv = np.column_stack([u, v])
    return replace(mesh, uv=uv)


def _triangle(a: Array, b: Array, c: Array) -> MeshArrays:
    """An upright triangle. It is visible from the side where its corners are counter-clockwise."""
    normal = np.cross(b - a, c - a)
    unit_normal = normal / np.linalg.norm(normal)
    normals = np.tile(unit_normal, (3, 1))
    vertices_m = np.array([a, b, c])
    along = (b - a) / np.linalg.norm(b - a)
    u = (vertices_m - a) @ along
    v = -vertices_m[:, 2]
    uv = np.column_stack([u, v])
    return MeshArrays(vertices_m, np.array([[0, 1, 2]]), uv, normals)
