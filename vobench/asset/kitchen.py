"""Furniture of kitchens: units, appliances and what stands on worktops. They stand on z = 0 and face x."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vobench.asset import picture
from vobench.asset.furniture import (
    BLACK,
    CHROME,
    DARK,
    SIDES,
    STEEL,
    WHITE,
    Part,
    coated,
    matt,
    mm,
    put,
    stood,
    wood,
)
from vobench.asset.picture import BRICK, OCHRE, TEAL, Rng, one_of
from vobench.asset.shape import at, block, card, cushion, extrusion, lathe, spline, tube
from vobench.scene.material import Material
from vobench.scene.mesh import flipped, joined, moved, quad

if TYPE_CHECKING:
    from trimesh import Trimesh

WORKTOP_M = 0.9
FRONTS = "#7f9182"
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])  # the corners of a square with sides of 2


def cupboard(
    width_m: float,
    *,
    drawers: Sequence[float] = (),
    doors: int = 1,
    height_m: float = 0.77,
    depth_m: float = 0.56,
    colour: str = FRONTS,
) -> list[Part]:
    """A cupboard with drawers of given heights, from below, or with doors."""
    paint = coated(colour, roughness=0.35)
    grip = tube(mm("0 -60 0, 22 -60 0, 22 60 0, 0 60 0"), 0.005)
    front_x = depth_m / 2 + 0.01
    grip_x = depth_m / 2 + 0.02
    parts = [stood((depth_m, width_m - 0.002, height_m), paint, bevel=0.001)]
    if drawers:
        z = 0.004
        for drawer_m in drawers:
            parts.append(stood((0.02, width_m - 0.006, drawer_m - 0.006), paint, front_x, z=z))
            parts.append(put(grip, STEEL, grip_x, z=z + drawer_m - 0.05))
            z += drawer_m
        return parts

    door_m = width_m / doors
    is_wall_cupboard = depth_m <= 0.4
    grip_z = 0.12 if is_wall_cupboard else height_m - 0.12
    for index in range(doors):
        y = (index + 0.5) * width_m / doors - width_m / 2
        # The grips of two neighbouring doors are beside each other.
        grip_side = 1 if index % 2 == 0 else -1
        grip_y = y + grip_side * (door_m / 2 - 0.05)
        parts.append(stood((0.02, door_m - 0.006, height_m - 0.008), paint, front_x, y, 0.004))
        parts.append(put(grip, STEEL, grip_x, grip_y, grip_z, roll=90))
    return parts


def oven() -> list[Part]:
    """An oven with a window and knobs, in a unit 0.6 m wide."""
    glass = coated("#0d0f10", roughness=0.05)
    body = stood((0.56, 0.598, 0.77), WHITE)
    plinth = stood((0.02, 0.594, 0.135), DARK, 0.29, z=0.008)
    front = stood((0.02, 0.594, 0.6), STEEL, 0.29, z=0.15)
    window = put(block((0.006, 0.48, 0.36), bevel_m=0.002), glass, 0.301, z=0.38)
    bar = put(tube(mm("0 -240 0, 40 -240 0, 40 240 0, 0 240 0"), 0.008), CHROME, 0.3, z=0.6)
    knob = lathe(mm("0 0, 20 0, 18 22, 0 22"), sections=20)
    knobs = [put(knob, BLACK, 0.3, y, 0.69, pitch=90) for y in (-0.22, -0.14, 0.14, 0.22)]
    time = matt("#1d3b2c", picture.sign("12:04", "#101312"))
    clock = put(card((0.12, 0.05)), time, 0.3012, z=0.69)
    return [body, plinth, front, window, bar, *knobs, clock]


def sink() -> list[Part]:
    """A basin and a tap; the rim of the basin is at z = 0."""
    width_m = 0.42
    length_m = 0.56
    depth_m = 0.17
    x = width_m / 2
    y = length_m / 2
    walls = [
        flipped(quad((-x, -y, -depth_m), (0, 0, depth_m), (0, length_m, 0))),
        flipped(quad((x, -y, -depth_m), (0, length_m, 0), (0, 0, depth_m))),
        flipped(quad((-x, -y, -depth_m), (width_m, 0, 0), (0, 0, depth_m))),
        flipped(quad((-x, y, -depth_m), (0, 0, depth_m), (width_m, 0, 0))),
        quad((-x, -y, -depth_m), (width_m, 0, 0), (0, length_m, 0)),
    ]
    rim = extrusion(SQUARE * [x + 0.025, y + 0.025], 0.004, holes_m=[SQUARE * [x, y]])
    tap = tube(spline(mm("-255 0 0, -255 0 240, -200 0 330, -110 0 300, -95 0 230"), 24), 0.013, sections=12)
    lever = tube(mm("-255 20 60, -255 60 90"), 0.008)
    plug = lathe(mm("0 0, 40 0, 38 3, 0 3"))
    return [put(joined([*walls, rim]), STEEL), put(joined([tap, lever]), CHROME), put(plug, CHROME, z=-depth_m)]


def fridge() -> list[Part]:
    """A fridge 1.85 m high with two doors, and notes on it."""
    paint = coated("#c9cdcc", roughness=0.2)
    grip = tube(mm("0 0 -200, 40 0 -200, 40 0 200, 0 0 200"), 0.009)
    freezer_door = stood((0.05, 0.594, 0.62), paint, 0.3, z=0.06, bevel=0.012)
    fridge_door = stood((0.05, 0.594, 1.16), paint, 0.3, z=0.69, bevel=0.012)
    grips = [put(grip, STEEL, 0.325, -0.25, z) for z in (0.48, 0.98)]
    # Each note shows another cell of the same picture of pages.
    notes = [
        _note((0.15, 0.21), (0, 1 / 3, 0, 0.5), y=0.08, z=1.5, roll_deg=4),
        _note((0.1, 0.14), (1 / 3, 2 / 3, 0, 0.5), y=-0.1, z=1.42, roll_deg=-6),
        _note((0.12, 0.17), (2 / 3, 1, 0.5, 1), y=0.15, z=1.2, roll_deg=2),
    ]
    magnet = cushion((0.012, 0.03, 0.03), power=2, cells=4)
    magnets = [
        put(magnet, coated(BRICK), 0.328, 0.08, 1.59),
        put(magnet, coated(OCHRE), 0.328, -0.1, 1.48),
        put(magnet, coated(TEAL), 0.328, 0.15, 1.275),
    ]
    body = stood((0.56, 0.596, 1.85), paint, bevel=0.01)
    return [body, freezer_door, fridge_door, *grips, *notes, *magnets]


def _note(
    size_m: tuple[float, float],
    cell: tuple[float, float, float, float],
    *,
    y: float,
    z: float,
    roll_deg: float,
) -> Part:
    """A note on the door of the fridge."""
    return put(card(size_m, cell=cell), matt(texture=picture.pages(3)), 0.3262, y, z, roll=roll_deg)


def hob() -> list[Part]:
    """A glass hob with three rings."""
    rings = [_hob_ring(-0.14, -0.12, 0.1), _hob_ring(0.14, -0.12, 0.08), _hob_ring(0.14, 0.13, 0.11)]
    plate = block((0.58, 0.51, 0.008), bevel_m=0.002)
    return [
        put(plate, coated("#0e0f10", roughness=0.04), z=0.004),
        put(joined(rings), coated("#3a3c3e", roughness=0.2)),
    ]


def _hob_ring(x: float, y: float, radius_m: float) -> "Trimesh":
    profile = np.array([[0, 0], [radius_m, 0], [radius_m, 0.001], [0, 0.001]])
    return moved(lathe(profile), at(x, y, 0.008))


def pot(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0, *, colour: str = BRICK) -> list[Part]:
    """A pot with a lid and two handles."""
    body = lathe(mm("0 0, 105 0, 110 6, 110 130, 113 132, 0 138, 0 140"), sections=32)
    handles = []
    for side in SIDES:
        inner_mm = side * 108
        outer_mm = side * 145
        path = mm(f"{inner_mm} -35 110, {outer_mm} -25 115, {outer_mm} 25 115, {inner_mm} 35 110")
        handles.append(tube(spline(path, 10), 0.007))
    knob = moved(lathe(mm("0 0, 10 0, 18 20, 0 24")), at(z_m=0.138))
    enamel = coated(colour, roughness=0.12)
    return [put(joined([body, *handles]), enamel, x_m, y_m, z_m), put(knob, BLACK, x_m, y_m, z_m)]


def kettle(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0, *, yaw_deg: float = 0.0) -> list[Part]:
    """A steel kettle."""
    body = lathe(mm("0 0, 78 0, 82 12, 74 150, 50 190, 20 200, 14 215, 0 218"), sections=32)
    grip = tube(spline(mm("60 0 175, 125 0 180, 130 0 80, 84 0 40"), 16), 0.011)
    spout = tube(spline(mm("-60 0 130, -95 0 165, -105 0 180"), 8), 0.012)
    return [
        put(body, STEEL, x_m, y_m, z_m, yaw=yaw_deg),
        put(joined([grip, spout]), BLACK, x_m, y_m, z_m, yaw=yaw_deg),
    ]


def bottle(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0, *, colour: str = "#2c3a1c") -> list[Part]:
    """A bottle of oil or wine."""
    glass = lathe(mm("0 0, 36 0, 38 6, 38 190, 15 240, 13 300, 16 302, 16 315, 0 316"), sections=24)
    return [put(glass, coated(colour, roughness=0.05), x_m, y_m, z_m)]


def jar(
    x_m: float = 0.0,
    y_m: float = 0.0,
    z_m: float = 0.0,
    *,
    height_m: float = 0.2,
    colour: str = "#b98a4e",
    yaw_deg: float = 0.0,
) -> list[Part]:
    """A jar with a wooden lid."""
    body = lathe(mm("0 0, 50 0, 55 8, 55 800, 0 805") * [1, height_m / 0.8], sections=24)
    lid = lathe(mm("0 0, 50 0, 50 24, 0 24"))
    return [
        put(body, coated(colour, roughness=0.06), x_m, y_m, z_m),
        put(lid, wood("beech"), x_m, y_m, z_m + height_m, yaw=yaw_deg),
    ]


# --- A row of units along a wall ---

ROW_DEPTH_M = 0.62  # from the wall to the edge of the worktop
UNIT_M = 0.6  # width of an appliance


@dataclass(frozen=True, slots=True)
class KitchenStyle:
    """The surfaces of a kitchen: colours of its fronts and wall cupboards, its worktop, and the tiles above it."""

    fronts: str
    wall_fronts: str
    worktop: Material
    tiles: Material


@dataclass(frozen=True, slots=True)
class _Unit:
    """A unit of a row: what it is, its middle along y, and its width."""

    kind: str
    y: float
    width_m: float


def row(
    rng: Rng,
    length_m: float,
    ceiling_m: float,
    style: KitchenStyle,
    window: tuple[float, float] | None = None,
) -> list[Part]:
    """A row of units with a worktop and wall cupboards. Its back is at x = 0, and its middle at y = 0.

    `window` is the first and the last y of a window above the worktop, which wall cupboards and hood leave free.
    """
    units = _units(rng, length_m)
    is_mirrored = rng.random() < 0.5
    if is_mirrored:
        units = [_Unit(unit.kind, -unit.y, unit.width_m) for unit in reversed(units)]
    sink_y = next(unit.y for unit in units if unit.kind == "sink")
    oven_y = next(unit.y for unit in units if unit.kind == "oven")

    parts = list[Part]()
    for unit in units:
        T_row_unit = at(0.3, unit.y, 0.0 if unit.kind == "fridge" else 0.1)
        parts += [part.moved(T_row_unit) for part in _unit_parts(unit, style)]

    below_worktop = [unit for unit in units if unit.kind != "fridge"]
    first_m = below_worktop[0].y - below_worktop[0].width_m / 2
    last_m = below_worktop[-1].y + below_worktop[-1].width_m / 2
    parts += _worktop(first_m, last_m, sink_y, style, tiles_m=0.12 if window else 0.56)
    parts += _cooker(rng, oven_y, ceiling_m, has_hood=_is_free(window, oven_y, 0.3))
    parts += _wall_cupboards(first_m, last_m, oven_y, style, window)
    parts += _worktop_things(rng, first_m, last_m, (sink_y, oven_y))
    return parts


def _units(rng: Rng, length_m: float) -> list[_Unit]:
    """The units of a row: a fridge at its first end, sink and oven apart from each other."""
    spare_m = length_m - 3 * UNIT_M  # without fridge, sink and oven
    cupboards = list[tuple[str, float]]()
    while spare_m >= 0.4:
        width_m = spare_m if spare_m < 0.95 else float(rng.choice([0.45, 0.6]))
        third_kind = "dishwasher" if width_m == UNIT_M else "doors"
        cupboards.append((one_of(rng, "drawers", "doors", third_kind), width_m))
        spare_m -= width_m
    split = int(rng.integers(1, len(cupboards) + 1)) if cupboards else 0
    sink_m = UNIT_M + max(spare_m, 0.0)
    row = [("fridge", UNIT_M), *cupboards[split:], ("sink", sink_m), *cupboards[:split], ("oven", UNIT_M)]

    units = []
    y = -length_m / 2
    for kind, width_m in row:
        units.append(_Unit(kind, y + width_m / 2, width_m))
        y += width_m
    return units


def _unit_parts(unit: _Unit, style: KitchenStyle) -> list[Part]:
    if unit.kind == "fridge":
        return fridge()
    if unit.kind == "oven":
        return oven()
    if unit.kind == "drawers":
        return cupboard(unit.width_m, drawers=(0.34, 0.26, 0.17), colour=style.fronts)
    if unit.kind == "dishwasher":
        return cupboard(unit.width_m, drawers=(0.6, 0.17), colour=style.fronts)
    return cupboard(unit.width_m, doors=2 if unit.width_m > 0.65 else 1, colour=style.fronts)


def _worktop(first_m: float, last_m: float, sink_y: float, style: KitchenStyle, *, tiles_m: float) -> list[Part]:
    """The worktop with the sink in it, the plinth, and the tiles behind."""
    outline = [(0.0, first_m), (ROW_DEPTH_M, first_m), (ROW_DEPTH_M, last_m), (0.0, last_m)]
    plinth = [(0.0, first_m), (0.54, first_m), (0.54, last_m), (0.0, last_m)]
    hole = SQUARE * [0.21, 0.28] + [0.32, sink_y]  # as large as the basin of `sink`
    tiles = block((0.008, last_m - first_m, tiles_m), bevel_m=0.001)
    return [
        put(extrusion(outline, 0.03, holes_m=[hole]), style.worktop, z=WORKTOP_M - 0.03),
        put(extrusion(plinth, 0.1), DARK),
        put(tiles, style.tiles, 0.004, (first_m + last_m) / 2, WORKTOP_M + tiles_m / 2),
        *(part.moved(at(0.32, sink_y, WORKTOP_M)) for part in sink()),
    ]


def _cooker(rng: Rng, y: float, ceiling_m: float, *, has_hood: bool) -> list[Part]:
    """The hob above the oven, mostly with a pot on it, and the hood above the hob."""
    parts = [part.moved(at(0.31, y, WORKTOP_M)) for part in hob()]
    has_pot = rng.random() < 0.7
    if has_pot:
        colour = one_of(rng, BRICK, TEAL, "#2b2d2f", "#c7c9c8", OCHRE)
        parts += pot(0.18, y + 0.13, WORKTOP_M + 0.009, colour=colour)
    if has_hood:
        parts.append(stood((0.48, 0.6, 0.06), STEEL, 0.25, y, 1.6))
        parts.append(stood((0.24, 0.26, ceiling_m - 1.661), STEEL, 0.13, y, 1.66))
    return parts


def _is_free(window: tuple[float, float] | None, y: float, half_m: float) -> bool:
    """Whether what reaches from y - half to y + half leaves the window and its frame free."""
    if window is None:
        return True
    return y + half_m < window[0] - 0.1 or y - half_m > window[1] + 0.1


def _wall_cupboards(
    first_m: float,
    last_m: float,
    oven_y: float,
    style: KitchenStyle,
    window: tuple[float, float] | None,
) -> list[Part]:
    """Wall cupboards on both sides of the hood."""
    parts = list[Part]()
    for start_m, end_m in ((first_m, oven_y - 0.31), (oven_y + 0.31, last_m)):
        count = int((end_m - start_m) / 0.42)
        for index in range(count):
            width_m = (end_m - start_m) / count
            y = start_m + (index + 0.5) * width_m
            if _is_free(window, y, width_m / 2):
                wall_unit = cupboard(width_m, height_m=0.72, depth_m=0.33, colour=style.wall_fronts)
                parts += [part.moved(at(0.166, y, 1.46)) for part in wall_unit]
    return parts


def _is_clear_of(y: float, taken_y: Sequence[float]) -> bool:
    """Whether a place along the worktop is clear of what stands there already, given by its middles in m."""
    return all(abs(y - middle) > 0.42 for middle in taken_y)


def _worktop_things(rng: Rng, first_m: float, last_m: float, taken_y: Sequence[float]) -> list[Part]:
    """A kettle, jars, boards, a block of knives and a bottle, where the worktop is free."""
    places = np.arange(first_m + 0.14, last_m - 0.1, 0.19)
    free = [y for y in places.tolist() if _is_clear_of(y, taken_y)]
    kinds = rng.permutation(["kettle", "jars", "bottle", "board", "knives", "jar"]).tolist()
    parts = list[Part]()
    for y, kind in zip(free, kinds, strict=False):
        is_used = rng.random() < 0.6
        if is_used:
            T_row_thing = at(0.17 + rng.uniform(0, 0.04), y, WORKTOP_M)
            parts += [part.moved(T_row_thing) for part in _worktop_thing(rng, kind)]
    return parts


def _worktop_thing(rng: Rng, kind: str) -> list[Part]:
    if kind == "kettle":
        return kettle(yaw_deg=rng.uniform(0, 360))
    if kind == "jars":
        return [*jar(0, -0.06), *jar(-0.01, 0.06, height_m=0.16, colour="#d9cfb8", yaw_deg=40)]
    if kind == "jar":
        return jar(height_m=0.24, colour="#8a4a2e")
    if kind == "bottle":
        return bottle(colour=one_of(rng, "#2c3a1c", "#5a2a1c", "#c9c2a8"))
    return _chopping_board() if kind == "board" else _knives()


def _chopping_board() -> list[Part]:
    """A board that leans against the tiles."""
    board = block((0.018, 0.24, 0.34), bevel_m=0.004)
    return [put(board, wood("walnut"), -0.115, 0, 0.168, pitch=-8)]


def _knives() -> list[Part]:
    """A block of knives."""
    handle = block((0.02, 0.026, 0.11), bevel_m=0.006)
    handles = []
    for index in range(4):  # in two rows
        x = 0.03 - 0.022 * index
        y = 0.03 * (index % 2) - 0.02
        handles.append(put(handle, BLACK, x, y, 0.26))
    return [stood((0.12, 0.1, 0.22), wood("walnut"), bevel=0.01), *handles]
