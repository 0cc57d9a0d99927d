"""Furnishes the living room of a home: a television corner, a dining table, shelves, lamps and plants."""

from vobench.asset.bed_place import add_bed
from vobench.asset.furnishing import (
    add_armchair,
    add_desk,
    add_dining_table,
    add_floor_plant,
    add_shelf,
    add_sideboard,
)
from vobench.asset.palette import Style
from vobench.asset.room_layout import RoomLayout
from vobench.asset.small_lamp import add_floor_lamp
from vobench.asset.television_corner import add_television_corner
from vobench.asset.wall_decoration import add_pictures, add_sockets

BED_WIDTHS_M = (1.2, 1.4)
TABLE_M2 = 18.0  # smaller living rooms have no dining table
SURE_TABLE_M2 = 24.0  # larger ones have one even if there is one in the kitchen
LARGE_TABLE_M2 = 26.0  # larger ones may have a table for six
KITCHEN_TABLE_M2 = 9.0  # larger kitchens have a dining table


def furnish_living_room(layout: RoomLayout, style: Style) -> None:
    """Furnish a living room. In a home without bedrooms it has a bed."""
    sofa_spot = add_television_corner(layout, style)
    _add_dining_table(layout, style)
    sideboard_spot = add_sideboard(layout, style) if layout.chance(0.8) else None
    add_shelf(layout, style)
    if layout.chance(0.3):
        add_shelf(layout, style)
    if layout.chance(0.6):
        add_floor_lamp(layout)
    has_bedroom = any(room.use == "bedroom" for room in layout.plan.rooms)
    if not has_bedroom:
        add_bed(layout, style, BED_WIDTHS_M)
    if layout.chance(0.4):
        add_desk(layout, style)
    if layout.chance(0.5):
        add_armchair(layout, style)
    for _ in range(int(layout.rng.integers(1, 3))):
        add_floor_plant(layout)
    picture_count = int(layout.rng.integers(1, 4))
    add_pictures(layout, style, picture_count, [sofa_spot, sideboard_spot])
    add_sockets(layout, 1)


def _add_dining_table(layout: RoomLayout, style: Style) -> None:
    """Add a dining table if there is space for one, and mostly only if the kitchen has none."""
    area_m2 = layout.room.rect.area_m2
    if area_m2 <= TABLE_M2:
        return
    has_kitchen_table = any(
        room.use == "kitchen" and room.rect.area_m2 > KITCHEN_TABLE_M2 for room in layout.plan.rooms
    )
    is_wanted = not has_kitchen_table or area_m2 > SURE_TABLE_M2 or layout.chance(0.4)
    if is_wanted:
        is_for_six = area_m2 > LARGE_TABLE_M2 and layout.chance(0.6)
        add_dining_table(layout, style, 6 if is_for_six else 4)
