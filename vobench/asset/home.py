"""Flats by seed: a floor plan, furnished by the use of each room, with surfaces that go together, in any daylight."""

from collections.abc import Callable, Sequence

import numpy as np

from vobench.asset import bathroom, bedroom, fitting, floor_plan, furniture, household, houseplant, kitchen
from vobench.asset.daylight import daylight, lamp_colour
from vobench.asset.floor_plan import SIDES, FloorPlan, Rect, Room, Side, Window, along_m
from vobench.asset.furniture import Part, wood
from vobench.asset.interior import (
    CEILING,
    GAP_M,
    SHELL,
    WALL,
    Interior,
    RoomFinish,
    RoomLayout,
    Spot,
    door_fittings,
    shell,
    without_excess,
    skirtings,
)
from vobench.asset.palette import HomeStyle, home_style
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at
from vobench.scene.light import AreaLight
from vobench.scene.mesh import moved

BOOK_SEEDS = 6
PANORAMAS = ("city", "city", "suburb", "country")
TABLE_M = 0.74
PIECE_FACES_PER_M2 = 740.0
OPTIONAL = ("sill_mug", "fruit", "bin", "socket", "mug", "sill_plant", "shoes", "keyboard", "plant", "picture")
POTS = ("", "", "#e6e2d8", "#3a3c3e", "#7f9182", "#46586a", "#c9a271")


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
        towards_deg=_outward_deg(plan, light_rng),
        height_m=float(light_rng.choice([1.2, 4.0, 7.0, 10.0, 16.0])),
        kinds=PANORAMAS,
    )
    lamp_rng = np.random.default_rng([seed, 4])
    door_fittings(plan, layouts, style.doors, panels=bool(rng.random() < 0.6))
    for layout in layouts.values():
        _dress_windows(layout, style)
        FURNISH[layout.room.use](layout, style)
        is_main = layout.room.use == "living"
        share = outside.lamp_share if any(plan.windows_of(layout.room)) else max(outside.lamp_share, 0.75)
        is_on = bool(lamp_rng.random() < share) or (is_main and outside.lamp_share > 0.8)
        _ceiling_lamp(layout, style, is_on=is_on)
        _small_lamps(layout, style, is_on=is_on and bool(lamp_rng.random() < 0.8))
        if layout.room.use != "bath":
            skirtings(layout)
    instances = tuple(shell(plan, finishes, thresholds=wood(style.tones)))
    placed = [piece for layout in layouts.values() for piece in layout.placed]
    pieces = without_excess(placed, round(PIECE_FACES_PER_M2 * plan.area_m2), OPTIONAL)
    lamps = [light for layout in layouts.values() for light in layout.lights]
    return Interior(plan, instances, pieces, (*lamps, *outside.lights))


def _outward_deg(plan: FloorPlan, rng: Rng) -> float:
    """The azimuth to which a window looks, mostly that of the largest room."""
    largest = max(plan.rooms, key=lambda room: room.rect.area_m2)
    windows = list(plan.windows_of(largest)) or list(plan.windows)
    if rng.random() < 0.3:
        windows = list(plan.windows)
    window = windows[int(rng.integers(len(windows)))]
    x, y = SIDES[plan.room(window.room).side_at(window.rect)]
    return float(np.rad2deg(np.arctan2(y, x)))


def _finish(rng: Rng, room: Room, style: HomeStyle) -> RoomFinish:
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


def _dress_windows(layout: RoomLayout, style: HomeStyle) -> None:
    """Add the frame, a radiator, and curtains or a blind to each window of a room."""
    for window in layout.plan.windows_of(layout.room):
        side = layout.room.side_at(window.rect)
        first_m, last_m = along_m(side, window.rect)
        spot = layout.spot(side, (first_m + last_m) / 2)
        width_m = last_m - first_m
        height_m = window.head_m - window.sill_m
        depth_m = min(window.rect.width_m, window.rect.depth_m)
        layout.add(
            "window_frame",
            fitting.window_frame,
            spot.at(0),
            (window.sill_m + window.head_m) / 2,
            yaw_deg=spot.yaw_deg,
            support=SHELL,
            width_m=width_m,
            height_m=height_m,
            depth_m=depth_m,
        )
        has_radiator = window.sill_m > 0.68 and layout.room.use != "bath"
        is_counter = layout.room.use == "kitchen"
        if has_radiator and not is_counter:
            _radiator(layout, style, spot, width_m, window.sill_m)
        if layout.room.use != "bath":
            _curtains(layout, style, spot, window, width_m)
        _on_sill(layout, spot, window, width_m, depth_m)


