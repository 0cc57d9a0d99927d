"""Flats by seed: a floor plan, furnished by the use of each room, with surfaces that go together, in any daylight."""

from collections.abc import Mapping

import numpy as np

from vobench.asset import floor_plan
from vobench.asset.ceiling_lamp import add_ceiling_lamps
from vobench.asset.daylight import Daylight
from vobench.asset.floor_plan import SIDES, FloorPlan, Room, Side
from vobench.asset.furniture import wood
from vobench.asset.home_room import FURNISH
from vobench.asset.interior import Interior, furnished_interior
from vobench.asset.interior_shell import RoomFinish, shell
from vobench.asset.palette import Style, home_style
from vobench.asset.picture import Rng
from vobench.asset.room_fitting import door_fittings, skirtings
from vobench.asset.room_layout import RoomLayout, room_layouts
from vobench.asset.small_lamp import light_small_lamps
from vobench.asset.window_dressing import dress_windows
from vobench.asset.window_view import view_outside

PANORAMAS = ("city", "city", "suburb", "country")
FLOOR_HEIGHTS_M = (1.2, 4.0, 7.0, 10.0, 16.0)  # of the flat above the ground
# The kinds of pieces that are left out if a flat has too many faces, in this order.
OPTIONAL = ("sill_mug", "fruit", "bin", "socket", "mug", "sill_plant", "shoes", "keyboard", "plant", "picture")


def furnished_flat(seed: int, lighting: str) -> Interior:
    """A flat of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    # Each choice has a random generator of its own, so that a change of one leaves the others as they are.
    plan = floor_plan.flat_plan(np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    style = home_style(rng)
    finishes = {room.name: _finish(rng, room, style) for room in plan.rooms}
    outside_rng = np.random.default_rng([seed, 3])
    outside = view_outside(plan, outside_rng, lighting, floor_heights_m=FLOOR_HEIGHTS_M, kinds=PANORAMAS)
    layouts = room_layouts(plan, seed, 2)

    door_fittings(plan, layouts, style.doors, panels=bool(rng.random() < 0.6))
    _furnish(plan, layouts, style, outside, np.random.default_rng([seed, 4]))

    surfaces = shell(plan, finishes, thresholds=wood(style.tones))
    return furnished_interior(plan, surfaces, layouts.values(), outside.lights, OPTIONAL)


def _furnish(
    plan: FloorPlan, layouts: Mapping[str, RoomLayout], style: Style, outside: Daylight, lamp_rng: Rng
) -> None:
    """Furnish all rooms. The darker it is outside, the more rooms have their lamps on."""
    for layout in layouts.values():
        use = layout.room.use
        dress_windows(layout, style)
        FURNISH[use](layout, style)

        has_window = any(plan.windows_of(layout.room))
        share_on = outside.lamp_share if has_window else max(outside.lamp_share, 0.75)
        is_lit_by_chance = bool(lamp_rng.random() < share_on)
        is_always_lit = use == "living" and outside.lamp_share > 0.8
        is_on = is_lit_by_chance or is_always_lit
        add_ceiling_lamps(layout, style, is_on=is_on)
        light_small_lamps(layout, style, is_on=is_on and bool(lamp_rng.random() < 0.8))
        if use != "bath":
            skirtings(layout)


def _finish(rng: Rng, room: Room, style: Style) -> RoomFinish:
    """The surfaces of a room: tiles where it gets wet, one wall or all walls painted in some of the others."""
    if room.use == "bath":
        return RoomFinish(style.floor_tiles, style.ceiling, dict.fromkeys(SIDES, style.bath_tiles))
    is_tiled = room.use == "kitchen" and rng.random() < 0.7
    floor = style.floor_tiles if is_tiled else style.planks
    walls = dict.fromkeys(SIDES, style.plain)
    accent = style.accents[int(rng.integers(len(style.accents)))]
    choice = rng.random()
    if choice < 0.35:
        sides: list[Side] = list(SIDES)
        walls[sides[int(rng.integers(4))]] = accent
    elif choice < 0.55:
        walls = dict.fromkeys(SIDES, accent)
    return RoomFinish(floor, style.ceiling, walls)
