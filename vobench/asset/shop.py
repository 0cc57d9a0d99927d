"""Shops behind their windows: a room with goods, in a frame whose x points out of the window, on the floor z = 0."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from vobench.asset import branching_tree, furniture, household, picture
from vobench.asset.furniture import BLACK, GREY, PAGE, STEEL, WHITE, Part, cloth, coated, matt, put, stood, wood
from vobench.asset.palette import PAINTS
from vobench.asset.picture import INKS, PAPER, SAND, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, cushion, lathe
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

NAMES: dict[str, tuple[str, ...]] = {
    "books": ("BOOKS", "THE READER", "OLD PAGES", "PRINTS"),
    "clothes": ("TAILOR", "FABRICS", "LINEN", "COATS", "DENIM"),
    "cafe": ("CAFE", "TEA ROOM", "BAKERY", "ESPRESSO", "NOODLES"),
    "grocer": ("GREENGROCER", "DELI", "FRUIT", "CORNER SHOP"),
    "flowers": ("FLORIST", "FLOWERS", "PLANTS"),
    "goods": ("HARDWARE", "PHARMACY", "OPTICIAN", "TOYS", "MUSIC", "LAMPS", "PHONES", "GIFTS"),
}
HEIGHT_M = 3.1
LAMP_M = (1.1, 0.22)


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
    sill_board_m = (0.45, width_m, sill_m - 0.02)
    parts = [
        *_room(rng, width_m, depth_m),
        stood(sill_board_m, wood("oak"), -0.225, 0, 0, bevel=0.005),
    ]
    parts += [part.moved(at(z_m=sill_m - 0.02)) for part in _display(rng, kind, width_m)]
    parts += KINDS[kind](rng, width_m, depth_m)
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
    length_m, lamp_width_m = LAMP_M
    count = max(1, round(width_m / 2.2))
    lamps = []
    for number in range(count):
        y_m = (number + 0.5) * width_m / count - width_m / 2
        corner_m = (-0.5 * depth_m - lamp_width_m / 2, y_m - length_m / 2, HEIGHT_M - 0.06)
        lamps.append(quad_arrays(corner_m, (0, length_m, 0), (lamp_width_m, 0, 0)))
    return lamps


def _display(rng: Rng, kind: str, width_m: float) -> list[Part]:
    """What stands on the sill of the window."""
    parts = []
    y_m = -width_m / 2 + 0.25
    while y_m < width_m / 2 - 0.25:
        x_m = -float(rng.uniform(0.14, 0.34))
        high_m = float(rng.uniform(0.14, 0.5))
        look = coated(one_of(rng, *INKS, PAPER, SAND, "#b3241c"), roughness=0.3)
        choice = rng.random()
        if kind == "flowers":
            plant = branching_tree.tub_plant(rng, height_m=high_m + 0.25)
            parts += [part.moved(at(x_m, y_m)) for part in plant]
        elif choice < 0.3:
            parts.append(put(_vase(high_m), look, x_m, y_m))
        elif choice < 0.75:
            size_m = (float(rng.uniform(0.05, 0.16)), float(rng.uniform(0.1, 0.28)), high_m)
            parts.append(stood(size_m, look, x_m, y_m, bevel=0.004).moved(at()))
        else:
            style = one_of(rng, "talk", "circles", "hills")
            poster = matt(texture=picture.poster(style, int(rng.integers(12))))
            parts.append(put(card_arrays((0.28, 0.4)), poster, x_m, y_m, 0.21))
        y_m += float(rng.uniform(0.24, 0.5))
    return parts


def _vase(high_m: float) -> "Trimesh":
    """A vase with a neck."""
    profile = [[0, 0], [0.07, 0], [0.09, 0.5 * high_m], [0.04, 0.8 * high_m], [0.05, high_m], [0, high_m]]
    return lathe(np.array(profile), sections=12)


def _shelves(rng: Rng, x_m: float, y_m: float, width_m: float, yaw_deg: float) -> list[Part]:
    """A tall shelf with boxes, bottles and tins, whose front faces x before it is turned."""
    palette = [one_of(rng, *INKS, PAPER, SAND, "#e3ddd0", "#b3241c") for _ in range(4)]
    boards = []
    boxes_by_colour: dict[str, list[MeshArrays]] = {}
    for level in range(5):
        board_z_m = 0.12 + 0.46 * level
        board = block_arrays((0.36, width_m, 0.03), bevel_m=0)
        boards.append(board.moved(at(0.18, 0, board_z_m)))
        begin_m = -width_m / 2 + 0.06  # of the next box, along the board
        while begin_m < width_m / 2 - 0.1:
            box_width_m = float(rng.uniform(0.06, 0.2))
            box_height_m = float(rng.uniform(0.12, 0.36))
            middle_y_m = begin_m + box_width_m / 2
            middle_z_m = board_z_m + 0.015 + box_height_m / 2
            box = block_arrays((0.2, box_width_m, box_height_m), bevel_m=0)
            colour = palette[int(rng.integers(4))]
            boxes_by_colour.setdefault(colour, []).append(box.moved(at(0.2, middle_y_m, middle_z_m)))
            begin_m += box_width_m + float(rng.choice([0.01, 0.02, 0.12]))

    side = block_arrays((0.36, 0.03, 2.2), bevel_m=0)
    sides = [side.moved(at(0.18, end * width_m / 2, 1.1)) for end in (-1, 1)]
    parts = [Part(joined_arrays([*boards, *sides]), WHITE)]
    for colour, boxes in boxes_by_colour.items():
        parts.append(Part(joined_arrays(boxes), coated(colour, roughness=0.3)))
    T_shop_shelf = at(x_m, y_m, yaw=yaw_deg)
    return [part.moved(T_shop_shelf) for part in parts]


def _along_walls(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Shelves along the back wall and one side."""
    parts = _shelves(rng, -depth_m + 0.02, 0.0, width_m - 0.3, 0.0)
    side = 1 if rng.random() < 0.5 else -1
    return parts + _shelves(rng, -depth_m / 2 - 0.2, side * (width_m / 2 - 0.02), depth_m - 1.4, -90.0 * side)


