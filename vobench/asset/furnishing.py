"""Adds furniture that several kinds of rooms have: shelves, chests, tables, desks, armchairs, cartons and plants."""

from collections.abc import Sequence

import numpy as np

from vobench.asset import bedroom, display, furniture, household, houseplant, office
from vobench.asset.furniture import Part
from vobench.asset.palette import Style
from vobench.asset.picture import Rng, one_of
from vobench.asset.room_layout import GAP_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.tabletop import (
    BOOK_SEEDS,
    CARTON_SEEDS,
    TABLE_HEIGHT_M,
    add_tabletop_items,
    tabletop_items,
)

# Shelves and chests. Their origin is the centre of the footprint, and *_BACK_M is its distance from the back.
SHELF_DEPTH_M = 0.32  # that of the shelf, 0.3 m, and 2 cm of space in front of it
SHELF_BACK_M = 0.155
LOW_SHELF_M = 1.2  # shelves that are lower than this have things on top
CHEST_DEPTH_M = 0.46  # that of the chest, 0.42 m, and that of the knobs
CHEST_BACK_M = 0.216

# Dining tables
TABLE_WIDTHS_M = {2: 0.85, 4: 1.35, 6: 1.85}  # by the number of seats
TABLE_DEPTH_M = 0.78
LARGE_TABLE_DEPTH_M = 0.9  # the depth of a table with six seats
CHAIR_REACH_M = 0.42  # the depth of the floor that a chair occupies beyond the edge of its table
CHAIR_RISE_M = 0.003  # the height of a chair above the floor, so that it does not intersect the floor

# Desks
DESK_DEPTH_M = 0.7
DESK_CHAIR_DEPTH_M = 0.62  # the depth of the floor that the chair occupies in front of a desk
SCREEN_SEEDS = 6  # the number of different pictures on monitors
MONITOR_ON_SHARE = 0.4  # the share of monitors that are switched on
DESK_LAMP_SHARE = 0.6  # the share of desks with a lamp

# Others
ARMCHAIR_SIDE_M = 0.96  # the side of the square footprint of an armchair, with the space to turn it
ARMCHAIR_HEIGHT_M = 0.9
ARMCHAIR_TURN_DEG = 20.0  # the largest angle between an armchair and the normal of its wall
PLANT_SPREAD = 0.72  # the side of the square footprint of a plant relative to its height: twice houseplant.REACH
CARTON_HEIGHT_M = 0.3


def add_floor_plant(layout: RoomLayout) -> None:
    """Add a plant on the floor, in a corner if one is free."""
    rng = layout.rng
    height_m = float(rng.uniform(0.7, 1.6))
    side_m = PLANT_SPREAD * height_m
    spots = layout.free_spots_at_walls((side_m, side_m, height_m), front_m=0.0, in_corner=True)
    spot = next(spots, None)
    if spot is None:
        return
    layout.add(
        "plant",
        houseplant.houseplant,
        spot.point(GAP_M + side_m / 2),
        yaw_deg=float(rng.uniform(0, 360)),
        height_m=height_m,
        habit=one_of(rng, "broad", "upright", "tree"),
        pot=one_of(rng, *houseplant.POT_COLOURS),
    )
    layout.floor.occupy(spot.footprint(side_m, side_m, GAP_M), height_m)


def add_shelf(layout: RoomLayout, style: Style, widths_m: Sequence[float] = (0.8, 1.0, 1.6)) -> Spot | None:
    """Add a bookcase at a wall, with things on top if it is low. Its width is one of `widths_m`.

    Returns its spot; None if there is no space for it.
    """
    width_m = float(layout.rng.choice(widths_m))
    height_m = float(layout.rng.choice([1.1, 1.8, 2.1]))
    shelf = layout.add_at_wall(
        "shelf",
        furniture.shelf,
        (SHELF_DEPTH_M, width_m, height_m),
        back_m=SHELF_BACK_M,
        front_m=0.5,
        width_m=width_m,
        height_m=height_m,
        tones=style.second_tones,
        seed=layout.seed % BOOK_SEEDS,
    )
    if shelf is None:
        return None
    name, spot = shelf
    if height_m < LOW_SHELF_M:
        top_m = height_m + 0.004  # slightly above the upper board
        items = ("plant", "box", "books")
        add_tabletop_items(layout, name, spot, items, x_m=GAP_M + 0.14, width_m=width_m - 0.1, z_m=top_m)
    return spot


