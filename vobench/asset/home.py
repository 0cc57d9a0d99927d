"""Flats by seed: a floor plan, furnished by the use of each room, with surfaces that go together, in any daylight."""

from collections.abc import Callable, Sequence

import numpy as np

from vobench.asset import bathroom, bedroom, fitting, floor_plan, furnishing, furniture, household
from vobench.asset.daylight import daylight, lamp_colour
from vobench.asset.floor_plan import SIDES, Rect, Room, Side
from vobench.asset.furniture import wood
from vobench.asset.interior import (
    CEILING,
    GAP_M,
    WALL,
    Interior,
    RoomFinish,
    RoomLayout,
    Span,
    Spot,
    corners_of,
    door_fittings,
    most_faces,
    shell,
    skirtings,
    without_excess,
)
from vobench.asset.palette import Style, home_style
from vobench.asset.picture import Rng, one_of
from vobench.scene.mesh import quad

PANORAMAS = ("city", "city", "suburb", "country")
OPTIONAL = ("sill_mug", "fruit", "bin", "socket", "mug", "sill_plant", "shoes", "keyboard", "plant", "picture")


def furnished_flat(seed: int, lighting: str) -> Interior:
    """A flat of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    plan = floor_plan.flat_plan(np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    style = home_style(rng)
    finishes = {room.name: _finish(rng, room, style) for room in plan.rooms}
    layouts = {
        room.name: RoomLayout(plan, room, seed, np.random.default_rng([seed, 2, number]))
        for number, room in enumerate(plan.rooms)
    }
    light_rng = np.random.default_rng([seed, 3])
    outside = daylight(
        light_rng,
        lighting,
        towards_deg=furnishing.outward_deg(plan, light_rng),
        height_m=float(light_rng.choice([1.2, 4.0, 7.0, 10.0, 16.0])),
        kinds=PANORAMAS,
    )
    lamp_rng = np.random.default_rng([seed, 4])
    door_fittings(plan, layouts, style.doors, panels=bool(rng.random() < 0.6))
    for layout in layouts.values():
        furnishing.dress_windows(layout, style)
        FURNISH[layout.room.use](layout, style)
        is_main = layout.room.use == "living"
        share = outside.lamp_share if any(plan.windows_of(layout.room)) else max(outside.lamp_share, 0.75)
        is_on = bool(lamp_rng.random() < share) or (is_main and outside.lamp_share > 0.8)
        _ceiling_lamps(layout, style, is_on=is_on)
        furnishing.small_lamps(layout, style, is_on=is_on and bool(lamp_rng.random() < 0.8))
        if layout.room.use != "bath":
            skirtings(layout)
    instances = tuple(shell(plan, finishes, thresholds=wood(style.tones)))
    placed = [piece for layout in layouts.values() for piece in layout.placed]
    pieces = without_excess(placed, most_faces(plan), OPTIONAL)
    lamps = [light for layout in layouts.values() for light in layout.lights]
    return Interior(plan, instances, pieces, (*lamps, *outside.lights))


def _finish(rng: Rng, room: Room, style: Style) -> RoomFinish:
    """The surfaces of a room: tiles where it gets wet, one wall or all walls painted in some of the others."""
    if room.use == "bath":
        return RoomFinish(style.floor_tiles, style.ceiling, dict.fromkeys(SIDES, style.bath_tiles))
    floor = style.floor_tiles if room.use == "kitchen" and rng.random() < 0.7 else style.planks
    walls = dict.fromkeys(SIDES, style.plain)
    accent = style.accents[int(rng.integers(len(style.accents)))]
    choice = rng.random()
    if choice < 0.35:
        sides: list[Side] = list(SIDES)
        walls[sides[int(rng.integers(4))]] = accent
    elif choice < 0.55:
        walls = dict.fromkeys(SIDES, accent)
    return RoomFinish(floor, style.ceiling, walls)


# --- Windows and lamps ---


def _ceiling_lamps(layout: RoomLayout, style: Style, *, is_on: bool) -> None:
    """A pendant over the dining table, and a lamp near the middle of the ceiling."""
    rng = layout.rng
    area_m2 = layout.room.rect.area_m2
    power_lm = float(np.clip(150 * area_m2, 1000, 4200)) * float(rng.uniform(0.85, 1.2))
    x_m, y_m = furnishing.middle_of_floor(layout)
    table = next((piece for piece in layout.placed if ".dining_table_" in piece.name), None)
    if table is not None:
        corners = corners_of(table.parts)
        table_x, table_y = ((corners.min(axis=0) + corners.max(axis=0)) / 2)[:2].tolist()
        _pendant(layout, style, (table_x, table_y), 1.55, 800.0, is_on=is_on)
        if np.hypot(table_x - x_m, table_y - y_m) < 0.7:
            return
    hangs = table is None and layout.room.use in ("living", "bedroom", "study") and rng.random() < 0.45
    if hangs:
        _pendant(layout, style, (x_m, y_m), 2.05, power_lm, is_on=is_on)
        return
    width_m = float(rng.choice([0.3, 0.4, 0.5]))
    is_round = rng.random() < 0.55
    height_m = layout.plan.height_m
    layout.add(
        "lamp_body",
        household.ceiling_lamp,
        (x_m, y_m),
        height_m,
        support=CEILING,
        width_m=width_m,
        is_round=bool(is_round),
    )
    low_m = height_m - household.CEILING_LAMP_M - 0.002
    half_m = 0.45 * width_m
    square = quad((x_m - half_m, y_m - half_m, low_m), (0, 2 * half_m, 0), (2 * half_m, 0, 0))
    face = household.diffuser(x_m, y_m, low_m, 2 * half_m) if is_round else square
    layout.lamp("lamp", face, power_lm, is_on=is_on, colour=lamp_colour(style.lamp_k))


def _pendant(
    layout: RoomLayout, style: Style, xy_m: tuple[float, float], low_m: float, power_lm: float, *, is_on: bool
) -> None:
    """A pendant whose shade ends at a height above the floor, and its bulb."""
    rng = layout.rng
    height_m = layout.plan.height_m
    wide_m = float(rng.choice([0.36, 0.46, 0.56]))
    layout.add(
        "pendant",
        furnishing.pendant,
        xy_m,
        height_m,
        support=CEILING,
        drop_m=height_m - low_m,
        colour=one_of(rng, "#2c4a4a", "#27445c", "#262b30", "#c9c4b8", "#b4533a", "#5c6b5a", "#d8c3a0"),
        wide_m=wide_m,
    )
    disc = household.diffuser(*xy_m, low_m + 0.035, 0.94 * wide_m)
    layout.lamp("lamp", disc, power_lm, is_on=is_on, colour=lamp_colour(style.lamp_k))


# --- Rooms by use ---


def _furnish_living(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    area_m2 = layout.room.rect.area_m2
    has_kitchen_table = any(room.use == "kitchen" and room.rect.area_m2 > 9 for room in layout.plan.rooms)
    board_spot, sofa_spot = _television_corner(layout, style)
    wants_table = area_m2 > 18 and (not has_kitchen_table or area_m2 > 24 or rng.random() < 0.4)
    if wants_table:
        furnishing.dining_table(layout, style, 6 if area_m2 > 26 and rng.random() < 0.6 else 4)
    sideboard = furnishing.sideboard(layout, style) if rng.random() < 0.8 else None
    furnishing.shelf(layout, style)
    if rng.random() < 0.3:
        furnishing.shelf(layout, style)
    if rng.random() < 0.6:
        furnishing.floor_lamp(layout)
    has_bed = not any(room.use == "bedroom" for room in layout.plan.rooms)
    if has_bed:
        _bed(layout, style, (1.2, 1.4))
    if rng.random() < 0.4:
        furnishing.desk(layout, style)
    if rng.random() < 0.5:
        furnishing.armchair(layout, style)
    for _ in range(int(rng.integers(1, 3))):
        furnishing.floor_plant(layout)
    furnishing.pictures(layout, style, int(rng.integers(1, 4)), [sofa_spot, sideboard])
    furnishing.sockets(layout, 1)
    del board_spot


def _television_corner(layout: RoomLayout, style: Style) -> tuple[Spot | None, Spot | None]:
    """A television on a low board, a sofa that faces it, and a table on a rug between them."""
    rng = layout.rng
    sofa_m = float(rng.choice([1.9, 2.1, 2.3]))
    board_m = float(rng.choice([1.4, 1.7, 1.9]))
    table_m = (0.55, 1.0)
    for spot in layout.spots(max(board_m, 1.2), 0.46, 0.5, front_m=1.2):
        depth_m = layout.depth_m(spot.side)
        is_at_wall = depth_m < 4.6 or rng.random() < 0.3
        back_m = depth_m - GAP_M if is_at_wall else float(rng.uniform(3.3, min(3.9, depth_m - 0.9)))
        front_m = back_m - 0.92
        gap_m = front_m - 0.5
        if not 1.3 < gap_m < 3.6:
            continue
        has_table = gap_m > 1.7
        table_x = front_m - 0.42 - table_m[0] / 2
        bodies = [spot.body(0.46, board_m, GAP_M), spot.rect(front_m, back_m, -sofa_m / 2, sofa_m / 2)]
        if has_table:
            bodies.append(spot.rect(table_x - 0.28, table_x + 0.28, -0.5, 0.5))
        behind = layout.spot(OPPOSITE[spot.side], spot.y_m if spot.side in ("east", "west") else spot.x_m)
        along = behind.y_m if behind.side in ("east", "west") else behind.x_m
        if is_at_wall and not _wall_is_low(layout, behind, along, sofa_m):
            continue
        if not layout.fits(bodies):
            continue
        _add_television(layout, style, spot, board_m)
        layout.add(
            "sofa",
            household.couch,
            spot.at(back_m - 0.46),
            yaw_deg=spot.yaw_deg + 180,
            width_m=sofa_m,
            colour=style.cloths[0],
            tones=style.tones,
            accents=(style.accent_cloths[0], style.accent_cloths[1]),
        )
        if has_table:
            _add_coffee_table(layout, style, spot, table_x, table_m)
        for body, height_m in zip(bodies, (0.5, 0.8, 0.42), strict=False):
            layout.take(body, height_m)
        if is_at_wall:
            layout.take_wall(behind.side, along - sofa_m / 2, along + sofa_m / 2, 0.0, 0.82)
        along = spot.y_m if spot.side in ("east", "west") else spot.x_m
        layout.take_wall(spot.side, along - board_m / 2, along + board_m / 2, 0.0, 1.3)
        return spot, behind if is_at_wall else None
    sofa = layout.stand(
        "sofa", household.couch, (0.92, 1.8, 0.8), back_m=0.46, front_m=0.7, width_m=1.8, colour=style.cloths[0]
    )
    return None, sofa[1] if sofa else None


OPPOSITE: dict[Side, Side] = {"east": "west", "west": "east", "north": "south", "south": "north"}


def _wall_is_low(layout: RoomLayout, spot: Spot, along: float, width_m: float) -> bool:
    """Whether a wall is free for a sofa at it."""
    return layout.is_wall_free(spot.side, Span(along - width_m / 2, along + width_m / 2, 0.0, 0.75))


def _add_television(layout: RoomLayout, style: Style, spot: Spot, board_m: float) -> None:
    board = layout.add(
        "low_board",
        household.low_board,
        spot.at(GAP_M + 0.216),
        yaw_deg=spot.yaw_deg,
        width_m=board_m,
        tones=style.second_tones,
    )
    screen_m = min(1.25, board_m - 0.3)
    layout.add(
        "television",
        furnishing.television,
        spot.at(GAP_M + 0.2),
        0.46,
        yaw_deg=spot.yaw_deg,
        support=board,
        width_m=screen_m,
        seed=style.rugs[0],
    )


def _add_coffee_table(layout: RoomLayout, style: Style, spot: Spot, x_m: float, table_m: tuple[float, float]) -> None:
    rng = layout.rng
    rug_m = (float(rng.uniform(1.9, 2.4)), float(rng.uniform(1.3, 1.6)))
    under = spot.rect(x_m - rug_m[1] / 2, x_m + rug_m[1] / 2, -rug_m[0] / 2, rug_m[0] / 2)
    has_rug = rng.random() < 0.75 and layout.room.rect.contains(under)
    if has_rug:
        layout.add(
            "rug",
            furnishing.rug,
            spot.at(x_m),
            yaw_deg=spot.yaw_deg,
            width_m=rug_m[0],
            depth_m=rug_m[1],
            seed=style.rugs[0],
        )
    table = layout.add(
        "coffee_table",
        household.table,
        spot.at(x_m),
        0.009 if has_rug else 0.0,
        yaw_deg=spot.yaw_deg,
        width_m=table_m[1],
        depth_m=table_m[0],
        height_m=0.42,
        tones=style.tones,
    )
    top_m = 0.429 if has_rug else 0.42
    names = ("mug", "books", "plant", "papers")
    chosen = [names[k] for k in rng.permutation(len(names)).tolist()][: int(rng.integers(1, 4))]
    furnishing.scatter(layout, table, spot, chosen, x_m=x_m, width_m=table_m[1] - 0.1, z_m=top_m)


def _furnish_kitchen(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    row = furnishing.kitchen_row(layout, style)
    area_m2 = layout.room.rect.area_m2
    if row is not None:
        seats = 4 if area_m2 > 10.5 else 2
        has_table = furnishing.dining_table(layout, style, seats) or furnishing.dining_table(layout, style, 2)
        del has_table
    if rng.random() < 0.25:
        layout.stand("bin", furniture.waste_bin, (0.32, 0.32, 0.42), back_m=0.16, front_m=0.0, in_corner=True,
                     width_m=0.28, height_m=0.38)  # fmt: skip
    if rng.random() < 0.35:
        furnishing.floor_plant(layout)
    furnishing.pictures(layout, style, int(rng.integers(1, 3)))
    furnishing.sockets(layout, 1)


def _bed(layout: RoomLayout, style: Style, widths_m: Sequence[float]) -> Spot | None:
    """A bed with its head at a wall, and tables with lamps beside it where there is space."""
    rng = layout.rng
    for width_m in sorted(rng.choice(widths_m, 2).tolist(), reverse=True):
        stood = layout.stand(
            "bed",
            bedroom.bed,
            (bedroom.BED_LENGTH_M + 0.05, width_m + 0.1, 0.95),
            back_m=0.0,
            front_m=0.35,
            width_m=width_m,
            tones=style.tones,
            linen=style.linen,
            cover=style.cover,
        )
        if stood is None:
            continue
        _, spot = stood
        for sign in (-1, 1):
            y = sign * (width_m / 2 + 0.08 + 0.23)
            body = spot.rect(GAP_M, GAP_M + 0.42, y - 0.225, y + 0.225)
            if layout.fits([body]):
                _bedside(layout, style, spot, y, body)
        return spot
    return None


def _bedside(layout: RoomLayout, style: Style, spot: Spot, y: float, body: Rect) -> None:
    name = layout.add(
        "bedside_table",
        bedroom.bedside_table,
        spot.at(GAP_M, y),
        yaw_deg=spot.yaw_deg,
        tones=style.tones,
    )
    layout.take(body, 0.5)
    furnishing.scatter(
        layout,
        name,
        Spot(*spot.at(0, y), spot.yaw_deg, spot.side),
        ("lamp", "mug"),
        x_m=GAP_M + 0.2,
        width_m=0.42,
        z_m=0.5,
    )


def _furnish_bedroom(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    bed = _bed(layout, style, (1.6, 1.4, 1.8) if layout.room.rect.area_m2 > 11 else (1.4, 0.9, 1.2))
    width_m = float(rng.choice([1.0, 1.5, 1.9, 2.4]))
    for attempt_m in (width_m, 1.0):
        wardrobe = layout.stand(
            "wardrobe",
            bedroom.wardrobe,
            (0.66, attempt_m + 0.02, 2.34),
            front_m=0.55,
            in_corner=True,
            width_m=attempt_m,
            colour=one_of(rng, "#e4e0d6", "#dcdbd6", style.kitchen.fronts) if style.is_painted else "",
            tones=style.tones,
        )
        if wardrobe is not None:
            break
    if rng.random() < 0.55:
        furnishing.sideboard(layout, style)
    if rng.random() < 0.45:
        furnishing.desk(layout, style)
    if rng.random() < 0.4:
        furnishing.shelf(layout, style, (0.8, 1.0))
    if rng.random() < 0.3:
        furnishing.armchair(layout, style)
    if rng.random() < 0.5:
        _loose_rug(layout, style)
    if rng.random() < 0.6:
        furnishing.floor_plant(layout)
    if rng.random() < 0.4:
        layout.hang("mirror", fitting.framed, (0.5, 1.4), middle_m=1.05, style="mirror", width_m=0.5, height_m=1.4)
    furnishing.pictures(layout, style, int(rng.integers(1, 3)), [bed])
    furnishing.sockets(layout, 1)


def _loose_rug(layout: RoomLayout, style: Style) -> None:
    """A rug where the floor is free."""
    rng = layout.rng
    width_m = float(rng.uniform(1.2, 1.7))
    depth_m = float(rng.uniform(0.7, 1.1))
    spot = layout.open_spot(depth_m, width_m)
    if spot is not None:
        layout.add(
            "rug",
            furnishing.rug,
            spot.at(0),
            yaw_deg=spot.yaw_deg,
            width_m=width_m,
            depth_m=depth_m,
            seed=style.rugs[1],
        )


def _furnish_study(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    desk = furnishing.desk(layout, style)
    for _ in range(int(rng.integers(1, 3))):
        furnishing.shelf(layout, style)
    if rng.random() < 0.5:
        furnishing.armchair(layout, style)
    if rng.random() < 0.35 and layout.room.rect.area_m2 > 8:
        layout.stand("sofa", household.couch, (0.92, 1.7, 0.8), back_m=0.46, width_m=1.7, colour=style.cloths[1])
    if rng.random() < 0.4:
        furnishing.sideboard(layout, style)
    if rng.random() < 0.4:
        furnishing.floor_lamp(layout)
    if rng.random() < 0.5:
        furnishing.cartons(layout)
    furnishing.floor_plant(layout)
    if rng.random() < 0.5:
        layout.hang(
            "noticeboard", fitting.noticeboard, (0.95, 0.65), above=desk, middle_m=1.62, width_m=0.9, height_m=0.6
        )
    furnishing.pictures(layout, style, int(rng.integers(1, 3)))
    furnishing.sockets(layout, 1)


def _furnish_hall(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    width_m = float(rng.choice([0.7, 0.9]))
    cabinet = layout.stand(
        "shoe_cabinet",
        bedroom.shoe_cabinet,
        (0.31, width_m + 0.02, 0.88),
        front_m=0.6,
        width_m=width_m,
        colour=one_of(rng, "#dcdbd6", "#c9c4b8", "#5b6b5d"),
    )
    spot = None
    if cabinet is not None:
        name, spot = cabinet
        furnishing.scatter(
            layout,
            name,
            spot,
            ("box", "mug", "plant")[: int(rng.integers(1, 4))],
            x_m=GAP_M + 0.14,
            width_m=width_m - 0.12,
            z_m=0.87,
        )
    if spot is not None and rng.random() < 0.6:
        layout.hang(
            "mirror", fitting.framed, (0.55, 0.75), middle_m=1.6, above=spot, style="mirror", width_m=0.5, height_m=0.7
        )
    _coats(layout, style)
    if rng.random() < 0.45:
        _runner(layout, style)
    if layout.room.rect.depth_m > 1.7 and layout.room.rect.width_m > 1.7:
        if rng.random() < 0.6:
            layout.stand(
                "wardrobe", bedroom.wardrobe, (0.66, 1.02, 2.34), front_m=0.5, in_corner=True, width_m=1.0,
                colour="#e4e0d6" if style.is_painted else "", tones=style.tones,
            )  # fmt: skip
        if rng.random() < 0.5:
            furnishing.shelf(layout, style, (0.8, 1.0))
        if rng.random() < 0.5:
            furnishing.floor_plant(layout)
    furnishing.pictures(layout, style, int(rng.integers(1, 3)))
    furnishing.sockets(layout, 1)


def _coats(layout: RoomLayout, style: Style) -> None:
    """A rack with coats, and shoes on the floor below it."""
    rng = layout.rng
    rack_m = float(rng.choice([0.7, 0.9, 1.1]))
    rack = layout.hang(
        "coat_rack", bedroom.coat_rack, (rack_m + 0.24, 1.3), middle_m=1.22, width_m=rack_m, tones=style.tones
    )
    if rack is not None:
        for _ in range(int(rng.integers(0, 3))):
            y = float(rng.uniform(-0.3, 0.3)) * rack_m
            body = rack.rect(0.02, 0.38, y - 0.17, y + 0.17)
            if layout.fits([body]):
                turn_deg = rack.yaw_deg + float(rng.normal(0, 8))
                layout.add("shoes", bedroom.shoes, rack.at(0.05, y), yaw_deg=turn_deg)
                layout.take(body, 0.12)


def _runner(layout: RoomLayout, style: Style) -> None:
    """A long rug in the middle of a hall."""
    rect = layout.room.rect
    is_along_x = rect.width_m > rect.depth_m
    length_m = min(2.6, max(rect.width_m, rect.depth_m) - 1.2)
    if length_m < 1.0:
        return
    layout.add(
        "rug",
        furnishing.rug,
        rect.center_m,
        yaw_deg=90.0 if is_along_x else 0.0,
        width_m=length_m,
        depth_m=0.68,
        seed=style.rugs[1],
    )


def _furnish_bath(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    wants_tub = rng.random() < 0.55
    basin_m = float(rng.choice([0.6, 0.8]))
    placed_tub = None
    if wants_tub:
        placed_tub = layout.stand(
            "bathtub", bathroom.bathtub, (0.76, 1.7, 0.6), front_m=0.3, first_m=0.0, in_corner=True
        )
    if placed_tub is None:
        layout.stand("shower", bathroom.shower, (0.92, 0.92, 2.15), front_m=0.4, first_m=0.0, in_corner=True)
    for width_m in (basin_m, 0.6):
        basin = layout.stand(
            "washbasin",
            bathroom.washbasin,
            (0.5, width_m + 0.08, 1.95),
            front_m=0.45,
            first_m=0.0,
            width_m=width_m,
            colour=one_of(rng, "#d8d6d0", "#5b6b5d", "#46586a"),
            tones=style.tones if rng.random() < 0.5 else "",
            mirror_m=(width_m, 0.75),
            support=WALL,
        )
        if basin is not None:
            break
    toilet = None
    for width_m, front_m in ((0.5, 0.4), (0.42, 0.25)):
        toilet = toilet or layout.stand(
            "toilet", bathroom.toilet, (0.58, width_m, 1.15), front_m=front_m, first_m=0.0, support=WALL
        )
    if toilet is not None:
        _, spot = toilet
        sign = 1 if rng.random() < 0.5 else -1
        body = spot.rect(0.02, 0.14, sign * 0.32 - 0.06, sign * 0.32 + 0.06)
        if layout.fits([body]):
            layout.add("brush", bathroom.toilet_brush, spot.at(0.08, sign * 0.32), yaw_deg=spot.yaw_deg)
            layout.take(body, 0.4)
    layout.hang("towel_rail", bathroom.towel_rail, (0.56, 1.2), middle_m=0.95, colour=one_of(rng, *BATH_CLOTHS))
    middle = layout.open_spot(0.5, 0.8)
    if middle is not None:
        layout.add(
            "bath_mat", bathroom.bath_mat, middle.at(0), yaw_deg=middle.yaw_deg, colour=one_of(rng, *BATH_CLOTHS)
        )
    if rng.random() < 0.2:
        layout.stand("bin", furniture.waste_bin, (0.26, 0.26, 0.32), back_m=0.12, front_m=0.0, in_corner=True,
                     width_m=0.22, height_m=0.28)  # fmt: skip


BATH_CLOTHS = ("#8fb3c7", "#d8c3a0", "#b4533a", "#8a9a7b", "#e6e1d6", "#6b4353", "#3d7a7c")

FURNISH: dict[str, Callable[[RoomLayout, Style], None]] = {
    "living": _furnish_living,
    "kitchen": _furnish_kitchen,
    "bedroom": _furnish_bedroom,
    "study": _furnish_study,
    "hall": _furnish_hall,
    "bath": _furnish_bath,
}
