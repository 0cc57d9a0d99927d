"""Workstations of offices: desks with chairs and computers, alone at a wall or in blocks of pairs face to face."""

from dataclasses import dataclass

import numpy as np

from vobench.asset import display, furniture, office
from vobench.asset.floor_plan import Side
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.placed_piece import SHELL
from vobench.asset.room_layout import GAP_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.tabletop import TABLE_HEIGHT_M, tabletop_items
from vobench.asset.wall_space import region_around
from vobench.scene.material import Material

DESK_WIDTHS_M = (1.4, 1.6)
DESK_DEPTH_M = 0.8
SEAT_M = 0.72  # of floor behind a desk for its chair
DESK_GAP_M = 0.02  # between desks side by side
BACK_GAP_M = 0.012  # from the middle of a block to the back of each desk, for the screen
CHAIR_TURN_DEG = 40.0  # by which a chair is turned away from its desk, at most
SCREEN_SEEDS = 4  # pictures on displays, from which those of an office are drawn

# Blocks of desks
AISLE_M = 0.95  # between blocks
ACROSS_FREE_M = 1.7  # of the width of the room that is left beside a block
ALONG_FREE_M = 1.2  # of the length of the room that is left beyond all blocks
MOST_PAIRS = 3  # side by side in a block
BLOCK_HEIGHT_M = 1.15  # with screens and displays
BLOCK_WALL_M = 0.35  # from a block to the wall beside it, where it is tried first
BLOCK_LEAST_WALL_M = 0.1
BLOCK_TRIES = 6  # other positions

# Desks at a wall
WALL_DESK_FRONT_M = 0.25  # of free floor behind the chair
CHAIR_HEIGHT_M = 0.9
DISPLAY_TOP_M = 1.2  # the height of what a desk hides of its wall


def add_workstation(layout: RoomLayout, style: Style, spot: Spot, width_m: float, top: Material) -> None:
    """Add a desk whose back is at a spot, with a chair, a computer and other things."""
    desk = layout.add(
        "desk",
        office.plain_desk,
        spot.point(DESK_DEPTH_M / 2),
        yaw_deg=spot.yaw_deg,
        width_m=width_m,
        depth_m=DESK_DEPTH_M,
        look=top,
    )
    _add_seat(layout, style, spot, width_m, desk)
    _add_computer(layout, spot, desk)
    _add_desk_items(layout, spot, width_m, desk)


def _add_seat(layout: RoomLayout, style: Style, spot: Spot, width_m: float, desk: str) -> None:
    """Add a chair and, below most desks, a pedestal of drawers."""
    rng = layout.rng
    chair_x_m = DESK_DEPTH_M + float(rng.uniform(0.2, 0.36))
    chair_y_m = float(rng.normal(0, 0.06))
    turn_deg = float(np.clip(rng.normal(0, 25), -CHAIR_TURN_DEG, CHAIR_TURN_DEG))
    layout.add(
        "chair",
        office.task_chair,
        spot.point(chair_x_m, chair_y_m),
        yaw_deg=spot.yaw_deg + 180 + turn_deg,
        may_overlap=(desk,),
        colour=style.cloths[0],
    )
    if layout.chance(0.7):
        side = 1 if layout.chance(0.5) else -1
        layout.add(
            "pedestal",
            office.pedestal,
            spot.point(DESK_DEPTH_M / 2 - 0.05, side * (width_m / 2 - 0.3)),
            yaw_deg=spot.yaw_deg,
            may_overlap=(desk,),
        )


def _add_computer(layout: RoomLayout, spot: Spot, desk: str) -> None:
    """Add a monitor, with a keyboard or without, or a laptop. Only the first monitor of a room may be on."""
    rng = layout.rng
    screen_seed = int(rng.integers(SCREEN_SEEDS))
    is_first = not any(".monitor_" in piece.name for piece in layout.placed)
    y_m = float(rng.uniform(-0.06, 0.06))
    has_monitor = layout.chance(0.75)
    if not has_monitor:
        layout.add(
            "laptop",
            display.laptop_off,
            spot.point(0.42, y_m),
            TABLE_HEIGHT_M,
            yaw_deg=spot.yaw_deg + float(rng.normal(0, 10)),
            support=desk,
            seed=screen_seed,
        )
        return
    layout.add(
        "monitor",
        display.monitor,
        spot.point(0.26, y_m),
        TABLE_HEIGHT_M,
        yaw_deg=spot.yaw_deg + float(rng.normal(0, 6)),
        support=desk,
        width_m=float(rng.choice([0.52, 0.6])),
        seed=screen_seed,
        is_on=is_first and layout.chance(0.6),
    )
    if layout.chance(0.5):
        layout.add(
            "keyboard",
            furniture.keyboard,
            spot.point(0.58, y_m),
            TABLE_HEIGHT_M,
            yaw_deg=spot.yaw_deg + float(rng.normal(0, 4)),
            support=desk,
        )


def _add_desk_items(layout: RoomLayout, spot: Spot, width_m: float, desk: str) -> None:
    """Put a mug, pens or papers on one end of a desk, on both, or on none."""
    rng = layout.rng
    available = tabletop_items(layout)
    for side in (-1, 1):
        if layout.chance(0.7):
            item = available[one_of(rng, "mug", "pens", "papers", "mug")]
            y_m = side * (width_m / 2 - max(item.half_width_m, 0.1) - 0.05)
            yaw_deg = spot.yaw_deg + 90 + float(rng.normal(0, 8))
            x_m = float(rng.uniform(0.24, 0.5))
            xy_m = spot.point(x_m, y_m)
            layout.add(item.kind, item.make, xy_m, TABLE_HEIGHT_M, yaw_deg=yaw_deg, support=desk, **item.options)


