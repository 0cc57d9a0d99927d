"""Variants of the paper's room by seed: a hall with a store of furniture, of any size, surfaces and lamps.

Some have an alcove behind a wide opening, some have pillars, some have windows; the floor is dull or a mirror.
"""

import numpy as np

from vobench.asset import fitting, furniture, picture
from vobench.asset.daylight import lamp_colour
from vobench.asset.floor_plan import (
    DOOR_HIGH_M,
    SIDES,
    WALL_M,
    FloorPlan,
    Passage,
    Rect,
    Room,
    Side,
    Window,
    hole_outwards,
    opening_between,
    outer_sides,
)
from vobench.asset.furnishing import (
    add_armchair,
    add_cartons,
    add_desk,
    add_dining_table,
    add_floor_plant,
    add_shelf,
    add_sideboard,
)
from vobench.asset.furniture import Part, coated, matt, put, stood, wood
from vobench.asset.interior import Interior, furnished_interior
from vobench.asset.interior_shell import RoomFinish, shell
from vobench.asset.palette import DEEP_PAINTS, PAINTS, WHITES, Style, office_style, plank_floor, plaster, tile_floor
from vobench.asset.picture import Rng, one_of
from vobench.asset.placed_piece import CEILING, WALL
from vobench.asset.room_fitting import door_fittings, skirtings
from vobench.asset.room_layout import GAP_M, RoomLayout, room_layouts
from vobench.asset.shape import card
from vobench.asset.small_lamp import add_floor_lamp
from vobench.asset.tabletop import add_tabletop_items
from vobench.asset.wall_decoration import add_sockets, framed_print
from vobench.asset.window_dressing import dress_windows
from vobench.asset.window_view import view_outside
from vobench.scene.material import Material
from vobench.scene.mesh import quad

PANORAMAS = ("city", "suburb", "country")
FLOOR_HEIGHTS_M = (1.2, 4.0, 8.0)  # of the room above the ground
OPTIONAL = ("socket", "mug", "plant", "picture", "carton", "noticeboard")
LUX = 230.0  # of the lamps together, on the floor, about
LEAST_FREE_SHARE = 0.42  # of the floor, which stays free of furniture
ENTRANCE_M = 0.95
OUTER_WALL_M = 0.3
ALCOVE_SHARE = 0.45  # of the rooms
WINDOW_SHARE = 0.6


def paper_room_plan(rng: Rng) -> FloorPlan:
    """A hall, sometimes with an alcove behind a wide opening, and sometimes with windows."""
    length_m = float(rng.uniform(6.5, 12.5))
    width_m = float(np.clip(length_m * rng.uniform(0.62, 1.0), 5.5, 11.0))
    height_m = float(rng.choice([2.7, 3.0, 3.3, 3.8]))
    hall = Room("hall", "store", Rect(-length_m / 2, -width_m / 2, length_m / 2, width_m / 2))
    rooms = [hall]
    passages: list[Passage] = []
    if rng.random() < ALCOVE_SHARE:
        alcove = _alcove(rng, hall)
        opening = opening_between(rng, hall, alcove, head_m=height_m - 0.35, most_m=4.0)
        if opening is not None:
            rooms.append(alcove)
            passages.append(opening)
    outer = FloorPlan(tuple(rooms), (), (), _entrance(rng, hall, ["west"]), height_m).outer
    free_sides = [side for side in outer_sides(hall, outer) if side in SIDES]
    entrance = _entrance(rng, hall, free_sides)
    windows: list[Window] = []
    if rng.random() < WINDOW_SHARE:
        windows = _windows(rng, hall, [side for side in free_sides if side != hall.side_at(entrance.rect)], height_m)
    return FloorPlan(tuple(rooms), tuple(passages), tuple(windows), entrance, height_m)


def _alcove(rng: Rng, hall: Room) -> Room:
    """A room along a part of the north wall of a hall."""
    width_m = float(rng.uniform(0.4, 0.75)) * hall.rect.width_m
    depth_m = float(rng.uniform(2.4, 3.8))
    x0 = hall.rect.x0 + float(rng.uniform(0, 1)) * (hall.rect.width_m - width_m)
    y0 = hall.rect.y1 + WALL_M
    return Room("alcove", "store", Rect(x0, y0, x0 + width_m, y0 + depth_m))


