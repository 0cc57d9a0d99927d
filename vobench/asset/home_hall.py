"""Furnishes the halls of homes: a shoe cabinet with a mirror, coats, a runner, and more where a hall is wide."""

from vobench.asset import bedroom, fitting
from vobench.asset.furnishing import add_floor_plant, add_shelf
from vobench.asset.home_piece import WARDROBE_M, decorate_walls
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.room_layout import GAP_M, RoomLayout
from vobench.asset.rug import rug
from vobench.asset.spot import Spot
from vobench.asset.tabletop import add_tabletop_items

WIDE_HALL_M = 1.7  # the least extent of a hall with furniture at its walls
CABINET_HEIGHT_M = 0.87  # of the top of a shoe cabinet
RACK_WIDTHS_M = (0.7, 0.9, 1.1)
RACK_HEIGHT_M = 1.3  # from the hems of the coats to the board
RACK_MIDDLE_M = 1.22  # above the floor
RUNNER_M = (1.0, 2.6)  # the least and the greatest length
RUNNER_WIDTH_M = 0.68
RUNNER_END_M = 0.6  # between the end of a runner and the wall


def furnish_hall(layout: RoomLayout, style: Style) -> None:
    """Furnish a hall."""
    cabinet_spot = _add_shoe_cabinet(layout)
    if cabinet_spot is not None and layout.chance(0.6):
        layout.add_on_wall(
            "mirror",
            fitting.framed,
            (0.55, 0.75),
            middle_m=1.6,
            above=cabinet_spot,
            style="mirror",
            width_m=0.5,
            height_m=0.7,
        )
    _add_coats(layout, style)
    if layout.chance(0.45):
        _add_runner(layout, style)
    is_wide = min(layout.room.rect.width_m, layout.room.rect.depth_m) > WIDE_HALL_M
    if is_wide:
        _furnish_wide_hall(layout, style)
    decorate_walls(layout, style)


def _add_shoe_cabinet(layout: RoomLayout) -> Spot | None:
    """Add a shoe cabinet with things on it. Returns its spot; None if there is no space for it."""
    rng = layout.rng
    width_m = float(rng.choice([0.7, 0.9]))
    cabinet = layout.add_at_wall(
        "shoe_cabinet",
        bedroom.shoe_cabinet,
        (0.31, width_m + 0.02, 0.88),
        width_m=width_m,
        colour=one_of(rng, "#dcdbd6", "#c9c4b8", "#5b6b5d"),
    )
    if cabinet is None:
        return None
    name, spot = cabinet
    items = ("box", "mug", "plant")
    count = int(rng.integers(1, 4))
    surface_m = width_m - 0.12
    add_tabletop_items(layout, name, spot, items[:count], x_m=GAP_M + 0.14, width_m=surface_m, z_m=CABINET_HEIGHT_M)
    return spot


def _add_coats(layout: RoomLayout, style: Style) -> None:
    """Add a rack with coats, and up to two pairs of shoes on the floor below it."""
    rng = layout.rng
    rack_m = float(rng.choice(RACK_WIDTHS_M))
    space_m = (rack_m + 0.24, RACK_HEIGHT_M)
    spot = layout.add_on_wall(
        "coat_rack", bedroom.coat_rack, space_m, middle_m=RACK_MIDDLE_M, width_m=rack_m, tones=style.tones
    )
    if spot is None:
        return
    for _ in range(int(rng.integers(0, 3))):
        y_m = float(rng.uniform(-0.3, 0.3)) * rack_m
        footprint = spot.rectangle(0.02, 0.38, y_m - 0.17, y_m + 0.17)
        if layout.floor.fits([footprint]):
            yaw_deg = spot.yaw_deg + float(rng.normal(0, 8))
            layout.add("shoes", bedroom.shoes, spot.point(0.05, y_m), yaw_deg=yaw_deg)
            layout.floor.occupy(footprint, 0.12)


def _add_runner(layout: RoomLayout, style: Style) -> None:
    """Add a long rug in the middle of a hall, if the hall is long enough."""
    rect = layout.room.rect
    is_along_x = rect.width_m > rect.depth_m
    least_m, most_m = RUNNER_M
    length_m = min(most_m, max(rect.width_m, rect.depth_m) - 2 * RUNNER_END_M)
    if length_m < least_m:
        return
    layout.add(
        "rug",
        rug,
        rect.center_m,
        yaw_deg=90.0 if is_along_x else 0.0,
        width_m=length_m,
        depth_m=RUNNER_WIDTH_M,
        seed=style.rugs[1],
    )


def _furnish_wide_hall(layout: RoomLayout, style: Style) -> None:
    """Add what only wide halls have space for: a wardrobe, a shelf, a plant."""
    depth_m, height_m = WARDROBE_M
    if layout.chance(0.6):
        layout.add_at_wall(
            "wardrobe",
            bedroom.wardrobe,
            (depth_m, 1.02, height_m),
            front_m=0.5,
            in_corner=True,
            width_m=1.0,
            colour="#e4e0d6" if style.is_painted else "",
            tones=style.tones,
        )
    if layout.chance(0.5):
        add_shelf(layout, style, (0.8, 1.0))
    if layout.chance(0.5):
        add_floor_plant(layout)
