"""A corridor along x: doors with numbers, signs, posters, handrails, lamps at intervals, a window at its end."""

from dataclasses import replace

import numpy as np

from vobench.plugin import (
    CHROME,
    DARK,
    FINISHES,
    INKS,
    NAVY,
    OUTWARD,
    PAPER,
    STEEL,
    TEAL,
    WHITE,
    Material,
    Opening,
    Piece,
    Procedural,
    at,
    block,
    card,
    coated,
    joined,
    lathe,
    matt,
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
WIDE = 2.4
HIGH = 2.75
DADO_M = 1.05
DOOR_M = 0.92
LAMPS_X = (-10.0, -6.0, -2.0, 2.0, 6.0, 10.0)
# Doors on the north and the south wall, with their numbers.
NORTH = {-9.0: "1.02", -5.2: "1.04", 1.4: "1.06", 5.6: "1.08", 9.8: "1.10"}
SOUTH = {-7.2: "1.01", -2.8: "1.03", 3.4: "1.05", 7.8: "1.07"}


def make(seed):
    """Its things and their materials."""
    lino = Procedural("terrazzo", 0.34, 0.35, tile_m=3.0, resolution_px=2048, seed=4)
    floor = Material(colour=(0.86, 0.95, 1.0), texture=lino, eta=1.5, roughness=0.22)
    wall = FINISHES["white_plaster"]()
    ceiling = FINISHES["ceiling_tiles"]()
    openings = [Opening("east", (0.0, 1.55), (1.5, 1.5))]
    room = shell((LONG, WIDE, HIGH), openings, floor=floor, ceiling=ceiling, walls=dict.fromkeys(OUTWARD, wall))
    coarse = list(room)
    fine = [piece.build(seed) for piece in _pieces()]
    for side, doors in ((1, NORTH), (-1, SOUTH)):
        fine += _wall_furnishing(side, sorted(doors))
    fine += [(f"housing_{k}", _trough(x)) for k, x in enumerate(LAMPS_X)]
    fine += _signs()
    fine.append(("extinguisher", _extinguisher()))
    made, known = things(coarse)
    more, known = things(fine, known)
    spaced = (replace(thing, spacing_m=0.035) for thing in more)
    return (*(replace(thing, spacing_m=0.06) for thing in made), *spaced), known


def _pieces():
    """Doors, pictures, furniture."""
    for side, doors in ((1, NORTH), (-1, SOUTH)):
        for x, label in doors.items():
            tones = "walnut" if label in ("1.01", "1.10") else "beech"
            yield Piece(
                "door", f"door_{label}", (x, side * WIDE / 2, 0), -90 * side, size={"label": label, "tones": tones}
            )
    yield Piece("door", "door_west", (-LONG / 2, 0, 0), 0, size={"label": "STAIRS", "width_m": 1.0})
    prints = [
        (-7.1, 1, "hills", 11, 0.7, 1.0), (-3.2, 1, "talk", 2, 0.84, 1.18), (3.1, 1, "circles", 4, 0.6, 0.85),
        (4.0, 1, "circles", 9, 0.6, 0.85), (7.6, 1, "talk", 7, 0.84, 1.18), (-9.6, -1, "talk", 5, 0.84, 1.18),
        (-4.9, -1, "circles", 21, 0.5, 0.7), (1.9, -1, "hills", 3, 0.9, 0.6), (5.6, -1, "talk", 13, 0.84, 1.18),
        (10.1, -1, "hills", 8, 0.7, 1.0),
    ]  # fmt: skip
    for k, (x, side, style, seed, w, h) in enumerate(prints):
        size = {"style": style, "seed": seed, "width_m": w, "height_m": h, "frame": ("#262b30", "#a4a7a6")[k % 2]}
        yield Piece("framed", f"print_{k}", (x, side * WIDE / 2, 1.68), -90 * side, size=size)
    yield Piece("noticeboard", "noticeboard", (-0.2, -WIDE / 2, 1.62), 90, size={"width_m": 1.6})
    yield Piece("radiator", "radiator", (11.99, 0, 0), 180, size={"width_m": 1.3})
    yield Piece("window_frame", "window_frame", (12.0, 0, 1.55), 180, size={"width_m": 1.5, "height_m": 1.5})
    yield Piece("plant", "plant_a", (11.55, 0.85, 0), 0, size={"height_m": 1.1})
    yield Piece("plant", "plant_b", (-11.5, 0.85, 0), 0, size={"height_m": 1.4})
    yield Piece("waste_bin", "bin", (-1.4, 0.98, 0))
    yield Piece("carton", "carton_a", (6.75, -0.93, 0), 86, size={"seed": 4})
    yield Piece("carton", "carton_b", (6.77, -0.94, 0.3), 98, size={"seed": 6, "size_m": (0.3, 0.36, 0.22)})
    yield Piece("cabinet", "cabinet", (-10.6, -0.96, 0), 90, size={"width_m": 0.9, "depth_m": 0.42, "height_m": 1.1})
    yield Piece("papers", "cabinet_papers", (-10.7, -0.95, 1.1), 80)
    for k, x in enumerate((-0.9, 6.6)):
        yield Piece("socket", f"socket_{k}", (x, WIDE / 2, 0.32), -90, size={"count": 2})
    yield Piece("pipe", "pipe", (0, WIDE / 2, HIGH - 0.2), -90, size={"length_m": 23.6, "radius_m": 0.025})
    yield Piece("pipe", "conduit", (0, WIDE / 2, HIGH - 0.29), -90, size={"length_m": 23.6, "radius_m": 0.011})


def _wall_furnishing(side, doors):
    """A painted band, its handrail and a skirting along a wall, between its doors."""
    ends = [-LONG / 2, *(x + s * (DOOR_M / 2 + 0.075) for x in doors for s in (-1, 1)), LONG / 2]
    paint = coated("#a3b8b0", picture.ground("plaster", 3, 1280, 1.6), roughness=0.4)
    rail = wood("oak")
    for k, (a, b) in enumerate(zip(ends[::2], ends[1::2], strict=True)):
        length = b - a
        middle = (a + b) / 2
        turned = at(middle, side * WIDE / 2, 0, yaw=-90 * side)
        half = length / 2 - 0.06
        bar = tube([[0.075, -half, 0.9], [0.075, half, 0.9]], 0.021, sections=12)
        holds = [tube(spline([[0, y, 0.84], [0.06, y, 0.845], [0.075, y, 0.88]], 6), 0.008) for y in _even(half)]
        parts = [
            stood((0.004, length, DADO_M - 0.09), paint, 0.002, 0, 0.09, bevel=0, u=middle),
            stood((0.014, length, 0.09), DARK, 0.007, bevel=0.003),
            stood((0.012, length, 0.02), WHITE, 0.006, 0, DADO_M, bevel=0.003),
            put(bar, rail),
            put(joined(holds), STEEL),
        ]
        yield f"band_{'north' if side > 0 else 'south'}_{k}", [part.moved(turned) for part in parts]


def _even(half):
    count = max(2, int(2 * half / 0.9) + 1)
    return np.linspace(-half + 0.1, half - 0.1, count)


def _trough(x):
    """What holds a lamp below the ceiling."""
    return [stood((1.26, 0.36, 0.045), WHITE, x, 0, HIGH - 0.045, bevel=0.004)]


def _signs():
    """Plates that stand out from the walls over doors, and a board with directions that hangs across."""
    brace = tube([[0, 0, 0], [0, 0, 0.25]], 0.006)
    for k, (x, side, text) in enumerate(((-5.2, 1, "LAB"), (3.4, -1, "WC"), (9.8, 1, "STORE"))):
        ink = (NAVY, TEAL, INKS[5])[k]
        y = side * (WIDE / 2 - 0.19)
        plate = matt(texture=picture.sign(text, ink))
        faces = [put(card((0.36, 0.18)), plate, x + s * 0.008, y, 2.28, yaw=90 * (1 - s)) for s in (-1, 1)]
        yield f"sign_{k}", [*faces, put(block((0.014, 0.37, 0.19), bevel_m=0.002), STEEL, x, y, 2.28)]
    board = matt(texture=picture.sign("1.01 - 1.10", PAPER))
    parts = [put(card((0.7, 0.35)), board, s * 0.012, 0, 2.34, yaw=90 * (1 - s)) for s in (-1, 1)]
    parts.append(put(block((0.022, 0.72, 0.37), bevel_m=0.003), DARK, 0, 0, 2.34))
    yield "directions", [*parts, *(put(brace, STEEL, 0, s * 0.3, 2.5) for s in (-1, 1))]


def _extinguisher():
    """A fire extinguisher on its hook, and its plate."""
    red = coated("#b3241c", roughness=0.15)
    body = lathe([[0, 0], [0.075, 0], [0.08, 0.02], [0.08, 0.42], [0.06, 0.48], [0.02, 0.5], [0.02, 0.54], [0, 0.54]])
    hose = tube(spline([[0, 0.02, 0.53], [0.03, 0.1, 0.5], [0.05, 0.12, 0.3], [0.04, 0.1, 0.15]], 12), 0.01)
    parts = [put(body, red, 0.1), put(hose, DARK, 0.1), put(block((0.02, 0.09, 0.03)), DARK, 0.1, 0, 0.56)]
    parts += [put(block((0.02, 0.06, 0.05)), CHROME, 0.01, 0, 0.4)]
    sign = put(card((0.2, 0.2)), matt(texture=picture.sign("FIRE", "#b3241c")), 0.004, 0, 1.25)
    return [part.moved(at(-1.15, -WIDE / 2, 0.25, yaw=90)) for part in (*parts, sign)]
