"""What is in shops: shelves, tables, counters, rails and crates with goods, by kind of shop.

Each function fills a room that is `width_m` wide along y and reaches from x = -depth_m to the window at x = 0.
"""

from collections.abc import Callable

import numpy as np

from vobench.asset import branching_tree, furniture, household, picture
from vobench.asset.furniture import BLACK, GREY, PAGE, SIDES, STEEL, WHITE, Part, cloth, coated, matt, put, stood, wood
from vobench.asset.picture import INKS, PAPER, SAND, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, cushion, lathe
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

SIGNAL_RED = "#b3241c"
PACKAGE_COLOURS = (*INKS, PAPER, SAND, "#e3ddd0", SIGNAL_RED)
COLOURS_PER_SHELF = 4
SHELF_HEIGHT_M = 2.2
SHELF_DEPTH_M = 0.36
SHELF_LEVELS = 5
LOWEST_SHELF_M = 0.12
SHELF_PITCH_M = 0.46  # between levels
PACKAGE_GAPS_M = (0.01, 0.02, 0.12)
TABLE_M = 0.74  # height of the underside of a table top
PILE_PITCH_M = 0.25
RAIL_M = 1.55  # height of a rail for garments
GARMENT_PITCH_M = 0.11
DUMMY_PITCH_M = 1.4  # of the width of a shop, at least
DRESS_PROFILE = np.array([[0, 0.55], [0.24, 0.55], [0.16, 1.05], [0.2, 1.32], [0.07, 1.48], [0, 1.48]])
SKIN = "#c9b8a4"
CAFE_TABLE_PITCH_M = 1.7  # of the width of a cafe, at least
CAFE_TABLE_X_M = -1.3
CAFE_TABLE_PROFILE = np.array(
    [[0, 0], [0.2, 0], [0.2, 0.02], [0.03, 0.03], [0.03, 0.7], [0.35, 0.71], [0.35, 0.74], [0, 0.74]]
)
MENUS = 12  # seeds of pictures
FRUIT_COLOURS = (SIGNAL_RED, "#d39a3c", "#7d9a3c", "#e0b83c", "#8a3f5c", "#c9652a")
FRUIT_CRATE_M = (0.8, 0.56, 0.5)
FRUIT_CRATE_PITCH_M = 0.62
FRUIT_X_M = -1.0  # of the middle of the crates
FRUITS = 22  # in a crate
PLANT_PITCH_M = 0.75
PLANT_STEP_M = 0.4  # height of the step on which plants stand


def _shelves(rng: Rng, x_m: float, y_m: float, width_m: float, yaw_deg: float) -> list[Part]:
    """A tall shelf with boxes, bottles and tins, whose front faces x before it is turned."""
    palette = [one_of(rng, *PACKAGE_COLOURS) for _ in range(COLOURS_PER_SHELF)]
    board = block_arrays((SHELF_DEPTH_M, width_m, 0.03), bevel_m=0)
    boards = []
    packages_by_colour: dict[str, list[MeshArrays]] = {}
    for level in range(SHELF_LEVELS):
        board_z_m = LOWEST_SHELF_M + SHELF_PITCH_M * level
        boards.append(board.moved(at(SHELF_DEPTH_M / 2, 0, board_z_m)))
        begin_m = -width_m / 2 + 0.06  # of the next package, along the board
        while begin_m < width_m / 2 - 0.1:
            package_width_m = float(rng.uniform(0.06, 0.2))
            package_height_m = float(rng.uniform(0.12, 0.36))
            middle_y_m = begin_m + package_width_m / 2
            middle_z_m = board_z_m + 0.015 + package_height_m / 2
            package = block_arrays((0.2, package_width_m, package_height_m), bevel_m=0)
            colour = palette[int(rng.integers(COLOURS_PER_SHELF))]
            packages = packages_by_colour.setdefault(colour, [])
            packages.append(package.moved(at(0.2, middle_y_m, middle_z_m)))
            begin_m += package_width_m + float(rng.choice(PACKAGE_GAPS_M))

    side_board = block_arrays((SHELF_DEPTH_M, 0.03, SHELF_HEIGHT_M), bevel_m=0)
    for side in SIDES:
        side_y_m = side * width_m / 2
        boards.append(side_board.moved(at(SHELF_DEPTH_M / 2, side_y_m, SHELF_HEIGHT_M / 2)))
    parts = [Part(joined_arrays(boards), WHITE)]
    for colour, packages in packages_by_colour.items():
        parts.append(Part(joined_arrays(packages), coated(colour, roughness=0.3)))
    T_shop_shelf = at(x_m, y_m, yaw=yaw_deg)
    return [part.moved(T_shop_shelf) for part in parts]


