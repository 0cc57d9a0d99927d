"""Shops behind their windows: a room with goods, in a frame whose x points out of the window, on the floor z = 0."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vobench.asset import branching_tree, furniture, household, picture
from vobench.asset.furniture import BLACK, GREY, PAGE, STEEL, WHITE, Part, cloth, coated, matt, put, stood, wood
from vobench.asset.palette import PAINTS
from vobench.asset.picture import INKS, PAPER, SAND, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, cushion, lathe
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

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
    w = width_m
    d = depth_m
    floor = (
        wood("oak")
        if rng.random() < 0.5
        else coated("#cfcac0", picture.masonry("tile", 0, 512, 1.2, rows=3, columns=3, bond=0.0), 0.25)
    )
    paint = matt(one_of(rng, "#e9e6df", "#efe9dc", *PAINTS))
    walls = [
        quad_arrays((-d, -w / 2, 0), (0, w, 0), (0, 0, HEIGHT_M)),
        quad_arrays((0, -w / 2, 0), (-d, 0, 0), (0, 0, HEIGHT_M)),
        quad_arrays((-d, w / 2, 0), (d, 0, 0), (0, 0, HEIGHT_M)),
    ]
    # Seen from inside, the first faces x, the others the middle of the room.
    walls[1] = walls[1].flipped()
    walls[2] = walls[2].flipped()
    parts = [
        Part(joined_arrays(walls), paint),
        Part(quad_arrays((-d, -w / 2, 0.01), (d, 0, 0), (0, w, 0)), floor),
        Part(quad_arrays((-d, -w / 2, HEIGHT_M), (0, w, 0), (d, 0, 0)), WHITE),
        stood((0.45, w, sill_m - 0.02), wood("oak"), -0.225, 0, 0, bevel=0.005),
    ]
    parts += [part.moved(at(z_m=sill_m - 0.02)) for part in _display(rng, kind, w)]
    parts += KINDS[kind](rng, w, d)
    lamps = []
    count = max(1, round(w / 2.2))
    for k in range(count):
        y = (k + 0.5) * w / count - w / 2
        corner = (-0.5 * d - LAMP_M[1] / 2, y - LAMP_M[0] / 2, HEIGHT_M - 0.06)
        lamps.append(quad_arrays(corner, (0, LAMP_M[0], 0), (LAMP_M[1], 0, 0)))
    return ShopInterior(parts, lamps)


def _display(rng: Rng, kind: str, width_m: float) -> list[Part]:
    """What stands on the sill of the window."""
    parts = []
    y = -width_m / 2 + 0.25
    while y < width_m / 2 - 0.25:
        x = -float(rng.uniform(0.14, 0.34))
        high_m = float(rng.uniform(0.14, 0.5))
        look = coated(one_of(rng, *INKS, PAPER, SAND, "#b3241c"), roughness=0.3)
        choice = rng.random()
        if kind == "flowers":
            parts += [part.moved(at(x, y)) for part in branching_tree.tub_plant(rng, height_m=high_m + 0.25)]
        elif choice < 0.3:
            profile = np.array(
                [[0, 0], [0.07, 0], [0.09, 0.5 * high_m], [0.04, 0.8 * high_m], [0.05, high_m], [0, high_m]]
            )
            parts.append(put(lathe(profile, sections=12), look, x, y))
        elif choice < 0.75:
            size_m = (float(rng.uniform(0.05, 0.16)), float(rng.uniform(0.1, 0.28)), high_m)
            parts.append(stood(size_m, look, x, y, bevel=0.004).moved(at()))
        else:
            poster = matt(texture=picture.poster(one_of(rng, "talk", "circles", "hills"), int(rng.integers(12))))
            parts.append(put(card_arrays((0.28, 0.4)), poster, x, y, 0.21))
        y += float(rng.uniform(0.24, 0.5))
    return parts


def _shelves(rng: Rng, x: float, y: float, width_m: float, yaw_deg: float) -> list[Part]:
    """A tall shelf with boxes, bottles and tins, whose front faces x before it is turned."""
    boards = []
    by_colour: dict[str, list[MeshArrays]] = {}
    palette = [one_of(rng, *INKS, PAPER, SAND, "#e3ddd0", "#b3241c") for _ in range(4)]
    for level in range(5):
        z = 0.12 + 0.46 * level
        boards.append(block_arrays((0.36, width_m, 0.03), bevel_m=0).moved(at(0.18, 0, z)))
        place = -width_m / 2 + 0.06
        while place < width_m / 2 - 0.1:
            w = float(rng.uniform(0.06, 0.2))
            h = float(rng.uniform(0.12, 0.36))
            box = block_arrays((0.2, w, h), bevel_m=0).moved(at(0.2, place + w / 2, z + 0.015 + h / 2))
            by_colour.setdefault(palette[int(rng.integers(4))], []).append(box)
            place += w + float(rng.choice([0.01, 0.02, 0.12]))
    sides = [block_arrays((0.36, 0.03, 2.2), bevel_m=0).moved(at(0.18, s * width_m / 2, 1.1)) for s in (-1, 1)]
    parts = [Part(joined_arrays([*boards, *sides]), WHITE)]
    parts += [Part(joined_arrays(boxes), coated(colour, roughness=0.3)) for colour, boxes in by_colour.items()]
    T = at(x, y, yaw=yaw_deg)
    return [part.moved(T) for part in parts]


def _along_walls(rng: Rng, w: float, d: float) -> list[Part]:
    """Shelves along the back wall and one side."""
    parts = _shelves(rng, -d + 0.02, 0.0, w - 0.3, 0.0)
    side = 1 if rng.random() < 0.5 else -1
    return parts + _shelves(rng, -d / 2 - 0.2, side * (w / 2 - 0.02), d - 1.4, -90.0 * side)


def _goods(rng: Rng, w: float, d: float) -> list[Part]:
    """Shelves, and a counter."""
    counter = stood((0.6, min(1.8, w - 1.2), 0.95), wood("beech"), -0.62 * d, 0.0, 0, bevel=0.01)
    return [*_along_walls(rng, w, d), counter]


def _books(rng: Rng, w: float, d: float) -> list[Part]:
    """A wall of books, and a table with piles of them."""
    shelf = furniture.shelf(rng, width_m=min(w - 0.3, 3.0), depth_m=0.35, height_m=2.2)
    parts = [part.moved(at(-d + 0.2)) for part in shelf]
    parts += _table(rng, -0.55 * d, min(1.6, w - 1.2))
    return parts


def _table(rng: Rng, x: float, width_m: float) -> list[Part]:
    """A table with flat piles on it."""
    parts = [stood((0.8, width_m, 0.04), wood("oak"), x, 0, 0.74)]
    parts += [
        stood((0.05, 0.05, 0.74), BLACK, x + sx * 0.35, sy * (width_m / 2 - 0.05), 0)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    for y in np.arange(-width_m / 2 + 0.15, width_m / 2 - 0.1, 0.25).tolist():
        high_m = float(rng.uniform(0.05, 0.22))
        look = coated(one_of(rng, *INKS, PAPER), roughness=0.4)
        parts.append(stood((0.24, 0.17, high_m), look, x + float(rng.normal(0, 0.08)), y, 0.78, bevel=0.002))
    return parts


def _clothes(rng: Rng, w: float, d: float) -> list[Part]:
    """Rails with garments along the walls, and dummies in the window."""
    parts = []
    for side in (-1, 1):
        y = side * (w / 2 - 0.4)
        first = -d + 0.4
        last = -0.9
        rail = block_arrays((last - first, 0.03, 0.03), bevel_m=0)
        parts.append(put(rail, STEEL, (first + last) / 2, y, 1.55))
        parts += [stood((0.03, 0.03, 1.55), STEEL, x, y, 0) for x in (first, last)]
        for x in np.arange(first + 0.1, last - 0.05, 0.11).tolist():
            high_m = float(rng.uniform(0.8, 1.15))
            parts.append(stood((0.06, 0.44, high_m), cloth(one_of(rng, *INKS, PAPER)), x, y, 1.5 - high_m, bevel=0.02))
    count = max(1, int(w / 1.4))
    for k in range(count):
        y = (k + 0.5) * w / count - w / 2 + float(rng.normal(0, 0.08))
        parts += [part.moved(at(-0.75, y)) for part in _dummy(rng)]
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


def _cafe(rng: Rng, w: float, d: float) -> list[Part]:
    """Tables with chairs, a counter and a board with the menu."""
    parts = []
    count = max(1, int(w / 1.7))
    for k in range(count):
        y = (k + 0.5) * w / count - w / 2
        profile = np.array(
            [[0, 0], [0.2, 0], [0.2, 0.02], [0.03, 0.03], [0.03, 0.7], [0.35, 0.71], [0.35, 0.74], [0, 0.74]]
        )
        parts.append(put(lathe(profile, sections=16), wood("walnut"), -1.3, y))
        for side in (-1, 1):
            chair = household.dining_chair(rng)
            parts += [part.moved(at(-1.3, y + side * 0.55, yaw=-90.0 * side)) for part in chair]
    parts.append(stood((0.6, w - 1.0, 1.05), wood("oak"), -d + 0.9, -0.3, 0, bevel=0.01))
    menu = matt(texture=picture.poster("talk", int(rng.integers(12))))
    parts += [put(card_arrays((0.7, 1.0)), menu, -d + 0.02, y, 1.9) for y in (-0.5, 0.5)]
    return parts


def _grocer(rng: Rng, w: float, d: float) -> list[Part]:
    """Sloping crates of fruit, and shelves behind."""
    parts = _shelves(rng, -d + 0.02, 0.0, w - 0.3, 0.0)
    colours = ("#b3241c", "#d39a3c", "#7d9a3c", "#e0b83c", "#8a3f5c", "#c9652a")
    for k, y in enumerate(np.arange(-w / 2 + 0.4, w / 2 - 0.3, 0.62).tolist()):
        parts.append(stood((0.8, 0.56, 0.5), wood("beech"), -1.0, y, 0, bevel=0.004))
        fruit = []
        for _ in range(22):
            size = float(rng.uniform(0.07, 0.11))
            ball = as_arrays(cushion((size, size, size), power=2, cells=2))
            fruit.append(
                ball.moved(at(-1.0 + float(rng.uniform(-0.33, 0.33)), y + float(rng.uniform(-0.22, 0.22)), 0.5))
            )
        look = coated(colours[(k + int(rng.integers(3))) % len(colours)], roughness=0.3)
        parts.append(Part(joined_arrays(fruit), look))
    return parts


def _flowers(rng: Rng, w: float, d: float) -> list[Part]:
    """Plants in pots on steps, and a counter."""
    parts = [stood((0.5, w - 0.8, 0.4), wood("oak"), -d + 0.5, 0, 0, bevel=0.005)]
    for y in np.arange(-w / 2 + 0.6, w / 2 - 0.5, 0.75).tolist():
        parts += [
            part.moved(at(-d + 0.5, y, 0.4)) for part in branching_tree.tub_plant(rng, float(rng.uniform(0.5, 0.9)))
        ]
    parts.append(stood((0.6, 1.2, 0.95), PAGE, -0.6 * d, 0, 0, bevel=0.01))
    parts.append(put(block_arrays((0.3, 0.3, 0.12)), GREY, -0.6 * d, 0.2, 1.01))
    return parts


KINDS: dict[str, Callable[[Rng, float, float], list[Part]]] = {
    "books": _books,
    "clothes": _clothes,
    "cafe": _cafe,
    "grocer": _grocer,
    "flowers": _flowers,
    "goods": _goods,
}
