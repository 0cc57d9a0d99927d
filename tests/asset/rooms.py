"""A room of its own, for tests of what furnishes rooms."""

import numpy as np

from vobench.asset.floor_plan import FloorPlan, Rect, Room, Window
from vobench.asset.palette import Style, home_style, office_style
from vobench.asset.room_layout import RoomLayout


def room_layout(use: str = "study", *, size_m: float = 4.0, seed: int = 0) -> RoomLayout:
    """The layout of an empty square room around the origin, with a window in the north and a door in the west."""
    half_m = size_m / 2
    room = Room(f"{use}_1", use, Rect(-half_m, -half_m, half_m, half_m))
    window = Window(room.name, Rect(-0.6, half_m, 0.6, half_m + 0.2), 0.9, 2.2)
    entrance = Window(room.name, Rect(-half_m - 0.12, -half_m + 0.5, -half_m, -half_m + 1.4), 0.0, 2.05)
    plan = FloorPlan((room,), (), (window,), entrance, 2.6)
    return RoomLayout(plan, room, seed, np.random.default_rng(seed))


def home() -> Style:
    return home_style(np.random.default_rng(0))


def office() -> Style:
    return office_style(np.random.default_rng(0))


def kinds(layout: RoomLayout) -> list[str]:
    """The kinds of the pieces of a room, in the order in which they were added."""
    return [piece.name.split(".")[1].rsplit("_", 1)[0] for piece in layout.placed]
