"""A warehouse: rows of pallet racks with cartons, aisles with marked floors, columns and a loading door."""

from dataclasses import replace

import numpy as np

from vobench.plugin import (
    BLACK,
    DARK,
    FINISHES,
    OCHRE,
    OUTWARD,
    PAPER,
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
    extrusion,
    joined,
    lathe,
    matt,
    mm,
    moved,
    picture,
    put,
    shell,
    stood,
    things,
    tube,
)

LONG = 26.0
WIDE = 16.0
HIGH = 6.5
BAY_M = 2.7
DEEP_M = 1.1
BAYS = 6
LEVELS_M = (0.12, 1.75, 3.3)
RACKS_Y = (-6.9, -2.6, -1.3, 3.0, 4.3)  # middles of the rows; aisles between them are 3.2 m wide
BLUE, ORANGE, YELLOW = (coated(c, roughness=0.4) for c in ("#24427a", "#d8641e", "#d8a614"))
PLANK = matt(texture=picture.boards("beech", 9, rows=6))


def make(seed):
    """Its things and their materials."""
    slab = Procedural("plaster", 0.36, 0.4, tile_m=6.0, resolution_px=2048, seed=8)
    floor = Material(colour=(0.95, 0.97, 1.0), texture=slab, eta=1.5, roughness=0.3)
    walls = matt("#cfd4d2", picture.ground("plaster", 2, 1280, 2.4))
    lights = [Opening(side, (x, 5.3), (3.0, 1.0)) for side in ("north", "south") for x in (-9, -3, 3, 9)]
    room = shell(
        (LONG, WIDE, HIGH),
        lights,
        floor=floor,
        ceiling=matt("#b8bdbf", picture.ground("plaster", 3, 512, 2.0)),
        walls={**dict.fromkeys(OUTWARD, walls), "west": FINISHES["brick"]()},
    )
    made, known = things(room)
    coarse = [("steelwork", _steelwork()), ("markings", _markings())]
    fine = [piece.build(seed) for piece in _pieces()] + _staging(seed)
    for row, y in enumerate(RACKS_Y):
        coarse += _rack(row, y)
        fine += _goods(row, y, seed)
    middle, known = things(coarse, known)
    near, known = things(fine, known)
    door, known = things([("loading_door", _loading_door())], known)
    spaced = ((made, 0.1), (middle, 0.12), (near, 0.1), (door, 0.04))
    return tuple(replace(thing, spacing_m=spacing) for some, spacing in spaced for thing in some), known


def _bay_x(bay):
    return (bay - (BAYS - 1) / 2) * (BAY_M + 0.1) - 1.5


def _rack(row, y):
    """Uprights with braces, beams and wire decks of a row of bays."""
    post = block((0.08, 0.1, 4.6), bevel_m=0.004, transform=at(z_m=2.3))
    foot = block((0.14, 0.16, 0.01), bevel_m=0.002)
    uprights = []
    feet = []
    braces = []
    beams = []
    decks = []
    for k in range(BAYS + 1):
        x = _bay_x(k) - (BAY_M + 0.1) / 2
        for s in (-1, 1):
            uprights.append(moved(post, at(x, y + s * DEEP_M / 2)))
            feet.append(moved(foot, at(x, y + s * DEEP_M / 2, 0.005)))
        for j in range(5):
            ends = [[x, y - DEEP_M / 2, 0.3 + 0.85 * j], [x, y + DEEP_M / 2, 0.3 + 0.85 * (j + 1)]]
            braces.append(tube(ends, 0.016, sections=5))
    beam = block((BAY_M, 0.05, 0.12), bevel_m=0)
    slat = block((0.1, DEEP_M - 0.06, 0.02), bevel_m=0)
    for x, z in ((_bay_x(bay), z) for bay in range(BAYS) for z in LEVELS_M[1:]):
        beams += [moved(beam, at(x, y + s * DEEP_M / 2, z - 0.06)) for s in (-1, 1)]
        decks += [moved(slat, at(x + along, y, z - 0.011)) for along in _slats()]
    steel = ((uprights, BLUE), (feet, STEEL), (braces, BLUE), (beams, ORANGE), (decks, STEEL))
    yield f"rack_{row}", [Part(joined(meshes), paint) for meshes, paint in steel]
    for bay in range(BAYS):
        plate = matt(texture=picture.sign(f"{'ABCDE'[row]}{bay + 1:02d}", OCHRE))
        sides = [put(card((0.2, 0.1)), plate, _bay_x(bay), y + s * 0.582, 1.69, yaw=s * 90) for s in (-1, 1)]
        yield f"label_{'abcde'[row]}{bay + 1}", sides


