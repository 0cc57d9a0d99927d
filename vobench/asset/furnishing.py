"""Furniture that many rooms have, placed by rules: what belongs to windows, desks, tables, shelves, kitchens."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vobench.asset import bedroom, fitting, furniture, household, houseplant, kitchen, office
from vobench.asset.daylight import lamp_colour
from vobench.asset.floor_plan import SIDES, FloorPlan, Rect, Side, Window, along_m
from vobench.asset.furniture import DARK, Part, cloth, coated, put, stood
from vobench.asset.palette import Style
from vobench.asset.picture import Rng, one_of
from vobench.asset.room_layout import GAP_M, SHELL, WALL, RoomLayout, Span, Spot, corners_of
from vobench.asset.shape import tube

BOOK_SEEDS = 6
TABLE_M = 0.74
POTS = ("", "", "#e6e2d8", "#3a3c3e", "#7f9182", "#46586a", "#c9a271")

Item = tuple[str, Callable[..., list[Part]], float, dict[str, Any]]


def outward_deg(plan: FloorPlan, rng: Rng) -> float:
    """The azimuth to which a window looks, mostly that of the largest room."""
    largest = max(plan.rooms, key=lambda room: room.rect.area_m2)
    windows = list(plan.windows_of(largest)) or list(plan.windows)
    if rng.random() < 0.3:
        windows = list(plan.windows)
    window = windows[int(rng.integers(len(windows)))]
    x, y = SIDES[plan.room(window.room).side_at(window.rect)]
    return float(np.rad2deg(np.arctan2(y, x)))


def dress_windows(layout: RoomLayout, style: Style) -> None:
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
            _radiator(layout, spot, width_m, window.sill_m)
        if layout.room.use != "bath":
            _curtains(layout, style, spot, window, width_m)
        _on_sill(layout, spot, window, width_m, depth_m)


def _radiator(layout: RoomLayout, spot: Spot, width_m: float, sill_m: float) -> None:
    height_m = float(np.clip(sill_m - 0.28, 0.4, 0.55))
    length_m = width_m - 0.12
    body = spot.body(0.16, length_m + 0.2)
    if not layout.fits([body]):
        return
    layout.add(
        "radiator",
        fitting.panel_radiator,
        spot.at(0),
        yaw_deg=spot.yaw_deg,
        support=WALL,
        width_m=length_m,
        height_m=height_m,
    )
    layout.take(body, height_m + 0.14)
    along = spot.along_m
    layout.take_wall(spot.side, along - length_m / 2 - 0.1, along + length_m / 2 + 0.1, 0.0, height_m + 0.14)


def _curtains(layout: RoomLayout, style: Style, spot: Spot, window: Window, width_m: float) -> None:
    along = spot.along_m
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
            _rod,
            spot.at(0.06),
            rod_m,
            yaw_deg=spot.yaw_deg,
            support=SHELL,
            length_m=2 * reach_m + 0.1,
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


def middle_of_floor(layout: RoomLayout) -> tuple[float, float]:
    """The middle (x, y) of a room, or of what a row of kitchen units leaves of it."""
    rect = layout.room.rect
    row = next((piece for piece in layout.placed if ".kitchen_row_" in piece.name), None)
    if row is None:
        return rect.center_m
    corners = corners_of(row.parts)
    low_x, low_y, _ = corners.min(axis=0).tolist()
    high_x, high_y, _ = corners.max(axis=0).tolist()
    # What is left is the largest of the four rectangles beside the row.
    beside = [
        Rect(rect.x0, rect.y0, low_x, rect.y1),
        Rect(high_x, rect.y0, rect.x1, rect.y1),
        Rect(rect.x0, rect.y0, rect.x1, low_y),
        Rect(rect.x0, high_y, rect.x1, rect.y1),
    ]
    return max(beside, key=lambda left: max(left.width_m, 0) * max(left.depth_m, 0)).center_m


def small_lamps(layout: RoomLayout, style: Style, *, is_on: bool) -> None:
    """Light from the shades of at most two floor lamps and table lamps."""
    colour = lamp_colour(style.lamp_k)
    number = 0
    for piece in list(layout.placed):
        is_lamp = ".floor_lamp_" in piece.name or ".table_lamp_" in piece.name
        if not is_lamp:
            continue
        corners = corners_of(piece.parts)
        low_m = corners.min(axis=0)
        high_m = corners.max(axis=0)
        x_m, y_m = ((low_m + high_m) / 2)[:2].tolist()
        is_shining = is_on and number < 2
        if is_shining:
            shade = household.glowing_shade(x_m, y_m, float(high_m[2]), float(high_m[0] - low_m[0]))
            power_lm = 550.0 if ".floor_lamp_" in piece.name else 280.0
            layout.lamp("small_lamp", shade, power_lm, is_on=True, colour=colour)
        number += 1


def items(layout: RoomLayout) -> dict[str, Item]:
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


def scatter(
    layout: RoomLayout,
    parent: str,
    spot: Spot,
    names: Sequence[str],
    *,
    x_m: float,
    width_m: float,
    z_m: float,
) -> None:
    """Put things in a row on a surface that is centred at y = 0 of a spot, in random order."""
    rng = layout.rng
    available = items(layout)
    chosen = [available[names[k]] for k in rng.permutation(len(names)).tolist()]
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


def pictures(layout: RoomLayout, style: Style, count: int, above: Sequence[Spot | None] = ()) -> None:
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
            framed_print,
            (width_m, height_m),
            middle_m=middle_m,
            above=spot,
            style=one_of(rng, "hills", "circles"),
            seed=style.prints[int(rng.integers(len(style.prints)))],
            width_m=width_m,
            height_m=height_m,
            frame=style.frame,
        )


def floor_plant(layout: RoomLayout) -> None:
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


def shelf(layout: RoomLayout, style: Style, widths_m: Sequence[float] = (0.8, 1.0, 1.6)) -> Spot | None:
    """A bookcase at a wall, of a height that leaves it free or not for things on top."""
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
        scatter(
            layout, name, spot, ("plant", "box", "books"), x_m=GAP_M + 0.14, width_m=width_m - 0.1, z_m=height_m + 0.004
        )
    return spot


def sideboard(layout: RoomLayout, style: Style) -> Spot | None:
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
    scatter(layout, name, spot, chosen, x_m=GAP_M + 0.22, width_m=width_m - 0.1, z_m=height_m)
    return spot


def dining_table(layout: RoomLayout, style: Style, seats: int) -> bool:
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
                _dining_chair,
                spot.at(x, y),
                0.003,
                yaw_deg=spot.yaw_deg + turn_deg,
                beside=(name,),
                style=style,
            )
    names = ("mug", "papers", "bottle", "plant", "books")
    if rng.random() < 0.3:
        names = (*names[:4], "fruit")
    chosen = [names[k] for k in rng.permutation(len(names)).tolist()][: int(rng.integers(1, 4))]
    scatter(layout, name, spot, chosen, x_m=0.0, width_m=width_m - 0.2, z_m=TABLE_M)
    return True


def _dining_chair(rng: Rng, style: Style) -> list[Part]:
    """A chair of the kind that a home has."""
    if style.has_slat_chairs:
        return household.slat_chair(rng, style.cloths[2], style.tones, has_pad=style.has_pads)
    return household.dining_chair(rng, style.cloths[2], style.tones)


def desk(layout: RoomLayout, style: Style) -> Spot | None:
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
        office.task_chair,
        spot.at(GAP_M + depth_m + 0.24, float(rng.normal(0, 0.06))),
        yaw_deg=spot.yaw_deg + 180 + float(rng.normal(0, 22)),
        beside=(name,),
        colour=style.cloths[3],
    )
    y = float(rng.uniform(-0.08, 0.02))
    layout.add(
        "monitor",
        monitor,
        spot.at(GAP_M + 0.2, y),
        TABLE_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 5)),
        support=name,
        width_m=0.5,
        seed=int(rng.integers(6)),
        is_on=bool(rng.random() < 0.4),
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
    kind, make, half_m, size = items(layout)[left]
    layout.add(
        kind, make, spot.at(GAP_M + 0.3, -width_m / 2 + half_m + 0.04), TABLE_M,
        yaw_deg=spot.yaw_deg + 90, support=name, **size,
    )  # fmt: skip
    return spot


def floor_lamp(layout: RoomLayout) -> None:
    """A floor lamp, if possible in a corner."""
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


def sockets(layout: RoomLayout, count: int) -> None:
    """Sockets low on the walls."""
    for _ in range(count):
        plugs = int(layout.rng.integers(1, 3))
        layout.hang("socket", fitting.socket, (0.16, 0.09), middle_m=0.3, count=plugs)


def armchair(layout: RoomLayout, style: Style) -> None:
    """An armchair, if possible in a corner, turned towards the middle of the room."""
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


def kitchen_row(layout: RoomLayout, style: Style) -> Spot | None:
    """A row of units along the wall where the longest one fits; the worktop may pass below a window."""
    for length_m in (3.6, 3.3, 3.0, 2.7, 2.4, 2.1, 1.8):
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
    windows = _windows_behind(layout, spot, along, length_m)
    height_m = 0.92 if windows else 2.2
    span = Span(along - length_m / 2, along + length_m / 2, 0.0, height_m)
    # The fridge and its end of the row must not stand before a window.
    is_clear = all(
        first - (along - length_m / 2) > 0.66 and along + length_m / 2 - last > 0.66 for first, last in windows
    )
    body = spot.body(kitchen.ROW_DEPTH_M, length_m, 0.0)
    front = spot.body(0.6, length_m, kitchen.ROW_DEPTH_M)
    return is_clear and layout.is_wall_free(spot.side, span) and layout.fits([body], [front])


def _add_row(layout: RoomLayout, style: Style, spot: Spot, along: float, length_m: float) -> Spot:
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
    step_m = (y_m if spot.side in ("east", "west") else x_m) - spot.along_m
    return 1 if step_m > 0 else -1


def cartons(layout: RoomLayout) -> None:
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


def television(rng: Rng, width_m: float, seed: int) -> list[Part]:
    """A television, mostly switched off."""
    parts = household.television(rng, width_m=width_m, seed=seed)
    return parts if rng.random() < 0.35 else switched_off(parts)


def switched_off(parts: Sequence[Part]) -> list[Part]:
    """The parts of a display, dark. Each display that shines is a lamp, and costs time when light is computed."""
    glass = coated("#141618", roughness=0.08)
    return [replace(part, material=glass) if part.material.emission_texture else part for part in parts]


def monitor(rng: Rng, width_m: float, seed: int, *, is_on: bool) -> list[Part]:
    """A display on a foot."""
    parts = furniture.monitor(rng, width_m=width_m, seed=seed)
    return parts if is_on else switched_off(parts)


RUG_COLOURS = ("#8f8a80", "#b9a88a", "#5c6b78", "#7a5a4c", "#6f7d6a", "#c2b8a4", "#3f4a55", "#9a6a5a")


def rug(rng: Rng, width_m: float, depth_m: float, seed: int) -> list[Part]:
    """A rug: woven in lozenges, striped, with a border, or plain, by its seed."""
    if seed % 4 == 0:
        return household.rug(rng, width_m=width_m, depth_m=depth_m, seed=seed)
    colours = np.random.default_rng(seed).permutation(RUG_COLOURS).tolist()
    parts = [stood((depth_m, width_m, 0.008), cloth(colours[0]), bevel=0.003)]
    if seed % 4 == 1:
        count = 2 * int(width_m / 0.22) + 1
        stripe_m = width_m / count
        for k in range(1, count, 2):
            y = (k + 0.5) * stripe_m - width_m / 2
            colour = colours[1 + k // 2 % 2]
            parts.append(stood((depth_m - 0.01, stripe_m, 0.0006), cloth(colour), 0, y, 0.008, bevel=0))
    elif seed % 4 == 2:
        inner_m = (depth_m - 0.24, width_m - 0.24, 0.0006)
        parts.append(stood((depth_m - 0.12, width_m - 0.12, 0.0003), cloth(colours[1]), 0, 0, 0.008, bevel=0))
        parts.append(stood(inner_m, cloth(colours[2]), 0, 0, 0.008, bevel=0))
    return parts


def framed_print(_: Rng, style: str, width_m: float, height_m: float, seed: int, frame: str) -> list[Part]:
    """A picture in a plain frame on a wall; it looks like `fitting.framed`, with fewer faces."""
    face = fitting.framed(_, style, width_m, height_m, seed, frame)[0]
    return [face, put(fitting.bars(width_m, height_m, 0.025, 0.02, bevel_m=0), coated(frame), 0.011)]


def _rod(_: Rng, length_m: float) -> list[Part]:
    """A rod for curtains, along y."""
    path_m = np.array([[0.0, -length_m / 2, 0.0], [0.0, length_m / 2, 0.0]])
    return [Part(tube(path_m, 0.012, sections=8), DARK)]


def pendant(rng: Rng, drop_m: float, colour: str, wide_m: float) -> list[Part]:
    """A pendant lamp, like that of `household`, with fewer faces."""
    return household.pendant(rng, drop_m, colour, wide_m, sections=22)
