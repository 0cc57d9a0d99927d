"""A hall on two levels: a ramp of two flights with a landing, a staircase beside it, a gallery, and exhibits."""

from dataclasses import replace

import numpy as np

from vobench.plugin import (
    BRICK,
    DARK,
    NAVY,
    OCHRE,
    OUTWARD,
    STEEL,
    TEAL,
    WHITE,
    Material,
    Opening,
    Part,
    Piece,
    Procedural,
    at,
    block,
    card,
    coated,
    cushion,
    extrusion,
    joined,
    lathe,
    matt,
    mm,
    moved,
    picture,
    put,
    shell,
    spline,
    stood,
    things,
    tube,
    wood,
)

LONG = 24.0
WIDE = 10.0
HIGH = 6.0
FOOT_X = -7.0
HEAD_X = 8.0
SLOPE = 0.08
# heights of landing and gallery
HALF_M = SLOPE * (HEAD_X - FOOT_X)
TOP_M = 2 * SLOPE * (HEAD_X - FOOT_X)
LOWER_Y = (-4.8, -2.3)
UPPER_Y = (-1.9, 0.6)
STAIR_Y = (1.6, 3.6)
STEPS = 15
TREAD_M = 0.3
SLAB_M = 0.28
KERB_M = 0.16
WINDOWS_X = (-8.4, -4.2, 0.0, 4.2, 8.4)


def make(seed):
    """Its things and their materials."""
    screed = Procedural("plaster", 0.34, 0.28, tile_m=6.0, resolution_px=2048, seed=3)
    floor = Material(colour=(1.0, 0.98, 0.94), texture=screed, eta=1.5, roughness=0.18)
    wall = matt("#ece7dc", picture.ground("plaster", 5, 1280, 1.9))
    raw = matt("#dcdad4", picture.ground("concrete", 2))
    walls = {**dict.fromkeys(OUTWARD, wall), "west": matt("#8f5a4a", picture.ground("plaster", 6, 1280, 1.9))}
    openings = [Opening("north", (x, 4.3), (2.6, 2.0), 0.25) for x in WINDOWS_X]
    room = shell((LONG, WIDE, HIGH), openings, floor=floor, ceiling=matt("#efece5"), walls=walls)
    coarse, known = things(
        [*room, ("ramp", list(_ramp(raw))), ("stair", list(_stair(raw))), ("gallery", list(_gallery(raw)))]
    )
    fine, known = things([("rails", [Part(joined(list(_rails())), STEEL)]), *_exhibits(), *_signs()], known)
    more, known = things([piece.build(seed) for piece in _pieces()], known)
    spaced = ((coarse, 0.1), (fine, 0.06), (more, 0.06))
    return tuple(replace(thing, spacing_m=at_m) for some, at_m in spaced for thing in some), known


def _along(profile, y0, y1):
    """A prism over a profile (N, 2) of x and z, from y0 to y1."""
    return moved(extrusion(np.asarray(profile, float), y1 - y0), at(0, y1, 0, roll=90))


def _flight(x0, z0, x1, z1):
    """The profile of a sloping slab; at its foot on the floor it ends in an edge."""
    return [(x0, z0), (x1, z1), (x1, max(z1 - SLAB_M, 0.0)), (x0, max(z0 - SLAB_M, 0.0))]


