"""Warehouses by seed: racks with goods in rows, or goods in blocks on the floor, aisles, docks, in any daylight."""

from collections.abc import Iterator
from dataclasses import dataclass

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

PANORAMAS = ("suburb", "city", "country")
STEELS = (
    ("#24427a", "#d8641e"),
    ("#2f5d46", "#d8a614"),
    ("#5d6468", "#c9652a"),
    ("#8d1f1c", "#d9dad7"),
    ("#24427a", "#d8a614"),
)
BODY_RADIUS_M = 0.5
CROSS_M = 1.35  # of floor before the ends of the rows, on which nothing stands
WALL_GAP_M = 0.2  # between a rack and a wall
BACK_GAP_M = 0.15  # between two racks back to back
SHELL_SPACING_M = 0.2  # between samples of the light
RACK_SPACING_M = 0.3
GOODS_SPACING_M = 0.2
LUX = 260.0  # on the floor by the lamps, about
CLOSE_M = 0.01  # that footprints may share
STAGING_X_M = 1.4  # of the staging area, kept free at the docks


@dataclass(frozen=True, slots=True)
class HallPlan:
    """The plan of a hall: its size, the rows of racks or blocks by their y, and where these end and the docks begin.

    gap_bay: the bay that is left out of all rows for a cross aisle, or -1.
    """

    size_m: tuple[float, float, float]
    rack: Rack
    rows_y_m: tuple[float, ...]
    aisles_y_m: tuple[float, ...]
    rows_x_m: float  # the middle of the rows
    gap_bay: int
    blocks: tuple[int, ...]  # rows whose goods stand in blocks on the floor

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
        x0 = self.rows_x_m - self.rack.length_m / 2
        x1 = self.docks_x_m
        half_m = self.rack.depth_m / 2 + 0.06
        return np.array([[x0, y_m - half_m], [x1, y_m - half_m], [x1, y_m + half_m], [x0, y_m + half_m]])


def hall_plan(rng: Rng) -> HallPlan:
    """The plan of a warehouse."""
    upright, beam = STEELS[int(rng.integers(len(STEELS)))]
    level_count = int(rng.integers(2, 4))
    step_m = float(rng.uniform(1.35, 1.8))
    rack = Rack(
        bays=int(rng.integers(4, 8)),
        bay_m=float(rng.choice([2.7, 2.7, 1.85])),
        depth_m=1.1,
        levels_m=tuple((1.5 + step_m * np.arange(level_count)).round(2).tolist()),
        upright=coated(upright, roughness=0.4),
        beam=coated(beam, roughness=0.4),
    )
    aisle_m = float(rng.uniform(2.5, 3.6))
    aisles = int(rng.integers(2, 5))
    has_wall_rows = bool(rng.random() < 0.7)
    rows_y = []
    aisles_y = []
    y = WALL_GAP_M
    if has_wall_rows:
        rows_y.append(y + rack.depth_m / 2)
        y += rack.depth_m
    for number in range(aisles):
        aisles_y.append(y + aisle_m / 2)
        y += aisle_m
        is_last = number == aisles - 1
        if not is_last:
            rows_y += [y + rack.depth_m / 2, y + 1.5 * rack.depth_m + BACK_GAP_M]
            y += 2 * rack.depth_m + BACK_GAP_M
    if has_wall_rows:
        rows_y.append(y + rack.depth_m / 2)
        y += rack.depth_m
    width_m = y + WALL_GAP_M
    head_m = float(rng.uniform(1.8, 3.2))  # free floor at the west end
    staging_m = float(rng.uniform(6.0, 9.0))
    length_m = head_m + rack.length_m + staging_m
    height_m = rack.levels_m[-1] + 1.3 + float(rng.uniform(1.0, 2.2))
    blocks = tuple(row for row in range(len(rows_y)) if rng.random() < 0.2)
    return HallPlan(
        size_m=(length_m, width_m, height_m),
        rack=rack,
        rows_y_m=tuple(row - width_m / 2 for row in rows_y),
        aisles_y_m=tuple(aisle - width_m / 2 for aisle in aisles_y),
        rows_x_m=-length_m / 2 + head_m + rack.length_m / 2,
        gap_bay=int(rng.integers(1, rack.bays - 1)) if rack.bays > 5 and rng.random() < 0.5 else -1,
        blocks=blocks,
    )


