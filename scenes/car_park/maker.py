"""A storey of a car park: two rows of bays with cars, a lane between, pillars, pipes, signs and an open front."""

from dataclasses import replace

import numpy as np

from vobench.plugin import (
    DARK,
    INK,
    NAVY,
    OCHRE,
    OUTWARD,
    STEEL,
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
    joined,
    matt,
    moved,
    picture,
    put,
    quad,
    shell,
    stood,
    things,
    tube,
)

LONG = 32.0
WIDE = 17.0
HIGH = 2.7
BAY_M = 2.6
DEEP_M = 5.0
BAYS_X = tuple((k - 5) * BAY_M for k in range(11))
PILLARS_X = tuple((k - 1.5) * 3 * BAY_M for k in range(4))
LAMPS = tuple((x, y) for x in (-7.8, 0.0, 7.8) for y in (-2.6, 2.6))


def make(seed):
    """Its things and their materials."""
    slab = Procedural("plaster", 0.36, 0.3, tile_m=7.0, resolution_px=2048, seed=12)
    floor = Material(colour=(0.97, 0.98, 1.0), texture=slab, eta=1.5, roughness=0.3)
    raw = matt("#d5d3cc", picture.ground("plaster", 9, 1280, 2.4))
    front = [Opening("north", (x, 1.75), (6.6, 1.1), 0.2) for x in (-11.7, -3.9, 3.9, 11.7)]
    room = shell((LONG, WIDE, HIGH), front, floor=floor, ceiling=raw, walls=dict.fromkeys(OUTWARD, raw), frame=raw)
    # The front is open: no panes.
    bare = [(name, parts[:1] if name.startswith("window") else parts) for name, parts in room]
    made, known = things(bare)
    middle, known = things([("marks", _marks()), ("structure", _structure()), ("numbers", list(_numbers()))], known)
    near, known = things([piece.build(seed) for piece in _pieces(np.random.default_rng([seed, 3]))], known)
    spaced = ((made, 0.12), (middle, 0.12), (near, 0.14))
    return tuple(replace(thing, spacing_m=spacing) for some, spacing in spaced for thing in some), known


def _marks():
    """Lines between bays, arrows along the lane, and a walkway."""
    line = matt("#d9d8d2")
    y0 = WIDE / 2 - DEEP_M
    xs = [x + s * BAY_M / 2 for x in BAYS_X for s in ((-1, 1) if x == BAYS_X[-1] else (-1,))]
    lines = [
        quad((x - 0.05, s * (y0 + DEEP_M / 2) - DEEP_M / 2, 0.003), (0.1, 0, 0), (0, DEEP_M, 0))
        for x in xs
        for s in (-1, 1)
    ]
    arrows = []
    for x, y, s in ((-9.0, -1.5, 1), (5.0, -1.5, 1), (-3.0, 1.5, -1), (10.0, 1.5, -1)):
        arrows.append(quad((x - 0.8, y - 0.08, 0.003), (1.6, 0, 0), (0, 0.16, 0)))
        head = [quad((0, 0, 0), (-0.7, 0.4, 0), (0.0, 0.2, 0)), quad((0, 0, 0), (0.0, -0.2, 0), (-0.7, -0.4, 0))]
        arrows += [moved(mesh, at(x + s * 1.3, y, 0.0035, yaw=0 if s > 0 else 180)) for mesh in head]
    path = [quad((-15.2, -7.5, 0.003), (0.9, 0, 0), (0, 15, 0))]
    return [
        Part(joined([*lines, *arrows]), line),
        Part(joined(path), matt("#4f7a5c", picture.ground("plaster", 6, 512, 2.0))),
    ]


