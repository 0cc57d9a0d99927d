"""Structures of parks: map boards, monuments and pavilions. They stand on the plane z = 0 at the origin."""

import numpy as np

from vobench.asset import picture
from vobench.asset.furniture import SIDES, Part, coated, matt, put, stood, wood
from vobench.asset.picture import NAVY, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, lathe, tube_arrays
from vobench.geometry.se3 import Array
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

STONE_TINTS = ("#cfc8ba", "#a8a49a", "#c9b49a", "#8f938f")
FOUNDATION_M = 0.25  # the depth of the lower step of a monument below the ground
LOWER_STEP_M = 0.5  # the height of the lower step, including the foundation
UPPER_STEP_M = 0.2  # the height of the upper step
STEPS_M = 0.45  # the height of both steps above the ground
CORNICE_M = 0.12  # the height of the cornice on the plinth
STEPS_AND_CORNICE_M = 0.57  # STEPS_M + CORNICE_M
PLATE_GAP_M = 0.004  # the distance of the plate from the plinth, so that their surfaces do not coincide
# The profiles (N, 2) of the figures that stand on a plinth: radius and height, for a plinth that is 1.25 m wide.
FIGURES = {
    "obelisk": np.array([[0, 0], [0.3, 0], [0.2, 2.0], [0, 2.3]]),
    "urn": np.array([[0, 0], [0.22, 0], [0.1, 0.12], [0.3, 0.4], [0.34, 0.62], [0.2, 0.74], [0.28, 0.8], [0, 0.8]]),
    "sphere": np.array([[0, 0.0], [0.2, 0.04], [0.37, 0.22], [0.42, 0.42], [0.37, 0.62], [0.2, 0.8], [0, 0.84]]),
}

PAVILION_SIDES = 6  # the number of sides, and of posts
PAVILION_PAINTS = ("#e4e2dc", "#5f7468", "#6d6472", "#46586a")
ROOF_TINTS = ("#8d4a36", "#4f5a58", "#5a5142")
EAVES_M = 2.45  # the height of the edge of the roof
RAIL_HEIGHTS_M = (0.5, 1.0)  # the heights of the rails between the posts


def map_board(seed: int) -> list[Part]:
    """A board with a map of the park under a small roof. It faces x."""
    timber = wood("walnut")
    posts = [stood((0.09, 0.09, 1.9), timber, 0, side * 0.62) for side in SIDES]
    map_picture = matt(texture=picture.poster("circles", seed, 1000, 700))
    title_picture = matt(texture=picture.sign("PARK", NAVY))
    sheet = put(card_arrays((1.15, 0.8)), map_picture, 0.021, z=1.35)
    back = stood((0.04, 1.2, 0.86), timber, z=0.92)
    roof = stood((0.3, 1.5, 0.05), timber, 0.03, z=1.9)
    title = put(card_arrays((0.6, 0.3)), title_picture, 0.0465, z=1.65)
    return [*posts, sheet, back, roof, title]


def monument(rng: Rng) -> list[Part]:
    """A monument: two steps, and a plinth that bears an obelisk, an urn or a sphere."""
    tint = one_of(rng, *STONE_TINTS)
    stone = matt(tint, picture.ground("concrete", int(rng.integers(4)), 1024, 1.4))
    width_m = float(rng.uniform(0.8, 1.3))  # the width of the plinth
    height_m = float(rng.uniform(0.8, 1.5))  # the height of the plinth
    plinth_top_m = STEPS_M + height_m

    lower_step_m = (2.2 * width_m, 2.2 * width_m, LOWER_STEP_M)
    upper_step_m = (1.5 * width_m, 1.5 * width_m, UPPER_STEP_M)
    plinth_m = (width_m, width_m, height_m)
    cornice_m = (1.2 * width_m, 1.2 * width_m, CORNICE_M)
    texture_offset = float(rng.uniform(0, 1))
    base = [
        stood(lower_step_m, stone, z=-FOUNDATION_M, bevel=0.02),
        stood(upper_step_m, stone, z=0.25, bevel=0.02),
        stood(plinth_m, stone, z=STEPS_M, bevel=0.03, u=texture_offset),
        stood(cornice_m, stone, z=plinth_top_m, bevel=0.03),
    ]

    year = int(rng.integers(1780, 1960))
    year_picture = matt(texture=picture.sign(f"{year}"))
    plate = put(card_arrays((0.6 * width_m, 0.3 * width_m)), year_picture)
    T_monument_plate = at(width_m / 2 + PLATE_GAP_M, 0, STEPS_M + 0.6 * height_m)

    kind = one_of(rng, *FIGURES)
    sections = 4 if kind == "obelisk" else 24
    figure_scale = 0.8 * width_m
    figure = lathe(FIGURES[kind] * figure_scale, sections=sections)
    figure_z_m = STEPS_AND_CORNICE_M + height_m
    return [*base, plate.moved(T_monument_plate), put(figure, stone, z=figure_z_m, yaw=45)]


def pavilion(rng: Rng) -> list[Part]:
    """A pavilion: a floor of boards, and a roof on six posts, with rails between the posts."""
    radius_m = float(rng.uniform(1.6, 2.3))
    timber = wood(one_of(rng, "oak", "walnut"))
    paint = coated(one_of(rng, *PAVILION_PAINTS), roughness=0.4)
    shingles = matt(one_of(rng, *ROOF_TINTS), picture.boards("walnut", 3, 512, 0.8))

    floor_radius_m = radius_m + 0.2
    roof_radius_m = radius_m + 0.5
    edge_top_m = EAVES_M + 0.08
    apex_m = EAVES_M + 1.3
    floor_profile = np.array([[0, -0.3], [floor_radius_m, -0.3], [floor_radius_m, 0.12], [0, 0.12]])
    roof_profile = np.array([[0, EAVES_M], [roof_radius_m, EAVES_M], [roof_radius_m, edge_top_m], [0, apex_m]])
    return [
        put(lathe(floor_profile, sections=PAVILION_SIDES), timber),
        put(lathe(roof_profile, sections=PAVILION_SIDES), shingles),
        Part(_posts(radius_m), paint),
        Part(_rails(radius_m), paint),
    ]


def _corner_m(radius_m: float, number: int) -> Array:
    """The position (2,) of a corner of a pavilion."""
    angle_rad = np.deg2rad(360 // PAVILION_SIDES * number)
    return radius_m * np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _posts(radius_m: float) -> MeshArrays:
    """A post at each corner of a pavilion."""
    post = block_arrays((0.12, 0.12, EAVES_M), bevel_m=0.01)
    posts = []
    for number in range(PAVILION_SIDES):
        x_m, y_m = _corner_m(radius_m, number).tolist()
        posts.append(post.moved(at(x_m, y_m, EAVES_M / 2 + 0.1)))
    return joined_arrays(posts)


def _rails(radius_m: float) -> MeshArrays:
    """Two rails on each side of a pavilion, except on the first one, which is the entrance."""
    rails = []
    for number in range(1, PAVILION_SIDES):
        ends_m = np.stack([_corner_m(radius_m, number), _corner_m(radius_m, number + 1)])
        for z_m in RAIL_HEIGHTS_M:
            path_m = np.column_stack([ends_m, [z_m, z_m]])
            rails.append(tube_arrays(path_m, 0.03, sections=6))
    return joined_arrays(rails)