def _radiator(layout: RoomLayout, style: HomeStyle, spot: Spot, width_m: float, sill_m: float) -> None:
    height_m = float(np.clip(sill_m - 0.28, 0.4, 0.55))
    length_m = width_m - 0.12
    body = spot.body(0.16, length_m + 0.2)
    if not layout.fits([body]):
        return
    layout.add("radiator", fitting.panel_radiator, spot.at(0), yaw_deg=spot.yaw_deg, support=WALL, width_m=length_m, height_m=height_m)
    layout.take(body, height_m + 0.14)
    along = spot.y_m if spot.side in ("east", "west") else spot.x_m
    layout.take_wall(spot.side, along - length_m / 2 - 0.1, along + length_m / 2 + 0.1, 0.0, height_m + 0.14)


def _curtains(layout: RoomLayout, style: HomeStyle, spot: Spot, window: Window, width_m: float) -> None:
    along = spot.y_m if spot.side in ("east", "west") else spot.x_m
    first_m, last_m = layout.room.span_m(spot.side)
    curtain_m = 0.42
    reach_m = width_m / 2 + 0.1 + curtain_m / 2
    rod_m = window.head_m + 0.1
    has_space = along - reach_m > first_m + 0.05 and along + reach_m < last_m - 0.05
    is_tall_enough = rod_m + 0.06 < layout.plan.height_m
    if style.window_dressing == "curtains" and has_space and is_tall_enough and layout.room.use != "kitchen":
        is_long = window.sill_m < 0.5
        height_m = rod_m - 0.04 if is_long else rod_m - window.sill_m + 0.12
        for sign in (-1, 1):
            layout.add(
                "curtain",
                fitting.curtain,
                spot.at(0.01, sign * (width_m / 2 + 0.1)),
                rod_m - 0.012,
                yaw_deg=spot.yaw_deg,
                support=SHELL,
                width_m=curtain_m,
                height_m=height_m,
                colour=style.curtain,
                columns=19,
            )
        layout.add(
            "rod",
            fitting.pipe,
            spot.at(-0.02),
            rod_m,
            yaw_deg=spot.yaw_deg,
            support=SHELL,
            length_m=2 * reach_m + 0.1,
            radius_m=0.012,
            colour="#3d4144",
        )
        low_m = 0.02 if is_long else window.sill_m - 0.16
        layout.take_wall(spot.side, along - reach_m - 0.06, along + reach_m + 0.06, low_m, rod_m + 0.06)
        if is_long:
            for sign in (-1, 1):
                y = sign * (width_m / 2 + 0.1)
                layout.take(spot.rect(0, 0.12, y - curtain_m / 2, y + curtain_m / 2), rod_m)
    elif style.window_dressing == "blinds":
        depth_m = min(window.rect.width_m, window.rect.depth_m)
        drop_m = float(layout.rng.uniform(0.15, 0.8)) * (window.head_m - window.sill_m)
        layout.add(
            "blind",
            fitting.blind,
            spot.at(0.04 - depth_m / 2),
            window.head_m - 0.02,
            yaw_deg=spot.yaw_deg,
            support=SHELL,
            width_m=width_m - 0.04,
            drop_m=max(drop_m, 0.12),
        )


def _on_sill(layout: RoomLayout, spot: Spot, window: Window, width_m: float, depth_m: float) -> None:
    """Mostly a plant or a few books on a window sill."""
    if window.sill_m < 0.6 or layout.rng.random() < 0.6:
        return
    z_m = window.sill_m + 0.002
    y = float(layout.rng.uniform(-0.32, 0.32)) * width_m
    x = 0.05 - depth_m / 2
    if layout.rng.random() < 0.75:
        height_m = float(layout.rng.uniform(0.2, 0.3))
        layout.add(
            "sill_plant",
            houseplant.houseplant,
            spot.at(x, y),
            z_m,
            support=SHELL,
            height_m=height_m,
            habit=one_of(layout.rng, *houseplant.HABITS),
            pot=one_of(layout.rng, *POTS),
        )
    else:
        layout.add("sill_mug", furniture.mug, spot.at(x, y), z_m, support=SHELL)