def _structure():
    """Pillars with striped feet, beams, lamps' trays and pipes below the ceiling."""
    raw = matt("#cfcdc6", picture.ground("plaster", 9, 1280, 2.4))
    yellow = matt("#d8a614")
    black = matt(INK)
    places = [(x, s * 3.9) for x in PILLARS_X for s in (-1, 1)]
    parts = [stood((0.42, 0.42, HIGH), raw, x, y, 0, bevel=0.02, u=x + y) for x, y in places]
    for k in range(5):
        paint = (yellow, black)[k % 2]
        parts.append(
            Part(joined([stood((0.426, 0.426, 0.2), paint, x, y, 0.2 * k, bevel=0.02).mesh for x, y in places]), paint)
        )
    beams = [block((0.4, WIDE - 0.01, 0.35), bevel_m=0.02, transform=at(x, 0, HIGH - 0.178)) for x in PILLARS_X]
    trays = [stood((1.5, 0.16, 0.08), WHITE, x, y, HIGH - 0.1) for x, y in LAMPS]
    red = [tube([[-LONG / 2 + 0.1, y, 2.28], [LONG / 2 - 0.1, y, 2.28]], 0.05, sections=12) for y in (-3.3, 3.3)]
    heads = [tube([[x, y, 2.28], [x, y, 2.15]], 0.02) for x in np.arange(-14, 14.1, 3.5) for y in (-3.3, 3.3)]
    duct = put(block((LONG - 0.4, 0.6, 0.3), bevel_m=0.01), STEEL, 0, -5.6, 2.15)
    guards = [
        tube([[x, s * 8.2, 0.14], [x + 1.7, s * 8.2, 0.14]], 0.06, sections=12)
        for x in np.array(BAYS_X) - 0.85
        for s in (-1, 1)
    ]
    return [
        *parts,
        Part(joined(beams), raw),
        *trays,
        Part(joined([*red, *heads]), coated("#a5251d")),
        duct,
        Part(joined(guards), yellow),
    ]


def _numbers():
    """The number of every bay on the wall behind it, and signs."""
    for k, x in enumerate(BAYS_X):
        for s in (-1, 1):
            plate = matt(texture=picture.sign(f"{'AB'[s > 0]}{k + 1:02d}"))
            yield put(card((0.4, 0.2)), plate, x, s * (WIDE / 2 - 0.004), 0.85, yaw=-90 * s)
    for x, y, text, ink in ((-7.8, 0, "EXIT", "#2f6b4a"), (3.9, 0, "LEVEL 2", NAVY), (11.7, 0, "PAY HERE", OCHRE)):
        plate = matt(texture=picture.sign(text, ink))
        for s in (-1, 1):
            yield put(card((0.7, 0.35)), plate, x + s * 0.02, y, 2.15, yaw=90 * (1 - s))
        yield put(block((0.035, 0.72, 0.37), bevel_m=0.003), DARK, x, y, 2.15)
        yield Part(joined([tube([[x, y + s * 0.3, 2.3], [x, y + s * 0.3, HIGH]], 0.008) for s in (-1, 1)]), STEEL)
    for x, y in ((-11.7, -3.9), (3.9, 3.9), (11.7, -3.9)):
        plate = matt(texture=picture.sign(f"P{int(abs(x))}", NAVY))
        yield put(card((0.36, 0.18)), plate, x + 0.2115, y, 1.75)


def _pieces(rng):
    """Cars in two of three bays, nose or tail in, a door, a ticket machine and what else stands about."""
    for k, x in enumerate(BAYS_X):
        for s in (-1, 1):
            if rng.random() < 0.34:
                continue
            turn = 90 * s + (180 if rng.random() < 0.3 else 0) + float(rng.normal(0, 1.2))
            place = (x + float(rng.normal(0, 0.12)), s * (5.75 + float(rng.normal(0, 0.12))), 0)
            yield Piece("car", f"car_{'ab'[s > 0]}{k + 1}", place, turn)
    yield Piece("door", "door", (-LONG / 2, 0, 0), 0, size={"label": "STAIRS", "tones": "walnut", "width_m": 1.0})
    yield Piece(
        "cabinet",
        "machine",
        (LONG / 2 - 0.3, 1.6, 0),
        180,
        size={"width_m": 0.7, "depth_m": 0.5, "height_m": 1.6, "colour": "#27445c"},
    )
    yield Piece(
        "framed",
        "tariff",
        (LONG / 2, 0.4, 1.6),
        180,
        size={"style": "talk", "seed": 31, "width_m": 0.6, "height_m": 0.84},
    )
    yield Piece("waste_bin", "bin", (-15.6, 1.2, 0), size={"width_m": 0.4, "height_m": 0.6})
    yield Piece("bollard", "bollard_a", (14.6, 2.6, 0))
    yield Piece("bollard", "bollard_b", (14.6, 0.6, 0))
    yield Piece("person", "person_a", (-12.8, 0.9, 0), 200)
    yield Piece("person", "person_b", (8.9, 3.0, 0), -70)
