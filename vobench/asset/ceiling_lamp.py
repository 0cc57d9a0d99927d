"""The lamps at the ceilings of a home: pendants over tables, and pendants or flat lamps near the middle of a room."""

import numpy as np

from vobench.asset import household
from vobench.asset.daylight import lamp_colour
from vobench.asset.furniture import Part
from vobench.asset.kitchen_place import middle_of_free_floor
from vobench.asset.palette import Style
from vobench.asset.picture import Rng, one_of
from vobench.asset.placed_piece import CEILING, vertices_of
from vobench.asset.room_layout import RoomLayout
from vobench.scene.mesh import quad

TABLE_PENDANT_LM = 800.0
TABLE_PENDANT_M = 1.55  # the height of its lower edge
ROOM_PENDANT_M = 2.05
PENDANT_SECTIONS = 22  # of the shade around its axis; household.pendant has 36 by default
NEAR_M = 0.7  # a pendant over a table that is no farther from the middle of the room is its only lamp


def add_ceiling_lamps(layout: RoomLayout, style: Style, *, is_on: bool) -> None:
    """Add a pendant over the dining table, and a lamp near the middle of the ceiling."""
    rng = layout.rng
    power_lm = float(np.clip(150 * layout.room.rect.area_m2, 1000, 4200)) * float(rng.uniform(0.85, 1.2))
    middle_m = middle_of_free_floor(layout)
    table_m = _middle_of_dining_table(layout)
    if table_m is not None:
        _add_pendant(layout, style, table_m, low_m=TABLE_PENDANT_M, power_lm=TABLE_PENDANT_LM, is_on=is_on)
        is_table_in_middle = np.hypot(table_m[0] - middle_m[0], table_m[1] - middle_m[1]) < NEAR_M
        if is_table_in_middle:
            return

    may_hang = table_m is None and layout.room.use in ("living", "bedroom", "study")
    if may_hang and layout.chance(0.45):
        _add_pendant(layout, style, middle_m, low_m=ROOM_PENDANT_M, power_lm=power_lm, is_on=is_on)
    else:
        _add_flat_lamp(layout, style, middle_m, power_lm=power_lm, is_on=is_on)


def _middle_of_dining_table(layout: RoomLayout) -> tuple[float, float] | None:
    """The middle (x, y) of the dining table; None if there is none."""
    for piece in layout.placed:
        if ".dining_table_" in piece.name:
            vertices_m = vertices_of(piece.parts)
            x_m, y_m, _ = ((vertices_m.min(axis=0) + vertices_m.max(axis=0)) / 2).tolist()
            return x_m, y_m
    return None


def _add_flat_lamp(
    layout: RoomLayout, style: Style, xy_m: tuple[float, float], *, power_lm: float, is_on: bool
) -> None:
    """Add a round or square lamp on the ceiling."""
    x_m, y_m = xy_m
    width_m = float(layout.rng.choice([0.3, 0.4, 0.5]))
    is_round = layout.chance(0.55)
    ceiling_m = layout.plan.height_m
    layout.add(
        "lamp_body",
        household.ceiling_lamp,
        xy_m,
        ceiling_m,
        support=CEILING,
        width_m=width_m,
        is_round=is_round,
    )
    low_m = ceiling_m - household.CEILING_LAMP_M - 0.002
    half_m = 0.45 * width_m
    square = quad((x_m - half_m, y_m - half_m, low_m), (0, 2 * half_m, 0), (2 * half_m, 0, 0))
    face = household.diffuser(x_m, y_m, low_m, 2 * half_m) if is_round else square
    layout.add_lamp("lamp", face, power_lm, is_on=is_on, colour=lamp_colour(style.lamp_k))


def _add_pendant(
    layout: RoomLayout, style: Style, xy_m: tuple[float, float], *, low_m: float, power_lm: float, is_on: bool
) -> None:
    """Add a pendant whose shade ends at a height above the floor, and its bulb."""
    rng = layout.rng
    ceiling_m = layout.plan.height_m
    width_m = float(rng.choice([0.36, 0.46, 0.56]))
    layout.add(
        "pendant",
        _pendant,
        xy_m,
        ceiling_m,
        support=CEILING,
        drop_m=ceiling_m - low_m,
        colour=one_of(rng, "#2c4a4a", "#27445c", "#262b30", "#c9c4b8", "#b4533a", "#5c6b5a", "#d8c3a0"),
        wide_m=width_m,
    )
    disc = household.diffuser(*xy_m, low_m + 0.035, 0.94 * width_m)
    layout.add_lamp("lamp", disc, power_lm, is_on=is_on, colour=lamp_colour(style.lamp_k))


def _pendant(rng: Rng, drop_m: float, colour: str, wide_m: float) -> list[Part]:
    """A pendant lamp, like that of `household`, with fewer faces."""
    return household.pendant(rng, drop_m, colour, wide_m, sections=PENDANT_SECTIONS)