def _entrance(rng: Rng, hall: Room, sides: list[Side]) -> Window:
    """The closed door of the hall."""
    side = sides[int(rng.integers(len(sides)))]
    first_m, last_m = hall.span_m(side)
    start_m = float(rng.uniform(first_m + 0.5, last_m - 0.5 - ENTRANCE_M))
    rect = hole_outwards(hall, side, start_m, start_m + ENTRANCE_M, WALL_M)
    return Window(hall.name, rect, 0.0, DOOR_HIGH_M)


def _windows(rng: Rng, hall: Room, sides: list[Side], height_m: float) -> list[Window]:
    """One to three windows in one wall of the hall; none if no wall is left."""
    if not sides:
        return []
    side = sides[int(rng.integers(len(sides)))]
    first_m, last_m = hall.span_m(side)
    width_m = float(rng.uniform(1.1, 2.2))
    count = min(int(rng.integers(1, 4)), int((last_m - first_m) / (width_m + 0.9)))
    sill_m = float(rng.choice([0.85, 1.0, 1.4]))
    head_m = min(sill_m + float(rng.uniform(0.9, 1.5)), height_m - 0.3)
    pitch_m = (last_m - first_m) / max(count, 1)
    found = []
    for number in range(count):
        middle_m = first_m + (number + 0.5) * pitch_m
        rect = hole_outwards(hall, side, middle_m - width_m / 2, middle_m + width_m / 2, OUTER_WALL_M)
        found.append(Window(hall.name, rect, sill_m, head_m))
    return found


def generated_paper_room(seed: int, lighting: str) -> Interior:
    """The room of a seed under a lighting, one of `daylight.LIGHTINGS`. Its lamps are always on."""
    # Each choice has a random generator of its own, so that a change of one leaves the others as they are.
    plan = paper_room_plan(np.random.default_rng([seed, 30]))
    rng = np.random.default_rng([seed, 31])
    style = office_style(rng)
    finish = _finish(rng)
    layouts = room_layouts(plan, seed, 32)
    door_fittings(plan, layouts, wood(one_of(rng, "walnut", "oak", "beech")), panels=bool(rng.random() < 0.4))
    lamp_rng = np.random.default_rng([seed, 33])
    outside_rng = np.random.default_rng([seed, 34])
    outside = view_outside(plan, outside_rng, lighting, floor_heights_m=FLOOR_HEIGHTS_M, kinds=PANORAMAS)
    for layout in layouts.values():
        dress_windows(layout, style)
        _pillars(layout)
        _furnish(layout, style)
        _lamps(layout, lamp_rng)
        skirtings(layout)

    surfaces = shell(plan, {room.name: finish for room in plan.rooms}, thresholds=wood(style.tones))
    return furnished_interior(plan, surfaces, layouts.values(), outside.lights, OPTIONAL)


# --- Surfaces ---


def _finish(rng: Rng) -> RoomFinish:
    """A floor, a ceiling and walls; one or two walls are of brick, boards or another paint."""
    plaster_seed = int(rng.integers(3))
    plain = plaster(one_of(rng, *WHITES, *PAINTS), plaster_seed)
    walls = dict.fromkeys(SIDES, plain)
    for side in rng.permutation(list(SIDES)).tolist()[: int(rng.integers(1, 3))]:
        walls[side] = _feature_wall(rng, plaster_seed)
    ceiling = plaster(one_of(rng, "#f4f1ea", "#e6e2d6", "#d9dcd8"), plaster_seed)
    if rng.random() < 0.25:
        ceiling = matt(texture=picture.masonry("tile", tile_m=1.2, rows=2, columns=2, bond=0.0))
    return RoomFinish(_floor(rng), ceiling, walls)


def _feature_wall(rng: Rng, plaster_seed: int) -> Material:
    """A wall that is unlike the others."""
    kind = one_of(rng, "brick", "brick", "boards", "paint", "concrete", "tiles")
    if kind == "brick":
        return matt(one_of(rng, "#ffffff", "#e6d6c4", "#d8b8a4"), picture.masonry("brick", int(rng.integers(2))))
    if kind == "boards":
        return matt(one_of(rng, "#ffffff", "#d6cdc4"), picture.boards("beech", 5, rows=6))
    if kind == "concrete":
        return matt(one_of(rng, "#ffffff", "#d9d4cc"), picture.ground("concrete", int(rng.integers(3))))
    if kind == "tiles":
        tiles = picture.masonry("tile", int(rng.integers(3)), 1024, 1.2, rows=8, columns=8, bond=0.0)
        return coated(one_of(rng, "#eef0ec", "#9fb3b5", "#d9c9b8"), tiles, roughness=0.15)
    return plaster(one_of(rng, *PAINTS, *DEEP_PAINTS), plaster_seed)


