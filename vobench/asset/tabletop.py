"""Things that lie on tables, desks and chests, in a row on a surface."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from vobench.asset import furniture, household, houseplant, kitchen
from vobench.asset.picture import one_of
from vobench.asset.room_layout import PieceMaker, RoomLayout
from vobench.asset.spot import Spot

TABLE_HEIGHT_M = 0.74  # the height of desks and dining tables, as in furniture.desk and household.table
BOOK_SEEDS = 6  # the number of pictures of book spines; few, so that the shelves of many places share them
CARTON_SEEDS = 4  # the number of pictures of cartons
# The kinds that are rotated by 90 degrees, so that their long side is along the surface.
ROTATED_KINDS = ("books", "papers")
YAW_NOISE_DEG = 9.0  # the standard deviation of the yaw of items


@dataclass(frozen=True, slots=True)
class TabletopItem:
    """A kind of thing that lies on surfaces.

    `kind` is the name that its pieces get.
    `make` is a function such that `make(rng, **options)` returns its parts.
    `half_width_m` is half of the width that is reserved for it.
    `options` are the keyword arguments of `make`.
    """

    kind: str
    make: PieceMaker
    half_width_m: float
    options: dict[str, Any] = field(default_factory=dict)


def tabletop_items(layout: RoomLayout) -> dict[str, TabletopItem]:
    """The things that may lie on a surface, by name.

    All of them are drawn in the same order, no matter which are used, so that the random numbers do not depend on it.
    """
    rng = layout.rng
    books = {"count": int(rng.integers(2, 6)), "seed": layout.seed % BOOK_SEEDS}
    papers = {"count": int(rng.integers(1, 4)), "spread_m": 0.03}
    plant = {
        "height_m": float(rng.uniform(0.26, 0.36)),
        "habit": one_of(rng, *houseplant.HABITS),
        "pot": one_of(rng, *houseplant.POT_COLOURS),
    }
    box = {"size_m": (0.2, 0.28, 0.14), "seed": int(rng.integers(CARTON_SEEDS))}
    lamp = {
        "height_m": float(rng.uniform(0.42, 0.55)),
        "wide_m": 0.26,
        "colour": one_of(rng, "#c9b48c", "#d8c3a0", "#a7b3bc"),
    }
    return {
        "mug": TabletopItem("mug", furniture.mug, 0.08),
        "books": TabletopItem("books", furniture.book_stack, 0.19, books),
        "papers": TabletopItem("papers", furniture.papers, 0.25, papers),
        "plant": TabletopItem("plant", houseplant.houseplant, 0.17, plant),
        "fruit": TabletopItem("fruit", household.fruit_bowl, 0.16),
        "pens": TabletopItem("pens", furniture.pens, 0.06),
        "bottle": TabletopItem("bottle", lambda _: kitchen.bottle(), 0.05),
        "box": TabletopItem("box", furniture.carton, 0.16, box),
        "lamp": TabletopItem("table_lamp", household.floor_lamp, 0.15, lamp),
    }


def add_tabletop_items(
    layout: RoomLayout,
    support: str,
    spot: Spot,
    names: Sequence[str],
    *,
    x_m: float,
    width_m: float,
    z_m: float,
) -> None:
    """Put things in a row along y on a surface, in random order. Those for which there is no space are left out.

    Args:
        layout: the room.
        support: the name of the piece whose surface it is.
        spot: the frame of the surface, whose middle is at y = 0.
        names: keys of `tabletop_items`.
        x_m: the x of the row.
        width_m: the width of the surface.
        z_m: the height of the surface above the floor.
    """
    rng = layout.rng
    available = tabletop_items(layout)
    items = []
    occupied_m = 0.0
    for index in rng.permutation(len(names)).tolist():
        item = available[names[index]]
        item_width_m = 2 * item.half_width_m
        if occupied_m + item_width_m <= width_m:
            items.append(item)
            occupied_m += item_width_m
    if not items:
        return

    mean_gap_m = (width_m - occupied_m) / (len(items) + 1)
    y_m = -width_m / 2
    for item in items:
        y_m += item.half_width_m + mean_gap_m * float(rng.uniform(0.5, 1.5))
        last_y_m = width_m / 2 - item.half_width_m
        y_m = min(y_m, last_y_m)
        rotation_deg = 90.0 if item.kind in ROTATED_KINDS else 0.0
        yaw_deg = spot.yaw_deg + rotation_deg + float(rng.normal(0, YAW_NOISE_DEG))
        position_m = spot.point(x_m, y_m)
        layout.add(item.kind, item.make, position_m, z_m, yaw_deg=yaw_deg, support=support, **item.options)
        y_m += item.half_width_m