def _slats():
    return np.linspace(-BAY_M / 2 + 0.1, BAY_M / 2 - 0.1, 12)


def pallet():
    """A euro pallet, 1.2 × 0.8 m, its top at 0.144 m."""
    parts = [stood((1.2, 0.1, 0.022), PLANK, 0, y, 0, bevel=0, u=y) for y in (-0.35, 0, 0.35)]
    parts += [
        stood((0.14, 0.1, 0.078), PLANK, x, y, 0.022, bevel=0, u=x + y)
        for x in (-0.53, 0, 0.53)
        for y in (-0.35, 0, 0.35)
    ]
    parts += [stood((0.14, 0.8, 0.022), PLANK, x, 0, 0.1, bevel=0, u=x) for x in (-0.53, 0, 0.53)]
    return [
        *parts,
        *(stood((1.2, 0.12, 0.022), PLANK, 0, y, 0.122, bevel=0, u=3 * y) for y in (-0.34, -0.17, 0, 0.17, 0.34)),
    ]


def _load(rng, high_m):
    """Cartons of one size in layers on a pallet, some with film around, or a crate, drums or sacks."""
    kind = rng.random()
    z0 = 0.145
    if kind < 0.12:
        drum = lathe(
            [[0, 0], [0.28, 0], [0.29, 0.02], [0.28, 0.28], [0.29, 0.3], [0.28, 0.58], [0.29, 0.86], [0, 0.86]]
        )
        colour = coated(picture.one_of(rng, "#27445c", "#b4533a", "#3d7a7c"), roughness=0.25)
        return [put(drum, colour, x, y, z0, yaw=rng.uniform(0, 90)) for x in (-0.3, 0.3) for y in (-0.05,)]
    if kind < 0.2:
        return [
            part.moved(at(z_m=z0))
            for part in Piece("crate", "crate", (0, 0, 0), size={"size_m": (1.1, 0.75, 0.9)}).build(
                int(rng.integers(99))
            )[1]
        ]
    nx, ny = (3, 2) if rng.random() < 0.5 else (2, 2)
    size = 1.16 / nx - 0.01, 0.78 / ny - 0.01, float(rng.uniform(0.22, 0.42))
    seed = int(rng.integers(8))
    rows = max(1, int((high_m - z0) / size[2]))
    boxes = []
    gone = rng.random() < 0.5
    rows = int(rng.integers(max(1, rows - 1), rows + 1))
    for r, i, j in np.ndindex(rows, nx, ny):
        if r == rows - 1 and gone and rng.random() < 0.4:
            continue
        dx = rng.normal(0, 0.006)
        dy = rng.normal(0, 0.006)
        turn = rng.normal(0, 0.8) + 180 * rng.integers(2)
        place = at((i - (nx - 1) / 2) * 1.16 / nx + dx, (j - (ny - 1) / 2) * 0.78 / ny + dy, z0 + r * size[2], yaw=turn)
        tile = max(size)
        box = block(size, bevel_m=0, uv_m=(tile / 2, tile / 2), upright=True, transform=at(z_m=size[2] / 2))
        boxes.append(moved(box, place))
    tint = picture.one_of(rng, "#ffffff", "#f3ead9", "#e5e9ea", "#fff3dc")
    return [Part(joined(boxes), matt(tint, picture.carton(seed, max(size))))]