def _floor(rng: Rng) -> Material:
    """Planks, carpet, concrete or tiles, or polished stone that mirrors the room."""
    kind = one_of(rng, "planks", "planks", "carpet", "concrete", "tiles", "mirror")
    if kind == "planks":
        return plank_floor(rng)
    if kind == "carpet":
        return matt(one_of(rng, "#ffffff", "#f0d8c4", "#d8e8d8"), picture.ground("carpet", int(rng.integers(2))))
    if kind == "concrete":
        return coated(one_of(rng, "#e6e4e0", "#cfc9c0"), picture.ground("concrete", int(rng.integers(3))), 0.3)
    if kind == "tiles":
        return tile_floor(rng)
    # Eta is that of the scenario mirror_floor: from a wax to the best mirror that a floor can be.
    return Material(texture=picture.terrazzo(int(rng.integers(2))), eta=float(rng.choice([1.5, 2.0, 3.0])))


# --- What stands in the room ---


def _pillars(layout: RoomLayout) -> None:
    """Pillars from floor to ceiling in some large rooms."""
    rng = layout.rng
    if layout.room.rect.area_m2 < 55 or rng.random() < 0.6:
        return
    width_m = float(rng.uniform(0.3, 0.5))
    height_m = layout.plan.height_m
    look = one_of(rng, "raw", "paint")
    paint = plaster(one_of(rng, *WHITES))
    for _ in range(int(rng.integers(1, 3))):
        spot = layout.free_spot_on_floor(width_m + 1.6, width_m + 1.6)
        if spot is None:
            return
        x_m, y_m = spot.point(0)
        body = spot.rectangle(-width_m / 2, width_m / 2, -width_m / 2, width_m / 2)
        if look == "raw":
            layout.add("pillar", furniture.pillar, (x_m, y_m), width_m=width_m, height_m=height_m)
        else:
            layout.add("pillar", _painted_pillar, (x_m, y_m), width_m=width_m, height_m=height_m, paint=paint)
        layout.floor.occupy(body, height_m)


def _painted_pillar(_: Rng, width_m: float, height_m: float, paint: Material) -> list[Part]:
    """A plain column of plaster."""
    return [stood((width_m, width_m, height_m), paint, bevel=0.01)]


def _furnish(layout: RoomLayout, style: Style) -> None:
    """A workplace, shelves, benches, crates and cartons, in a random order, as long as enough of the floor is free."""
    rng = layout.rng
    area_m2 = layout.room.rect.area_m2
    makers = [
        lambda: add_desk(layout, style),
        lambda: add_shelf(layout, style, (1.0, 1.6, 2.2)),
        lambda: add_shelf(layout, style, (1.0, 1.8, 2.4)),
        lambda: _workbench(layout),
        lambda: _crate(layout),
        lambda: _crate(layout),
        lambda: add_cartons(layout),
        lambda: add_cartons(layout),
        lambda: add_cartons(layout),
        lambda: _screen(layout),
        lambda: _cabinet(layout),
        lambda: add_armchair(layout, style),
        lambda: add_dining_table(layout, style, 4),
        lambda: add_sideboard(layout, style),
        lambda: add_floor_plant(layout),
        lambda: add_floor_plant(layout),
        lambda: add_floor_lamp(layout),
    ]
    count = int(np.clip(area_m2 / 6.5, 3, 14))
    for index in rng.permutation(len(makers)).tolist()[:count]:
        if layout.floor.free_share() > LEAST_FREE_SHARE:
            makers[index]()
    for _ in range(int(rng.integers(1, 4))):
        _hang_poster(layout, style)
    if rng.random() < 0.6:
        layout.add_on_wall("noticeboard", fitting.noticeboard, (1.3, 1.0), middle_m=1.55, width_m=1.2, height_m=0.9)
    if rng.random() < 0.5:
        _hang(layout, "whiteboard", "whiteboard", (1.8, 1.0), "#a4a7a6")
    if rng.random() < 0.25:
        _hang(layout, "mirror", "mirror", (0.8, 1.3), picture.INK)
    if rng.random() < 0.5:
        _pipe(layout)
    add_sockets(layout, 2)


