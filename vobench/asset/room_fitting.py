"""The fittings of every room: the linings and leaves of doors, the front door, and skirting boards."""

from collections.abc import Iterator, Mapping
from itertools import pairwise

from vobench.asset import doorway, furniture
from vobench.asset.floor_plan import SIDES, FloorPlan, Passage, Side, along_m
from vobench.asset.furniture import WHITE, Part
from vobench.asset.picture import Rng
from vobench.asset.placed_piece import SHELL
from vobench.asset.room_layout import CASING_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.scene.material import Material

ENTRANCE_MARGIN_M = 0.1  # beside the front door, without a skirting board
LEAST_SKIRTING_M = 0.03  # the length of a skirting board


def door_fittings(plan: FloorPlan, layouts: Mapping[str, RoomLayout], material: Material, *, panels: bool) -> None:
    """Add the linings and the open leaves of all doors, and the front door."""
    for passage in plan.passages:
        if passage.kind == "door":
            owner = passage.opens_into or passage.rooms[0]
            _add_door(layouts[owner], passage, material, panels=panels)
    _add_entrance(layouts[plan.entrance.room], plan, material)


def _add_door(layout: RoomLayout, passage: Passage, material: Material, *, panels: bool) -> None:
    """Add the lining of a door and its leaf, if it has one, to the room into which it opens."""
    spot = layout.spot_at_hole(passage.rect)
    wall_m = min(passage.rect.width_m, passage.rect.depth_m)  # thickness
    layout.add(
        "lining",
        lambda _, **size: doorway.lining(**size),
        spot.point(-wall_m / 2),
        yaw_deg=spot.yaw_deg,
        support=SHELL,
        width_m=2 * layout.half_width_m(passage.rect),
        height_m=passage.head_m,
        wall_m=wall_m,
        material=material,
    )
    if passage.has_leaf:
        _add_leaf(layout, passage, spot, material, panels=panels)


def _add_entrance(layout: RoomLayout, plan: FloorPlan, material: Material) -> None:
    """Add the closed front door."""
    spot = layout.spot_at_hole(plan.entrance.rect)
    layout.add(
        "entrance",
        doorway.entrance,
        spot.point(0.0),
        yaw_deg=spot.yaw_deg,
        support=SHELL,
        width_m=2 * layout.half_width_m(plan.entrance.rect),
        height_m=plan.entrance.head_m,
        material=material,
    )


def _add_leaf(layout: RoomLayout, passage: Passage, spot: Spot, material: Material, *, panels: bool) -> None:
    """A leaf that stands open at a right angle to its wall, or nearly so."""
    hinge_y_m = layout.hinge_y_m(passage, spot)
    sign = 1 if hinge_y_m > 0 else -1
    inner_y_m = hinge_y_m - sign * (doorway.LINING_M + doorway.LEAF_M / 2)
    swing_deg = layout.rng.uniform(0, 4)
    layout.add(
        "leaf",
        doorway.leaf,
        spot.point(0.012, inner_y_m),
        yaw_deg=spot.yaw_deg - 90 + sign * swing_deg,
        support=SHELL,
        width_m=2 * (abs(hinge_y_m) - doorway.LINING_M) - 0.006,
        height_m=passage.head_m - doorway.LINING_M - 0.006,
        material=material,
        has_panels=panels,
    )


def skirtings(layout: RoomLayout, height_m: float = 0.08) -> None:
    """Add skirting boards along the walls, between the doors."""
    for side in SIDES:
        first_m, last_m = layout.room.span_m(side)
        cuts = sorted(_skirting_cuts(layout, side, height_m))
        ends = [first_m, *(end for cut in cuts for end in cut), last_m]
        for start_m, end_m in list(pairwise(ends))[::2]:
            if end_m - start_m > LEAST_SKIRTING_M:
                spot = layout.spot(side, (start_m + end_m) / 2)
                layout.add(
                    "skirting",
                    _skirting,
                    spot.point(0),
                    yaw_deg=spot.yaw_deg,
                    support=SHELL,
                    length_m=end_m - start_m,
                    height_m=height_m,
                )


def _skirting_cuts(layout: RoomLayout, side: Side, height_m: float) -> Iterator[tuple[float, float]]:
    """The parts of a wall without a skirting board: at doorways, with their casings, and at windows that are low."""
    plan = layout.plan
    room = layout.room
    doorways = []  # (rectangle, margin beside it in metres)
    for passage in plan.passages_of(room):
        if passage.is_walkable:
            margin_m = CASING_M - 0.02 if passage.kind == "door" else 0.0
            doorways.append((passage.rect, margin_m))
    if plan.entrance.room == room.name:
        doorways.append((plan.entrance.rect, ENTRANCE_MARGIN_M))

    for rect, margin_m in doorways:
        if room.side_at(rect) == side:
            start_m, end_m = along_m(side, rect)
            yield start_m - margin_m, end_m + margin_m
    for window in plan.windows_of(room):
        is_low = window.sill_m < height_m + 0.05
        if is_low and room.side_at(window.rect) == side:
            yield along_m(side, window.rect)


def _skirting(_: Rng, length_m: float, height_m: float) -> list[Part]:
    """A plain skirting board."""
    return [furniture.stood((0.014, length_m, height_m), WHITE, 0.007, bevel=0)]