def generated_warehouse(seed: int, lighting: str) -> Site:
    """The warehouse of a seed under a lighting, one of `daylight.LIGHTINGS`. Its lamps are always on."""
    # Each choice has a random generator of its own, so that a change of one leaves the others as they are.
    plan = hall_plan(np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    windows = _windows(rng, plan)
    trays, lamps = _lamps(rng, plan)
    structures = [*_shell(rng, plan, windows), *_steelwork(rng, plan, trays), _markings(rng, plan)]
    structures += list(_racks(plan))
    loads = list(_loads(plan, seed))
    pieces = _without_overlaps([*loads, *_furniture(plan, np.random.default_rng([seed, 2]))], plan)
    outside = level_daylight(
        np.random.default_rng([seed, 3]),
        np.random.default_rng([seed, 4]),
        lighting,
        kinds=PANORAMAS,
        distance_m=(40.0, 70.0),
    )
    x, y = plan.half_m
    floor = Area(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), 0.0)
    ends = [plan.rows_x_m - plan.rack.length_m / 2 - 0.2, plan.docks_x_m + CROSS_M / 2]
    stations = [[end, aisle] for aisle in plan.aisles_y_m for end in ends]
    return Site(
        structures=tuple(structures),
        pieces=tuple(pieces),
        lights=(*lamps, *outside.lights),
        ground=LevelAreas((floor,)),
        roads=(floor,),
        stations_m=np.array(stations),
        body_radius_m=BODY_RADIUS_M,
        blocked=tuple(corners for row in range(len(plan.rows_y_m)) for corners in _standing_rows(plan, row)),
    )


def _standing_rows(plan: HallPlan, row: int) -> Iterator[Array]:
    """The footprints of the racks of a row, before and after the cross aisle."""
    corners = plan.row_corners_m(plan.rows_y_m[row])
    if row in plan.blocks:
        return
    if plan.gap_bay < 0:
        yield corners
        return
    middle_m = plan.rows_x_m + plan.rack.bay_x_m(plan.gap_bay)
    half_m = plan.rack.pitch_m / 2
    before = corners.copy()
    before[[1, 2], 0] = middle_m - half_m + 0.06
    after = corners.copy()
    after[[0, 3], 0] = middle_m + half_m - 0.06
    yield before
    yield after


# --- The building ---


def _windows(rng: Rng, plan: HallPlan) -> list[Opening]:
    """Bands of windows below the roof, on two sides or on one, or none there and one in the west."""
    x, y = plan.half_m
    high_m = plan.size_m[2] - 0.75
    choices: tuple[tuple[Wall, ...], ...] = (("north", "south"), ("north",), ("south",))
    sides = choices[int(rng.choice(3, p=[0.6, 0.25, 0.15]))]
    width_m = float(rng.uniform(2.0, 3.6))
    count = max(2, int(2 * x / (width_m + 2.6)))
    middles = (np.arange(count) + 0.5) * 2 * x / count - x
    found = [Opening(side, (float(along), high_m), (width_m, 0.9)) for side in sides for along in middles.tolist()]
    if rng.random() < 0.4:
        found.append(Opening("west", (0.0, high_m - 0.3), (min(4.0, y), 1.2)))
    return found


def _shell(rng: Rng, plan: HallPlan, windows: list[Opening]) -> Iterator[Structure]:
    """Floor, walls, ceiling and windows."""
    seed = int(rng.integers(4))
    albedo = float(rng.uniform(0.26, 0.42))
    slab = Procedural("plaster", albedo, 0.4, tile_m=6.0, resolution_px=1024, seed=8 + seed)
    roughness = float(rng.choice([0.2, 0.3, 0.5]))
    tint = one_of(rng, "#fafcff", "#fff8ee", "#e6efe9", "#f0f0f4")
    floor = coated(tint, slab, roughness)
    kind = one_of(rng, "plaster", "plaster", "panel", "brick")
    if kind == "plaster":
        wall = matt(one_of(rng, "#cfd4d2", "#d9d4c8", "#c2ccd0", "#dfe0da"), picture.ground("plaster", 2, 1024, 2.4))
    elif kind == "panel":
        panels = picture.masonry("tile", 0, 512, 3.0, rows=1, columns=3, bond=0.0)
        wall = coated(one_of(rng, "#d6d9da", "#b9c2c6", "#cfcac0"), panels, 0.4)
    else:
        wall = matt(one_of(rng, "#ffffff", "#e6d6b4", "#d8c0a8"), picture.masonry("brick", 0))
    ends = matt(one_of(rng, "#ffffff", "#c9b8a8"), picture.masonry("brick", 1)) if rng.random() < 0.3 else wall
    ceiling = matt(one_of(rng, "#b8bdbf", "#d0d2d0", "#9aa0a4"), picture.ground("plaster", 1, 512, 2.0))
    walls: dict[Wall, Material] = {**dict.fromkeys(OUTWARD, wall), "west": ends}
    for name, parts in shell(plan.size_m, windows, floor=floor, ceiling=ceiling, walls=walls):
        yield Structure(name, tuple(parts), SHELL_SPACING_M)