def _workbench(layout: RoomLayout) -> None:
    rng = layout.rng
    width_m = float(rng.choice([1.6, 2.0]))
    bench = layout.add_at_wall(
        "bench", furniture.bench, (0.92, width_m + 0.02, 1.0), back_m=0.46, width_m=width_m, front_m=0.5
    )
    if bench is not None:
        name, spot = bench
        names = ("books", "papers", "mug", "box")
        add_tabletop_items(layout, name, spot, names, x_m=GAP_M + 0.4, width_m=width_m - 0.3, z_m=0.7)


def _crate(layout: RoomLayout) -> None:
    rng = layout.rng
    size_m = (float(rng.uniform(0.5, 0.9)), float(rng.uniform(0.5, 0.9)), float(rng.uniform(0.5, 1.2)))
    layout.add_at_wall(
        "crate",
        lambda of_crate: furniture.crate(of_crate, size_m),
        (size_m[0] + 0.04, size_m[1] + 0.04, size_m[2]),
        back_m=size_m[0] / 2 + 0.02,
        front_m=0.0,
        in_corner=bool(rng.random() < 0.5),
    )


def _cabinet(layout: RoomLayout) -> None:
    rng = layout.rng
    width_m = float(rng.choice([0.8, 1.0]))
    height_m = float(rng.choice([1.2, 1.9]))
    layout.add_at_wall(
        "cabinet",
        furniture.cabinet,
        (0.5, width_m + 0.02, height_m),
        back_m=0.225,
        width_m=width_m,
        depth_m=0.45,
        height_m=height_m,
        colour=one_of(rng, "#8b9493", "#4f6472", "#5b6b5d", "#7d3a30"),
    )


def _screen(layout: RoomLayout) -> None:
    """A screen on feet in the middle of the room, with posters on both sides."""
    rng = layout.rng
    width_m = float(rng.uniform(1.4, 2.2))
    spot = layout.free_spot_on_floor(0.5, width_m)
    if spot is None:
        return
    seed = int(rng.integers(20))
    layout.add(
        "screen",
        _standing_screen,
        spot.point(0),
        yaw_deg=spot.yaw_deg,
        width_m=width_m,
        seed=seed,
        colour=one_of(rng, "#4f6472", "#8a9a7b", "#6b4353", "#c9c4b8"),
    )
    layout.floor.occupy(spot.rectangle(-0.25, 0.25, -width_m / 2, width_m / 2), 1.8)


def _standing_screen(_: Rng, width_m: float, seed: int, colour: str) -> list[Part]:
    """A board 1.8 m high on two feet, with two posters on each side."""
    parts = [stood((0.04, width_m - 0.08, 1.55), furniture.cloth(colour), z=0.25, bevel=0.004)]
    for side in (-1, 1):
        post_y = side * (width_m / 2 - 0.02)
        parts.append(stood((0.04, 0.04, 1.8), furniture.STEEL, 0, post_y, bevel=0.003))
        parts.append(stood((0.5, 0.04, 0.03), furniture.STEEL, 0, post_y, bevel=0.003))
    high_m = 1.0
    for side, yaw_deg in ((1, 0.0), (-1, 180.0)):
        for number, y_m in enumerate((-0.25 * width_m, 0.25 * width_m)):
            style = ("talk", "circles", "hills")[(seed + number + (side > 0)) % 3]
            print_m = (min(0.38 * width_m, 0.72), high_m)
            look = matt(texture=picture.poster(style, seed + number, 500, 700))
            parts.append(put(card(print_m), look, side * 0.022, y_m, 1.1, yaw=yaw_deg))
    return parts