def add_sideboard(layout: RoomLayout, style: Style) -> Spot | None:
    """Add a chest at a wall with a lamp and other things on it. Returns its spot; None if there is no space for it."""
    width_m = float(layout.rng.choice([1.1, 1.3, 1.6]))
    height_m = float(layout.rng.choice([0.7, 0.8, 0.92]))
    chest = layout.add_at_wall(
        "sideboard",
        household.low_board,
        (CHEST_DEPTH_M, width_m, height_m),
        back_m=CHEST_BACK_M,
        width_m=width_m,
        height_m=height_m,
        tones=style.second_tones,
    )
    if chest is None:
        return None
    name, spot = chest
    items = ("lamp", "books", "plant", "box", "mug")
    count = int(layout.rng.integers(2, 5))
    add_tabletop_items(layout, name, spot, items[:count], x_m=GAP_M + 0.22, width_m=width_m - 0.1, z_m=height_m)
    return spot


# --- Dining tables ---


def add_dining_table(layout: RoomLayout, style: Style, seats: int) -> bool:
    """Add a table for 2, 4 or 6 with chairs at its long sides and things on it. Returns whether there was space."""
    width_m = TABLE_WIDTHS_M[seats]
    depth_m = TABLE_DEPTH_M if seats < 6 else LARGE_TABLE_DEPTH_M
    spot = layout.free_spot_on_floor(depth_m + 2 * CHAIR_REACH_M, width_m)
    if spot is None:
        return False
    table = layout.add(
        "dining_table",
        household.table,
        spot.point(0),
        yaw_deg=spot.yaw_deg,
        width_m=width_m,
        depth_m=depth_m,
        tones=style.tones,
    )
    half_depth_m = depth_m / 2 + CHAIR_REACH_M
    footprint = spot.rectangle(-half_depth_m, half_depth_m, -width_m / 2, width_m / 2)
    layout.floor.occupy(footprint, TABLE_HEIGHT_M)
    _add_dining_chairs(layout, style, table, spot, size_m=(depth_m, width_m), chairs_per_side=seats // 2)
    items = _dining_items(layout)
    add_tabletop_items(layout, table, spot, items, x_m=0.0, width_m=width_m - 0.2, z_m=TABLE_HEIGHT_M)
    return True


def _add_dining_chairs(
    layout: RoomLayout,
    style: Style,
    table: str,
    spot: Spot,
    *,
    size_m: tuple[float, float],
    chairs_per_side: int,
) -> None:
    """Add chairs at both long sides of a table. `size_m` is the depth and the width of the table."""
    rng = layout.rng
    depth_m, width_m = size_m
    for sign in (-1, 1):
        for index in range(chairs_per_side):
            y_share = (index + 0.5) / chairs_per_side - 0.5
            y_m = y_share * width_m
            x_m = sign * (depth_m / 2 + float(rng.uniform(0.02, 0.1)))
            towards_table_deg = 180.0 if sign > 0 else 0.0
            turn_deg = towards_table_deg + float(rng.normal(0, 4))
            layout.add(
                "dining_chair",
                _dining_chair,
                spot.point(x_m, y_m),
                CHAIR_RISE_M,
                yaw_deg=spot.yaw_deg + turn_deg,
                may_overlap=(table,),
                style=style,
            )


def _dining_chair(rng: Rng, style: Style) -> list[Part]:
    """A dining chair in the style of the home."""
    if style.has_slat_chairs:
        return household.slat_chair(rng, style.cloths[2], style.tones, has_pad=style.has_pads)
    return household.dining_chair(rng, style.cloths[2], style.tones)


def _dining_items(layout: RoomLayout) -> list[str]:
    """The names of one to three things that lie on a dining table."""
    last = "fruit" if layout.chance(0.3) else "books"
    names = ("mug", "papers", "bottle", "plant", last)
    shuffled = [names[index] for index in layout.rng.permutation(len(names)).tolist()]
    count = int(layout.rng.integers(1, 4))
    return shuffled[:count]


# --- Desks ---


def add_desk(layout: RoomLayout, style: Style) -> Spot | None:
    """Add a desk at a wall with a chair, a computer and other things. Returns its spot; None if there is no space."""
    rng = layout.rng
    width_m = float(rng.choice([1.4, 1.6]))
    desk = layout.add_at_wall(
        "desk",
        furniture.desk,
        (DESK_DEPTH_M + DESK_CHAIR_DEPTH_M, width_m, TABLE_HEIGHT_M),
        back_m=DESK_DEPTH_M / 2,
        front_m=0.2,
        width_m=width_m,
        depth_m=DESK_DEPTH_M,
        tones=style.second_tones,
    )
    if desk is None:
        return None
    name, spot = desk
    layout.add(
        "chair",
        office.task_chair,
        spot.point(GAP_M + DESK_DEPTH_M + 0.24, float(rng.normal(0, 0.06))),
        yaw_deg=spot.yaw_deg + 180 + float(rng.normal(0, 22)),
        may_overlap=(name,),
        colour=style.cloths[3],
    )
    _add_computer(layout, name, spot)
    if layout.chance(DESK_LAMP_SHARE):
        layout.add(
            "desk_lamp",
            furniture.desk_lamp,
            spot.point(GAP_M + 0.14, width_m / 2 - 0.12),
            TABLE_HEIGHT_M,
            yaw_deg=spot.yaw_deg,
            support=name,
            colour=one_of(rng, "#3d7a7c", "#d39a3c", "#b4533a", "#262b30"),
        )
    _add_desk_item(layout, name, spot, width_m)
    return spot


def _add_computer(layout: RoomLayout, desk: str, spot: Spot) -> None:
    """Add a monitor and a keyboard to a desk."""
    rng = layout.rng
    y_m = float(rng.uniform(-0.08, 0.02))
    layout.add(
        "monitor",
        display.monitor,
        spot.point(GAP_M + 0.2, y_m),
        TABLE_HEIGHT_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 5)),
        support=desk,
        width_m=0.5,
        seed=int(rng.integers(SCREEN_SEEDS)),
        is_on=layout.chance(MONITOR_ON_SHARE),
    )
    layout.add(
        "keyboard",
        furniture.keyboard,
        spot.point(GAP_M + 0.48, y_m),
        TABLE_HEIGHT_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 3)),
        support=desk,
    )