def _ramp(raw):
    """Two flights and a landing on piers, with kerbs along their sides and strips across that are rough."""
    lower = [(FOOT_X, 0.0), (HEAD_X, 0.0), (HEAD_X, HALF_M)]
    yield Part(_along(lower, *LOWER_Y), raw)
    yield Part(_along([*_flight(HEAD_X, HALF_M, FOOT_X, TOP_M)], *UPPER_Y), raw)
    deck = block((LONG / 2 - HEAD_X, UPPER_Y[1] - LOWER_Y[0], HALF_M), bevel_m=0)
    yield put(deck, raw, (LONG / 2 + HEAD_X) / 2, (UPPER_Y[1] + LOWER_Y[0]) / 2, HALF_M / 2)
    middle = sum(UPPER_Y) / 2
    for x in (-4.6, -0.6, 3.4):
        top = TOP_M - SLOPE * (x - FOOT_X) - SLAB_M
        yield stood((0.35, 1.4, top + 0.02), raw, x, middle, 0, bevel=0.02, u=x)
    kerbs = []
    for sides, z0 in ((LOWER_Y, 0.0), (UPPER_Y, TOP_M)):
        kerb = [(FOOT_X, z0), (HEAD_X, HALF_M), (HEAD_X, HALF_M + KERB_M), (FOOT_X, z0 + KERB_M)]
        kerbs += [_along(kerb, y, y + 0.14) for y in (sides[0], sides[1] - 0.14)]
    kerbs.append(
        block(
            (LONG / 2 - HEAD_X, 0.14, KERB_M),
            bevel_m=0,
            transform=at((LONG / 2 + HEAD_X) / 2, UPPER_Y[1] - 0.07, HALF_M + KERB_M / 2),
        )
    )
    kerbs.append(
        block(
            (0.14, UPPER_Y[0] - LOWER_Y[1] + 0.28, KERB_M),
            bevel_m=0,
            transform=at(HEAD_X + 0.07, (UPPER_Y[0] + LOWER_Y[1]) / 2, HALF_M + KERB_M / 2),
        )
    )
    yield Part(joined(kerbs), matt("#c7c3ba", picture.ground("concrete", 8)))
    tilt = float(np.rad2deg(np.arctan(SLOPE)))
    strips = []
    for k in range(15):
        x = FOOT_X + 0.7 + k
        for (y0, y1), z, pitch in (
            (LOWER_Y, SLOPE * (x - FOOT_X), -tilt),
            (UPPER_Y, TOP_M - SLOPE * (x - FOOT_X), tilt),
        ):
            strip = block((0.12 if k else 0.3, y1 - y0 - 0.3, 0.004), bevel_m=0)
            strips.append(moved(strip, at(x, (y0 + y1) / 2, z + 0.002, pitch=pitch)))
    yield Part(joined(strips), matt("#5a574f", picture.ground("carpet", 3, 512, 0.8)))


def _stair(raw):
    """Steps of concrete with dark nosings."""
    rise = TOP_M / STEPS
    y = sum(STAIR_Y) / 2
    steps = []
    edges = []
    for k in range(STEPS - 1):
        x = FOOT_X + (k + 0.5) * TREAD_M
        z = TOP_M - (k + 1) * rise
        steps.append(
            block((TREAD_M, STAIR_Y[1] - STAIR_Y[0], z), bevel_m=0, uv_m=(0.3 * k, 0.7 * k), transform=at(x, y, z / 2))
        )
        edges.append(
            block(
                (0.05, STAIR_Y[1] - STAIR_Y[0] - 0.02, 0.004),
                bevel_m=0,
                transform=at(x + TREAD_M / 2 - 0.03, y, z + 0.002),
            )
        )
    yield Part(joined(steps), raw)
    yield Part(joined(edges), matt("#26282a"))


def _gallery(raw):
    """The upper floor on pillars, with a timber deck."""
    x0 = -LONG / 2
    y0 = UPPER_Y[0]
    y1 = WIDE / 2
    middle = (x0 + FOOT_X) / 2, (y0 + y1) / 2
    yield put(block((FOOT_X - x0, y1 - y0, SLAB_M), bevel_m=0), raw, *middle, TOP_M - SLAB_M / 2 - 0.02)
    yield put(
        block((FOOT_X - x0, y1 - y0, 0.02), bevel_m=0),
        matt(texture=picture.boards("oak", 6, 2048, 2.0, rows=14, joint_m=0.002)),
        *middle,
        TOP_M - 0.01,
    )
    for x, y in ((FOOT_X - 0.4, y0 + 0.4), (FOOT_X - 0.4, 4.4)):
        yield stood((0.35, 0.35, TOP_M - SLAB_M), raw, x, y, bevel=0.02, u=y)