def _ceiling_lamp(layout: RoomLayout, style: HomeStyle, *, is_on: bool) -> None:
    """A pendant over the dining table, else a dome or a pendant at the middle of the ceiling."""
    rng = layout.rng
    colour = lamp_colour(style.lamp_k)
    height_m = layout.plan.height_m
    area_m2 = layout.room.rect.area_m2
    power_lm = float(np.clip(95 * area_m2, 700, 3000)) * float(rng.uniform(0.85, 1.2))
    x_m, y_m = layout.room.rect.center_m
    table = next((piece for piece in layout.placed if ".dining_table_" in piece.name), None)
    if table is not None:
        corners = np.concatenate([part.arrays.vertices_m for part in table.parts])
        x_m, y_m = ((corners.min(axis=0) + corners.max(axis=0)) / 2)[:2].tolist()
    hangs = table is not None or (layout.room.use in ("living", "bedroom", "study") and rng.random() < 0.45)
    if hangs:
        low_m = 1.55 if table is not None else 2.05
        wide_m = float(rng.choice([0.36, 0.46, 0.56]))
        shade = one_of(rng, "#2c4a4a", "#27445c", "#262b30", "#c9c4b8", "#b4533a", "#5c6b5a", "#d8c3a0")
        layout.add(
            "pendant",
            household.pendant,
            (x_m, y_m),
            height_m,
            support=CEILING,
            drop_m=height_m - low_m,
            colour=shade,
            wide_m=wide_m,
            sections=22,
        )
        bulb = household.bulb(x_m, y_m, low_m + 0.07, 0.12)
        layout.lamp("lamp", bulb, power_lm, is_on=is_on, colour=colour)
        return
    base, dome = household.ceiling_dome(float(rng.choice([0.3, 0.4, 0.5])))
    layout.add("lamp_base", lambda _: base, (x_m, y_m), height_m, support=CEILING)
    layout.lamp("lamp", moved(dome, at(x_m, y_m, height_m)), power_lm, is_on=is_on, colour=colour)


def _small_lamps(layout: RoomLayout, style: HomeStyle, *, is_on: bool) -> None:
    """The bulbs of floor lamps and table lamps, of which at most two shine."""
    colour = lamp_colour(style.lamp_k)
    number = 0
    for piece in list(layout.placed):
        is_lamp = ".floor_lamp_" in piece.name or ".table_lamp_" in piece.name
        if not is_lamp:
            continue
        corners = np.concatenate([part.arrays.vertices_m for part in piece.parts])
        low_m = corners.min(axis=0)
        high_m = corners.max(axis=0)
        x_m, y_m = ((low_m + high_m) / 2)[:2].tolist()
        is_tall = ".floor_lamp_" in piece.name
        bulb = household.bulb(x_m, y_m, float(high_m[2]) - 0.15, 0.1)
        power_lm = 900.0 if is_tall else 420.0
        layout.lamp("small_lamp", bulb, power_lm, is_on=is_on and number < 2, colour=colour)
        number += 1


# --- What many rooms have ---

Item = tuple[str, Callable[..., list[Part]], float, dict[str, object]]


def _items(layout: RoomLayout) -> dict[str, Item]:
    """Things that lie on surfaces: a name, what makes them, half of their width, and their size."""
    rng = layout.rng
    return {
        "mug": ("mug", furniture.mug, 0.08, {}),
        "books": (
            "books",
            furniture.book_stack,
            0.19,
            {"count": int(rng.integers(2, 6)), "seed": layout.seed % BOOK_SEEDS},
        ),
        "papers": ("papers", furniture.papers, 0.25, {"count": int(rng.integers(1, 4)), "spread_m": 0.03}),
        "plant": (
            "plant",
            houseplant.houseplant,
            0.17,
            {
                "height_m": float(rng.uniform(0.26, 0.36)),
                "habit": one_of(rng, *houseplant.HABITS),
                "pot": one_of(rng, *POTS),
            },
        ),
        "fruit": ("fruit", household.fruit_bowl, 0.16, {}),
        "pens": ("pens", furniture.pens, 0.06, {}),
        "bottle": ("bottle", lambda _: kitchen.bottle(), 0.05, {}),
        "box": ("box", furniture.carton, 0.16, {"size_m": (0.2, 0.28, 0.14), "seed": int(rng.integers(4))}),
        "lamp": (
            "table_lamp",
            household.floor_lamp,
            0.15,
            {
                "height_m": float(rng.uniform(0.42, 0.55)),
                "wide_m": 0.26,
                "colour": one_of(rng, "#c9b48c", "#d8c3a0", "#a7b3bc"),
            },
        ),
    }


def _scatter(
    layout: RoomLayout,
    parent: str,
    spot: Spot,
    x_m: float,
    width_m: float,
    z_m: float,
    names: Sequence[str],
) -> None:
    """Put things in a row on a surface that is centred at y = 0 of a spot, in random order."""
    rng = layout.rng
    items = _items(layout)
    chosen = [items[names[k]] for k in rng.permutation(len(names)).tolist()]
    needed_m = 0.0
    fitting_items = list[Item]()
    for item in chosen:
        if needed_m + 2 * item[2] <= width_m:
            fitting_items.append(item)
            needed_m += 2 * item[2]
    if not fitting_items:
        return
    spare_m = (width_m - needed_m) / (len(fitting_items) + 1)
    y = -width_m / 2
    for kind, make, half_m, size in fitting_items:
        y += half_m + spare_m * float(rng.uniform(0.5, 1.5))
        y = min(y, width_m / 2 - half_m)
        turn_deg = spot.yaw_deg + (90.0 if kind in ("books", "papers") else 0.0) + float(rng.normal(0, 9))
        layout.add(kind, make, spot.at(x_m, y), z_m, yaw_deg=turn_deg, support=parent, **size)
        y += half_m


