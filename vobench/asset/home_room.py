"""Furnishes the kitchens, bedrooms and studies of homes, and names the function for each use of a room."""

from collections.abc import Callable

from vobench.asset import bedroom, fitting, household
from vobench.asset.bed_place import add_bed
from vobench.asset.furnishing import (
    add_armchair,
    add_cartons,
    add_desk,
    add_dining_table,
    add_floor_plant,
    add_shelf,
    add_sideboard,
)
from vobench.asset.home_bath import furnish_bath
from vobench.asset.home_hall import furnish_hall
from vobench.asset.home_piece import WARDROBE_M, add_bin, decorate_walls
from vobench.asset.kitchen_place import add_kitchen_row
from vobench.asset.living_room import furnish_living_room
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.room_layout import RoomLayout
from vobench.asset.rug import rug
from vobench.asset.small_lamp import add_floor_lamp

LARGE_KITCHEN_M2 = 10.5  # with a table for four, if it fits
LARGE_BEDROOM_M2 = 11.0  # with a wider bed
BED_WIDTHS_M = (1.4, 0.9, 1.2)
LARGE_BED_WIDTHS_M = (1.6, 1.4, 1.8)
WARDROBE_WIDTHS_M = (1.0, 1.5, 1.9, 2.4)
NARROW_WARDROBE_M = 1.0  # width, where the chosen one does not fit
SOFA_STUDY_M2 = 8.0  # larger studies may have a sofa


def _furnish_kitchen(layout: RoomLayout, style: Style) -> None:
    row_spot = add_kitchen_row(layout, style)
    if row_spot is not None:
        seats = 4 if layout.room.rect.area_m2 > LARGE_KITCHEN_M2 else 2
        has_table = add_dining_table(layout, style, seats)
        if not has_table:
            add_dining_table(layout, style, 2)
    if layout.chance(0.25):
        add_bin(layout, width_m=0.28, height_m=0.38, back_m=0.16)
    if layout.chance(0.35):
        add_floor_plant(layout)
    decorate_walls(layout, style)


# --- Bedrooms ---


def _furnish_bedroom(layout: RoomLayout, style: Style) -> None:
    is_large = layout.room.rect.area_m2 > LARGE_BEDROOM_M2
    bed_spot = add_bed(layout, style, LARGE_BED_WIDTHS_M if is_large else BED_WIDTHS_M)
    _add_wardrobe(layout, style)
    if layout.chance(0.55):
        add_sideboard(layout, style)
    if layout.chance(0.45):
        add_desk(layout, style)
    if layout.chance(0.4):
        add_shelf(layout, style, (0.8, 1.0))
    if layout.chance(0.3):
        add_armchair(layout, style)
    if layout.chance(0.5):
        _add_loose_rug(layout, style)
    if layout.chance(0.6):
        add_floor_plant(layout)
    if layout.chance(0.4):
        mirror_m = (0.5, 1.4)
        layout.add_on_wall(
            "mirror",
            fitting.framed,
            mirror_m,
            middle_m=1.05,
            style="mirror",
            width_m=mirror_m[0],
            height_m=mirror_m[1],
        )
    decorate_walls(layout, style, above=bed_spot)


def _add_wardrobe(layout: RoomLayout, style: Style) -> None:
    """Add a wardrobe, or a narrow one if there is no space for the chosen width."""
    depth_m, height_m = WARDROBE_M
    chosen_m = float(layout.rng.choice(WARDROBE_WIDTHS_M))
    for width_m in (chosen_m, NARROW_WARDROBE_M):
        colour = one_of(layout.rng, "#e4e0d6", "#dcdbd6", style.kitchen.fronts) if style.is_painted else ""
        wardrobe = layout.add_at_wall(
            "wardrobe",
            bedroom.wardrobe,
            (depth_m, width_m + 0.02, height_m),
            front_m=0.55,
            in_corner=True,
            width_m=width_m,
            colour=colour,
            tones=style.tones,
        )
        if wardrobe is not None:
            return


def _add_loose_rug(layout: RoomLayout, style: Style) -> None:
    """Add a rug where the floor is free."""
    width_m = float(layout.rng.uniform(1.2, 1.7))
    depth_m = float(layout.rng.uniform(0.7, 1.1))
    spot = layout.free_spot_on_floor(depth_m, width_m)
    if spot is not None:
        seed = style.rugs[1]
        layout.add("rug", rug, spot.point(0), yaw_deg=spot.yaw_deg, width_m=width_m, depth_m=depth_m, seed=seed)


# --- Studies ---


def _furnish_study(layout: RoomLayout, style: Style) -> None:
    desk_spot = add_desk(layout, style)
    for _ in range(int(layout.rng.integers(1, 3))):
        add_shelf(layout, style)
    if layout.chance(0.5):
        add_armchair(layout, style)
    if layout.chance(0.35) and layout.room.rect.area_m2 > SOFA_STUDY_M2:
        layout.add_at_wall("sofa", household.couch, (0.92, 1.7, 0.8), back_m=0.46, width_m=1.7, colour=style.cloths[1])
    if layout.chance(0.4):
        add_sideboard(layout, style)
    if layout.chance(0.4):
        add_floor_lamp(layout)
    if layout.chance(0.5):
        add_cartons(layout)
    add_floor_plant(layout)
    if layout.chance(0.5):
        layout.add_on_wall(
            "noticeboard",
            fitting.noticeboard,
            (0.95, 0.65),
            above=desk_spot,
            middle_m=1.62,
            width_m=0.9,
            height_m=0.6,
        )
    decorate_walls(layout, style)


FURNISH: dict[str, Callable[[RoomLayout, Style], None]] = {
    "living": furnish_living_room,
    "kitchen": _furnish_kitchen,
    "bedroom": _furnish_bedroom,
    "study": _furnish_study,
    "hall": furnish_hall,
    "bath": furnish_bath,
}
"""How a room of each use is furnished: functions of its layout and of the style."""
