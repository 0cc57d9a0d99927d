"""Finds a place for a row of kitchen units at a wall, and the largest free part of the floor."""

from dataclasses import dataclass

from vobench.asset import kitchen
from vobench.asset.floor_plan import SIDES, Rect, Side, along_m
from vobench.asset.palette import Style
from vobench.asset.placed_piece import vertices_of
from vobench.asset.room_layout import FRONT_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.wall_space import region_around

LENGTHS_M = (3.6, 3.3, 3.0, 2.7, 2.4, 2.1, 1.8)  # the lengths of rows, in the order in which they are tried
WALL_END_M = 0.01  # the distance of a row from the end of its wall
WORKTOP_HEIGHT_M = 0.92  # the height of a row below a window: that of the worktop, and 2 cm above it
ROW_HEIGHT_M = 2.2  # the height of the fridge and the wall cupboards
END_UNIT_M = 0.66  # the width of the high unit at each end of a row: the fridge with its side panels
WALL_GAP_M = 0.002  # the distance of a row from the wall, so that their surfaces do not coincide
WORKTOP_EDGE_M = 0.03  # the distance by which fronts and handles project beyond the worktop


@dataclass(frozen=True, slots=True)
class _RowPlace:
    """A place for a row of kitchen units at a wall.

    `spot` is the spot at the middle of the row.
    `length_m` is the length of the row.
    `windows_m` are the windows behind the row: the first and the last coordinate of each along the wall.
    """

    spot: Spot
    length_m: float
    windows_m: tuple[tuple[float, float], ...]

    @property
    def start_m(self) -> float:
        """The first coordinate of the row along the wall."""
        return self.spot.along_m - self.length_m / 2

    @property
    def end_m(self) -> float:
        """The last coordinate of the row along the wall."""
        return self.spot.along_m + self.length_m / 2

    @property
    def window_y_m(self) -> tuple[float, float] | None:
        """The range of y, in the frame of the spot, that the windows behind the row cover; None without windows."""
        if not self.windows_m:
            return None
        start_m = min(start for start, _ in self.windows_m) - self.spot.along_m
        end_m = max(end for _, end in self.windows_m) - self.spot.along_m
        sign = _sign_along(self.spot)
        first_y_m, last_y_m = sorted([sign * start_m, sign * end_m])
        return first_y_m, last_y_m

    @property
    def has_clear_ends(self) -> bool:
        """Whether no window is behind the units at the ends. They are too high to stand in front of a window."""
        for window_start_m, window_end_m in self.windows_m:
            to_start_m = window_start_m - self.start_m
            to_end_m = self.end_m - window_end_m
            if to_start_m <= END_UNIT_M or to_end_m <= END_UNIT_M:
                return False
        return True


def _sign_along(spot: Spot) -> int:
    """1 if the y axis of a spot has the direction of the coordinate along its wall, and -1 if it is opposite."""
    x_m, y_m = spot.point(0, 1)
    along_m = y_m if spot.side in ("east", "west") else x_m
    return 1 if along_m > spot.along_m else -1


def add_kitchen_row(layout: RoomLayout, style: Style) -> Spot | None:
    """Add the longest row of kitchen units that fits, at an end of a wall. Its worktop may pass below a window.

    Returns the spot at the middle of the row; None if there is no space for it.
    """
    for length_m in LENGTHS_M:
        for side_index in layout.rng.permutation(len(SIDES)).tolist():
            side: Side = tuple(SIDES)[side_index]
            start_m, end_m = layout.room.span_m(side)
            if end_m - start_m < length_m + 2 * WALL_END_M:
                continue
            first_m = start_m + length_m / 2 + WALL_END_M
            last_m = end_m - length_m / 2 - WALL_END_M
            for middle_m in (first_m, last_m):
                place = _row_place(layout, layout.spot(side, middle_m), length_m)
                if _fits(layout, place):
                    _add_row(layout, style, place)
                    return place.spot
    return None


def _row_place(layout: RoomLayout, spot: Spot, length_m: float) -> _RowPlace:
    """The place of a row of a length at a spot, with the windows behind it."""
    row_start_m = spot.along_m - length_m / 2
    row_end_m = spot.along_m + length_m / 2
    windows_m = []
    for window in layout.plan.windows_of(layout.room):
        start_m, end_m = along_m(spot.side, window.rect)
        is_in_wall = layout.room.side_at(window.rect) == spot.side
        is_behind_row = start_m < row_end_m and end_m > row_start_m
        if is_in_wall and is_behind_row:
            windows_m.append((start_m, end_m))
    return _RowPlace(spot, length_m, tuple(windows_m))


def _fits(layout: RoomLayout, place: _RowPlace) -> bool:
    """Whether a row can stand at a place: its ends, the wall and the floor are free."""
    height_m = WORKTOP_HEIGHT_M if place.windows_m else ROW_HEIGHT_M
    spot = place.spot
    region = region_around(spot.along_m, width_m=place.length_m, bottom_m=0.0, top_m=height_m)
    footprint = spot.footprint(kitchen.ROW_DEPTH_M, place.length_m)
    front = spot.footprint(FRONT_M, place.length_m, kitchen.ROW_DEPTH_M)
    is_wall_free = layout.walls.is_free(spot.side, region)
    return place.has_clear_ends and is_wall_free and layout.floor.fits([footprint], [front])


def _add_row(layout: RoomLayout, style: Style, place: _RowPlace) -> None:
    """Add a row at a place, and mark its part of the floor and the wall as occupied."""
    spot = place.spot
    layout.add(
        "kitchen_row",
        kitchen.row,
        spot.point(WALL_GAP_M),
        yaw_deg=spot.yaw_deg,
        length_m=place.length_m,
        ceiling_m=layout.plan.height_m,
        style=style.kitchen,
        window=place.window_y_m,
    )
    footprint = spot.footprint(kitchen.ROW_DEPTH_M + WORKTOP_EDGE_M, place.length_m)
    region = region_around(spot.along_m, width_m=place.length_m, bottom_m=0.0, top_m=ROW_HEIGHT_M)
    layout.floor.occupy(footprint, ROW_HEIGHT_M)
    layout.walls.occupy(spot.side, region)


def middle_of_free_floor(layout: RoomLayout) -> tuple[float, float]:
    """The centre (x, y) of a room or, if it has a row of kitchen units, of the largest rectangle beside the row."""
    rect = layout.room.rect
    row = next((piece for piece in layout.placed if ".kitchen_row_" in piece.name), None)
    if row is None:
        return rect.center_m
    vertices_m = vertices_of(row.parts)
    low_x, low_y, _ = vertices_m.min(axis=0).tolist()
    high_x, high_y, _ = vertices_m.max(axis=0).tolist()
    beside_row = [
        Rect(rect.x0, rect.y0, low_x, rect.y1),
        Rect(high_x, rect.y0, rect.x1, rect.y1),
        Rect(rect.x0, rect.y0, rect.x1, low_y),
        Rect(rect.x0, high_y, rect.x1, rect.y1),
    ]
    return max(beside_row, key=_area_m2).center_m


def _area_m2(rect: Rect) -> float:
    """The area of a rectangle; 0 if its last coordinate is less than its first one on an axis."""
    return max(rect.width_m, 0) * max(rect.depth_m, 0)