def _pictures(layout: RoomLayout, style: HomeStyle, count: int, above: Sequence[Spot | None] = ()) -> None:
    """Hang pictures above pieces of furniture, and a few elsewhere."""
    rng = layout.rng
    places = [spot for spot in above if spot is not None]
    spots: list[Spot | None] = [*places, *([None] * count)]
    for spot in spots[: count + 1]:
        is_wide = rng.random() < 0.5
        width_m, height_m = ((0.9, 0.6), (1.1, 0.8), (0.7, 0.5))[int(rng.integers(3))]
        if not is_wide:
            width_m, height_m = ((0.5, 0.7), (0.42, 0.6), (0.6, 0.85))[int(rng.integers(3))]
        middle_m = float(rng.uniform(1.5, 1.68))
        if spot is not None:
            middle_m = max(middle_m, 1.02 + height_m / 2)
        layout.hang(
            "picture",
            fitting.framed,
            (width_m, height_m),
            middle_m=middle_m,
            above=spot,
            style=one_of(rng, "hills", "circles"),
            seed=style.prints[int(rng.integers(len(style.prints)))],
            width_m=width_m,
            height_m=height_m,
            frame=style.frame,
        )


def _plant(layout: RoomLayout) -> None:
    """A plant on the floor, in a corner if one is free."""
    height_m = float(layout.rng.uniform(0.7, 1.6))
    side_m = 0.72 * height_m
    spot = next(layout.spots(side_m, side_m, height_m, front_m=0.0, in_corner=True), None)
    if spot is None:
        return
    layout.add(
        "plant",
        houseplant.houseplant,
        spot.at(GAP_M + side_m / 2),
        yaw_deg=float(layout.rng.uniform(0, 360)),
        height_m=height_m,
        habit=one_of(layout.rng, "broad", "upright", "tree"),
        pot=one_of(layout.rng, *POTS),
    )
    layout.take(spot.body(side_m, side_m, GAP_M), height_m)


def _shelf(layout: RoomLayout, style: HomeStyle, widths_m: Sequence[float] = (0.8, 1.0, 1.6)) -> Spot | None:
    width_m = float(layout.rng.choice(widths_m))
    height_m = float(layout.rng.choice([1.1, 1.8, 2.1]))
    stood = layout.stand(
        "shelf",
        furniture.shelf,
        (0.32, width_m, height_m),
        back_m=0.155,
        front_m=0.5,
        width_m=width_m,
        height_m=height_m,
        tones=style.second_tones,
        seed=layout.seed % BOOK_SEEDS,
    )
    if stood is None:
        return None
    name, spot = stood
    if height_m < 1.2:
        _scatter(layout, name, spot, GAP_M + 0.14, width_m - 0.1, height_m + 0.004, ("plant", "box", "books"))
    return spot


def _sideboard(layout: RoomLayout, style: HomeStyle) -> Spot | None:
    """A chest at a wall with a lamp and other things on it."""
    width_m = float(layout.rng.choice([1.1, 1.3, 1.6]))
    height_m = float(layout.rng.choice([0.7, 0.8, 0.92]))
    stood = layout.stand(
        "sideboard",
        household.low_board,
        (0.46, width_m, height_m),
        back_m=0.216,
        width_m=width_m,
        height_m=height_m,
        tones=style.second_tones,
    )
    if stood is None:
        return None
    name, spot = stood
    names = ("lamp", "books", "plant", "box", "mug")
    chosen = names[: int(layout.rng.integers(2, 5))]
    _scatter(layout, name, spot, GAP_M + 0.22, width_m - 0.1, height_m, chosen)
    return spot


def _dining(layout: RoomLayout, style: HomeStyle, seats: int) -> bool:
    """A table with chairs at both of its sides, things on it."""
    rng = layout.rng
    width_m = {2: 0.85, 4: 1.35, 6: 1.85}[seats]
    depth_m = 0.78 if seats < 6 else 0.9
    pulled_m = 0.42
    spot = layout.open_spot(depth_m + 2 * pulled_m, width_m)
    if spot is None:
        return False
    name = layout.add(
        "dining_table",
        household.table,
        spot.at(0),
        yaw_deg=spot.yaw_deg,
        width_m=width_m,
        depth_m=depth_m,
        tones=style.tones,
    )
    layout.take(spot.rect(-depth_m / 2 - pulled_m, depth_m / 2 + pulled_m, -width_m / 2, width_m / 2), TABLE_M)
    along = seats // 2
    for sign in (-1, 1):
        for k in range(along):
            y = ((k + 0.5) / along - 0.5) * width_m
            x = sign * (depth_m / 2 + float(rng.uniform(0.02, 0.1)))
            turn_deg = (180.0 if sign > 0 else 0.0) + float(rng.normal(0, 4))
            layout.add(
                "dining_chair",
                household.slat_chair if style.has_slat_chairs else household.dining_chair,
                spot.at(x, y),
                0.003,
                yaw_deg=spot.yaw_deg + turn_deg,
                beside=(name,),
                colour=style.cloths[2],
                tones=style.tones,
            )
    names = ("mug", "papers", "bottle", "plant", "books")
    if rng.random() < 0.3:
        names = (*names[:4], "fruit")
    chosen = [names[k] for k in rng.permutation(len(names)).tolist()][: int(rng.integers(1, 4))]
    _scatter(layout, name, spot, 0.0, width_m - 0.2, TABLE_M, chosen)
    return True


