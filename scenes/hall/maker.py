"""A hall behind a wall of glass: columns, lifts, mirrors, a reception desk, a meeting room of glass, and a square."""

from dataclasses import replace

import numpy as np

from vobench.plugin import (
    CHROME,
    DARK,
    FINISHES,
    INK,
    NAVY,
    OUTWARD,
    PAPER,
    STEEL,
    TEAL,
    WHITE,
    AreaLight,
    Material,
    Opening,
    Part,
    Piece,
    at,
    bars,
    block,
    card,
    coated,
    joined,
    lathe,
    matt,
    picture,
    pierced,
    put,
    quad,
    shell,
    stood,
    things,
    tube,
    wood,
)

LONG = 22.0
WIDE = 12.0
HIGH = 4.4
BAYS_X = tuple(3.6 * (k - 2.5) for k in range(6))  # middles of the panes
PANE_M = (3.5, 4.1)
COLUMNS = tuple((x, y) for x in (-7.2, 0.0, 7.2) for y in (-2.6, 2.6))
PANELS = tuple((x, y) for x in (-7.4, -3.6, 0.0, 3.6, 7.4) for y in (-4.2, 0.0, 4.2))
# the inner corner of the meeting room
ROOM_X = -6.4
ROOM_Y = 2.4


def make(seed):
    """Its things, their materials and its lamps."""
    floor = replace(FINISHES["terrazzo"](), colour=(0.86, 0.86, 0.88))
    wall = matt("#e6e3dc", picture.ground("plaster", 4, 1280, 1.8))
    ceiling = matt("#efeeea")
    walls = {
        **dict.fromkeys(OUTWARD, wall),
        "north": matt("#c9c2b4", picture.masonry("tile", 7, 1024, 2.4, rows=2, columns=2)),
    }
    front = [Opening("south", (x, 2.1), PANE_M, 0.12) for x in BAYS_X]
    glass = Material("pane", eta=1.5, tint=0.75)
    room = shell((LONG, WIDE, HIGH), front, floor=floor, ceiling=ceiling, walls=walls, frame=DARK, pane=glass)
    made, known = things(room)
    built = [("mullions", list(_mullions())), ("columns", list(_columns())), ("trays", list(_trays())),
             ("reception", list(_reception())), ("lifts", list(_lifts())), *_signs()]  # fmt: skip
    inner, known = things([*built, *(piece.build(seed) for piece in _pieces())], known)
    outer, known = things([*_square(), *(piece.build(seed) for piece in _outside())], known)
    spaced = ((made, 0.12), (inner, 0.08), (outer, 0.5))
    return tuple(replace(thing, spacing_m=at_m) for some, at_m in spaced for thing in some), known, _lamps()


def _lamps():
    """Panels in the ceiling and a strip that washes the wall behind the desk."""
    faces = [quad((x - 0.55, y - 0.55, HIGH - 0.041), (0, 1.1, 0), (1.1, 0, 0)) for x, y in PANELS]
    yield AreaLight("panels", joined(faces), 5000.0 * len(faces), colour=(1.06, 0.99, 0.9))
    yield AreaLight("wash", quad((3.4, 5.42, 2.963), (0, 0.05, 0), (4.2, 0, 0)), 2600.0, colour=(1.2, 0.96, 0.66))


def _trays():
    """What holds the panels, and the shelf above the sign of the reception."""
    for x, y in PANELS:
        yield stood((1.16, 1.16, 0.04), WHITE, x, y, HIGH - 0.04, bevel=0.004)
    yield stood((4.4, 0.62, 0.08), wood("walnut"), 5.5, WIDE / 2 - 0.3, 2.965)


def _mullions():
    """Posts and rails before the panes, with a double door amid them."""
    y = -WIDE / 2 - 0.04
    edges = [x + s * 1.8 for x in BAYS_X for s in ((-1, 1) if x == BAYS_X[-1] else (-1,))]
    posts = [block((0.1, 0.14, 4.3), bevel_m=0.004, transform=at(x, y, 2.15)) for x in edges]
    posts += [block((0.06, 0.1, 4.1), bevel_m=0.004, transform=at(x, y, 2.1)) for x in BAYS_X]
    rails = [block((LONG - 0.4, 0.12, 0.09), bevel_m=0.004, transform=at(0, y, z)) for z in (0.07, 2.5, 4.17)]
    yield Part(joined([*posts, *rails]), DARK)
    grip = tube([[0, 0, 0.7], [0, 0, 1.6]], 0.018, sections=12)
    ends = [tube([[0, 0, z], [0, -0.07, z]], 0.012) for z in (0.8, 1.5)]
    for x in (1.8 - 0.14, 1.8 + 0.14):
        yield put(joined([grip, *ends]), CHROME, x, y + 0.13)


