"""A bed with its head at a wall, and tables beside it."""

from collections.abc import Sequence

from vobench.asset import bedroom
from vobench.asset.floor_plan import Rect
from vobench.asset.palette import Style
from vobench.asset.room_layout import GAP_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.tabletop import add_tabletop_items


def add_bed(layout: RoomLayout, style: Style, widths_m: Sequence[float]) -> Spot | None:
    """Add a bed of one of the widths, and tables with lamps beside it if there is space.

    Returns the spot of the bed; None if there is no space for it.
    """
    for width_m in sorted(layout.rng.choice(widths_m, 2).tolist(), reverse=True):
        placed = layout.add_at_wall(
            "bed",
            bedroom.bed,
            (bedroom.BED_LENGTH_M + 0.05, width_m + 0.1, 0.95),
            back_m=0.0,
            front_m=0.35,
            width_m=width_m,
            tones=style.tones,
            linen=style.linen,
            cover=style.cover,
        )
        if placed is None:
            continue
        _, spot = placed
        for side in (-1, 1):
            y = side * (width_m / 2 + 0.08 + 0.23)
            body = spot.rectangle(GAP_M, GAP_M + 0.42, y - 0.225, y + 0.225)
            if layout.floor.fits([body]):
                _add_bedside_table(layout, style, spot, y, body)
        return spot
    return None


def _add_bedside_table(layout: RoomLayout, style: Style, spot: Spot, y: float, body: Rect) -> None:
    """Add a table with a lamp or a mug at a distance y along the wall from the middle of the bed."""
    name = layout.add(
        "bedside_table",
        bedroom.bedside_table,
        spot.point(GAP_M, y),
        yaw_deg=spot.yaw_deg,
        tones=style.tones,
    )
    layout.floor.occupy(body, 0.5)
    add_tabletop_items(
        layout,
        name,
        Spot(*spot.point(0, y), spot.yaw_deg, spot.side),
        ("lamp", "mug"),
        x_m=GAP_M + 0.2,
        width_m=0.42,
        z_m=0.5,
    )