def _goods(row, y, seed):
    """Pallets with loads, two or three to a level of a bay; a few places are empty."""
    for bay in range(BAYS):
        rng = np.random.default_rng([seed, row, bay])
        parts = []
        for level, z in enumerate(LEVELS_M):
            for x in (-0.68, 0.68):
                if rng.random() < 0.16:
                    continue
                shift = at(
                    _bay_x(bay) + x + rng.normal(0, 0.03),
                    y + rng.normal(0, 0.02),
                    z if level else 0,
                    yaw=rng.normal(0, 1.2),
                )
                high = 1.3 if level < 2 else 1.1
                parts += [part.moved(shift) for part in (*pallet(), *_load(rng, high))]
        if parts:
            yield f"goods_{'abcde'[row]}{bay + 1}", parts


def _steelwork():
    """Columns, beams and purlins below the roof, and lamps' trays."""
    paint = coated("#6d7579", roughness=0.4)
    corner = np.array([[1, -1], [1, -0.85], [0.07, -0.85], [0.07, 0.85], [1, 0.85], [1, 1]])
    profile = np.concatenate([corner, -corner])
    column = extrusion(profile * 0.13, HIGH - 0.4)
    beam = extrusion(profile * [0.1, 0.19], WIDE)
    parts = []
    for x in (-12.8, -6.3, 0.2, 6.7, 12.8):
        parts += [moved(column, at(x, s * (WIDE / 2 - 0.16))) for s in (-1, 1)]
        parts.append(moved(beam, at(x, WIDE / 2, HIGH - 0.2, roll=90)))
    purlins = [block((LONG, 0.08, 0.16), bevel_m=0, transform=at(0, y, HIGH - 0.08)) for y in np.arange(-7, 7.1, 2)]
    lamps = [(x, y) for x in (-6.0, 3.0) for y in (-4.75, 0.85, 6.4)]
    trays = [stood((2.5, 0.34, 0.06), WHITE, x, y, 5.905) for x, y in lamps]
    ends = [(x + s * 0.9, y) for x, y in lamps for s in (-1, 1)]
    rods = [tube([[x, y, 5.95], [x, y, HIGH]], 0.006, sections=5) for x, y in ends]
    return [Part(joined([*parts, *purlins]), paint), *trays, Part(joined(rods), STEEL)]


def _markings():
    """Yellow lines along the aisles and around the space before the loading door, zebra and bay numbers."""
    line = [
        block((17.2, 0.1, 0.003), bevel_m=0, transform=at(-1.5, y, 0.002)) for y in (-6.15, -3.35, -0.55, 2.25, 5.05)
    ]
    line += [block((0.1, 11.2, 0.003), bevel_m=0, transform=at(x, -0.55, 0.002)) for x in (7.6, 11.4)]
    zebra = matt("#dcdbd6")
    stripes = [block((0.4, 0.9, 0.003), bevel_m=0, transform=at(8.0 + 0.8 * k, 5.8, 0.002)) for k in range(5)]
    return [Part(joined(line), YELLOW), Part(joined(stripes), zebra)]


def _loading_door():
    """A roller door with guides and bumpers on the east wall, and a plate over it."""
    slat = block((0.04, 4.0, 0.118), bevel_m=0.01)
    slats = joined([moved(slat, at(0, 0, 0.06 + 0.12 * k)) for k in range(34)])
    stripe = joined([block((0.05, 0.12, 1.1), transform=at(0.03, s * 2.2, 0.55)) for s in (-1, 1)])
    parts = [put(slats, coated("#b9bfc2", roughness=0.35), 0.03), Part(stripe, YELLOW)]
    parts += [stood((0.16, 0.14, 4.3), DARK, 0.08, s * 2.08) for s in (-1, 1)]
    parts += [stood((0.45, 4.5, 0.45), DARK, 0.22, 0, 4.1), stood((0.25, 0.2, 0.6), BLACK, 0.12, 2.6, 0.4)]
    parts.append(put(card((1.2, 0.6)), matt(texture=picture.sign("DOCK 3", PAPER)), 0.006, 0, 5.1))
    return [part.moved(at(LONG / 2, -1.0, 0, yaw=180)) for part in parts]