def _shelf_at_back(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """A shelf along the back wall."""
    return _shelves(rng, -depth_m + 0.02, 0.0, width_m - 0.3, yaw_deg=0.0)


def _shelf_at_side(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """A shelf along one of the side walls."""
    side = 1 if rng.random() < 0.5 else -1
    x_m = -depth_m / 2 - 0.2
    y_m = side * (width_m / 2 - 0.02)
    return _shelves(rng, x_m, y_m, depth_m - 1.4, yaw_deg=-90.0 * side)


def _goods(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Shelves along the back wall and one side, and a counter."""
    counter_m = (0.6, min(1.8, width_m - 1.2), 0.95)
    counter = stood(counter_m, wood("beech"), -0.62 * depth_m, bevel=0.01)
    shelves = _shelf_at_back(rng, width_m, depth_m)
    shelves += _shelf_at_side(rng, width_m, depth_m)
    return [*shelves, counter]


def _books(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """A wall of books, and a table with piles of them."""
    shelf = furniture.shelf(rng, width_m=min(width_m - 0.3, 3.0), depth_m=0.35, height_m=2.2)
    parts = [part.moved(at(-depth_m + 0.2)) for part in shelf]
    parts += _table(rng, -0.55 * depth_m, min(1.6, width_m - 1.2))
    return parts


def _table(rng: Rng, x: float, width_m: float) -> list[Part]:
    """A table with flat piles on it."""
    top_m = (0.8, width_m, 0.04)
    leg_m = (0.05, 0.05, TABLE_M)
    parts = [stood(top_m, wood("oak"), x, z=TABLE_M)]
    for end in (-1, 1):
        for side in SIDES:
            leg_x = x + end * 0.35
            leg_y = side * (width_m / 2 - 0.05)
            parts.append(stood(leg_m, BLACK, leg_x, leg_y))
    for pile_y in np.arange(-width_m / 2 + 0.15, width_m / 2 - 0.1, PILE_PITCH_M).tolist():
        pile_m = (0.24, 0.17, float(rng.uniform(0.05, 0.22)))
        cover = coated(one_of(rng, *INKS, PAPER), roughness=0.4)
        pile_x = x + float(rng.normal(0, 0.08))
        parts.append(stood(pile_m, cover, pile_x, pile_y, 0.78, bevel=0.002))
    return parts


def _clothes(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Rails with garments along the walls, and dummies in the window."""
    parts = []
    for side in SIDES:
        parts += _rail_of_garments(rng, side * (width_m / 2 - 0.4), depth_m)
    for middle_y_m in _in_a_row(width_m, DUMMY_PITCH_M):
        y_m = middle_y_m + float(rng.normal(0, 0.08))
        parts += [part.moved(at(-0.75, y_m)) for part in _dummy(rng)]
    return parts


def _in_a_row(width_m: float, pitch_m: float) -> list[float]:
    """The places of things side by side across a shop, at least `pitch_m` from one another."""
    count = max(1, int(width_m / pitch_m))
    return [(number + 0.5) * width_m / count - width_m / 2 for number in range(count)]


def _rail_of_garments(rng: Rng, y_m: float, depth_m: float) -> list[Part]:
    """A rail on two posts along a side of the shop, with garments on it."""
    first_m = -depth_m + 0.4
    last_m = -0.9
    rail = block_arrays((last_m - first_m, 0.03, 0.03), bevel_m=0)
    post_m = (0.03, 0.03, RAIL_M)
    parts = [put(rail, STEEL, (first_m + last_m) / 2, y_m, RAIL_M)]
    parts += [stood(post_m, STEEL, x_m, y_m) for x_m in (first_m, last_m)]
    for x_m in np.arange(first_m + 0.1, last_m - 0.05, GARMENT_PITCH_M).tolist():
        length_m = float(rng.uniform(0.8, 1.15))
        fabric = cloth(one_of(rng, *INKS, PAPER))
        parts.append(stood((0.06, 0.44, length_m), fabric, x_m, y_m, 1.5 - length_m, bevel=0.02))
    return parts


def _dummy(rng: Rng) -> list[Part]:
    """A dummy in a dress on a stand."""
    dress = lathe(DRESS_PROFILE, sections=14)
    head = cushion((0.16, 0.14, 0.22), power=2.2, cells=4)
    return [
        put(dress, cloth(one_of(rng, *INKS, PAPER, SAND))),
        put(head, matt(SKIN), z=1.62),
        stood((0.03, 0.03, 0.6), STEEL),
        stood((0.34, 0.34, 0.02), STEEL),
    ]


def _cafe(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Tables with chairs, a counter and a board with the menu."""
    parts = []
    table = lathe(CAFE_TABLE_PROFILE, sections=16)
    for table_y_m in _in_a_row(width_m, CAFE_TABLE_PITCH_M):
        parts.append(put(table, wood("walnut"), CAFE_TABLE_X_M, table_y_m))
        for side in SIDES:
            chair = household.dining_chair(rng)
            T_shop_chair = at(CAFE_TABLE_X_M, table_y_m + side * 0.55, yaw=-90.0 * side)
            parts += [part.moved(T_shop_chair) for part in chair]

    counter_m = (0.6, width_m - 1.0, 1.05)
    parts.append(stood(counter_m, wood("oak"), -depth_m + 0.9, -0.3, bevel=0.01))
    menu = matt(texture=picture.poster("talk", int(rng.integers(MENUS))))
    parts += [put(card_arrays((0.7, 1.0)), menu, -depth_m + 0.02, y, 1.9) for y in (-0.5, 0.5)]
    return parts


def _grocer(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Crates of fruit, and shelves behind."""
    parts = _shelf_at_back(rng, width_m, depth_m)
    crates_y_m = np.arange(-width_m / 2 + 0.4, width_m / 2 - 0.3, FRUIT_CRATE_PITCH_M).tolist()
    for number, y_m in enumerate(crates_y_m):
        parts.append(stood(FRUIT_CRATE_M, wood("beech"), FRUIT_X_M, y_m, bevel=0.004))
        fruit = _fruit(rng, FRUIT_X_M, y_m)
        colour_index = number + int(rng.integers(3))
        colour = FRUIT_COLOURS[colour_index % len(FRUIT_COLOURS)]
        parts.append(Part(joined_arrays(fruit), coated(colour, roughness=0.3)))
    return parts


def _fruit(rng: Rng, x_m: float, y_m: float) -> list[MeshArrays]:
    """Round fruit of many sizes on top of a crate."""
    crate_height_m = FRUIT_CRATE_M[2]
    fruit = []
    for _ in range(FRUITS):
        size_m = float(rng.uniform(0.07, 0.11))
        ball = as_arrays(cushion((size_m, size_m, size_m), power=2, cells=2))
        ball_x_m = x_m + float(rng.uniform(-0.33, 0.33))
        ball_y_m = y_m + float(rng.uniform(-0.22, 0.22))
        fruit.append(ball.moved(at(ball_x_m, ball_y_m, crate_height_m)))
    return fruit


def _flowers(rng: Rng, width_m: float, depth_m: float) -> list[Part]:
    """Plants in pots on a step, and a counter with a till."""
    step_x = -depth_m + 0.5
    parts = [stood((0.5, width_m - 0.8, PLANT_STEP_M), wood("oak"), step_x, bevel=0.005)]
    for y in np.arange(-width_m / 2 + 0.6, width_m / 2 - 0.5, PLANT_PITCH_M).tolist():
        plant = branching_tree.tub_plant(rng, float(rng.uniform(0.5, 0.9)))
        parts += [part.moved(at(step_x, y, PLANT_STEP_M)) for part in plant]
    counter = stood((0.6, 1.2, 0.95), PAGE, -0.6 * depth_m, bevel=0.01)
    till = block_arrays((0.3, 0.3, 0.12))
    return [*parts, counter, put(till, GREY, -0.6 * depth_m, 0.2, 1.01)]


GOODS: dict[str, Callable[[Rng, float, float], list[Part]]] = {
    "books": _books,
    "clothes": _clothes,
    "cafe": _cafe,
    "grocer": _grocer,
    "flowers": _flowers,
    "goods": _goods,
}
