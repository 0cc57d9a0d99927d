"""A flat: a kitchen to the west and a living room to the east of an opening, with windows, furniture and lamps."""

from dataclasses import replace

import numpy as np

from vobench.plugin import (
    BLACK,
    DARK,
    FINISHES,
    NAVY,
    OUTWARD,
    SAND,
    STEEL,
    AreaLight,
    Opening,
    Part,
    Piece,
    Steady,
    at,
    block,
    bulb,
    coated,
    extrusion,
    flipped,
    joined,
    kitchen,
    matt,
    picture,
    pierced,
    put,
    quad,
    shell,
    stood,
    things,
    wood,
)

LONG = 9.6
WIDE = 5.4
HIGH = 2.55
# the wall between kitchen and living room
WALL_X = -1.2
WALL_M = 0.14
# its opening, along y, and how high that is
GAP = (-1.2, 0.5)
GAP_M = 2.15
TOP_M = 0.9  # of the worktop
WINDOWS = (
    Opening("south", (2.9, 1.13), (2.2, 2.16)),
    Opening("south", (0.4, 1.5), (1.3, 1.3)),
    Opening("south", (-3.0, 1.5), (1.5, 1.3)),
    Opening("west", (0.9, 1.6), (1.1, 1.1)),
)
WARM = (1.25, 0.95, 0.62)
DIM = Steady(0.01)


def make(seed):
    """Its things, their materials and its lamps."""
    plaster = matt("#efe9dc", picture.ground("plaster", 0, 1280, 1.6))
    oak = FINISHES["oak_floor"]()
    walls = {**dict.fromkeys(OUTWARD, plaster), "east": matt("#a9b5a6", picture.ground("plaster", 1, 1280, 1.6))}
    ceiling = matt("#f4f1ea", picture.ground("plaster", 2, 640, 1.6))
    room = [r for r in shell((LONG, WIDE, HIGH), WINDOWS, floor=oak, ceiling=ceiling, walls=walls) if r[0] != "floor"]
    coarse, known = things([*room, ("floor", _floor(oak)), ("partition", _partition(plaster))])
    pieces = [piece.build(seed) for piece in (*_kitchen_pieces(), *_living_pieces(), *_windows())]
    fine, known = things([*pieces, *_kitchen()], known)
    spaced = ((coarse, 0.06), (fine, 0.05))
    return tuple(replace(thing, spacing_m=at_m) for some, at_m in spaced for thing in some), known, _lamps()


def _floor(oak):
    """Oak in the living room, tiles in the kitchen, a strip of wood between them."""
    tiles = coated("#e8e2d6", picture.masonry("tile", 5, 1024, 1.2, rows=4, columns=4, bond=0.0), roughness=0.12)
    rest = LONG / 2 - WALL_X
    return [
        Part(pierced((WALL_X, -WIDE / 2, 0), (rest, 0, 0), (0, WIDE, 0)), oak),
        Part(pierced((-LONG / 2, -WIDE / 2, 0), (LONG - rest, 0, 0), (0, WIDE, 0)), tiles),
        stood((0.05, GAP[1] - GAP[0], 0.005), wood("walnut"), WALL_X, sum(GAP) / 2, 0, bevel=0.002),
    ]


def _partition(plaster):
    """The wall with the opening, lined with oak."""
    south = GAP[0] + WIDE / 2
    north = WIDE / 2 - GAP[1]
    wide = GAP[1] - GAP[0]
    sides = [((GAP[0] - WIDE / 2) / 2, south, 0.0, HIGH), ((GAP[1] + WIDE / 2) / 2, north, 0.0, HIGH)]
    blocks = [
        block((WALL_M, long, high), bevel_m=0, transform=at(WALL_X, y, z + high / 2))
        for y, long, z, high in (*sides, (sum(GAP) / 2, wide, GAP_M, HIGH - GAP_M))
    ]
    jambs = [
        stood((WALL_M + 0.03, 0.025, GAP_M), wood("oak"), WALL_X, y + s * 0.0125)
        for y, s in zip(GAP, (1, -1), strict=True)
    ]
    lintel = stood((WALL_M + 0.03, wide, 0.025), wood("oak"), WALL_X, sum(GAP) / 2, GAP_M - 0.025)
    return [Part(joined(blocks), plaster), *jambs, lintel]


