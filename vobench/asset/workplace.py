"""Offices by seed: a floor plan with an open area, cells and meeting rooms, furnished by the use of each room."""

from collections.abc import Callable

import numpy as np

from vobench.asset import bedroom, fitting, floor_plan, furnishing, furniture, household, office
from vobench.asset.daylight import daylight, lamp_colour
from vobench.asset.floor_plan import SIDES, Room, Side
from vobench.asset.furnishing import TABLE_M
from vobench.asset.furniture import STEEL, Part, coated, wood
from vobench.asset.interior import Interior, most_faces, without_excess
from vobench.asset.interior_shell import RoomFinish, shell
from vobench.asset.palette import Style, office_style
from vobench.asset.picture import one_of
from vobench.asset.room_fitting import door_fittings, skirtings
from vobench.asset.room_layout import CEILING, GAP_M, RoomLayout, Spot
from vobench.scene.material import Material
from vobench.scene.mesh import quad

PANORAMAS = ("city", "city", "city", "suburb")
OPTIONAL = ("sill_mug", "socket", "mug", "keyboard", "sill_plant", "plant", "picture", "pedestal")
DESK_M = 0.8  # depth
SEAT_M = 0.72  # of floor behind a desk for its chair
AISLE_M = 0.95
COATS_M = 0.2  # from the wall to the outside of coats on hooks
SCREENS = 4  # pictures on displays, from which those of an office are drawn