def _steelwork(rng: Rng, plan: HallPlan, trays: list[Part]) -> Iterator[Structure]:
    """Columns at the walls, beams and purlins below the roof, and the trays of lamps."""
    x, y = plan.half_m
    high_m = plan.size_m[2]
    paint = coated(one_of(rng, "#6d7579", "#8d9092", "#4f6472", "#b7bcc0"), roughness=0.4)
    corner = np.array([[1, -1], [1, -0.85], [0.07, -0.85], [0.07, 0.85], [1, 0.85], [1, 1]])
    profile = np.concatenate([corner, -corner])
    beam = as_arrays(extrusion(profile * [0.1, 0.19], 2 * y))
    count = max(3, round(2 * x / 6.0) + 1)
    purlin = block_arrays((2 * x, 0.08, 0.16), bevel_m=0)
    beams_x = np.linspace(-x + 0.15, x - 0.15, count).tolist()
    purlins_y = np.arange(-y + 1.0, y - 0.5, 2.0).tolist()
    steel = [beam.moved(at(along, y, high_m - 0.2, roll=90)) for along in beams_x]
    steel += [purlin.moved(at(0, across, high_m - 0.08)) for across in purlins_y]
    yield Structure("steelwork", (Part(joined_arrays(steel), paint), *trays), RACK_SPACING_M)
    pipe = fitting.pipe(rng, length_m=2 * x - 1, radius_m=0.05, colour="#a5251d")
    T = at(0, y, high_m - 1.6, yaw=-90)
    yield Structure("sprinkler", tuple(part.moved(T) for part in pipe), RACK_SPACING_M)
    docks = int(rng.integers(1, 3))
    for number in range(docks):
        across = (number - (docks - 1) / 2) * 5.2 + float(rng.uniform(-0.3, 0.3))
        if abs(across) + 2.6 < y:
            door = warehouse_equipment.roller_door(rng, int(rng.integers(1, 20)))
            parts = tuple(part.moved(at(x, across, 0, yaw=180)) for part in door)
            yield Structure(f"dock_{number}", parts, RACK_SPACING_M)


def _lamps(rng: Rng, plan: HallPlan) -> tuple[list[Part], list[Light]]:
    """Bands of light above the aisles: their trays and rods, and a light for each band."""
    x, y = plan.half_m
    high_m = plan.size_m[2]
    z_m = high_m - float(rng.uniform(0.5, 0.9))
    count = max(1, round(2 * x / float(rng.uniform(7.0, 13.0))))
    pitch_m = 2 * x / count
    length_m = float(rng.uniform(0.45, 0.85)) * pitch_m
    width_m = float(rng.uniform(0.12, 0.4))
    colour = lamp_colour(float(rng.uniform(3600, 5500)))
    # About half of the light reaches the floor between the racks.
    power_lm = LUX * 4 * x * y / 0.5 / (count * len(plan.aisles_y_m))
    trays = []
    lights: list[Light] = []
    rod = block_arrays((0.012, 0.012, high_m - z_m - 0.06), bevel_m=0)
    for number in range(count):
        lamp_x = (number + 0.5) * pitch_m - x
        for lamp_y in plan.aisles_y_m:
            trays.append(stood((length_m + 0.1, width_m + 0.08, 0.06), WHITE, lamp_x, lamp_y, z_m + 0.004, bevel=0.01))
            for end in (-1, 1):
                place = at(lamp_x + end * 0.4 * length_m, lamp_y, (high_m + z_m + 0.06) / 2)
                trays.append(Part(rod.moved(place), STEEL))
            corner = (lamp_x - length_m / 2, lamp_y - width_m / 2, z_m)
            panel = quad(corner, (0, width_m, 0), (length_m, 0, 0))
            lights.append(AreaLight(f"lamp_{len(lights)}", panel, power_lm, colour=colour))
    return trays, lights