# --- Desks at a wall ---


def add_wall_workstation(layout: RoomLayout, style: Style, top: Material) -> None:
    """Add a workstation at a wall or below a window if there is space for it."""
    width_m = float(layout.rng.choice(DESK_WIDTHS_M))
    depth_m = DESK_DEPTH_M + SEAT_M
    spots = layout.free_spots_at_walls((depth_m, width_m, TABLE_HEIGHT_M), front_m=WALL_DESK_FRONT_M)
    spot = next(spots, None)
    if spot is None:
        return
    back = Spot(*spot.point(GAP_M), spot.yaw_deg, spot.side)
    add_workstation(layout, style, back, width_m - DESK_GAP_M, top)
    layout.floor.occupy(spot.footprint(depth_m, width_m, GAP_M), CHAIR_HEIGHT_M)
    layout.walls.occupy(spot.side, region_around(spot.along_m, width_m=width_m, bottom_m=0.0, top_m=DISPLAY_TOP_M))


# --- Blocks of desks ---


@dataclass(frozen=True, slots=True)
class _DeskBlock:
    """A block of desks: pairs face to face, side by side along y of its spot, which is at its middle."""

    spot: Spot
    pairs: int
    desk_width_m: float  # with the gap beside the desk
    top: Material
    has_screens: bool

    def middles_y_m(self) -> list[float]:
        """The y of the middle of each pair."""
        return [(pair - (self.pairs - 1) / 2) * self.desk_width_m for pair in range(self.pairs)]


def add_desk_blocks(layout: RoomLayout, style: Style, top: Material) -> int:
    """Add blocks of desks across a room, with aisles between them. Returns the number of desks."""
    rng = layout.rng
    rect = layout.room.rect
    is_along_x = rect.width_m >= rect.depth_m
    side: Side = "west" if is_along_x else "south"
    length_m = layout.length_from_m(side)
    across_m = min(rect.width_m, rect.depth_m)
    desk_width_m = float(rng.choice(DESK_WIDTHS_M))
    block_depth_m = 2 * (DESK_DEPTH_M + SEAT_M)
    pitch_m = block_depth_m + AISLE_M
    most_pairs = min(MOST_PAIRS, int((across_m - ACROSS_FREE_M) / desk_width_m))
    block_count = int((length_m - ALONG_FREE_M) / pitch_m)
    has_screens = layout.chance(0.6)

    desk_count = 0
    margin_m = (length_m - block_count * pitch_m) / 2
    for number in range(block_count):
        distance_m = margin_m + (number + 0.5) * pitch_m
        for pairs in range(most_pairs, 0, -1):
            spot = _occupied_block_spot(layout, side, distance_m, (block_depth_m, pairs * desk_width_m))
            if spot is not None:
                _add_block(layout, style, _DeskBlock(spot, pairs, desk_width_m, top, has_screens))
                desk_count += 2 * pairs
                break
    return desk_count


def _occupied_block_spot(layout: RoomLayout, side: Side, distance_m: float, size_m: tuple[float, float]) -> Spot | None:
    """Find the spot for the middle of a block at a distance from a wall, and occupy its floor.

    size_m: extent of the block away from the wall and along it. None if there is no space for it.
    """
    depth_m, width_m = size_m
    start_m, end_m = layout.room.span_m(side)
    first_m = start_m + width_m / 2
    last_m = end_m - width_m / 2
    least_m = first_m + BLOCK_LEAST_WALL_M
    most_m = max(last_m - BLOCK_LEAST_WALL_M, least_m)
    others_m = layout.rng.uniform(least_m, most_m, BLOCK_TRIES).tolist()
    for along in (first_m + BLOCK_WALL_M, last_m - BLOCK_WALL_M, *others_m):
        at_wall = layout.spot(side, along)
        spot = Spot(*at_wall.point(distance_m), at_wall.yaw_deg, side)
        footprint = spot.rectangle(-depth_m / 2, depth_m / 2, -width_m / 2, width_m / 2)
        if layout.floor.fits([footprint]):
            layout.floor.occupy(footprint, BLOCK_HEIGHT_M)
            return spot
    return None


def _add_block(layout: RoomLayout, style: Style, block: _DeskBlock) -> None:
    """Add the desks of a block, and the screens between them if it has any."""
    spot = block.spot
    for y_m in block.middles_y_m():
        for sign in (-1, 1):
            back_x_m, back_y_m = spot.point(sign * BACK_GAP_M, y_m)
            yaw_deg = spot.yaw_deg + (0.0 if sign > 0 else 180.0)
            back = Spot(back_x_m, back_y_m, yaw_deg, spot.side)
            add_workstation(layout, style, back, block.desk_width_m - DESK_GAP_M, block.top)
    if not block.has_screens:
        return
    for y_m in block.middles_y_m():
        layout.add(
            "screen",
            office.desk_screen,
            spot.point(0, y_m),
            TABLE_HEIGHT_M,
            yaw_deg=spot.yaw_deg,
            support=SHELL,
            width_m=block.desk_width_m - 0.06,
            colour=style.accent_cloths[0],
        )
