"""Floor lamps and table lamps, and the light of their shades."""

from vobench.asset import household
from vobench.asset.daylight import lamp_colour
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.placed_piece import vertices_of
from vobench.asset.room_layout import RoomLayout

FLOOR_LAMP_LM = 550.0
TABLE_LAMP_LM = 280.0
MOST_LIT = 2  # lamps in a room whose light is computed


def add_floor_lamp(layout: RoomLayout) -> None:
    """Add a floor lamp, in a corner if one is free."""
    layout.add_at_wall(
        "floor_lamp",
        household.floor_lamp,
        (0.44, 0.44, 1.7),
        back_m=0.22,
        front_m=0.0,
        in_corner=True,
        height_m=float(layout.rng.uniform(1.45, 1.68)),
        colour=one_of(layout.rng, "#d8c3a0", "#e6e1d6", "#a7b3bc", "#c9a271"),
    )


def light_small_lamps(layout: RoomLayout, style: Style, *, is_on: bool) -> None:
    """Add the light of the shades of the first floor and table lamps of a room, if they are on."""
    if not is_on:
        return
    lamps = [piece for piece in layout.placed if ".floor_lamp_" in piece.name or ".table_lamp_" in piece.name]
    for lamp in lamps[:MOST_LIT]:
        vertices_m = vertices_of(lamp.parts)
        low_m = vertices_m.min(axis=0)
        high_m = vertices_m.max(axis=0)
        middle_x_m, middle_y_m = ((low_m + high_m) / 2)[:2].tolist()
        shade_width_m = float(high_m[0] - low_m[0])  # the shade is wider than the foot
        shade = household.glowing_shade(middle_x_m, middle_y_m, float(high_m[2]), shade_width_m)
        power_lm = FLOOR_LAMP_LM if ".floor_lamp_" in lamp.name else TABLE_LAMP_LM
        layout.add_lamp("small_lamp", shade, power_lm, is_on=True, colour=lamp_colour(style.lamp_k))