def _hang_poster(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    kind = one_of(rng, "talk", "circles", "hills")
    size_m = (0.84, 1.18) if kind == "talk" else (float(rng.uniform(0.6, 1.3)), float(rng.uniform(0.6, 1.0)))
    layout.add_on_wall(
        "picture",
        framed_print,
        size_m,
        middle_m=1.6,
        style=kind,
        seed=style.prints[int(rng.integers(len(style.prints)))],
        width_m=size_m[0],
        height_m=size_m[1],
        frame=style.frame,
    )


def _hang(layout: RoomLayout, kind: str, style: str, size_m: tuple[float, float], frame: str) -> None:
    layout.add_on_wall(
        kind,
        fitting.framed,
        (size_m[0] + 0.1, size_m[1] + 0.1),
        middle_m=1.5,
        style=style,
        width_m=size_m[0],
        height_m=size_m[1],
        frame=frame,
    )


def _pipe(layout: RoomLayout) -> None:
    """A pipe along a wall below the ceiling."""
    rng = layout.rng
    sides = list(SIDES)
    side = sides[int(rng.integers(len(sides)))]
    first_m, last_m = layout.room.span_m(side)
    z_m = layout.plan.height_m - 0.25
    spot = layout.spot(side, (first_m + last_m) / 2)
    layout.add(
        "pipe",
        fitting.pipe,
        spot.point(0.0),
        z_m,
        yaw_deg=spot.yaw_deg,
        support=WALL,
        length_m=last_m - first_m - 0.2,
        colour=one_of(rng, "#a4a7a6", "#b4533a", "#3f6c87", "#d8a614"),
    )


# --- Lamps ---


def _lamps(layout: RoomLayout, rng: Rng) -> None:
    """One to four panels of unequal power at random places below the ceiling, as in the paper's room, or a row."""
    rect = layout.room.rect
    count = int(np.clip(rng.integers(1, 5), 1, max(1, rect.area_m2 / 9)))
    shares = rng.uniform(0.4, 1.0, count)
    total_lm = LUX * rect.area_m2 / 0.62 * float(rng.uniform(0.7, 1.4))
    is_in_row = rng.random() < 0.35
    temperature_k = float(rng.uniform(2800, 5500))
    size_m = (float(rng.uniform(0.5, 1.6)), float(rng.uniform(0.2, 0.7)))
    drop_m = float(rng.choice([0.1, 0.1, 0.4]))
    z_m = layout.plan.height_m - drop_m
    places = _lamp_places(layout, rng, count, size_m, is_in_row=bool(is_in_row))
    for number, (x_m, y_m) in enumerate(places):
        layout.add("housing", fitting.lamp_housing, (x_m, y_m), z_m, support=CEILING, size_m=size_m, hang_m=drop_m)
        panel = quad((x_m - size_m[0] / 2, y_m - size_m[1] / 2, z_m), (0, size_m[1], 0), (size_m[0], 0, 0))
        power_lm = total_lm * float(shares[number] / shares.sum())
        layout.add_lamp("lamp", panel, power_lm, is_on=True, colour=lamp_colour(temperature_k))


def _lamp_places(
    layout: RoomLayout, rng: Rng, count: int, size_m: tuple[float, float], *, is_in_row: bool
) -> list[tuple[float, float]]:
    """Places (x, y) of lamps that do not meet one another or a pillar."""
    rect = layout.room.rect
    if is_in_row:
        y_m = rect.center_m[1]
        row = [(rect.x0 + (number + 0.5) * rect.width_m / count, y_m) for number in range(count)]
        if all(_is_clear_of_pillars(layout, x_m, y_m, size_m) for x_m, y_m in row):
            return row
    found: list[tuple[float, float]] = []
    for _ in range(200):
        x_m = float(rng.uniform(rect.x0 + 1.0, rect.x1 - 1.0))
        y_m = float(rng.uniform(rect.y0 + 0.7, rect.y1 - 0.7))
        is_apart = all(np.hypot(x_m - x, y_m - y) > size_m[0] + 0.3 for x, y in found)
        if is_apart and _is_clear_of_pillars(layout, x_m, y_m, size_m):
            found.append((x_m, y_m))
        if len(found) == count:
            break
    return found


def _is_clear_of_pillars(layout: RoomLayout, x_m: float, y_m: float, size_m: tuple[float, float]) -> bool:
    """Whether a lamp at a place meets nothing that is as high as the room."""
    half_x = size_m[0] / 2 + 0.1
    half_y = size_m[1] / 2 + 0.1
    lamp = Rect(x_m - half_x, y_m - half_y, x_m + half_x, y_m + half_y)
    return not any(lamp.overlaps(rect) for rect in layout.floor.footprints_above(layout.plan.height_m - 0.6))
