"""Shops behind their windows: a room with goods, in a frame whose x points out of the window, on the floor z = 0."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vobench.asset import branching_tree, picture
from vobench.asset.furniture import WHITE, Part, coated, matt, put, stood, wood
from vobench.asset.palette import PAINTS
from vobench.asset.picture import INKS, PAPER, SAND, Rng, one_of
from vobench.asset.shape import at, card_arrays, lathe
from vobench.asset.shop_goods import GOODS, SIGNAL_RED
from vobench.scene.material import Material
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

# What is written above the window, by kind of shop
NAMES: dict[str, tuple[str, ...]] = {
    "books": ("BOOKS", "THE READER", "OLD PAGES", "PRINTS"),
    "clothes": ("TAILOR", "FABRICS", "LINEN", "COATS", "DENIM"),
    "cafe": ("CAFE", "TEA ROOM", "BAKERY", "ESPRESSO", "NOODLES"),
    "grocer": ("GREENGROCER", "DELI", "FRUIT", "CORNER SHOP"),
    "flowers": ("FLORIST", "FLOWERS", "PLANTS"),
    "goods": ("HARDWARE", "PHARMACY", "OPTICIAN", "TOYS", "MUSIC", "LAMPS", "PHONES", "GIFTS"),
}
HEIGHT_M = 3.1
LAMP_LENGTH_M = 1.1
LAMP_WIDTH_M = 0.22
LAMP_PITCH_M = 2.2  # of the width of a shop, about
BELOW_CEILING_M = 0.06
SILL_DEPTH_M = 0.45
SILL_DROP_M = 0.02  # of the board on which goods stand, below the edge of the window
FROM_SIDE_M = 0.25  # from a side of the window to the first goods in it
POSTERS = 12  # seeds of pictures
DISPLAY_COLOURS = (*INKS, PAPER, SAND, SIGNAL_RED)


@dataclass(frozen=True, slots=True)
class ShopInterior:
    """What is behind a shop window: parts, and the faces of lamps."""

    parts: list[Part]
    lamps: list[MeshArrays]


def drawn_kind(rng: Rng) -> str:
    """One of the kinds of shops."""
    return one_of(rng, *NAMES)


def interior(rng: Rng, kind: str, *, width_m: float, sill_m: float, depth_m: float) -> ShopInterior:
    """The room of a shop as wide as its window, which begins at sill_m on x = 0."""
    board_top_m = sill_m - SILL_DROP_M
    sill_board = stood((SILL_DEPTH_M, width_m, board_top_m), wood("oak"), -SILL_DEPTH_M / 2, bevel=0.005)
    parts = [*_room(rng, width_m, depth_m), sill_board]
    parts += [part.moved(at(z_m=board_top_m)) for part in _display(rng, kind, width_m)]
    parts += GOODS[kind](rng, width_m, depth_m)
    return ShopInterior(parts, _lamps(width_m, depth_m))


def _room(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """The walls, the floor and the ceiling of a shop, which are seen from inside."""
    floor = wood("oak") if rng.random() < 0.5 else _tiles()
    paint = matt(one_of(rng, "#e9e6df", "#efe9dc", *PAINTS))
    back_right_m = (-depth_m, -width_m / 2, 0)
    front_right_m = (0, -width_m / 2, 0)
    back_left_m = (-depth_m, width_m / 2, 0)
    up_m = (0, 0, HEIGHT_M)
    walls = [
        quad_arrays(back_right_m, (0, width_m, 0), up_m),
        quad_arrays(front_right_m, (-depth_m, 0, 0), up_m).flipped(),
        quad_arrays(back_left_m, (depth_m, 0, 0), up_m).flipped(),
    ]
    floor_corner_m = (-depth_m, -width_m / 2, 0.01)
    ceiling_corner_m = (-depth_m, -width_m / 2, HEIGHT_M)
    return [
        Part(joined_arrays(walls), paint),
        Part(quad_arrays(floor_corner_m, (depth_m, 0, 0), (0, width_m, 0)), floor),
        Part(quad_arrays(ceiling_corner_m, (0, width_m, 0), (depth_m, 0, 0)), WHITE),
    ]


def _tiles() -> Material:
    """Floor tiles."""
    return coated("#cfcac0", picture.masonry("tile", 0, 512, 1.2, rows=3, columns=3, bond=0.0), 0.25)


def _lamps(width_m: float, depth_m: float) -> list[MeshArrays]:
    """The faces of a row of lamps below the ceiling, across the middle of the room."""
    count = max(1, round(width_m / LAMP_PITCH_M))
    corner_x_m = -0.5 * depth_m - LAMP_WIDTH_M / 2
    lamps = []
    for number in range(count):
        middle_y_m = (number + 0.5) * width_m / count - width_m / 2
        corner_m = (corner_x_m, middle_y_m - LAMP_LENGTH_M / 2, HEIGHT_M - BELOW_CEILING_M)
        lamps.append(quad_arrays(corner_m, (0, LAMP_LENGTH_M, 0), (LAMP_WIDTH_M, 0, 0)))
    return lamps


def _display(rng: Rng, kind: str, width_m: float) -> list[Part]:
    """What stands on the sill of the window."""
    parts = []
    y_m = -width_m / 2 + FROM_SIDE_M
    while y_m < width_m / 2 - FROM_SIDE_M:
        x_m = -float(rng.uniform(0.14, 0.34))
        parts += _displayed(rng, kind, x_m, y_m)
        y_m += float(rng.uniform(0.24, 0.5))
    return parts


def _displayed(rng: Rng, kind: str, x_m: float, y_m: float) -> list[Part]:
    """A plant in the window of a florist; a vase, a box or a poster in that of others."""
    height_m = float(rng.uniform(0.14, 0.5))
    surface = coated(one_of(rng, *DISPLAY_COLOURS), roughness=0.3)
    choice = rng.random()
    if kind == "flowers":
        plant = branching_tree.tub_plant(rng, height_m=height_m + 0.25)
        return [part.moved(at(x_m, y_m)) for part in plant]
    if choice < 0.3:
        return [put(_vase(height_m), surface, x_m, y_m)]
    if choice < 0.75:
        depth_m = float(rng.uniform(0.05, 0.16))
        box_width_m = float(rng.uniform(0.1, 0.28))
        return [stood((depth_m, box_width_m, height_m), surface, x_m, y_m, bevel=0.004)]
    style = one_of(rng, "talk", "circles", "hills")
    poster = matt(texture=picture.poster(style, int(rng.integers(POSTERS))))
    return [put(card_arrays((0.28, 0.4)), poster, x_m, y_m, 0.21)]


def _vase(height_m: float) -> "Trimesh":
    """A vase with a neck."""
    profile = [[0, 0], [0.07, 0], [0.09, 0.5 * height_m], [0.04, 0.8 * height_m], [0.05, height_m], [0, height_m]]
    return lathe(np.array(profile), sections=12)
