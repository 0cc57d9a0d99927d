"""Offices by seed: a floor plan with an open area, cells and meeting rooms, furnished by the use of each room."""

from collections.abc import Mapping

import numpy as np

from vobench.asset import floor_plan
from vobench.asset.daylight import Daylight
from vobench.asset.floor_plan import SIDES, FloorPlan, Room, Side
from vobench.asset.furniture import STEEL, coated, wood
from vobench.asset.interior import Interior, furnished_interior
from vobench.asset.interior_shell import RoomFinish, shell
from vobench.asset.office_lamp import add_office_lamps
from vobench.asset.office_room import FURNISH
from vobench.asset.palette import Style, office_style
from vobench.asset.picture import Rng, one_of
from vobench.asset.room_fitting import door_fittings, skirtings
from vobench.asset.room_layout import room_layouts
from vobench.asset.window_dressing import dress_windows
from vobench.asset.window_view import view_outside
from vobench.scene.material import Material

PANORAMAS = ("city", "city", "city", "suburb")
FLOOR_HEIGHTS_M = (1.2, 4.5, 8.0, 12.0, 22.0, 40.0)  # of the office above the ground
# The kinds of pieces that are left out if an office has too many faces, in this order.
OPTIONAL = ("sill_mug", "socket", "mug", "keyboard", "sill_plant", "plant", "picture", "pedestal")
DESK_TOPS = ("wood", "wood", "#dedcd6", "#c9cac6", "#5b5f62")  # wood, or the colour of a coating
SKIRTING_M = 0.07  # height
ACCENT_SHARE = 0.5  # of rooms, in which one wall has another colour
LEAST_LAMP_SHARE = 0.75  # of rooms with lamps on: offices are lit by day, too
ALL_LIT_SHARE = 0.8  # from this share on, all lamps are on
FORGOTTEN_SHARE = 0.2  # of rooms with lamps on in an office that is not lit


def furnished_office(seed: int, lighting: str) -> Interior:
    """An office of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    # Each choice has a random generator of its own, so that a change of one leaves the others as they are.
    plan = floor_plan.office_plan(np.random.default_rng([seed, 10]))
    rng = np.random.default_rng([seed, 11])
    style = office_style(rng)
    finishes = {room.name: _finish(rng, room, style) for room in plan.rooms}
    layouts = room_layouts(plan, seed, 12)
    outside_rng = np.random.default_rng([seed, 13])
    outside = view_outside(plan, outside_rng, lighting, floor_heights_m=FLOOR_HEIGHTS_M, kinds=PANORAMAS)
    desk_top = _desk_top(rng, style)
    lamp_kind = one_of(rng, "bars", "squares", "hanging")

    door_fittings(plan, layouts, style.doors, panels=False)
    lit_rooms = _lit_rooms(plan, outside, np.random.default_rng([seed, 14]))
    for name, layout in layouts.items():
        dress_windows(layout, style)
        FURNISH[layout.room.use](layout, style, desk_top)
        add_office_lamps(layout, style, lamp_kind, is_on=lit_rooms[name])
        skirtings(layout, height_m=SKIRTING_M)

    surfaces = shell(plan, finishes, thresholds=STEEL)
    return furnished_interior(plan, surfaces, layouts.values(), outside.lights, OPTIONAL)


def _desk_top(rng: Rng, style: Style) -> Material:
    """The material of all desk tops of an office."""
    kind = one_of(rng, *DESK_TOPS)
    return wood(style.tones) if kind == "wood" else coated(kind, roughness=0.35)


def _lit_rooms(plan: FloorPlan, outside: Daylight, rng: Rng) -> Mapping[str, bool]:
    """Whether the ceiling lamps of each room are on. Rooms without a window are always lit."""
    share = max(outside.lamp_share, LEAST_LAMP_SHARE)
    is_office_lit = share > ALL_LIT_SHARE or bool(rng.random() < share)
    lit = {}
    for room in plan.rooms:
        has_window = any(plan.windows_of(room))
        is_lit = is_office_lit or not has_window
        lit[room.name] = is_lit or bool(rng.random() < FORGOTTEN_SHARE)
    return lit


def _finish(rng: Rng, room: Room, style: Style) -> RoomFinish:
    """The surfaces of a room: one floor in most of them, a painted wall in some."""
    floor = style.floor_tiles if room.use == "pantry" else style.planks
    walls = dict.fromkeys(SIDES, style.plain)
    if rng.random() < ACCENT_SHARE:
        accent = style.accents[int(rng.integers(len(style.accents)))]
        sides: list[Side] = list(SIDES)
        side = sides[int(rng.integers(len(sides)))]
        walls[side] = accent
    return RoomFinish(floor, style.ceiling, walls)
