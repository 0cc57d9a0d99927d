"""The ceiling lamps of offices: a grid of panels at the ceiling or below it."""

from vobench.asset import fitting
from vobench.asset.daylight import lamp_colour
from vobench.asset.kitchen_place import middle_of_free_floor
from vobench.asset.palette import Style
from vobench.asset.placed_piece import CEILING
from vobench.asset.room_layout import RoomLayout
from vobench.scene.mesh import quad

SIZES_M = {"bars": (1.5, 0.28), "squares": (0.9, 0.9), "hanging": (2.2, 0.16)}  # length, width of a panel
ALONG_M = 4.4  # from lamp to lamp along a room, about
ACROSS_M = 4.6
DROP_M = 0.06  # of a panel below the ceiling
HANGING_DROP_M = 0.55
LM_PER_M2 = 230  # of floor


def add_office_lamps(layout: RoomLayout, style: Style, kind: str, *, is_on: bool) -> None:
    """Add lamps of a kind, one of SIZES_M, along the room. A pantry has one lamp, which never hangs."""
    rect = layout.room.rect
    is_pantry = layout.room.use == "pantry"
    is_along_x = rect.width_m >= rect.depth_m
    positions_m = [middle_of_free_floor(layout)] if is_pantry else _grid_m(layout)
    drop_m = HANGING_DROP_M if kind == "hanging" and not is_pantry else DROP_M
    z_m = layout.plan.height_m - drop_m
    size_m = SIZES_M[kind]
    length_x_m, length_y_m = size_m if is_along_x else size_m[::-1]
    power_lm = LM_PER_M2 * rect.area_m2 / len(positions_m)
    for x_m, y_m in positions_m:
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
        corner_m = (x_m - length_x_m / 2, y_m - length_y_m / 2, z_m)
        panel = quad(corner_m, (0, length_y_m, 0), (length_x_m, 0, 0))
        layout.add_lamp("lamp", panel, power_lm, is_on=is_on, colour=lamp_colour(style.lamp_k))


def _grid_m(layout: RoomLayout) -> list[tuple[float, float]]:
    """The middles (x, y) of the lamps of a room, in rows along its longer side."""
    rect = layout.room.rect
    is_along_x = rect.width_m >= rect.depth_m
    length_m = max(rect.width_m, rect.depth_m)
    across_m = min(rect.width_m, rect.depth_m)
    columns = max(1, round(length_m / ALONG_M))
    rows = max(1, round(across_m / ACROSS_M))
    middles_m = []
    for column in range(columns):
        for row in range(rows):
            along_offset_m = (column + 0.5) * length_m / columns
            across_offset_m = (row + 0.5) * across_m / rows
            x_m = rect.x0 + (along_offset_m if is_along_x else across_offset_m)
            y_m = rect.y0 + (across_offset_m if is_along_x else along_offset_m)
            middles_m.append((x_m, y_m))
    return middles_m
