"""Warehouses by seed: racks with goods in rows, or goods in blocks on the floor, aisles, docks, in any daylight."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vobench.asset import fitting, furniture, outdoors, pallet, picture, warehouse_equipment
from vobench.asset.daylight import lamp_colour, level_daylight
from vobench.asset.furniture import STEEL, WHITE, Part, coated, matt, put, stood
from vobench.asset.pallet_rack import Rack
from vobench.asset.picture import Rng, one_of
from vobench.asset.room import OUTWARD, Opening, Wall, shell
from vobench.asset.shape import at, block_arrays, card_arrays, extrusion
from vobench.asset.site import Area, Footprint, LevelAreas, Site, SitePiece, Structure, footprint
from vobench.asset.texture import Procedural
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays, quad
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

# Each choice has a stream of random numbers of its own, so that a change of one leaves the others as they are.
PLAN_STREAM = 0
BUILDING_STREAM = 1
FURNITURE_STREAM = 2
DAYLIGHT_STREAM = 3
SUN_STREAM = 4
FILL_STREAM = 20
LOAD_STREAM = 21  # followed by the numbers of row and bay

PANORAMAS = ("suburb", "city", "country")
PANORAMA_M = (40.0, 70.0)  # distance of what is around the hall
BODY_RADIUS_M = 0.5
CLOSE_M = 0.01  # that footprints may share
LUX = 260.0  # on the floor by the lamps, about

# Distances between samples of the light
SHELL_SPACING_M = 0.2
RACK_SPACING_M = 0.3
GOODS_SPACING_M = 0.2

# Colours of uprights and beams
STEELS = (
    ("#24427a", "#d8641e"),
    ("#2f5d46", "#d8a614"),
    ("#5d6468", "#c9652a"),
    ("#8d1f1c", "#d9dad7"),
    ("#24427a", "#d8a614"),
)
FIRST_DECK_M = 1.5
CROSS_M = 1.35  # of floor before the ends of the rows, on which nothing stands
WALL_GAP_M = 0.2  # between a rack and a wall
BACK_GAP_M = 0.15  # between two racks back to back
BESIDE_ROW_M = 0.06  # what a row takes up beside its racks
STAGING_X_M = 1.4  # of the staging area, kept free at the docks
BLOCK_M = 1.9  # height of goods in blocks on the floor
MOST_LOAD_M = 1.7  # height of a load
TOP_LOAD_M = 1.35  # height of a load on the uppermost deck
BELOW_DECK_M = 0.16  # free height and thickness of the deck above a load

FLOOR_TINTS = ("#fafcff", "#fff8ee", "#e6efe9", "#f0f0f4")
PLASTER_TINTS = ("#cfd4d2", "#d9d4c8", "#c2ccd0", "#dfe0da")
PANEL_TINTS = ("#d6d9da", "#b9c2c6", "#cfcac0")
BRICK_TINTS = ("#ffffff", "#e6d6b4", "#d8c0a8")
WEST_BRICK_TINTS = ("#ffffff", "#c9b8a8")
CEILING_TINTS = ("#b8bdbf", "#d0d2d0", "#9aa0a4")
STEELWORK_PAINTS = ("#6d7579", "#8d9092", "#4f6472", "#b7bcc0")
SPRINKLER_RED = "#a5251d"
LINE_PAINTS = ("#d8a614", "#d9dad7", "#c9652a", "#3f6c87")
TYRE_MARK = "#7d7c77"
LINE_M = 0.003  # height of lines above the floor
TYRE_MARK_M = 0.0015
LABEL_COLOUR = "#d39a3c"
ROW_LETTERS = "ABCDEFGHIJ"
CABINET_COLOURS = ("#8b9493", "#4f6472", "#7d3a30")


@dataclass(frozen=True, slots=True)
class HallPlan:
    """The plan of a hall, whose middle is at the origin. Rows of racks run along x, and the docks are in the east.

    `rack` is a row of racks, and `rows_y_m` are the middles of the rows.
    `aisles_y_m` are the middles of the aisles between them.
    `rows_x_m` is the middle of all rows.
    `gap_bay` is the bay that is left out of all rows for a cross aisle, or -1.
    `blocks` are the rows whose goods stand in blocks on the floor.
    """

    size_m: tuple[float, float, float]
    rack: Rack
    rows_y_m: tuple[float, ...]
    aisles_y_m: tuple[float, ...]
    rows_x_m: float
    gap_bay: int
    blocks: tuple[int, ...]

    @property
    def half_m(self) -> tuple[float, float]:
        """Half the length and the width of the hall."""
        return self.size_m[0] / 2, self.size_m[1] / 2

    @property
    def docks_x_m(self) -> float:
        """Where the rows end and the staging area begins."""
        return self.rows_x_m + self.rack.length_m / 2

    def row_corners_m(self, y_m: float) -> Array:
        """The footprint (4, 2) of a row."""
        west_m = self.rows_x_m - self.rack.length_m / 2
        east_m = self.docks_x_m
        half_m = self.rack.depth_m / 2 + BESIDE_ROW_M
        south_m = y_m - half_m
        north_m = y_m + half_m
        return np.array([[west_m, south_m], [east_m, south_m], [east_m, north_m], [west_m, north_m]])


def hall_plan(rng: Rng) -> HallPlan:
    """The plan of a warehouse."""
    rack = _rack(rng)
    aisle_m = float(rng.uniform(2.5, 3.6))
    aisle_count = int(rng.integers(2, 5))
    has_wall_rows = bool(rng.random() < 0.7)
    section = _cross_section(rack.depth_m, aisle_m, aisle_count, has_wall_rows=has_wall_rows)

    head_m = float(rng.uniform(1.8, 3.2))  # free floor at the west end
    staging_m = float(rng.uniform(6.0, 9.0))
    length_m = head_m + rack.length_m + staging_m
    height_m = rack.levels_m[-1] + 1.3 + float(rng.uniform(1.0, 2.2))
    blocks = tuple(row for row in range(len(section.rows_y_m)) if rng.random() < 0.2)
    has_cross_aisle = rack.bays > 5 and rng.random() < 0.5
    gap_bay = int(rng.integers(1, rack.bays - 1)) if has_cross_aisle else -1
    middle_y_m = section.width_m / 2
    return HallPlan(
        size_m=(length_m, section.width_m, height_m),
        rack=rack,
        rows_y_m=tuple(y_m - middle_y_m for y_m in section.rows_y_m),
        aisles_y_m=tuple(y_m - middle_y_m for y_m in section.aisles_y_m),
        rows_x_m=-length_m / 2 + head_m + rack.length_m / 2,
        gap_bay=gap_bay,
        blocks=blocks,
    )


def _rack(rng: Rng) -> Rack:
    """A row of racks, of which all rows of a hall are copies."""
    upright, beam = STEELS[int(rng.integers(len(STEELS)))]
    level_count = int(rng.integers(2, 4))
    step_m = float(rng.uniform(1.35, 1.8))
    levels_m = (FIRST_DECK_M + step_m * np.arange(level_count)).round(2)
    return Rack(
        bays=int(rng.integers(4, 8)),
        bay_m=float(rng.choice([2.7, 2.7, 1.85])),
        depth_m=1.1,
        levels_m=tuple(levels_m.tolist()),
        upright=coated(upright, roughness=0.4),
        beam=coated(beam, roughness=0.4),
    )


class _CrossSection(NamedTuple):
    """The middles of rows and aisles from the south wall at y = 0 to the north wall."""

    rows_y_m: list[float]
    aisles_y_m: list[float]
    width_m: float


def _cross_section(depth_m: float, aisle_m: float, aisle_count: int, *, has_wall_rows: bool) -> _CrossSection:
    """Aisles with two rows back to back between them and, if `has_wall_rows`, one row at each wall."""
    rows_y_m = []
    aisles_y_m = []
    y_m = WALL_GAP_M
    if has_wall_rows:
        rows_y_m.append(y_m + depth_m / 2)
        y_m += depth_m
    for number in range(aisle_count):
        aisles_y_m.append(y_m + aisle_m / 2)
        y_m += aisle_m
        is_last = number == aisle_count - 1
        if not is_last:
            rows_y_m.append(y_m + depth_m / 2)
            rows_y_m.append(y_m + 1.5 * depth_m + BACK_GAP_M)
            y_m += 2 * depth_m + BACK_GAP_M
    if has_wall_rows:
        rows_y_m.append(y_m + depth_m / 2)
        y_m += depth_m
    return _CrossSection(rows_y_m, aisles_y_m, y_m + WALL_GAP_M)


def generated_warehouse(seed: int, lighting: str) -> Site:
    """The warehouse of a seed under a lighting, one of `daylight.LIGHTINGS`. Its lamps are always on."""
    plan = hall_plan(np.random.default_rng([seed, PLAN_STREAM]))
    rng = np.random.default_rng([seed, BUILDING_STREAM])
    windows = _windows(rng, plan)
    trays, lamps = _lamps(rng, plan)
    structures = list(_shell(rng, plan, windows))
    structures += _steelwork(rng, plan, trays)
    structures += _docks(rng, plan)
    structures.append(_markings(rng, plan))
    structures += _racks(plan)
    candidates = list(_loads(plan, seed))
    candidates += _furniture(plan, np.random.default_rng([seed, FURNITURE_STREAM]))
    outside = level_daylight(
        np.random.default_rng([seed, DAYLIGHT_STREAM]),
        np.random.default_rng([seed, SUN_STREAM]),
        lighting,
        kinds=PANORAMAS,
        distance_m=PANORAMA_M,
    )
    half_x_m, half_y_m = plan.half_m
    corners_m = [[-half_x_m, -half_y_m], [half_x_m, -half_y_m], [half_x_m, half_y_m], [-half_x_m, half_y_m]]
    floor = Area(np.array(corners_m), 0.0)
    return Site(
        structures=tuple(structures),
        pieces=tuple(_without_overlaps(candidates, plan)),
        lights=(*lamps, *outside.lights),
        ground=LevelAreas((floor,)),
        roads=(floor,),
        stations_m=_stations_m(plan),
        body_radius_m=BODY_RADIUS_M,
        blocked=tuple(_rack_footprints(plan)),
    )


def _west_end_m(plan: HallPlan) -> float:
    """The x at which the rows begin."""
    return plan.rows_x_m - plan.rack.length_m / 2


def _stations_m(plan: HallPlan) -> Array:
    """The ends (N, 2) of all aisles, which a body has to reach."""
    west_m = _west_end_m(plan) - 0.2
    east_m = plan.docks_x_m + CROSS_M / 2
    stations_m = []
    for aisle_m in plan.aisles_y_m:
        stations_m.append([west_m, aisle_m])
        stations_m.append([east_m, aisle_m])
    return np.array(stations_m)


def _rack_footprints(plan: HallPlan) -> Iterator[Array]:
    """The footprints (4, 2) of all racks, before and after the cross aisle."""
    for row, y_m in enumerate(plan.rows_y_m):
        if row in plan.blocks:
            continue
        corners_m = plan.row_corners_m(y_m)
        if plan.gap_bay < 0:
            yield corners_m
            continue
        gap_x_m = plan.rows_x_m + plan.rack.bay_x_m(plan.gap_bay)
        half_m = plan.rack.pitch_m / 2
        west_part_m = corners_m.copy()
        west_part_m[[1, 2], 0] = gap_x_m - half_m + BESIDE_ROW_M
        east_part_m = corners_m.copy()
        east_part_m[[0, 3], 0] = gap_x_m + half_m - BESIDE_ROW_M
        yield west_part_m
        yield east_part_m


# --- The building ---


def _windows(rng: Rng, plan: HallPlan) -> list[Opening]:
    """Bands of windows below the roof, on two sides or on one, and in some halls one in the west."""
    half_x_m, half_y_m = plan.half_m
    high_m = plan.size_m[2] - 0.75
    choices: tuple[tuple[Wall, ...], ...] = (("north", "south"), ("north",), ("south",))
    sides = choices[int(rng.choice(3, p=[0.6, 0.25, 0.15]))]
    width_m = float(rng.uniform(2.0, 3.6))
    count = max(2, int(2 * half_x_m / (width_m + 2.6)))
    middles_m = (np.arange(count) + 0.5) * 2 * half_x_m / count - half_x_m
    windows = []
    for side in sides:
        windows += [Opening(side, (middle_m, high_m), (width_m, 0.9)) for middle_m in middles_m.tolist()]
    has_west_window = rng.random() < 0.4
    if has_west_window:
        windows.append(Opening("west", (0.0, high_m - 0.3), (min(4.0, half_y_m), 1.2)))
    return windows


def _shell(rng: Rng, plan: HallPlan, windows: list[Opening]) -> Iterator[Structure]:
    """Floor, walls, ceiling and windows."""
    floor = _floor_material(rng)
    wall = _wall_material(rng)
    has_brick_end = rng.random() < 0.3
    west_wall = matt(one_of(rng, *WEST_BRICK_TINTS), picture.masonry("brick", 1)) if has_brick_end else wall
    ceiling = matt(one_of(rng, *CEILING_TINTS), picture.ground("plaster", 1, 512, 2.0))
    walls: dict[Wall, Material] = {**dict.fromkeys(OUTWARD, wall), "west": west_wall}
    for name, parts in shell(plan.size_m, windows, floor=floor, ceiling=ceiling, walls=walls):
        yield Structure(name, tuple(parts), SHELL_SPACING_M)


def _floor_material(rng: Rng) -> Material:
    """Polished concrete."""
    seed = int(rng.integers(4))
    albedo = float(rng.uniform(0.26, 0.42))
    slab = Procedural("plaster", albedo, contrast=0.4, tile_m=6.0, resolution_px=1024, seed=8 + seed)
    roughness = float(rng.choice([0.2, 0.3, 0.5]))
    return coated(one_of(rng, *FLOOR_TINTS), slab, roughness)


def _wall_material(rng: Rng) -> Material:
    """Plaster, panels or brick."""
    kind = one_of(rng, "plaster", "plaster", "panel", "brick")
    if kind == "plaster":
        return matt(one_of(rng, *PLASTER_TINTS), picture.ground("plaster", 2, 1024, 2.4))
    if kind == "panel":
        panels = picture.masonry("tile", 0, 512, 3.0, rows=1, columns=3, bond=0.0)
        return coated(one_of(rng, *PANEL_TINTS), panels, roughness=0.4)
    return matt(one_of(rng, *BRICK_TINTS), picture.masonry("brick", 0))


def _steelwork(rng: Rng, plan: HallPlan, trays: list[Part]) -> Iterator[Structure]:
    """Beams and purlins below the roof with the trays of lamps, and the pipe of the sprinklers."""
    half_x_m, half_y_m = plan.half_m
    high_m = plan.size_m[2]
    paint = coated(one_of(rng, *STEELWORK_PAINTS), roughness=0.4)
    # The profile of an I-beam, in halves of its width and height. The second half is the first one, turned.
    half_profile = np.array([[1, -1], [1, -0.85], [0.07, -0.85], [0.07, 0.85], [1, 0.85], [1, 1]])
    profile = np.concatenate([half_profile, -half_profile])
    beam = as_arrays(extrusion(profile * [0.1, 0.19], 2 * half_y_m))
    beam_count = max(3, round(2 * half_x_m / 6.0) + 1)
    beams_x_m = np.linspace(-half_x_m + 0.15, half_x_m - 0.15, beam_count).tolist()
    steel = [beam.moved(at(x_m, half_y_m, high_m - 0.2, roll=90)) for x_m in beams_x_m]

    purlin = block_arrays((2 * half_x_m, 0.08, 0.16), bevel_m=0)
    purlins_y_m = np.arange(-half_y_m + 1.0, half_y_m - 0.5, 2.0).tolist()
    steel += [purlin.moved(at(0, y_m, high_m - 0.08)) for y_m in purlins_y_m]
    yield Structure("steelwork", (Part(joined_arrays(steel), paint), *trays), RACK_SPACING_M)

    pipe = fitting.pipe(rng, length_m=2 * half_x_m - 1, radius_m=0.05, colour=SPRINKLER_RED)
    T_hall_pipe = at(0, half_y_m, high_m - 1.6, yaw=-90)
    yield Structure("sprinkler", tuple(part.moved(T_hall_pipe) for part in pipe), RACK_SPACING_M)


def _docks(rng: Rng, plan: HallPlan) -> Iterator[Structure]:
    """One or two roller doors in the east wall, if there is room for them."""
    half_x_m, half_y_m = plan.half_m
    count = int(rng.integers(1, 3))
    for number in range(count):
        from_middle = number - (count - 1) / 2
        y_m = from_middle * 5.2 + float(rng.uniform(-0.3, 0.3))
        has_room = abs(y_m) + 2.6 < half_y_m
        if has_room:
            door = warehouse_equipment.roller_door(rng, int(rng.integers(1, 20)))
            T_hall_door = at(half_x_m, y_m, 0, yaw=180)
            yield Structure(f"dock_{number}", tuple(part.moved(T_hall_door) for part in door), RACK_SPACING_M)


def _lamps(rng: Rng, plan: HallPlan) -> tuple[list[Part], list[Light]]:
    """Bands of light above the aisles: their trays and rods, and a light for each band."""
    half_x_m, half_y_m = plan.half_m
    high_m = plan.size_m[2]
    lamp_z_m = high_m - float(rng.uniform(0.5, 0.9))
    count = max(1, round(2 * half_x_m / float(rng.uniform(7.0, 13.0))))  # above each aisle
    pitch_m = 2 * half_x_m / count
    length_m = float(rng.uniform(0.45, 0.85)) * pitch_m
    width_m = float(rng.uniform(0.12, 0.4))
    colour = lamp_colour(float(rng.uniform(3600, 5500)))
    # About half of the light reaches the floor between the racks.
    power_lm = LUX * 4 * half_x_m * half_y_m / 0.5 / (count * len(plan.aisles_y_m))

    tray_m = (length_m + 0.1, width_m + 0.08, 0.06)
    rod = block_arrays((0.012, 0.012, high_m - lamp_z_m - 0.06), bevel_m=0)
    rod_z_m = (high_m + lamp_z_m + 0.06) / 2
    trays = []
    lights: list[Light] = []
    for number in range(count):
        x_m = (number + 0.5) * pitch_m - half_x_m
        for y_m in plan.aisles_y_m:
            trays.append(stood(tray_m, WHITE, x_m, y_m, lamp_z_m + 0.004, bevel=0.01))
            for end in (-1, 1):
                rod_x_m = x_m + end * 0.4 * length_m
                trays.append(Part(rod.moved(at(rod_x_m, y_m, rod_z_m)), STEEL))
            corner_m = (x_m - length_m / 2, y_m - width_m / 2, lamp_z_m)
            panel = quad(corner_m, (0, width_m, 0), (length_m, 0, 0))
            lights.append(AreaLight(f"lamp_{len(lights)}", panel, power_lm, colour=colour))
    return trays, lights


def _markings(rng: Rng, plan: HallPlan) -> Structure:
    """Lines along the rows and around the staging area, and tyre marks on the floor."""
    paint = coated(one_of(rng, *LINE_PAINTS), roughness=0.4)
    lines = Part(joined_arrays(_lines(plan)), paint)
    marks = Part(joined_arrays(_tyre_marks(rng, plan)), matt(TYRE_MARK))
    return Structure("markings", (lines, marks), SHELL_SPACING_M)


def _lines(plan: HallPlan) -> list[MeshArrays]:
    """Lines along both sides of the rows, and across the hall at both ends of the staging area."""
    half_x_m, half_y_m = plan.half_m
    lines = []
    for row_y_m in plan.rows_y_m:
        for side in (-1, 1):
            y_m = row_y_m + side * (plan.rack.depth_m / 2 + 0.16)
            is_in_hall = abs(y_m) < half_y_m - 0.1
            if is_in_hall:
                lines.append(_strip(_west_end_m(plan), plan.docks_x_m, y_m, 0.08))
    ends_m = (plan.docks_x_m + 0.35, half_x_m - STAGING_X_M)
    lines += [_strip_across(end_m, -half_y_m + 0.4, half_y_m - 0.4, 0.1) for end_m in ends_m]
    return lines


def _tyre_marks(rng: Rng, plan: HallPlan) -> list[MeshArrays]:
    """Pairs of marks in the aisles."""
    marks = []
    for aisle_y_m in plan.aisles_y_m:
        for _ in range(int(rng.integers(1, 4))):
            start_m = float(rng.uniform(_west_end_m(plan), plan.docks_x_m - 2))
            middle_y_m = aisle_y_m + float(rng.uniform(-0.5, 0.5))
            end_m = min(start_m + float(rng.uniform(1.5, 6)), plan.docks_x_m)
            for side in (-1, 1):
                width_m = float(rng.uniform(0.02, 0.07))
                marks.append(_strip(start_m, end_m, middle_y_m + side * 0.42, width_m, TYRE_MARK_M))
    return marks


def _strip(x0: float, x1: float, y: float, width_m: float, z_m: float = LINE_M) -> MeshArrays:
    """A strip on the floor along x."""
    return quad_arrays((x0, y - width_m / 2, z_m), (x1 - x0, 0, 0), (0, width_m, 0))


def _strip_across(x: float, y0: float, y1: float, width_m: float) -> MeshArrays:
    """A strip on the floor along y."""
    return quad_arrays((x - width_m / 2, y0, LINE_M), (width_m, 0, 0), (0, y1 - y0, 0))


# --- Racks and goods ---


def _racks(plan: HallPlan) -> Iterator[Structure]:
    """The steel of all rows that have racks, and the labels of the bays."""
    rack = plan.rack
    for row, y_m in enumerate(plan.rows_y_m):
        if row in plan.blocks:
            continue
        parts: list[Part] = []
        for first, end in _runs(plan):
            run = replace(rack, bays=end - first)
            middle_m = plan.rows_x_m + (rack.bay_x_m(first) + rack.bay_x_m(end - 1)) / 2
            parts += [part.moved(at(middle_m, y_m)) for part in run.parts()]
        yield Structure(f"rack_{row}", tuple(parts), RACK_SPACING_M)
        yield Structure(f"label_{row}", tuple(_labels(plan, row, y_m)), RACK_SPACING_M)


def _labels(plan: HallPlan, row: int, y_m: float) -> Iterator[Part]:
    """Plates with the row and the number of every other bay, at both sides of a row on the lowest beam."""
    rack = plan.rack
    z_m = rack.levels_m[0] - 0.06
    to_face_m = rack.depth_m / 2 + 0.028
    card = card_arrays((0.2, 0.1))
    for bay in range(0, rack.bays, 2):
        if bay == plan.gap_bay:
            continue
        text = f"{ROW_LETTERS[row]}{bay + 1:02d}"
        plate = matt(texture=picture.sign(text, LABEL_COLOUR))
        x_m = plan.rows_x_m + rack.bay_x_m(bay)
        for side in (-1, 1):
            yield put(card, plate, x_m, y_m + side * to_face_m, z_m, yaw=side * 90.0)


def _runs(plan: HallPlan) -> Iterator[tuple[int, int]]:
    """The first bay and the one after the last of each run of racks."""
    if plan.gap_bay < 0:
        yield 0, plan.rack.bays
        return
    yield 0, plan.gap_bay
    yield plan.gap_bay + 1, plan.rack.bays


def _loads(plan: HallPlan, seed: int) -> Iterator[SitePiece]:
    """Pallets with loads: in racks, two or three to a level of a bay, and on the floor where there are no racks."""
    filled_share = float(np.random.default_rng([seed, FILL_STREAM]).uniform(0.55, 0.92))
    for row in range(len(plan.rows_y_m)):
        for bay in range(plan.rack.bays):
            if bay != plan.gap_bay:
                rng = np.random.default_rng([seed, LOAD_STREAM, row, bay])
                yield from _loads_of_bay(rng, plan, row, bay, filled_share=filled_share)


def _loads_of_bay(rng: Rng, plan: HallPlan, row: int, bay: int, *, filled_share: float) -> Iterator[SitePiece]:
    """The loads on all levels of a bay."""
    rack = plan.rack
    places = 3 if rack.bay_m > 2.5 else 2  # on each level
    bay_x_m = plan.rows_x_m + rack.bay_x_m(bay)
    y_m = plan.rows_y_m[row]
    for level, (floor_m, ceiling_m) in enumerate(_levels(plan, row)):
        for place in range(places):
            x_m = bay_x_m + (place - (places - 1) / 2) * rack.bay_m / places
            high_m = min(ceiling_m - floor_m, MOST_LOAD_M) * float(rng.uniform(0.6, 1.0))
            parts = pallet.load(rng, high_m)
            error_x_m = float(np.clip(rng.normal(0, 0.012), -0.02, 0.02))
            error_y_m = float(np.clip(rng.normal(0, 0.015), -0.03, 0.03))
            error_yaw_deg = float(np.clip(rng.normal(0, 0.3), -0.6, 0.6))
            is_filled = rng.random() < filled_share
            if is_filled:
                # Pallets stand crosswise: their longer side reaches into the rack.
                T_hall_load = at(x_m + error_x_m, y_m + error_y_m, floor_m, yaw=90.0 + error_yaw_deg)
                moved = tuple(part.moved(T_hall_load) for part in parts)
                yield SitePiece(f"load_{row}_{bay}_{level}_{place}", moved, GOODS_SPACING_M, base_m=floor_m)


def _levels(plan: HallPlan, row: int) -> list[tuple[float, float]]:
    """The height of the floor and of the ceiling of each level of a row."""
    if row in plan.blocks:
        return [(0.0, BLOCK_M)]
    floors_m = (0.0, *plan.rack.levels_m)
    top_m = floors_m[-1] + TOP_LOAD_M
    ceilings_m = [level_m - BELOW_DECK_M for level_m in (*floors_m[1:], top_m)]
    return list(zip(floors_m, ceilings_m, strict=True))


# --- The staging area ---


def _furniture(plan: HallPlan, rng: Rng) -> Iterator[SitePiece]:
    """What stands in the staging area: loads, empty pallets, machines, people, cabinets and a desk."""
    for number in range(int(rng.integers(3, 8))):
        turn_deg = float(rng.choice([0.0, 90.0]) + np.clip(rng.normal(0, 4), -8, 8))
        load = pallet.load(rng, float(rng.uniform(0.8, 1.7)))
        yield _staged(f"waiting_{number}", load, plan, rng, from_wall_m=1.2, turn_deg=turn_deg)

    empty_pallets = _empty_pallets(rng)
    turn_deg = float(rng.choice([0.0, 90.0]))
    yield _staged("empty_pallets", empty_pallets, plan, rng, from_wall_m=1.2, turn_deg=turn_deg)

    has_forklift = rng.random() < 0.75
    if has_forklift:
        forklift = warehouse_equipment.forklift(rng)
        turn_deg = float(rng.uniform(0, 360))
        yield _staged("forklift", forklift, plan, rng, from_wall_m=2.0, turn_deg=turn_deg)
    truck = warehouse_equipment.pallet_truck(rng)
    turn_deg = float(rng.uniform(0, 360))
    yield _staged("pallet_truck", truck, plan, rng, from_wall_m=1.4, turn_deg=turn_deg)

    for number in range(int(rng.integers(0, 3))):
        person = outdoors.person(rng, float(rng.uniform(1.6, 1.85)))
        turn_deg = float(rng.uniform(0, 360))
        yield _staged(f"person_{number}", person, plan, rng, from_wall_m=1.2, turn_deg=turn_deg)
    yield from _at_walls(plan, rng)


def _staged(
    name: str,
    parts: list[Part],
    plan: HallPlan,
    rng: Rng,
    *,
    from_wall_m: float,
    turn_deg: float,
) -> SitePiece:
    """A piece somewhere in the staging area."""
    half_x_m, half_y_m = plan.half_m
    x_m = float(rng.uniform(plan.docks_x_m + 1.9, half_x_m - STAGING_X_M - 0.3))
    reach_m = half_y_m - from_wall_m
    y_m = float(rng.uniform(-reach_m, reach_m))
    return _piece(name, parts, at(x_m, y_m, yaw=turn_deg))


def _piece(name: str, parts: list[Part], T_hall_piece: Array) -> SitePiece:
    return SitePiece(name, tuple(part.moved(T_hall_piece) for part in parts), GOODS_SPACING_M)


def _empty_pallets(rng: Rng) -> list[Part]:
    """A stack of pallets, each turned a little."""
    pallet_height_m = pallet.PALLET_M[2]
    parts = []
    for level in range(int(rng.integers(4, 10))):
        yaw_deg = float(np.clip(rng.normal(0, 1.5), -3, 3))
        T_stack_pallet = at(0, 0, level * pallet_height_m, yaw=yaw_deg)
        parts += [part.moved(T_stack_pallet) for part in pallet.pallet()]
    return parts


def _at_walls(plan: HallPlan, rng: Rng) -> Iterator[SitePiece]:
    """Cabinets at one wall beside the docks, and a desk at the opposite one."""
    half_x_m, half_y_m = plan.half_m
    side = 1 if rng.random() < 0.5 else -1
    facing_deg = -90.0 * side  # away from the wall of the cabinets
    for number in range(int(rng.integers(1, 5))):
        x_m = half_x_m - 0.7 - 1.0 * number
        height_m = float(rng.choice([1.2, 1.9]))
        cabinet = furniture.cabinet(rng, height_m=height_m, colour=one_of(rng, *CABINET_COLOURS))
        yield _piece(f"cabinet_{number}", cabinet, at(x_m, side * (half_y_m - 0.32), yaw=facing_deg))
    desk = furniture.desk(rng)
    yield _piece("desk", desk, at(half_x_m - 1.4, -side * (half_y_m - 0.5), yaw=-facing_deg))


def _without_overlaps(candidates: list[SitePiece], plan: HallPlan) -> list[SitePiece]:
    """The pieces that overlap no earlier one, stay inside of the walls, and leave the ends of the aisles free."""
    selected: list[SitePiece] = []
    occupied: list[Footprint] = []
    for piece in candidates:
        ground = footprint(piece)
        is_inside = bool((np.abs(ground.corners_m) < plan.half_m).all())
        is_in_row = piece.name.startswith("load_")
        leaves_aisles_free = is_in_row or bool(ground.corners_m[:, 0].min() > plan.docks_x_m + CROSS_M)
        if not is_inside or not leaves_aisles_free:
            continue
        if all(ground.overlap_depth_m(other, CLOSE_M) == 0 for other in occupied):
            selected.append(piece)
            occupied.append(ground)
    return selected