def _lamps():
    """Bulbs in the shades and a strip below the wall cupboards, all but off by day."""
    strip = quad((-4.2, 2.36, 1.447), (0, 0.03, 0), (2.2, 0, 0))
    yield AreaLight("pendant", bulb(-3.0, -1.5, 1.52, 0.16), 2200.0, DIM, colour=WARM)
    yield AreaLight("floor_lamp", bulb(1.55, 1.95, 1.47, 0.16), 3000.0, DIM, colour=WARM)
    yield AreaLight("table_lamp", bulb(0.35, 2.42, 1.21, 0.12), 1300.0, DIM, colour=WARM)
    yield AreaLight("strip", strip, 1400.0, DIM, colour=(1.08, 0.99, 0.84))


def _kitchen():
    """Units along the north and the west wall, their worktop, tiles above it, a hob, a hood and a fridge."""
    north = WIDE / 2 - 0.3
    west = -LONG / 2 + 0.3
    rows = (0.34, 0.26, 0.17)
    line = [
        ("drawers", kitchen.cupboard(0.6, drawers=rows), at(-3.9, north, 0.1, yaw=-90)),
        ("oven", kitchen.oven(), at(-3.3, north, 0.1, yaw=-90)),
        ("cupboard", kitchen.cupboard(1.1, doors=2), at(-2.45, north, 0.1, yaw=-90)),
        ("corner", kitchen.cupboard(0.6), at(west, 1.8, 0.1)),
        ("sink_unit", kitchen.cupboard(1.2, doors=2), at(west, 0.9, 0.1)),
        ("dishwasher", kitchen.cupboard(0.6, drawers=(0.6, 0.17)), at(west, 0.0, 0.1)),
        ("fridge", kitchen.fridge(), at(-1.585, WIDE / 2 - 0.3, 0.0, yaw=-90)),
    ]  # fmt: skip
    for k, (x, wide, doors) in enumerate(((-4.2, 1.2, 2), (-2.45, 1.1, 2))):
        cupboard = kitchen.cupboard(wide, doors=doors, height_m=0.72, depth_m=0.33, colour="#e4e0d6")
        line.append((f"wall_cupboard_{k}", cupboard, at(x, WIDE / 2 - 0.166, 1.45, yaw=-90)))
    for name, parts, place in line:
        yield name, [part.moved(place) for part in parts]
    x0 = -LONG / 2
    x1 = -1.9
    y0 = -0.3
    y1 = WIDE / 2
    outline = [(x0, y0), (x0 + 0.62, y0), (x0 + 0.62, y1 - 0.62), (x1, y1 - 0.62), (x1, y1), (x0, y1)]
    hole = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [0.21, 0.28] + [x0 + 0.32, 0.9]
    top = put(extrusion(outline, 0.03, holes_m=[hole]), wood("beech"), z=TOP_M - 0.03)
    plinth = [(x0, y0), (x0 + 0.54, y0), (x0 + 0.54, y1 - 0.54), (x1, y1 - 0.54), (x1, y1), (x0, y1)]
    yield (
        "worktop",
        [top, put(extrusion(plinth, 0.1), DARK), *(p.moved(at(x0 + 0.32, 0.9, TOP_M)) for p in kitchen.sink())],
    )
    tiles = coated("#eef0ec", picture.masonry("tile", 3, 1024, 0.8, rows=10, columns=5), roughness=0.1)
    back = [flipped(quad((x1, y1 - 0.008, TOP_M), (x0 - x1, 0, 0), (0, 0, 0.56)))]
    back += [quad((x0 + 0.008, y1, TOP_M), (0, y0 - y1, 0), (0, 0, 0.13))]
    yield (
        "splashback",
        [put(block((x1 - x0, 0.008, 0.56), bevel_m=0.001), tiles, (x0 + x1) / 2, y1 - 0.004, TOP_M + 0.28)],
    )
    yield (
        "west_tiles",
        [put(block((0.008, y1 - y0, 0.12), bevel_m=0.001), tiles, x0 + 0.004, (y0 + y1) / 2, TOP_M + 0.06)],
    )
    yield "hob", [part.moved(at(-3.3, y1 - 0.31, TOP_M)) for part in (*kitchen.hob(), *kitchen.pot(-0.14, 0.13, 0.01))]
    hood = [stood((0.6, 0.48, 0.06), STEEL, 0, -0.24, 1.6), stood((0.26, 0.24, HIGH - 1.66), STEEL, 0, -0.12, 1.66)]
    yield "hood", [part.moved(at(-3.3, y1, 0)) for part in hood]
    yield "worktop_things", list(_worktop_things())