def _columns():
    """Round columns of stone with rings of steel at their feet and heads."""
    stone = matt("#e9e6df", picture.ground("concrete", 7, 1024, 2.2))
    shaft = lathe([[0, 0], [0.3, 0], [0.3, HIGH], [0, HIGH]], sections=40)
    ring = lathe([[0, 0], [0.315, 0], [0.315, 0.14], [0.3, 0.145], [0, 0.145]], sections=40)
    for k, (x, y) in enumerate(COLUMNS):
        yield put(shaft, stone, x, y, yaw=50 * k)
        yield put(ring, STEEL, x, y)
        yield put(ring, STEEL, x, y, HIGH - 0.145)
        if k % 2:
            sign = matt(texture=picture.sign("ABC"[k // 2], (NAVY, TEAL, INK)[k // 2]))
            yield put(card((0.3, 0.15)), sign, x, y - 0.311, 1.9, yaw=-90)


def _reception():
    """A desk of walnut slats under stone before a panel with a name, and what works on it."""
    x = 5.5
    y = 3.3
    long = 4.0
    stone = Material(colour=(0.75, 0.74, 0.72), texture=picture.terrazzo(3, 1024, 1.2), eta=1.5, roughness=0.06)
    yield stood((long, 0.05, 1.02), DARK, x, y - 0.34, 0.04)
    slats = [
        block((0.035, 0.03, 1.0), bevel_m=0.004, transform=at(x + d, y - 0.378, 0.55))
        for d in np.arange(-1.97, 2.0, 0.06)
    ]
    yield Part(joined(slats), wood("walnut"))
    yield stood((long + 0.1, 0.42, 0.05), stone, x, y - 0.25, 1.06, bevel=0.006)
    yield stood((long, 0.75, 0.03), wood("walnut"), x, y + 0.05, 0.74)
    for s in (-1, 1):
        yield stood((0.05, 0.72, 1.06), wood("walnut"), x + s * (long / 2 - 0.03), y + 0.04)
    yield stood((long, 0.02, 0.04), STEEL, x, y - 0.37, 0, bevel=0.002)
    panel = matt("#3b4a4c")
    back = WIDE / 2 - 0.02
    yield stood((4.4, 0.04, 2.96), wood("walnut"), x, back)
    yield put(
        card((1.6, 0.8)),
        coated("#ffffff", picture.sign("ATLAS", "#2c3a3c"), roughness=0.2),
        x,
        back - 0.0215,
        2.1,
        yaw=-90,
    )
    yield put(bars(1.6, 0.8, 0.02, 0.03), panel, x, back - 0.021, 2.1, yaw=-90)


def _lifts():
    """Two lifts with doors of steel, a plate of buttons between them and their floors above."""
    y = WIDE / 2
    for k, x in enumerate((-4.4, -2.2)):
        leaf = [block((0.545, 0.03, 2.2), bevel_m=0.003, transform=at(x + s * 0.274, y - 0.02, 1.1)) for s in (-1, 1)]
        yield Part(joined(leaf), replace(STEEL, roughness=0.18))
        jambs = [block((0.14, 0.12, 2.34), bevel_m=0.006, transform=at(x + s * 0.62, y - 0.055, 1.17)) for s in (-1, 1)]
        lintel = block((1.1, 0.12, 0.14), bevel_m=0.006, transform=at(x, y - 0.055, 2.27))
        yield Part(joined([*jambs, lintel]), DARK)
        yield put(
            card((0.28, 0.14)), matt(texture=picture.sign(f"{k} {'vA'[k]}", "#141617")), x, y - 0.02, 2.5, yaw=-90
        )
    yield put(block((0.1, 0.02, 0.26), bevel_m=0.004), STEEL, -3.3, y - 0.01, 1.15)
    for z in (1.1, 1.2):
        yield put(lathe([[0, 0], [0.02, 0], [0.02, 0.006], [0, 0.006]]), coated(PAPER), -3.3, y - 0.02, z, roll=90)


def _signs():
    """Boards that hang across, and one that stands by the door."""
    rods = [tube([[0, s * 0.45, 0], [0, s * 0.45, HIGH - 3.2]], 0.006) for s in (-1, 1)]
    for k, (x, y, front, back) in enumerate(((-3.0, 1.4, "LIFTS", "WAY OUT"), (4.2, -0.2, "DESK", "EXIT"))):
        parts = [put(block((0.03, 1.12, 0.56), bevel_m=0.003), DARK, z=2.92)]
        for s, text in ((1, front), (-1, back)):
            plate = matt(texture=picture.sign(text, (NAVY, "#2f6b4a")[s < 0]))
            parts.append(put(card((1.1, 0.55)), plate, s * 0.0165, 0, 2.92, yaw=90 * (1 - s)))
        parts.append(put(joined(rods), STEEL, z=3.2))
        yield f"sign_{k}", [part.moved(at(x, y, yaw=(-90, 180)[k])) for part in parts]
    totem = [stood((0.16, 0.62, 1.9), coated("#2c3a3c", roughness=0.2), 0, 0, 0.02), stood((0.4, 0.8, 0.02), STEEL)]
    for k, text in enumerate(("ATLAS", "1 DESK", "2 LAB", "3 CAFE")):
        totem.append(
            put(card((0.5, 0.25)), matt(texture=picture.sign(text, (NAVY, PAPER)[k > 0])), 0.0805, 0, 1.7 - 0.3 * k)
        )
    yield "totem", [part.moved(at(-1.6, -3.8, yaw=-60)) for part in totem]


def _pieces():
    """A place to wait, the meeting room, mirrors, plants, prints, and people."""
    yield Piece("rug", "rug", (8.4, -3.4, 0), 90, size={"width_m": 2.6, "depth_m": 3.0, "seed": 7})
    yield Piece("sofa", "sofa_a", (8.4, -4.75, 0), 90, size={"colour": "#4c5a63"})
    yield Piece("sofa", "sofa_b", (8.4, -2.05, 0), -90, size={"colour": "#4c5a63"})
    yield Piece(
        "table",
        "low_table",
        (8.4, -3.4, 0),
        90,
        size={"width_m": 1.2, "depth_m": 0.6, "height_m": 0.4, "tones": "walnut"},
    )
    yield Piece("papers", "magazines", (8.2, -3.35, 0.4), 30, size={"count": 3})
    yield Piece("book_stack", "low_books", (8.8, -3.5, 0.4), 80, size={"count": 2})
    for k, x in enumerate((4.6, 6.4)):
        yield Piece(
            "monitor", f"screen_{k}", (x, 3.35, 0.77), 90 + 8 * (2 * k - 1), size={"width_m": 0.5, "seed": k + 3}
        )
        yield Piece("keyboard", f"keyboard_{k}", (x, 3.6, 0.77), 90)
        yield Piece("chair", f"desk_chair_{k}", (x + 0.1, 4.1, 0), -100 + 25 * k)
    yield Piece("plant", "desk_plant", (7.1, 3.02, 1.11), size={"height_m": 0.42, "leaves": 16})
    yield Piece("fruit_bowl", "sweets", (4.0, 3.05, 1.11))
    yield Piece(
        "framed", "mirror_north", (0.6, WIDE / 2, 1.45), -90, size={"style": "mirror", "width_m": 1.8, "height_m": 2.4}
    )
    yield Piece(
        "framed", "mirror_west", (-LONG / 2, -2.2, 1.5), 0, size={"style": "mirror", "width_m": 2.4, "height_m": 2.2}
    )
    for k, (y, style, seed, w, h) in enumerate(((-0.6, "hills", 21, 1.8, 1.2), (2.4, "circles", 33, 1.2, 1.7))):
        yield Piece(
            "framed",
            f"east_print_{k}",
            (LONG / 2, y, 1.7),
            180,
            size={"style": style, "seed": seed, "width_m": w, "height_m": h},
        )
    yield Piece(
        "door", "door_east", (LONG / 2, 4.8, 0), 180, size={"label": "STAIRS", "tones": "walnut", "width_m": 1.0}
    )
    yield Piece("door", "door_west", (-LONG / 2, 1.2, 0), 0, size={"label": "WC", "tones": "walnut"})
    yield Piece("noticeboard", "noticeboard", (-LONG / 2, -4.6, 1.6), 0, size={"width_m": 1.4})
    for k, (x, y, high) in enumerate(
        ((-10.2, -5.2, 1.9), (10.3, -5.3, 2.1), (2.2, 5.5, 1.7), (10.4, 3.6, 1.5), (-5.7, 5.5, 1.3))
    ):
        yield Piece("plant", f"plant_{k}", (x, y, 0), 77 * k, size={"height_m": high, "leaves": 34})
    yield Piece("waste_bin", "bin", (-6.1, 1.9, 0), size={"width_m": 0.34, "height_m": 0.62})
    # The meeting room in the corner.
    for k, x in enumerate((-10.2, -8.6)):
        yield Piece("glass_wall", f"room_south_{k}", (x, ROOM_Y, 0), -90, size={"width_m": 1.54, "height_m": 2.6})
    for k, y in enumerate((3.2, 4.8)):
        yield Piece("glass_wall", f"room_east_{k}", (ROOM_X, y, 0), 0, size={"width_m": 1.54, "height_m": 2.6})
    yield Piece("table", "room_table", (-8.7, 4.4, 0), 90, size={"width_m": 2.2, "depth_m": 1.0})
    for k, (x, y, yaw) in enumerate(((-9.4, 3.7, 88), (-8.1, 3.65, 97), (-9.3, 5.1, -92), (-8.2, 5.15, -80))):
        yield Piece("chair", f"room_chair_{k}", (x, y, 0), yaw, size={"colour": "#3d7a7c"})
    yield Piece(
        "framed",
        "whiteboard",
        (-LONG / 2, 4.2, 1.5),
        0,
        size={"style": "whiteboard", "width_m": 2.2, "height_m": 1.2, "frame": "#a4a7a6"},
    )
    yield Piece("papers", "room_papers", (-8.5, 4.3, 0.74), 10)
    yield Piece("mug", "room_mug", (-9.1, 4.6, 0.74))
    for k, (x, y, yaw) in enumerate(((4.9, 2.3, 95), (-3.5, 4.7, 80), (6.2, 4.2, -90))):
        yield Piece("person", f"person_{k}", (x, y, 0), yaw, size={"stride_deg": 6, "height_m": 1.68 + 0.06 * k})


def _square():
    """The pavement outside and the house across it."""
    slabs = matt("#f2eee6", picture.masonry("paving", 2, 1024, 2.4, rows=6, columns=4))
    yield "pavement", [Part(quad((-45, -24, -0.06), (90, 0, 0), (0, 17.88, 0)), slabs)]
    high = 11.0
    columns = 26
    step = 90 / columns
    holes = [((k + 0.28) * step, (k + 0.72) * step, z, z + (2.5 if z < 2 else 1.8))
             for z in (0.5, 4.2, 7.4) for k in range(columns)]  # fmt: skip
    corner = np.array([45, -24, -0.06])
    front = pierced(corner, (-90, 0, 0), (0, 0, high), holes)
    panes = [quad(corner - [u0, 0.15, -v0], (u0 - u1, 0, 0), (0, 0, v1 - v0)) for u0, u1, v0, v1 in holes]
    sills = [
        block((u1 - u0 + 0.2, 0.22, 0.1), bevel_m=0, transform=at(45 - (u0 + u1) / 2, -23.95, v0 - 0.1))
        for u0, u1, v0, _ in holes
    ]
    eaves = block((90, 0.5, 0.3), bevel_m=0, transform=at(0, -23.9, high))
    brick = matt("#e8d8c8", picture.masonry("brick", 1))
    glass = coated("#20282e", roughness=0.12)
    yield "house", [Part(front, brick), Part(joined(panes), glass), Part(joined([*sills, eaves]), matt("#d9d5ca"))]


def _outside():
    for k, x in enumerate((-14.0, -6.5, 3.0, 10.5, 17.0)):
        yield Piece("tree", f"tree_{k}", (x, -13.0 - 1.5 * (k % 2), -0.06), 70 * k, size={"height_m": 5.4 + 0.4 * k})
    for k in range(7):
        yield Piece("bollard", f"bollard_{k}", (-9 + 3 * k, -8.8, -0.06))
    for k, (x, yaw) in enumerate(((-4, 0), (6.2, 180), (12.4, 0))):
        yield Piece("car", f"car_{k}", (x, -19.5, -0.06), yaw)
    yield Piece("person", "passer_by", (-1.2, -10.5, -0.06), 10)