def _markings(rng: Rng, plan: HallPlan) -> Structure:
    """Lines along the aisles, a zebra and tyre marks on the floor."""
    x, y = plan.half_m
    x0 = plan.rows_x_m - plan.rack.length_m / 2
    paint = coated(one_of(rng, "#d8a614", "#d9dad7", "#c9652a", "#3f6c87"), roughness=0.4)
    lines = []
    for row in plan.rows_y_m:
        for side in (-1, 1):
            edge = row + side * (plan.rack.depth_m / 2 + 0.16)
            if abs(edge) < y - 0.1:
                lines.append(_strip(x0, plan.docks_x_m, edge, 0.08))
    lines.append(_strip_across(plan.docks_x_m + 0.35, -y + 0.4, y - 0.4, 0.1))
    lines.append(_strip_across(x - STAGING_X_M, -y + 0.4, y - 0.4, 0.1))
    marks = []
    rubber = matt("#7d7c77")
    for aisle in plan.aisles_y_m:
        for _ in range(int(rng.integers(1, 4))):
            start = float(rng.uniform(x0, plan.docks_x_m - 2))
            offset = aisle + float(rng.uniform(-0.5, 0.5))
            end = min(start + float(rng.uniform(1.5, 6)), plan.docks_x_m)
            marks += [
                _strip(start, end, offset + side * 0.42, float(rng.uniform(0.02, 0.07)), 0.0015) for side in (-1, 1)
            ]
    return Structure(
        "markings", (Part(joined_arrays(lines), paint), Part(joined_arrays(marks), rubber)), SHELL_SPACING_M
    )


def _strip(x0: float, x1: float, y: float, width_m: float, z_m: float = 0.003) -> MeshArrays:
    return quad_arrays((x0, y - width_m / 2, z_m), (x1 - x0, 0, 0), (0, width_m, 0))


def _strip_across(x: float, y0: float, y1: float, width_m: float) -> MeshArrays:
    return quad_arrays((x - width_m / 2, y0, 0.003), (width_m, 0, 0), (0, y1 - y0, 0))


# --- Racks and goods ---


def _racks(plan: HallPlan) -> Iterator[Structure]:
    """The steel of all rows that have racks, and the labels of the bays."""
    rack = plan.rack
    for row, y in enumerate(plan.rows_y_m):
        if row in plan.blocks:
            continue
        parts: list[Part] = []
        for first, last in _runs(plan):
            run = Rack(last - first, rack.bay_m, rack.depth_m, rack.levels_m, rack.upright, rack.beam)
            middle_m = plan.rows_x_m + (rack.bay_x_m(first) + rack.bay_x_m(last - 1)) / 2
            parts += [part.moved(at(middle_m, y)) for part in run.parts()]
        yield Structure(f"rack_{row}", tuple(parts), RACK_SPACING_M)
        labels = []
        for bay in range(0, rack.bays, 2):
            if bay != plan.gap_bay:
                plate = matt(texture=picture.sign(f"{'ABCDEFGHIJ'[row]}{bay + 1:02d}", "#d39a3c"))
                x = plan.rows_x_m + rack.bay_x_m(bay)
                z = rack.levels_m[0] - 0.06
                reach_m = rack.depth_m / 2 + 0.028
                labels += [put(card_arrays((0.2, 0.1)), plate, x, y + s * reach_m, z, yaw=s * 90.0) for s in (-1, 1)]
        yield Structure(f"label_{row}", tuple(labels), RACK_SPACING_M)


def _runs(plan: HallPlan) -> Iterator[tuple[int, int]]:
    """The first bay and the one after the last of each run of racks."""
    if plan.gap_bay < 0:
        yield 0, plan.rack.bays
        return
    yield 0, plan.gap_bay
    yield plan.gap_bay + 1, plan.rack.bays


def _loads(plan: HallPlan, seed: int) -> Iterator[SitePiece]:
    """Pallets with loads: in racks, two or three to a level of a bay, and stacked on the floor where there are none."""
    rack = plan.rack
    per_bay = 3 if rack.bay_m > 2.5 else 2
    fill = float(np.random.default_rng([seed, 20]).uniform(0.55, 0.92))
    for row, y in enumerate(plan.rows_y_m):
        for bay in range(rack.bays):
            if bay == plan.gap_bay:
                continue
            rng = np.random.default_rng([seed, 21, row, bay])
            middle_m = plan.rows_x_m + rack.bay_x_m(bay)
            levels_m = (0.0,) if row in plan.blocks else (0.0, *rack.levels_m)
            for level, z in enumerate(levels_m):
                ceiling_m = [*levels_m[1:], z + 1.35][level] - 0.16
                if row in plan.blocks:
                    ceiling_m = 1.9
                for place in range(per_bay):
                    x = middle_m + (place - (per_bay - 1) / 2) * rack.bay_m / per_bay
                    high_m = min(ceiling_m - z, 1.7) * float(rng.uniform(0.6, 1.0))
                    parts = pallet.load(rng, high_m)
                    # Pallets stand crosswise: their longer side reaches into the rack.
                    T = at(
                        x + float(np.clip(rng.normal(0, 0.012), -0.02, 0.02)),
                        y + float(np.clip(rng.normal(0, 0.015), -0.03, 0.03)),
                        z,
                        yaw=90.0 + float(np.clip(rng.normal(0, 0.3), -0.6, 0.6)),
                    )
                    if rng.random() < fill:
                        name = f"load_{row}_{bay}_{level}_{place}"
                        yield SitePiece(name, tuple(part.moved(T) for part in parts), GOODS_SPACING_M, base_m=z)