def _worktop_things():
    """A kettle, jars, boards, a block of knives and a bottle."""
    yield from kitchen.kettle(-4.45, 1.55, TOP_M, yaw_deg=40)
    for k, (x, tall, ink) in enumerate(((-2.75, 0.2, "#b98a4e"), (-2.6, 0.16, "#d9cfb8"), (-2.46, 0.24, "#8a4a2e"))):
        yield from kitchen.jar(x, 2.55, TOP_M, height_m=tall, colour=ink, yaw_deg=40 * k)
    for k, (y, w, h) in enumerate(((2.62, 0.28, 0.4), (2.59, 0.22, 0.32))):
        yield put(
            block((w, 0.018, h), bevel_m=0.004), wood(("walnut", "oak")[k]), -2.12 + 0.03 * k, y, TOP_M + h / 2, roll=-5
        )
    yield stood((0.12, 0.2, 0.22), wood("walnut"), -4.55, 2.4, TOP_M, bevel=0.01)
    for k in range(4):
        yield put(
            block((0.02, 0.026, 0.11), bevel_m=0.006), BLACK, -4.58 + 0.022 * k, 2.35 + 0.03 * (k % 2), TOP_M + 0.26
        )
    yield from kitchen.bottle(-3.75, 2.5, TOP_M)


def _kitchen_pieces():
    """A table with four chairs, what lies on it, and what hangs on the walls."""
    yield Piece("table", "kitchen_table", (-3.0, -1.5, 0), 90, size={"width_m": 1.5})
    for k, (x, y, yaw) in enumerate(((-3.36, -0.92, -84), (-2.62, -0.85, -97), (-3.4, -2.1, 92), (-2.6, -2.05, 86))):
        yield Piece("dining_chair", f"kitchen_chair_{k}", (x, y, 0), yaw, size={"colour": (NAVY, SAND)[k % 2]})
    yield Piece("fruit_bowl", "fruit", (-3.05, -1.5, 0.74), 20)
    yield Piece("mug", "table_mug", (-2.6, -1.32, 0.74))
    yield Piece("papers", "table_papers", (-3.42, -1.38, 0.74), 70, size={"count": 3})
    yield Piece("pendant", "pendant", (-3.0, -1.5, HIGH), size={"drop_m": 1.13, "colour": "#2c4a4a", "wide_m": 0.46})
    yield Piece(
        "framed",
        "kitchen_print",
        (-1.27, -1.95, 1.6),
        180,
        size={"style": "circles", "seed": 6, "width_m": 0.5, "height_m": 0.7},
    )
    yield Piece(
        "framed",
        "kitchen_print_b",
        (-4.8, -1.5, 1.55),
        0,
        size={"style": "hills", "seed": 12, "width_m": 0.9, "height_m": 0.6},
    )
    yield Piece("book_stack", "cookbooks", (-4.58, -0.1, TOP_M), 90, size={"count": 3})
    yield Piece("mug", "sink_mug", (-4.35, 0.35, TOP_M))
    yield Piece("plant", "herbs", (-4.85, 0.62, 1.08), size={"height_m": 0.26, "leaves": 14})
    yield Piece("waste_bin", "kitchen_bin", (-4.55, -0.6, 0))
    yield Piece("socket", "socket_k", (-2.0, 2.691, 1.15), -90)