def _rails():
    """Handrails on posts along whatever one could fall from."""
    r = UPPER_Y
    s = STAIR_Y
    t = TOP_M
    foot = FOOT_X + STEPS * TREAD_M - 0.3
    lines = [[(FOOT_X, y, KERB_M), (HEAD_X, y, HALF_M + KERB_M)] for y in (LOWER_Y[0] + 0.07, LOWER_Y[1] - 0.07)]
    lines += [[(HEAD_X, y, HALF_M + KERB_M), (FOOT_X, y, t + KERB_M)] for y in (r[0] + 0.07, r[1] - 0.07)]
    lines += [[(HEAD_X, r[1] - 0.07, HALF_M + KERB_M), (LONG / 2, r[1] - 0.07, HALF_M + KERB_M)]]
    lines += [[(FOOT_X, y, t), (foot, y, 0.16)] for y in (s[0] + 0.06, s[1] - 0.06)]
    lines += [[(FOOT_X - 0.06, a, t), (FOOT_X - 0.06, b, t)] for a, b in ((r[1], s[0] + 0.06), (s[1] - 0.06, WIDE / 2))]
    lines += [[(-LONG / 2, r[0] + 0.07, t), (FOOT_X, r[0] + 0.07, t)]]
    for a, b in np.array(lines, float):
        count = max(2, int(np.linalg.norm(b - a) / 1.25) + 1)
        up = np.array([0, 0, 0.95])
        yield tube([a + up, b + up], 0.022, sections=12)
        yield from (tube([a + up * h, b + up * h], 0.008) for h in (0.3, 0.55, 0.78))
        yield from (tube([p, p + up], 0.014) for p in np.linspace(a, b, count))


def _exhibits():
    """Vases, a boulder and turned and bent forms on white plinths."""
    glaze = [coated(c, roughness=0.12) for c in (TEAL, "#c98a3a", "#2b3550", BRICK)]
    belly = spline(mm("60 0, 200 250, 160 500, 60 700, 100 820"), 24)
    vase = lathe([[0, 0], *belly, [0, 0.8]], sections=40)
    knot = np.linspace(0, 2 * np.pi, 90)
    ring = np.stack(
        [
            (0.28 + 0.1 * np.cos(3 * knot)) * np.cos(2 * knot),
            (0.28 + 0.1 * np.cos(3 * knot)) * np.sin(2 * knot),
            0.1 * np.sin(3 * knot) + 0.22,
        ],
        axis=1,
    )
    tower = [
        block(
            (0.34 - 0.04 * k, 0.34 - 0.04 * k, 0.16),
            bevel_m=0.006,
            transform=at(0.01 * k, 0, 0.08 + 0.16 * k, yaw=17 * k),
        )
        for k in range(6)
    ]
    drop = lathe([[0, 0], [0.05, 0.0], [0.24, 0.3], [0.2, 0.5], [0.05, 0.8], [0, 0.86]], sections=40)
    egg = moved(cushion((0.5, 0.4, 0.45), power=3), at(z_m=0.225))
    bowl = moved(vase, np.diag([1.25, 1.25, 0.6, 1]))
    knotted = (tube(ring, 0.055, sections=14), replace(STEEL, roughness=0.12))
    timber = (joined(tower), wood("walnut"))
    shapes = [(vase, glaze[0]), knotted, timber, (drop, glaze[1]), (egg, glaze[2]), (bowl, glaze[3])]
    places = [
        (0.2, 2.6, 0.0),
        (3.0, 3.4, 0.0),
        (5.6, 2.2, 0.0),
        (8.6, 3.3, 0.0),
        (11.0, -3.9, HALF_M),
        (-10.8, 3.8, TOP_M),
    ]
    for k, ((mesh, look), (x, y, z)) in enumerate(zip(shapes, places, strict=True)):
        label = put(card((0.16, 0.1)), matt(texture=picture.pages(k)), 0.2805, 0.12, 0.8)
        plinth = [stood((0.56, 0.56, 0.94), WHITE, bevel=0.004), stood((0.5, 0.5, 0.03), DARK, 0, 0, -0.0), label]
        place = at(x, y, z, yaw=(-90, -60, -110, -90, 150, -40)[k])
        yield f"exhibit_{k}", [part.moved(place) for part in (*plinth, put(mesh, look, z=0.94, yaw=40 * k))]