def _furniture(plan: HallPlan, rng: Rng) -> Iterator[SitePiece]:
    """What stands in the staging area: loads, empty pallets, machines, a desk, cabinets and people."""
    x, y = plan.half_m
    free_x = (plan.docks_x_m + 1.9, x - STAGING_X_M - 0.3)
    for number in range(int(rng.integers(3, 8))):
        turn_deg = float(rng.choice([0.0, 90.0]) + np.clip(rng.normal(0, 4), -8, 8))
        parts = pallet.load(rng, float(rng.uniform(0.8, 1.7)))
        yield _placed(f"waiting_{number}", parts, rng, free_x=free_x, reach_y=y - 1.2, turn_deg=turn_deg)
    stack = int(rng.integers(4, 10))
    pallets = []
    for level in range(stack):
        T = at(0, 0, level * pallet.PALLET_M[2], yaw=float(np.clip(rng.normal(0, 1.5), -3, 3)))
        pallets += [part.moved(T) for part in pallet.pallet()]
    yield _placed(
        "empty_pallets", pallets, rng, free_x=free_x, reach_y=y - 1.2, turn_deg=float(rng.choice([0.0, 90.0]))
    )
    if rng.random() < 0.75:
        yield _placed(
            "forklift",
            warehouse_equipment.forklift(rng),
            rng,
            free_x=free_x,
            reach_y=y - 2.0,
            turn_deg=float(rng.uniform(0, 360)),
        )
    yield _placed(
        "pallet_truck",
        warehouse_equipment.pallet_truck(rng),
        rng,
        free_x=free_x,
        reach_y=y - 1.4,
        turn_deg=float(rng.uniform(0, 360)),
    )
    for number in range(int(rng.integers(0, 3))):
        person = outdoors.person(rng, float(rng.uniform(1.6, 1.85)))
        yield _placed(
            f"person_{number}", person, rng, free_x=free_x, reach_y=y - 1.2, turn_deg=float(rng.uniform(0, 360))
        )
    side = 1 if rng.random() < 0.5 else -1
    wall_y = side * (y - 0.32)
    facing_deg = -90.0 * side
    spots = [x - 0.7 - 1.0 * k for k in range(4)]
    for number, place_x in enumerate(spots[: int(rng.integers(1, 5))]):
        cabinet = furniture.cabinet(
            rng, height_m=float(rng.choice([1.2, 1.9])), colour=one_of(rng, "#8b9493", "#4f6472", "#7d3a30")
        )
        T = at(place_x, wall_y, 0, yaw=facing_deg)
        yield SitePiece(f"cabinet_{number}", tuple(part.moved(T) for part in cabinet), GOODS_SPACING_M)
    desk = furniture.desk(rng)
    T = at(x - 1.4, -side * (y - 0.5), 0, yaw=-facing_deg)
    yield SitePiece("desk", tuple(part.moved(T) for part in desk), GOODS_SPACING_M)


def _placed(
    name: str, parts: list[Part], rng: Rng, *, free_x: tuple[float, float], reach_y: float, turn_deg: float
) -> SitePiece:
    """A piece somewhere in the staging area."""
    T = at(float(rng.uniform(*free_x)), float(rng.uniform(-reach_y, reach_y)), yaw=turn_deg)
    return SitePiece(name, tuple(part.moved(T) for part in parts), GOODS_SPACING_M)


def _without_overlaps(pieces: list[SitePiece], plan: HallPlan) -> list[SitePiece]:
    """The pieces that meet no earlier one and stay inside of the walls."""
    x, y = plan.half_m
    kept: list[SitePiece] = []
    taken: list[Footprint] = []
    for piece in pieces:
        place = footprint(piece)
        is_inside = bool((np.abs(place.corners_m) < [x, y]).all())
        is_load = piece.name.startswith("load_")
        leaves_way = is_load or bool(place.corners_m[:, 0].min() > plan.docks_x_m + CROSS_M)
        if is_inside and leaves_way and all(place.overlap_depth_m(other, CLOSE_M) == 0 for other in taken):
            kept.append(piece)
            taken.append(place)
    return kept