def _desk(layout: RoomLayout, style: HomeStyle) -> Spot | None:
    """A desk at a wall with a chair, a computer or books, and a lamp."""
    rng = layout.rng
    width_m = float(rng.choice([1.4, 1.6]))
    depth_m = 0.7
    chair_m = 0.62
    stood = layout.stand(
        "desk",
        furniture.desk,
        (depth_m + chair_m, width_m, TABLE_M),
        back_m=depth_m / 2,
        front_m=0.2,
        width_m=width_m,
        depth_m=depth_m,
        tones=style.second_tones,
    )
    if stood is None:
        return None
    name, spot = stood
    layout.add(
        "chair",
        furniture.chair,
        spot.at(GAP_M + depth_m + 0.24, float(rng.normal(0, 0.06))),
        yaw_deg=spot.yaw_deg + 180 + float(rng.normal(0, 22)),
        beside=(name,),
        colour=style.cloths[3],
    )
    y = float(rng.uniform(-0.08, 0.02))
    layout.add(
        "monitor",
        furniture.monitor,
        spot.at(GAP_M + 0.2, y),
        TABLE_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 5)),
        support=name,
        width_m=0.5,
        seed=int(rng.integers(6)),
    )
    layout.add(
        "keyboard",
        furniture.keyboard,
        spot.at(GAP_M + 0.48, y),
        TABLE_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 3)),
        support=name,
    )
    if rng.random() < 0.6:
        layout.add(
            "desk_lamp",
            furniture.desk_lamp,
            spot.at(GAP_M + 0.14, width_m / 2 - 0.12),
            TABLE_M,
            yaw_deg=spot.yaw_deg,
            support=name,
            colour=one_of(rng, "#3d7a7c", "#d39a3c", "#b4533a", "#262b30"),
        )
    left = one_of(rng, "mug", "pens", "books" if width_m > 1.5 else "mug")
    kind, make, half_m, size = _items(layout)[left]
    layout.add(
        kind, make, spot.at(GAP_M + 0.3, -width_m / 2 + half_m + 0.04), TABLE_M,
        yaw_deg=spot.yaw_deg + 90, support=name, **size,
    )  # fmt: skip
    return spot


def _floor_lamp(layout: RoomLayout) -> None:
    layout.stand(
        "floor_lamp",
        household.floor_lamp,
        (0.44, 0.44, 1.7),
        back_m=0.22,
        front_m=0.0,
        in_corner=True,
        height_m=float(layout.rng.uniform(1.45, 1.68)),
        colour=one_of(layout.rng, "#d8c3a0", "#e6e1d6", "#a7b3bc", "#c9a271"),
    )


def _sockets(layout: RoomLayout, count: int) -> None:
    for _ in range(count):
        plugs = int(layout.rng.integers(1, 3))
        layout.hang("socket", fitting.socket, (0.16, 0.09), middle_m=0.3, count=plugs)


# --- Rooms by use ---


def _furnish_living(layout: RoomLayout, style: HomeStyle) -> None:
    rng = layout.rng
    area_m2 = layout.room.rect.area_m2
    has_kitchen_table = any(room.use == "kitchen" and room.rect.area_m2 > 9 for room in layout.plan.rooms)
    board_spot, sofa_spot = _television_corner(layout, style)
    wants_table = area_m2 > 18 and (not has_kitchen_table or area_m2 > 24 or rng.random() < 0.4)
    if wants_table:
        _dining(layout, style, 6 if area_m2 > 26 and rng.random() < 0.6 else 4)
    sideboard = _sideboard(layout, style) if rng.random() < 0.8 else None
    _shelf(layout, style)
    if rng.random() < 0.3:
        _shelf(layout, style)
    if rng.random() < 0.6:
        _floor_lamp(layout)
    has_bed = not any(room.use == "bedroom" for room in layout.plan.rooms)
    if has_bed:
        _bed(layout, style, (1.2, 1.4))
    if rng.random() < 0.4:
        _desk(layout, style)
    if rng.random() < 0.5:
        _armchair(layout, style)
    for _ in range(int(rng.integers(1, 3))):
        _plant(layout)
    _pictures(layout, style, int(rng.integers(1, 4)), [sofa_spot, sideboard])
    _sockets(layout, 1)
    del board_spot