def _pieces():
    """Furniture along the east wall, and cartons."""
    yield Piece("door", "door", (LONG / 2, 5.8, 0), 180, size={"label": "OFFICE", "tones": "walnut"})
    yield Piece("desk", "desk", (12.4, 3.6, 0), 180)
    yield Piece("keyboard", "desk_keyboard", (12.28, 3.6, 0.74), 180)
    yield Piece("papers", "desk_papers", (12.3, 3.05, 0.74), 170)
    yield Piece("chair", "chair", (11.75, 3.5, 0), 20)
    yield Piece("waste_bin", "bin", (12.5, 4.7, 0))
    yield Piece("cabinet", "cabinet", (12.6, -5.2, 0), 180, size={"height_m": 1.9})
    yield Piece("cabinet", "cabinet_b", (12.6, -6.05, 0), 180, size={"height_m": 1.9})
    yield Piece("noticeboard", "noticeboard", (LONG / 2, 3.6, 1.75), 180, size={"width_m": 1.6})
    yield Piece(
        "framed",
        "safety",
        (LONG / 2, -4.1, 1.8),
        180,
        size={"style": "talk", "seed": 17, "width_m": 0.84, "height_m": 1.18},
    )
    for k, x in enumerate((-8.5, -4.6, 0.4, 4.3)):
        yield Piece(
            "framed",
            f"sheet_{k}",
            (x, 8, 1.7),
            -90,
            size={"style": "talk", "seed": 20 + k, "width_m": 0.6, "height_m": 0.84},
        )
    yield Piece("pipe", "sprinkler", (0, 8, 4.3), -90, size={"length_m": 25, "radius_m": 0.05, "colour": "#a5251d"})


def _staging(seed):
    """Loads that wait on the floor, a stack of empty pallets and a hand truck."""
    rng = np.random.default_rng([seed, 77])
    found = []
    for k, (x, y, yaw) in enumerate(
        ((9.2, -4.6, 4), (10.3, 0.6, 93), (9.1, 1.9, 88), (10.6, -6.6, 2), (-11.6, 6.3, 12))
    ):
        load = [part.moved(at(x, y, 0, yaw=yaw)) for part in (*pallet(), *_load(rng, 1.2))]
        found.append((f"waiting_{k}", load))
    stack = [part.moved(at(-11.7, -4.7, 0.145 * n, yaw=90 + rng.normal(0, 1.5))) for n in range(7) for part in pallet()]
    found.append(("empty_pallets", stack))
    found.append(("pallet_truck", [part.moved(at(9.6, 4.0, 0, yaw=-35)) for part in _pallet_truck()]))
    return found


def _pallet_truck():
    """A hand truck: two forks, a pump and a tiller."""
    roll = lathe(mm("0 -35, 38 -35, 40 -30, 40 30, 38 35, 0 35"), sections=16)
    grip = tube([[-0.42, -0.12, 1.18], [-0.42, 0.12, 1.18]], 0.015)
    return [
        *(stood((1.15, 0.16, 0.05), YELLOW, 0.1, s * 0.19, 0.07, bevel=0.012) for s in (-1, 1)),
        stood((0.2, 0.54, 0.34), YELLOW, -0.52, 0, 0.1, bevel=0.02),
        *(put(roll, BLACK, x, s * 0.19, 0.04, roll=90) for x in (0.55, -0.5) for s in (-1, 1)),
        put(lathe(mm("0 0, 60 0, 60 340, 40 360, 0 360")), DARK, -0.6, 0, 0.3),
        put(tube([[-0.6, 0, 0.6], [-0.42, 0, 1.18]], 0.018), DARK),
        put(grip, BLACK),
    ]