def _add_desk_item(layout: RoomLayout, desk: str, spot: Spot, width_m: float) -> None:
    """Add a mug, pens or books at the left end of a desk."""
    third_name = "books" if width_m > 1.5 else "mug"  # only a wide desk has space for books
    name = one_of(layout.rng, "mug", "pens", third_name)
    item = tabletop_items(layout)[name]
    y_m = -width_m / 2 + item.half_width_m + 0.04
    layout.add(
        item.kind,
        item.make,
        spot.point(GAP_M + 0.3, y_m),
        TABLE_HEIGHT_M,
        yaw_deg=spot.yaw_deg + 90,
        support=desk,
        **item.options,
    )


# --- Others ---


def add_armchair(layout: RoomLayout, style: Style) -> None:
    """Add an armchair, in a corner if one is free, turned towards the middle of the room."""
    size_m = (ARMCHAIR_SIDE_M, ARMCHAIR_SIDE_M, ARMCHAIR_HEIGHT_M)
    spots = layout.free_spots_at_walls(size_m, front_m=0.5, in_corner=True)
    spot = next(spots, None)
    if spot is None:
        return
    x_m, y_m = spot.point(GAP_M + 0.47)
    middle_x_m, middle_y_m = layout.room.rect.center_m
    towards_deg = float(np.rad2deg(np.arctan2(middle_y_m - y_m, middle_x_m - x_m)))
    difference_deg = (towards_deg - spot.yaw_deg + 180) % 360 - 180  # from -180 to 180
    turn_deg = float(np.clip(difference_deg, -ARMCHAIR_TURN_DEG, ARMCHAIR_TURN_DEG))
    layout.add(
        "armchair",
        bedroom.armchair,
        (x_m, y_m),
        yaw_deg=spot.yaw_deg + turn_deg,
        colour=style.cloths[1],
        tones=style.tones,
    )
    layout.floor.occupy(spot.footprint(ARMCHAIR_SIDE_M, ARMCHAIR_SIDE_M, GAP_M), ARMCHAIR_HEIGHT_M)


def add_cartons(layout: RoomLayout) -> None:
    """Add two cartons, one on the other, in a corner if one is free."""
    rng = layout.rng
    lower = layout.add_at_wall(
        "carton",
        furniture.carton,
        (0.42, 0.5, CARTON_HEIGHT_M),
        back_m=0.2,
        front_m=0.0,
        in_corner=True,
        seed=int(rng.integers(CARTON_SEEDS)),
    )
    if lower is None:
        return
    name, spot = lower
    layout.add(
        "carton",
        furniture.carton,
        spot.point(GAP_M + 0.2),
        CARTON_HEIGHT_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 8)),
        support=name,
        size_m=(0.28, 0.36, 0.22),
        seed=int(rng.integers(CARTON_SEEDS)),
    )