def _television_corner(layout: RoomLayout, style: HomeStyle) -> tuple[Spot | None, Spot | None]:
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
    from vobench.asset.interior import _Span

    return layout.is_wall_free(spot.side, _Span(along - width_m / 2, along + width_m / 2, 0.0, 0.75))


def _add_television(layout: RoomLayout, style: HomeStyle, spot: Spot, board_m: float) -> None:
    rng = layout.rng
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
        household.television,
        spot.at(GAP_M + 0.2),
        0.46,
        yaw_deg=spot.yaw_deg,
        support=board,
        width_m=screen_m,
        seed=style.rugs[0],
    )


def _add_coffee_table(
    layout: RoomLayout, style: HomeStyle, spot: Spot, x_m: float, table_m: tuple[float, float]
) -> None:
    rng = layout.rng
    has_rug = rng.random() < 0.75
    if has_rug:
        layout.add(
            "rug",
            household.rug,
            spot.at(x_m),
            yaw_deg=spot.yaw_deg,
            width_m=float(rng.uniform(1.9, 2.4)),
            depth_m=float(rng.uniform(1.3, 1.6)),
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
    _scatter(layout, table, spot, x_m, table_m[1] - 0.1, top_m, chosen)


def _armchair(layout: RoomLayout, style: HomeStyle) -> None:
    spot = next(layout.spots(0.96, 0.96, 0.9, front_m=0.5, in_corner=True), None)
    if spot is None:
        return
    x_m, y_m = spot.at(GAP_M + 0.47)
    middle_x, middle_y = layout.room.rect.center_m
    towards_deg = float(np.rad2deg(np.arctan2(middle_y - y_m, middle_x - x_m)))
    difference = (towards_deg - spot.yaw_deg + 180) % 360 - 180
    turn_deg = float(np.clip(difference, -20, 20))
    layout.add(
        "armchair",
        bedroom.armchair,
        (x_m, y_m),
        yaw_deg=spot.yaw_deg + turn_deg,
        colour=style.cloths[1],
        tones=style.tones,
    )
    layout.take(spot.body(0.96, 0.96, GAP_M), 0.9)


def _furnish_kitchen(layout: RoomLayout, style: HomeStyle) -> None:
    rng = layout.rng
    row = _kitchen_row(layout, style)
    area_m2 = layout.room.rect.area_m2
    if row is not None:
        seats = 4 if area_m2 > 10.5 else 2
        has_table = _dining(layout, style, seats) or _dining(layout, style, 2)
        del has_table
    if rng.random() < 0.25:
        layout.stand("bin", furniture.waste_bin, (0.32, 0.32, 0.42), back_m=0.16, front_m=0.0, in_corner=True,
                     width_m=0.28, height_m=0.38)  # fmt: skip
    if rng.random() < 0.35:
        _plant(layout)
    _pictures(layout, style, int(rng.integers(1, 3)))
    _sockets(layout, 1)


def _kitchen_row(layout: RoomLayout, style: HomeStyle) -> Spot | None:
    """A row of units along the wall where the longest one fits; the worktop may pass below a window."""
    for length_m in (3.6, 3.3, 3.0, 2.7, 2.4):
        for side_index in layout.rng.permutation(4).tolist():
            side: Side = tuple(SIDES)[side_index]
            first_m, last_m = layout.room.span_m(side)
            if last_m - first_m < length_m + 0.02:
                continue
            for along in (first_m + length_m / 2 + 0.01, last_m - length_m / 2 - 0.01):
                spot = layout.spot(side, along)
                if _fits_row(layout, spot, along, length_m):
                    return _add_row(layout, style, spot, along, length_m)
    return None


def _windows_behind(layout: RoomLayout, spot: Spot, along: float, length_m: float) -> list[tuple[float, float]]:
    """The windows, from first to last coordinate, in the wall behind a row."""
    spans = []
    for window in layout.plan.windows_of(layout.room):
        first_m, last_m = along_m(spot.side, window.rect)
        is_behind = first_m < along + length_m / 2 and last_m > along - length_m / 2
        if layout.room.side_at(window.rect) == spot.side and is_behind:
            spans.append((first_m, last_m))
    return spans


def _fits_row(layout: RoomLayout, spot: Spot, along: float, length_m: float) -> bool:
    from vobench.asset.interior import _Span

    windows = _windows_behind(layout, spot, along, length_m)
    height_m = 0.92 if windows else 2.2
    span = _Span(along - length_m / 2, along + length_m / 2, 0.0, height_m)
    # The fridge and its end of the row must not stand before a window.
    is_clear = all(
        first - (along - length_m / 2) > 0.66 and along + length_m / 2 - last > 0.66 for first, last in windows
    )
    body = spot.body(kitchen.ROW_DEPTH_M, length_m, 0.0)
    front = spot.body(0.7, length_m, kitchen.ROW_DEPTH_M)
    return is_clear and layout.is_wall_free(spot.side, span) and layout.fits([body], [front])


def _add_row(layout: RoomLayout, style: HomeStyle, spot: Spot, along: float, length_m: float) -> Spot:
    windows = _windows_behind(layout, spot, along, length_m)
    window = None
    if windows:
        first_m = min(first for first, _ in windows) - along
        last_m = max(last for _, last in windows) - along
        sign = _sign_along(spot)
        window = (min(sign * first_m, sign * last_m), max(sign * first_m, sign * last_m))
    layout.add(
        "kitchen_row",
        kitchen.row,
        spot.at(0.002),
        yaw_deg=spot.yaw_deg,
        length_m=length_m,
        ceiling_m=layout.plan.height_m,
        style=style.kitchen,
        window=window,
    )
    layout.take(spot.body(kitchen.ROW_DEPTH_M + 0.03, length_m, 0.0), 2.2)
    layout.take_wall(spot.side, along - length_m / 2, along + length_m / 2, 0.0, 2.2)
    return spot


def _sign_along(spot: Spot) -> int:
    """Whether y of a spot runs along the coordinate of its wall (1) or against it (-1)."""
    x_m, y_m = spot.at(0, 1)
    step_m = y_m - spot.y_m if spot.side in ("east", "west") else x_m - spot.x_m
    return 1 if step_m > 0 else -1


def _bed(layout: RoomLayout, style: HomeStyle, widths_m: Sequence[float]) -> Spot | None:
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


def _bedside(layout: RoomLayout, style: HomeStyle, spot: Spot, y: float, body: Rect) -> None:
    name = layout.add(
        "bedside_table",
        bedroom.bedside_table,
        spot.at(GAP_M, y),
        yaw_deg=spot.yaw_deg,
        tones=style.tones,
    )
    layout.take(body, 0.5)
    _scatter(layout, name, Spot(*spot.at(0, y), spot.yaw_deg, spot.side), GAP_M + 0.2, 0.42, 0.5, ("lamp", "mug"))


def _furnish_bedroom(layout: RoomLayout, style: HomeStyle) -> None:
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
        _sideboard(layout, style)
    if rng.random() < 0.45:
        _desk(layout, style)
    if rng.random() < 0.4:
        _shelf(layout, style, (0.8, 1.0))
    if rng.random() < 0.3:
        _armchair(layout, style)
    if rng.random() < 0.5:
        _loose_rug(layout, style)
    if rng.random() < 0.6:
        _plant(layout)
    if rng.random() < 0.4:
        layout.hang("mirror", fitting.framed, (0.5, 1.4), middle_m=1.05, style="mirror", width_m=0.5, height_m=1.4)
    _pictures(layout, style, int(rng.integers(1, 3)), [bed])
    _sockets(layout, 1)


def _loose_rug(layout: RoomLayout, style: HomeStyle) -> None:
    """A rug where the floor is free."""
    rng = layout.rng
    width_m = float(rng.uniform(1.2, 1.7))
    depth_m = float(rng.uniform(0.7, 1.1))
    spot = layout.open_spot(depth_m, width_m)
    if spot is not None:
        layout.add(
            "rug",
            household.rug,
            spot.at(0),
            yaw_deg=spot.yaw_deg,
            width_m=width_m,
            depth_m=depth_m,
            seed=style.rugs[1],
        )


def _furnish_study(layout: RoomLayout, style: HomeStyle) -> None:
    rng = layout.rng
    desk = _desk(layout, style)
    for _ in range(int(rng.integers(1, 3))):
        _shelf(layout, style)
    if rng.random() < 0.5:
        _armchair(layout, style)
    if rng.random() < 0.35 and layout.room.rect.area_m2 > 8:
        layout.stand("sofa", household.couch, (0.92, 1.7, 0.8), back_m=0.46, width_m=1.7, colour=style.cloths[1])
    if rng.random() < 0.4:
        _sideboard(layout, style)
    if rng.random() < 0.4:
        _floor_lamp(layout)
    if rng.random() < 0.5:
        _cartons(layout)
    _plant(layout)
    if rng.random() < 0.5:
        layout.hang(
            "noticeboard", fitting.noticeboard, (0.95, 0.65), above=desk, middle_m=1.62, width_m=0.9, height_m=0.6
        )
    _pictures(layout, style, int(rng.integers(1, 3)))
    _sockets(layout, 1)


def _cartons(layout: RoomLayout) -> None:
    """Two cartons, one on the other."""
    stood = layout.stand(
        "carton",
        furniture.carton,
        (0.42, 0.5, 0.3),
        back_m=0.2,
        front_m=0.0,
        in_corner=True,
        seed=int(layout.rng.integers(4)),
    )
    if stood is not None:
        name, spot = stood
        layout.add(
            "carton",
            furniture.carton,
            spot.at(GAP_M + 0.2),
            0.3,
            yaw_deg=spot.yaw_deg + float(layout.rng.normal(0, 8)),
            support=name,
            size_m=(0.28, 0.36, 0.22),
            seed=int(layout.rng.integers(4)),
        )


def _furnish_hall(layout: RoomLayout, style: HomeStyle) -> None:
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
        _scatter(
            layout, name, spot, GAP_M + 0.14, width_m - 0.12, 0.87, ("box", "mug", "plant")[: int(rng.integers(1, 4))]
        )
    if spot is not None and rng.random() < 0.6:
        layout.hang(
            "mirror", fitting.framed, (0.55, 0.75), middle_m=1.6, above=spot, style="mirror", width_m=0.5, height_m=0.7
        )
    rack_m = float(rng.choice([0.7, 0.9, 1.1]))
    rack = layout.hang(
        "coat_rack", bedroom.coat_rack, (rack_m + 0.24, 1.3), middle_m=1.22, width_m=rack_m, tones=style.tones
    )
    if rack is not None:
        for _ in range(int(rng.integers(0, 3))):
            y = float(rng.uniform(-0.3, 0.3)) * rack_m
            body = rack.rect(0.02, 0.36, y - 0.13, y + 0.13)
            if layout.fits([body]):
                turn_deg = rack.yaw_deg + float(rng.normal(0, 8))
                layout.add("shoes", bedroom.shoes, rack.at(0.05, y), yaw_deg=turn_deg)
                layout.take(body, 0.12)
    if rng.random() < 0.45:
        _runner(layout, style)
    if layout.room.rect.depth_m > 1.7 and layout.room.rect.width_m > 1.7:
        if rng.random() < 0.6:
            layout.stand(
                "wardrobe", bedroom.wardrobe, (0.66, 1.02, 2.34), front_m=0.5, in_corner=True, width_m=1.0,
                colour="#e4e0d6" if style.is_painted else "", tones=style.tones,
            )  # fmt: skip
        if rng.random() < 0.5:
            _shelf(layout, style, (0.8, 1.0))
        if rng.random() < 0.5:
            _plant(layout)
    _pictures(layout, style, int(rng.integers(1, 3)))
    _sockets(layout, 1)


def _runner(layout: RoomLayout, style: HomeStyle) -> None:
    """A long rug in the middle of a hall."""
    rect = layout.room.rect
    is_along_x = rect.width_m > rect.depth_m
    length_m = min(2.6, max(rect.width_m, rect.depth_m) - 1.2)
    if length_m < 1.0:
        return
    layout.add(
        "rug",
        household.rug,
        rect.center_m,
        yaw_deg=90.0 if is_along_x else 0.0,
        width_m=length_m,
        depth_m=0.68,
        seed=style.rugs[1],
    )


def _furnish_bath(layout: RoomLayout, style: HomeStyle) -> None:
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
    toilet = layout.stand("toilet", bathroom.toilet, (0.62, 0.5, 1.15), front_m=0.4, first_m=0.0, support=WALL)
    if toilet is not None:
        _, spot = toilet
        sign = 1 if rng.random() < 0.5 else -1
        body = spot.rect(0.02, 0.14, sign * 0.32 - 0.06, sign * 0.32 + 0.06)
        if layout.fits([body]):
            layout.add("brush", bathroom.toilet_brush, spot.at(0.08, sign * 0.32), yaw_deg=spot.yaw_deg)
            layout.take(body, 0.4)
    layout.hang("towel_rail", bathroom.towel_rail, (0.56, 1.2), middle_m=0.95, colour=one_of(rng, *BATH_CLOTHS))
    spot = layout.open_spot(0.5, 0.8)
    if spot is not None:
        layout.add("bath_mat", bathroom.bath_mat, spot.at(0), yaw_deg=spot.yaw_deg, colour=one_of(rng, *BATH_CLOTHS))
    if rng.random() < 0.2:
        layout.stand("bin", furniture.waste_bin, (0.26, 0.26, 0.32), back_m=0.12, front_m=0.0, in_corner=True,
                     width_m=0.22, height_m=0.28)  # fmt: skip


BATH_CLOTHS = ("#8fb3c7", "#d8c3a0", "#b4533a", "#8a9a7b", "#e6e1d6", "#6b4353", "#3d7a7c")

FURNISH: dict[str, Callable[[RoomLayout, HomeStyle], None]] = {
    "living": _furnish_living,
    "kitchen": _furnish_kitchen,
    "bedroom": _furnish_bedroom,
    "study": _furnish_study,
    "hall": _furnish_hall,
    "bath": _furnish_bath,
}