def _living_pieces():
    """A sofa before a television, shelves, lamps, plants and pictures."""
    yield Piece("rug", "rug", (2.75, 0.3, 0), 90, size={"width_m": 2.0, "depth_m": 2.7, "seed": 2})
    yield Piece("sofa", "sofa", (1.45, 0.35, 0), 0, size={"width_m": 2.1, "colour": "#8f8a80"})
    yield Piece(
        "table",
        "coffee_table",
        (2.75, 0.35, 0),
        0,
        size={"width_m": 1.1, "depth_m": 0.6, "height_m": 0.42, "tones": "walnut"},
    )
    yield Piece("book_stack", "coffee_books", (2.8, 0.6, 0.42), 75, size={"count": 3})
    yield Piece("mug", "coffee_mug", (2.62, 0.1, 0.42))
    yield Piece("television", "television", (4.5, 0.35, 0.46), 180, size={"seed": 5, "width_m": 1.25})
    yield Piece("low_board", "low_board", (4.56, 0.35, 0), 180)
    yield Piece("plant", "board_plant", (4.6, 1.2, 0.46), size={"height_m": 0.45, "leaves": 16})
    yield Piece("book_stack", "board_books", (4.58, -0.5, 0.46), 100, size={"count": 4})
    yield Piece(
        "shelf", "bookcase", (3.3, 2.55, 0), -90, size={"width_m": 2.0, "height_m": 2.1, "tones": "oak", "seed": 1}
    )
    yield Piece("low_board", "sideboard", (0.75, 2.45, 0), -90, size={"width_m": 1.3, "height_m": 0.78})
    yield Piece(
        "floor_lamp", "table_lamp", (0.35, 2.42, 0.78), size={"height_m": 0.52, "wide_m": 0.3, "colour": "#c9b48c"}
    )
    yield Piece(
        "framed",
        "painting",
        (1.0, WIDE / 2, 1.62),
        -90,
        size={"width_m": 1.1, "height_m": 0.8, "style": "hills", "seed": 3},
    )
    yield Piece("book_stack", "sideboard_books", (1.15, 2.46, 0.78), -80, size={"count": 5})
    yield Piece("floor_lamp", "floor_lamp", (1.55, 1.95, 0), size={"height_m": 1.62})
    yield Piece("door", "door", (-0.55, WIDE / 2, 0), -90, size={"label": "", "tones": "oak"})
    yield Piece("plant", "plant_a", (4.3, -2.15, 0), size={"height_m": 1.7, "leaves": 34})
    yield Piece("plant", "plant_b", (-0.72, -2.3, 0), size={"height_m": 1.15})
    for k, (y, style, seed) in enumerate(((1.1, "circles", 4), (1.7, "hills", 9), (2.3, "circles", 15))):
        yield Piece(
            "framed",
            f"print_{k}",
            (WALL_X + WALL_M / 2, y, 1.6),
            0,
            size={"style": style, "seed": seed, "width_m": 0.42, "height_m": 0.6},
        )
    yield Piece(
        "framed",
        "east_print",
        (LONG / 2, -1.35, 1.6),
        180,
        size={"style": "circles", "seed": 22, "width_m": 0.6, "height_m": 0.85},
    )
    yield Piece("radiator", "radiator", (0.4, -WIDE / 2, 0), 90, size={"width_m": 1.1})
    yield Piece("radiator", "radiator_k", (-3.0, -WIDE / 2, 0), 90, size={"width_m": 1.3})
    yield Piece("socket", "socket_a", (LONG / 2, -0.7, 0.3), 180)
    yield Piece("socket", "socket_b", (-0.02, WIDE / 2, 0.3), -90, size={"count": 1})
    for name, x, y, yaw, long in (
        ("south_a", 0.07, -WIDE / 2, 90, 2.4), ("south_b", 4.41, -WIDE / 2, 90, 0.76), ("east", LONG / 2, 0, 180, WIDE),
        ("north", 2.4, WIDE / 2, -90, LONG / 2), ("gap_a", -1.13, 1.6, 0, 2.15), ("gap_b", -1.13, -1.95, 0, 1.45),
        ("gap_c", -1.27, -1.95, 180, 1.45), ("south_k", -3.03, -WIDE / 2, 90, 3.5), ("west", -LONG / 2, -1.5, 0, 2.4),
    ):  # fmt: skip
        yield Piece("skirting", f"skirting_{name}", (x, y, 0), yaw, size={"length_m": long})


def _windows():
    """Frames and curtains."""
    turn = {"south": 90, "west": 0}
    for k, window in enumerate(WINDOWS):
        (along, up) = window.center_m
        (wide, high) = window.size_m
        x, y = (along, -WIDE / 2) if window.wall == "south" else (-LONG / 2, along)
        yield Piece(
            "window_frame", f"frame_{k}", (x, y, up), turn[window.wall], size={"width_m": wide, "height_m": high}
        )
        if window.wall == "south":
            for s in (-1, 1):
                size = {
                    "width_m": 0.45,
                    "height_m": 2.36 if high > 2 else 1.75,
                    "colour": ("#c9b99a", "#b7c0b4")[k == 2],
                }
                yield Piece("curtain", f"curtain_{k}_{s}", (x + s * (wide / 2 + 0.12), y, 2.42), 90, size=size)
            yield Piece(
                "pipe",
                f"rod_{k}",
                (x, y - 0.03, 2.43),
                90,
                size={"length_m": wide + 1.0, "radius_m": 0.012, "colour": "#3d4144"},
            )
