"""Pictures and sockets on the walls of a room."""

from collections.abc import Sequence

from vobench.asset import fitting
from vobench.asset.furniture import Part, coated, put
from vobench.asset.palette import Style
from vobench.asset.picture import Rng, one_of
from vobench.asset.room_layout import RoomLayout
from vobench.asset.spot import Spot

WIDE_PRINTS_M = ((0.9, 0.6), (1.1, 0.8), (0.7, 0.5))  # width, height
TALL_PRINTS_M = ((0.5, 0.7), (0.42, 0.6), (0.6, 0.85))
ABOVE_FURNITURE_M = 1.02  # the least height of the lower edge of a picture above a piece of furniture
FRAME_WIDTH_M = 0.025
FRAME_DEPTH_M = 0.02
SOCKET_M = (0.16, 0.09)  # width and height of the space for a socket
SOCKET_HEIGHT_M = 0.3


def add_pictures(layout: RoomLayout, style: Style, count: int, above: Sequence[Spot | None] = ()) -> None:
    """Hang pictures: first above pieces of furniture at spots (None is skipped), then anywhere.

    At most count + 1 are tried.
    """
    rng = layout.rng
    furniture_spots = [spot for spot in above if spot is not None]
    spots: list[Spot | None] = [*furniture_spots, *([None] * count)]
    for spot in spots[: count + 1]:
        is_wide = layout.chance(0.5)
        width_m, height_m = WIDE_PRINTS_M[int(rng.integers(len(WIDE_PRINTS_M)))]
        if not is_wide:
            width_m, height_m = TALL_PRINTS_M[int(rng.integers(len(TALL_PRINTS_M)))]
        middle_m = float(rng.uniform(1.5, 1.68))
        if spot is not None:
            middle_m = max(middle_m, ABOVE_FURNITURE_M + height_m / 2)
        layout.add_on_wall(
            "picture",
            framed_print,
            (width_m, height_m),
            middle_m=middle_m,
            above=spot,
            style=one_of(rng, "hills", "circles"),
            seed=style.prints[int(rng.integers(len(style.prints)))],
            width_m=width_m,
            height_m=height_m,
            frame=style.frame,
        )


def framed_print(rng: Rng, *, style: str, width_m: float, height_m: float, seed: int, frame: str) -> list[Part]:
    """A print in a frame, like `fitting.framed` but with sharp edges, and so with fewer faces."""
    face = fitting.framed(rng, style, width_m, height_m, seed, frame)[0]
    border = fitting.bars(width_m, height_m, FRAME_WIDTH_M, FRAME_DEPTH_M, bevel_m=0)
    return [face, put(border, coated(frame), 0.011)]


def add_sockets(layout: RoomLayout, count: int) -> None:
    """Add sockets with one or two outlets low on the walls."""
    for _ in range(count):
        outlets = int(layout.rng.integers(1, 3))
        layout.add_on_wall("socket", fitting.socket, SOCKET_M, middle_m=SOCKET_HEIGHT_M, count=outlets)