def _signs():
    """Plates for the levels, and one for the slope."""
    for k, (text, ink, x, y, z, yaw) in enumerate((
        ("LEVEL 0", NAVY, -LONG / 2 + 0.012, -3.55, 1.9, 0), ("LEVEL 1", NAVY, -LONG / 2 + 0.012, -0.6, TOP_M + 1.9, 0),
        ("8 %", OCHRE, FOOT_X + 0.15, -4.985, 1.5, 90), ("STAIRS", TEAL, -2.45, WIDE / 2 - 0.012, 1.8, -90),
        ("LANDING", NAVY, LONG / 2 - 0.012, -1.9, HALF_M + 1.8, 180),
    )):  # fmt: skip
        yield f"sign_{k}", [put(card((0.7, 0.35)), matt(texture=picture.sign(text, ink)), x, y, z, yaw=yaw)]


def _pieces():
    """Paintings along the ramp, benches, plants, doors, housings and visitors."""
    for k in range(6):
        x = FOOT_X + 1.6 + 2.5 * k
        size = {
            "style": ("hills", "circles", "hills", "talk", "circles", "hills")[k],
            "seed": 51 + k,
            "width_m": (1.3, 0.8, 1.0, 0.84, 1.1, 1.4)[k],
            "height_m": (0.9, 1.1, 1.0, 1.18, 1.1, 0.9)[k],
        }
        yield Piece("framed", f"painting_{k}", (x, -WIDE / 2, SLOPE * (x - FOOT_X) + 1.65), 90, size=size)
    for k, (x, y, z, yaw, style) in enumerate(
        ((12, 2.9, 1.7, 180, "circles"), (-12, 2.0, 4.1, 0, "hills"), (12, -3.9, 3.0, 180, "hills"))
    ):
        yield Piece(
            "framed",
            f"print_{k}",
            (x, y, z),
            yaw,
            size={"style": style, "seed": 70 + k, "width_m": 1.5, "height_m": 1.3},
        )
    for k, (x, y, z, yaw) in enumerate(
        ((2.0, 4.55, 0, -90), (7.0, 4.55, 0, -90), (-9.6, 3.9, TOP_M, -90), (11.4, -1.0, HALF_M, 180))
    ):
        yield Piece("park_bench", f"bench_{k}", (x, y, z), yaw, size={"width_m": 1.6})
    for k, (x, y, z, high) in enumerate(
        (
            (-2.0, 4.4, 0, 1.7),
            (11.3, 4.3, 0, 1.9),
            (11.4, 0.1, HALF_M, 1.3),
            (-11.4, -1.4, TOP_M, 1.4),
            (-11.4, -4.4, 0, 1.6),
        )
    ):
        yield Piece("plant", f"plant_{k}", (x, y, z), 70 * k, size={"height_m": high, "leaves": 30})
    yield Piece("door", "door_0", (-LONG / 2, -2.6, 0), 0, size={"label": "EXIT", "tones": "walnut"})
    yield Piece("door", "door_1", (-LONG / 2, 0.4, TOP_M), 0, size={"label": "1.01", "tones": "walnut"})
    yield Piece("door", "door_2", (LONG / 2, 1.5, 0), 180, size={"label": "STORE", "tones": "beech"})
    yield Piece("waste_bin", "bin", (4.6, 4.6, 0))
    yield Piece("radiator", "radiator", (4.5, WIDE / 2, 0), -90, size={"width_m": 2.0})
    for k, x in enumerate(WINDOWS_X):
        yield Piece(
            "window_frame",
            f"frame_{k}",
            (x, WIDE / 2, 4.3),
            -90,
            size={"width_m": 2.6, "height_m": 2.0, "depth_m": 0.25},
        )
    for name, x, y in (("a", -9, -2), ("b", -3, 2.4), ("c", -2, -3), ("d", 4, -2), ("e", 5, 2.6), ("f", 10, -1)):
        yield Piece("lamp_housing", f"housing_{name}", (x, y, 5.9), size={"size_m": (1.5, 0.6)})
    for k, (x, y, z, yaw) in enumerate(
        ((1.2, 3.1, 0, 210), (6.2, -3.0, SLOPE * (6.2 - FOOT_X), 12), (-8.3, 2.6, TOP_M, -40))
    ):
        yield Piece(
            "person",
            f"visitor_{k}",
            (x, y, z),
            yaw,
            size={"stride_deg": 20 if k == 1 else 5, "height_m": 1.66 + 0.05 * k},
        )