def furnished_office(seed: int, lighting: str) -> Interior:
    """An office of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    plan = floor_plan.office_plan(np.random.default_rng([seed, 10]))
    rng = np.random.default_rng([seed, 11])
    style = office_style(rng)
    finishes = {room.name: _finish(rng, room, style) for room in plan.rooms}
    layouts = {
        room.name: RoomLayout(plan, room, seed, np.random.default_rng([seed, 12, number]))
        for number, room in enumerate(plan.rooms)
    }
    light_rng = np.random.default_rng([seed, 13])
    outside = daylight(
        light_rng,
        lighting,
        towards_deg=furnishing.outward_deg(plan, light_rng),
        height_m=float(light_rng.choice([1.2, 4.5, 8.0, 12.0, 22.0, 40.0])),
        kinds=PANORAMAS,
    )
    lamp_rng = np.random.default_rng([seed, 14])
    # Offices are lit by day, too.
    share = max(outside.lamp_share, 0.75)
    desk_tops = one_of(rng, "wood", "wood", "#dedcd6", "#c9cac6", "#5b5f62")
    top = wood(style.tones) if desk_tops == "wood" else coated(desk_tops, roughness=0.35)
    kind = one_of(rng, "bars", "squares", "hanging")
    is_lit = share > 0.8 or bool(lamp_rng.random() < share)
    door_fittings(plan, layouts, style.doors, panels=False)
    for layout in layouts.values():
        furnishing.dress_windows(layout, style)
        FURNISH[layout.room.use](layout, style, top)
        has_window = any(plan.windows_of(layout.room))
        is_on = is_lit if has_window else True
        _ceiling_lamps(layout, style, kind, is_on=is_on or bool(lamp_rng.random() < 0.2))
        skirtings(layout, height_m=0.07)
    instances = tuple(shell(plan, finishes, thresholds=STEEL))
    placed = [piece for layout in layouts.values() for piece in layout.placed]
    pieces = without_excess(placed, most_faces(plan), OPTIONAL)
    lamps = [light for layout in layouts.values() for light in layout.lights]
    return Interior(plan, instances, pieces, (*lamps, *outside.lights))


def _finish(rng: np.random.Generator, room: Room, style: Style) -> RoomFinish:
    """The surfaces of a room: one floor in most of them, a painted wall in some."""
    floor = style.floor_tiles if room.use == "pantry" else style.planks
    walls = dict.fromkeys(SIDES, style.plain)
    if rng.random() < 0.5:
        sides: list[Side] = list(SIDES)
        walls[sides[int(rng.integers(4))]] = style.accents[int(rng.integers(len(style.accents)))]
    return RoomFinish(floor, style.ceiling, walls)


def _ceiling_lamps(layout: RoomLayout, style: Style, kind: str, *, is_on: bool) -> None:
    """Panels below the ceiling, in a grid."""
    rect = layout.room.rect
    size_m = {"bars": (1.5, 0.28), "squares": (0.9, 0.9), "hanging": (2.2, 0.16)}[kind]
    is_along_x = rect.width_m >= rect.depth_m
    length_m = max(rect.width_m, rect.depth_m)
    across_m = min(rect.width_m, rect.depth_m)
    columns = max(1, round(length_m / 4.4))
    rows = max(1, round(across_m / 4.6))
    if layout.room.use == "pantry":
        columns = 1
        rows = 1
    height_m = layout.plan.height_m
    hangs = kind == "hanging" and layout.room.use != "pantry"
    drop_m = 0.55 if hangs else 0.06
    power_lm = 230 * rect.area_m2 / (columns * rows)
    colour = lamp_colour(style.lamp_k)
    for column in range(columns):
        for row in range(rows):
            along = (column + 0.5) * length_m / columns
            across = (row + 0.5) * across_m / rows
            x_m = rect.x0 + (along if is_along_x else across)
            y_m = rect.y0 + (across if is_along_x else along)
            if layout.room.use == "pantry":
                x_m, y_m = furnishing.middle_of_floor(layout)
            z_m = height_m - drop_m
            half_x = size_m[0] / 2 if is_along_x else size_m[1] / 2
            half_y = size_m[1] / 2 if is_along_x else size_m[0] / 2
            layout.add(
                "housing",
                fitting.lamp_housing,
                (x_m, y_m),
                z_m,
                yaw_deg=0.0 if is_along_x else 90.0,
                support=CEILING,
                size_m=size_m,
                hang_m=drop_m,
            )
            panel = quad((x_m - half_x, y_m - half_y, z_m), (0, 2 * half_y, 0), (2 * half_x, 0, 0))
            layout.lamp("lamp", panel, power_lm, is_on=is_on, colour=colour)


# --- Workplaces ---


def _workplace(layout: RoomLayout, style: Style, spot: Spot, width_m: float, top: Material) -> None:
    """A desk whose back is at a spot, with a chair, a display or a laptop, and what else lies on it."""
    rng = layout.rng
    desk = layout.add(
        "desk",
        office.plain_desk,
        spot.at(DESK_M / 2),
        yaw_deg=spot.yaw_deg,
        width_m=width_m,
        depth_m=DESK_M,
        look=top,
    )
    chair_x = DESK_M + float(rng.uniform(0.2, 0.36))
    layout.add(
        "chair",
        office.task_chair,
        spot.at(chair_x, float(rng.normal(0, 0.06))),
        yaw_deg=spot.yaw_deg + 180 + float(np.clip(rng.normal(0, 25), -40, 40)),
        beside=(desk,),
        colour=style.cloths[0],
    )
    if rng.random() < 0.7:
        side = 1 if rng.random() < 0.5 else -1
        layout.add(
            "pedestal",
            office.pedestal,
            spot.at(DESK_M / 2 - 0.05, side * (width_m / 2 - 0.3)),
            yaw_deg=spot.yaw_deg,
            beside=(desk,),
        )
    screen_seed = int(rng.integers(SCREENS))
    is_first = not any(".monitor_" in piece.name for piece in layout.placed)
    y = float(rng.uniform(-0.06, 0.06))
    has_display = rng.random() < 0.75
    if has_display:
        layout.add(
            "monitor",
            furnishing.monitor,
            spot.at(0.26, y),
            TABLE_M,
            yaw_deg=spot.yaw_deg + float(rng.normal(0, 6)),
            support=desk,
            width_m=float(rng.choice([0.52, 0.6])),
            seed=screen_seed,
            is_on=is_first and bool(rng.random() < 0.6),
        )
        if rng.random() < 0.5:
            layout.add(
                "keyboard",
                furniture.keyboard,
                spot.at(0.58, y),
                TABLE_M,
                yaw_deg=spot.yaw_deg + float(rng.normal(0, 4)),
                support=desk,
            )
    else:
        layout.add(
            "laptop",
            _laptop,
            spot.at(0.42, y),
            TABLE_M,
            yaw_deg=spot.yaw_deg + float(rng.normal(0, 10)),
            support=desk,
            seed=screen_seed,
        )
    available = furnishing.items(layout)
    for side in (-1, 1):
        if rng.random() < 0.7:
            kind, make, half_m, size = available[one_of(rng, "mug", "pens", "papers", "mug")]
            place_y = side * (width_m / 2 - max(half_m, 0.1) - 0.05)
            turn_deg = spot.yaw_deg + 90 + float(rng.normal(0, 8))
            layout.add(
                kind,
                make,
                spot.at(float(rng.uniform(0.24, 0.5)), place_y),
                TABLE_M,
                yaw_deg=turn_deg,
                support=desk,
                **size,
            )


def _laptop(rng: np.random.Generator, seed: int) -> list[Part]:
    """A laptop that is asleep."""
    return furnishing.switched_off(office.laptop(rng, seed))


def _clusters(layout: RoomLayout, style: Style, top: Material) -> int:
    """Desks in pairs that face each other, in rows across the room; returns their number."""
    rng = layout.rng
    rect = layout.room.rect
    is_along_x = rect.width_m >= rect.depth_m
    side: Side = "west" if is_along_x else "south"
    length_m = layout.depth_m(side)
    width_m = float(rng.choice([1.4, 1.6]))
    pair_m = 2 * (DESK_M + SEAT_M)
    pitch_m = pair_m + AISLE_M
    across_m = min(rect.width_m, rect.depth_m)
    most = min(3, int((across_m - 1.7) / width_m))
    count = int((length_m - 1.2) / pitch_m)
    has_screens = rng.random() < 0.6
    placed = 0
    spare_m = length_m - count * pitch_m
    for k in range(count):
        middle_m = spare_m / 2 + (k + 0.5) * pitch_m
        for desks in range(most, 0, -1):
            spot = _cluster_spot(layout, side, middle_m, (pair_m, desks * width_m))
            if spot is None:
                continue
            _cluster(layout, style, spot, desks=desks, width_m=width_m, top=top, has_screens=has_screens)
            placed += 2 * desks
            break
    return placed


def _cluster_spot(layout: RoomLayout, side: Side, middle_m: float, size_m: tuple[float, float]) -> Spot | None:
    """The middle of a free place for a cluster, at a distance from one side of the room."""
    first_m, last_m = layout.room.span_m(side)
    half_m = size_m[1] / 2
    places = layout.rng.uniform(first_m + half_m + 0.1, max(last_m - half_m - 0.1, first_m + half_m + 0.1), 6).tolist()
    for along in [first_m + half_m + 0.35, last_m - half_m - 0.35, *places]:
        wall = layout.spot(side, along)
        spot = Spot(*wall.at(middle_m), wall.yaw_deg, side)
        body = spot.rect(-size_m[0] / 2, size_m[0] / 2, -half_m, half_m)
        if layout.fits([body]):
            layout.take(body, 1.15)
            return spot
    return None


def _cluster(
    layout: RoomLayout, style: Style, spot: Spot, *, desks: int, width_m: float, top: Material, has_screens: bool
) -> None:
    """Pairs of desks side by side, with screens between them or not."""
    for k in range(desks):
        y = (k - (desks - 1) / 2) * width_m
        for sign in (-1, 1):
            x_m, y_m = spot.at(sign * 0.012, y)
            yaw_deg = spot.yaw_deg + (0.0 if sign > 0 else 180.0)
            _workplace(layout, style, Spot(x_m, y_m, yaw_deg, spot.side), width_m - 0.02, top)
    if has_screens:
        for k in range(desks):
            y = (k - (desks - 1) / 2) * width_m
            layout.add(
                "screen",
                office.desk_screen,
                spot.at(0, y),
                TABLE_M,
                yaw_deg=spot.yaw_deg,
                support="shell",
                width_m=width_m - 0.06,
                colour=style.accent_cloths[0],
            )


def _wall_desk(layout: RoomLayout, style: Style, top: Material) -> bool:
    """A workplace at a wall or window."""
    width_m = float(layout.rng.choice([1.4, 1.6]))
    spot = next(layout.spots(width_m, DESK_M + SEAT_M, TABLE_M, front_m=0.25), None)
    if spot is None:
        return False
    back = Spot(*spot.at(GAP_M), spot.yaw_deg, spot.side)
    _workplace(layout, style, back, width_m - 0.02, top)
    layout.take(spot.body(DESK_M + SEAT_M, width_m, GAP_M), 0.9)
    layout.take_wall(spot.side, *_along(spot, width_m), 0.0, 1.2)
    return True


def _along(spot: Spot, width_m: float) -> tuple[float, float]:
    """The part of a wall that something at a spot covers."""
    along = spot.along_m
    return along - width_m / 2, along + width_m / 2


# --- Storage and walls ---


def _cabinet(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    width_m = float(rng.choice([0.8, 0.9, 1.0]))
    height_m = float(rng.choice([0.78, 1.2, 1.9]))
    stood = layout.stand(
        "cabinet",
        furniture.cabinet,
        (0.5, width_m + 0.02, height_m),
        back_m=0.225,
        width_m=width_m,
        depth_m=0.45,
        height_m=height_m,
        colour=one_of(rng, "#8b9493", "#c9cac6", "#5b6b5d", style.kitchen.fronts),
    )
    if stood is not None and height_m < 1.3:
        name, spot = stood
        names = ("plant", "box", "books", "papers")
        furnishing.scatter(layout, name, spot, names, x_m=GAP_M + 0.22, width_m=width_m - 0.1, z_m=height_m)


def _wall_things(layout: RoomLayout, style: Style, posters: int) -> None:
    """A whiteboard, a notice board and posters."""
    rng = layout.rng
    if rng.random() < 0.75:
        layout.hang(
            "whiteboard",
            fitting.framed,
            (1.5, 1.0),
            middle_m=1.5,
            style="whiteboard",
            seed=int(rng.integers(3)),
            width_m=1.4,
            height_m=0.9,
            frame="#a4a7a6",
        )
    if rng.random() < 0.45:
        layout.hang("noticeboard", fitting.noticeboard, (1.05, 0.8), middle_m=1.55, width_m=0.95, height_m=0.7)
    for _ in range(posters):
        kind = one_of(rng, "talk", "circles", "hills")
        width_m, height_m = (0.84, 1.18) if kind == "talk" else (0.6, 0.85)
        layout.hang(
            "picture",
            furnishing.framed_print,
            (width_m, height_m),
            middle_m=1.6,
            style=kind,
            seed=style.prints[int(rng.integers(len(style.prints)))],
            width_m=width_m,
            height_m=height_m,
            frame=style.frame,
        )
    furnishing.sockets(layout, 2)


def _bin(layout: RoomLayout) -> None:
    layout.stand(
        "bin",
        furniture.waste_bin,
        (0.32, 0.32, 0.4),
        back_m=0.16,
        front_m=0.0,
        in_corner=True,
        width_m=0.28,
        height_m=0.34,
    )


# --- Rooms by use ---


def _furnish_open(layout: RoomLayout, style: Style, top: Material) -> None:
    rng = layout.rng
    count = _clusters(layout, style, top)
    if count < 2:
        _wall_desk(layout, style, top)
    for _ in range(int(rng.integers(1, 4))):
        _cabinet(layout, style)
    for _ in range(int(rng.integers(1, 3))):
        furnishing.shelf(layout, style, (1.0, 1.6, 2.0))
    layout.stand("copier", office.copier, (0.68, 0.62, 1.06), back_m=0.31)
    if rng.random() < 0.5:
        layout.stand("coat_stand", office.coat_stand, (0.5, 0.5, 1.8), back_m=0.25, front_m=0.0, in_corner=True)
    if rng.random() < 0.6:
        _seats(layout, style)
    for _ in range(int(rng.integers(2, 5))):
        furnishing.floor_plant(layout)
    _bin(layout)
    _wall_things(layout, style, int(rng.integers(2, 5)))


def _seats(layout: RoomLayout, style: Style) -> None:
    """A sofa or armchairs for visitors."""
    if layout.rng.random() < 0.5:
        layout.stand(
            "sofa",
            household.couch,
            (0.92, 1.8, 0.8),
            back_m=0.46,
            front_m=0.7,
            width_m=1.8,
            colour=style.cover,
            tones=style.tones,
        )
    else:
        furnishing.armchair(layout, style)
        furnishing.armchair(layout, style)


def _furnish_cell(layout: RoomLayout, style: Style, top: Material) -> None:
    rng = layout.rng
    _wall_desk(layout, style, top)
    if layout.room.rect.area_m2 > 13 or rng.random() < 0.4:
        _wall_desk(layout, style, top)
    furnishing.shelf(layout, style)
    if rng.random() < 0.6:
        _cabinet(layout, style)
    if rng.random() < 0.3:
        furnishing.armchair(layout, style)
    if rng.random() < 0.4:
        layout.stand("coat_stand", office.coat_stand, (0.5, 0.5, 1.8), back_m=0.25, front_m=0.0, in_corner=True)
    if rng.random() < 0.3:
        furnishing.cartons(layout)
    if rng.random() < 0.7:
        furnishing.floor_plant(layout)
    _wall_things(layout, style, int(rng.integers(0, 3)))


def _furnish_meeting(layout: RoomLayout, style: Style, top: Material) -> None:
    rng = layout.rng
    for seats in (5, 4, 3, 2):
        length_m = 0.72 * seats + 0.2
        spot = layout.open_spot(1.15 + 2 * 0.5, length_m)
        if spot is None:
            continue
        body = spot.rect(-1.075, 1.075, -length_m / 2, length_m / 2)
        table = layout.add(
            "meeting_table",
            office.meeting_table,
            spot.at(0),
            yaw_deg=spot.yaw_deg,
            length_m=length_m,
            width_m=1.15,
            look=top,
        )
        layout.take(body, TABLE_M)
        for sign in (-1, 1):
            for k in range(seats):
                y = (k - (seats - 1) / 2) * 0.72
                turn_deg = (180.0 if sign > 0 else 0.0) + float(rng.normal(0, 8))
                layout.add(
                    "chair",
                    office.task_chair,
                    spot.at(sign * (0.575 + float(rng.uniform(0.05, 0.16))), y),
                    yaw_deg=spot.yaw_deg + turn_deg,
                    beside=(table, *(piece.name for piece in layout.placed if ".chair_" in piece.name)),
                    colour=style.cloths[1],
                )
        names = ("papers", "mug", "bottle", "plant")
        furnishing.scatter(layout, table, spot, names, x_m=0.0, width_m=length_m - 0.4, z_m=TABLE_M)
        break
    board = layout.stand(
        "sideboard",
        household.low_board,
        (0.46, 1.5, 1.4),
        back_m=0.216,
        front_m=0.5,
        width_m=1.5,
        height_m=0.7,
        tones=style.second_tones,
    )
    if board is not None:
        name, spot = board
        layout.add(
            "television",
            furnishing.television,
            spot.at(GAP_M + 0.2),
            0.7,
            yaw_deg=spot.yaw_deg,
            support=name,
            width_m=1.2,
            seed=int(rng.integers(8)),
        )
    if rng.random() < 0.7:
        furnishing.floor_plant(layout)
    _wall_things(layout, style, 1)


def _furnish_pantry(layout: RoomLayout, style: Style, top: Material) -> None:
    del top
    rng = layout.rng
    furnishing.kitchen_row(layout, style)
    area_m2 = layout.room.rect.area_m2
    has_table = area_m2 > 9 and furnishing.dining_table(layout, style, 4)
    if not has_table:
        furnishing.dining_table(layout, style, 2)
    _bin(layout)
    if rng.random() < 0.5:
        furnishing.floor_plant(layout)
    furnishing.pictures(layout, style, 2)
    furnishing.sockets(layout, 1)


def _furnish_hall(layout: RoomLayout, style: Style, top: Material) -> None:
    del top
    rng = layout.rng
    for _ in range(int(rng.integers(1, 3))):
        _cabinet(layout, style)
    if rng.random() < 0.6:
        layout.stand("copier", office.copier, (0.68, 0.62, 1.06), back_m=0.31)
    if rng.random() < 0.5:
        rack_m = 1.1
        rack = layout.hang(
            "coat_rack",
            bedroom.coat_rack,
            (rack_m + 0.24, 1.3),
            middle_m=1.22,
            width_m=rack_m,
            tones=style.tones,
        )
        if rack is not None:
            layout.take(rack.body(COATS_M, rack_m + 0.2), 1.8)
    for _ in range(int(rng.integers(1, 3))):
        furnishing.floor_plant(layout)
    _wall_things(layout, style, int(rng.integers(2, 5)))


FURNISH: dict[str, Callable[[RoomLayout, Style, Material], None]] = {
    "open": _furnish_open,
    "cell": _furnish_cell,
    "meeting": _furnish_meeting,
    "pantry": _furnish_pantry,
    "hall": _furnish_hall,
}