def _goods(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Shelves, and a counter."""
    counter = stood((0.6, min(1.8, width_m - 1.2), 0.95), wood("beech"), -0.62 * depth_m, 0.0, 0, bevel=0.01)
    return [*_along_walls(rng, width_m, depth_m), counter]


def _books(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """A wall of books, and a table with piles of them."""
    shelf = furniture.shelf(rng, width_m=min(width_m - 0.3, 3.0), depth_m=0.35, height_m=2.2)
    parts = [part.moved(at(-depth_m + 0.2)) for part in shelf]
    parts += _table(rng, -0.55 * depth_m, min(1.6, width_m - 1.2))
    return parts


def _table(rng: Rng, x: float, width_m: float) -> list[Part]:
    """A table with flat piles on it."""
    parts = [stood((0.8, width_m, 0.04), wood("oak"), x, 0, 0.74)]
    leg_m = (0.05, 0.05, 0.74)
    for end, side in product((-1, 1), (-1, 1)):
        parts.append(stood(leg_m, BLACK, x + end * 0.35, side * (width_m / 2 - 0.05), 0))
    for y_m in np.arange(-width_m / 2 + 0.15, width_m / 2 - 0.1, 0.25).tolist():
        pile_m = (0.24, 0.17, float(rng.uniform(0.05, 0.22)))
        look = coated(one_of(rng, *INKS, PAPER), roughness=0.4)
        pile_x_m = x + float(rng.normal(0, 0.08))
        parts.append(stood(pile_m, look, pile_x_m, y_m, 0.78, bevel=0.002))
    return parts


def _clothes(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Rails with garments along the walls, and dummies in the window."""
    parts = []
    for side in (-1, 1):
        parts += _rail_of_garments(rng, side * (width_m / 2 - 0.4), depth_m)
    count = max(1, int(width_m / 1.4))
    for number in range(count):
        y_m = (number + 0.5) * width_m / count - width_m / 2 + float(rng.normal(0, 0.08))
        parts += [part.moved(at(-0.75, y_m)) for part in _dummy(rng)]
    return parts


def _rail_of_garments(rng: Rng, y_m: float, depth_m: float) -> list[Part]:
    """A rail on two posts along a side of the shop, with garments on it."""
    first_m = -depth_m + 0.4
    last_m = -0.9
    rail = block_arrays((last_m - first_m, 0.03, 0.03), bevel_m=0)
    parts = [put(rail, STEEL, (first_m + last_m) / 2, y_m, 1.55)]
    parts += [stood((0.03, 0.03, 1.55), STEEL, x_m, y_m, 0) for x_m in (first_m, last_m)]
    for x_m in np.arange(first_m + 0.1, last_m - 0.05, 0.11).tolist():
        high_m = float(rng.uniform(0.8, 1.15))
        garment = cloth(one_of(rng, *INKS, PAPER))
        parts.append(stood((0.06, 0.44, high_m), garment, x_m, y_m, 1.5 - high_m, bevel=0.02))
    return parts


def _dummy(rng: Rng) -> list[Part]:
    """A dummy in a dress on a stand."""
    dress = np.array([[0, 0.55], [0.24, 0.55], [0.16, 1.05], [0.2, 1.32], [0.07, 1.48], [0, 1.48]])
    skin = matt("#c9b8a4")
    return [
        put(lathe(dress, sections=14), cloth(one_of(rng, *INKS, PAPER, SAND))),
        put(cushion((0.16, 0.14, 0.22), power=2.2, cells=4), skin, 0, 0, 1.62),
        stood((0.03, 0.03, 0.6), STEEL),
        stood((0.34, 0.34, 0.02), STEEL),
    ]


def _cafe(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Tables with chairs, a counter and a board with the menu."""
    parts = []
    count = max(1, int(width_m / 1.7))
    foot = [[0, 0], [0.2, 0], [0.2, 0.02], [0.03, 0.03]]
    top = [[0.03, 0.7], [0.35, 0.71], [0.35, 0.74], [0, 0.74]]
    table = lathe(np.array([*foot, *top]), sections=16)
    for number in range(count):
        y_m = (number + 0.5) * width_m / count - width_m / 2
        parts.append(put(table, wood("walnut"), -1.3, y_m))
        for side in (-1, 1):
            chair = household.dining_chair(rng)
            parts += [part.moved(at(-1.3, y_m + side * 0.55, yaw=-90.0 * side)) for part in chair]
    parts.append(stood((0.6, width_m - 1.0, 1.05), wood("oak"), -depth_m + 0.9, -0.3, 0, bevel=0.01))
    menu = matt(texture=picture.poster("talk", int(rng.integers(12))))
    parts += [put(card_arrays((0.7, 1.0)), menu, -depth_m + 0.02, y, 1.9) for y in (-0.5, 0.5)]
    return parts


def _grocer(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Sloping crates of fruit, and shelves behind."""
    parts = _shelves(rng, -depth_m + 0.02, 0.0, width_m - 0.3, 0.0)
    colours = ("#b3241c", "#d39a3c", "#7d9a3c", "#e0b83c", "#8a3f5c", "#c9652a")
    for number, y_m in enumerate(np.arange(-width_m / 2 + 0.4, width_m / 2 - 0.3, 0.62).tolist()):
        parts.append(stood((0.8, 0.56, 0.5), wood("beech"), -1.0, y_m, 0, bevel=0.004))
        fruit = _fruit(rng, -1.0, y_m)
        colour = colours[(number + int(rng.integers(3))) % len(colours)]
        parts.append(Part(joined_arrays(fruit), coated(colour, roughness=0.3)))
    return parts


def _fruit(rng: Rng, x_m: float, y_m: float) -> list[MeshArrays]:
    """Round fruit of many sizes on top of a crate."""
    fruit = []
    for _ in range(22):
        size_m = float(rng.uniform(0.07, 0.11))
        ball = as_arrays(cushion((size_m, size_m, size_m), power=2, cells=2))
        ball_x_m = x_m + float(rng.uniform(-0.33, 0.33))
        ball_y_m = y_m + float(rng.uniform(-0.22, 0.22))
        fruit.append(ball.moved(at(ball_x_m, ball_y_m, 0.5)))
    return fruit


def _flowers(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Plants in pots on steps, and a counter."""
    parts = [stood((0.5, width_m - 0.8, 0.4), wood("oak"), -depth_m + 0.5, 0, 0, bevel=0.005)]
    for y in np.arange(-width_m / 2 + 0.6, width_m / 2 - 0.5, 0.75).tolist():
        plant = branching_tree.tub_plant(rng, float(rng.uniform(0.5, 0.9)))
        parts += [part.moved(at(-depth_m + 0.5, y, 0.4)) for part in plant]
    parts.append(stood((0.6, 1.2, 0.95), PAGE, -0.6 * depth_m, 0, 0, bevel=0.01))
    parts.append(put(block_arrays((0.3, 0.3, 0.12)), GREY, -0.6 * depth_m, 0.2, 1.01))
    return parts


KINDS: dict[str, Callable[[Rng, float, float], list[Part]]] = {
    "books": _books,
    "clothes": _clothes,
    "cafe": _cafe,
    "grocer": _grocer,
    "flowers": _flowers,
    "goods": _goods,
}
