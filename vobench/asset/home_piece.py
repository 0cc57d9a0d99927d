"""What several rooms of a home have: bins, and pictures and sockets on the walls."""

from vobench.asset import furniture
from vobench.asset.palette import Style
from vobench.asset.room_layout import RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.wall_decoration import add_pictures, add_sockets

WARDROBE_M = (0.66, 2.34)  # depth and height of the space for a wardrobe, with the boxes on top of some
BIN_SPARE_M = 0.04  # by which the space for a bin is wider and higher than the bin


def add_bin(layout: RoomLayout, *, width_m: float, height_m: float, back_m: float) -> None:
    """Add a bin in a corner if one is free. `back_m` is the distance between the back of its space and its middle."""
    space_m = (width_m + BIN_SPARE_M, width_m + BIN_SPARE_M, height_m + BIN_SPARE_M)
    layout.add_at_wall(
        "bin",
        furniture.waste_bin,
        space_m,
        back_m=back_m,
        front_m=0.0,
        in_corner=True,
        width_m=width_m,
        height_m=height_m,
    )


def decorate_walls(layout: RoomLayout, style: Style, *, above: Spot | None = None) -> None:
    """Add one or two pictures, where there is space above a spot, and a socket."""
    count = int(layout.rng.integers(1, 3))
    add_pictures(layout, style, count, [above])
    add_sockets(layout, 1)
