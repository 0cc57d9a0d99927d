"""The place of a row of kitchen units at a wall, and the floor that it leaves."""

from dataclasses import dataclass

from vobench.asset import kitchen
from vobench.asset.floor_plan import SIDES, Rect, Side, along_m
from vobench.asset.palette import Style
from vobench.asset.placed_piece import vertices_of
from vobench.asset.room_layout import FRONT_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.wall_space import region_around

LENGTHS_M = (3.6, 3.3, 3.0, 2.7, 2.4, 2.1, 1.8)  # of rows, in the order in which they are tried
WALL_END_M = 0.01  # between a row and the end of its wall
WORKTOP_HEIGHT_M = 0.92  # of what stands below a window: the worktop, and 2 cm above it
ROW_HEIGHT_M = 2.2  # of the fridge and the wall cupboards
END_UNIT_M = 0.66  # at either end of a row without a window behind it: the fridge with its side panels
WALL_GAP_M = 0.002  # between the row and the wall, so that their surfaces are apart
WORKTOP_EDGE_M = 0.03  # by which fronts and handles reach beyond the worktop


@dataclass(frozen=True, slots=True)
class _RowPlace:
    """A place for a row at a wall: the spot at its middle, its length, and the windows behind it.

    `windows_m` are the first and last coordinates of the windows along the wall.
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
        """The first and last y of the windows behind the row in the frame of its spot; None if there are none."""
        if not self.windows_m:
            return None
        start_m = min(start for start, _ in self.windows_m) - self.spot.along_m
        end_m = max(end for _, end in self.windows_m) - self.spot.along_m
        sign = _sign_along(self.spot)
        return min(sign * start_m, sign * end_m), max(sign * start_m, sign * end_m)


def _sign_along(spot: Spot) -> int:
    """Whether y of a spot runs along the coordinate of its wall (1) or against it (-1)."""
    x_m, y_m = spot.point(0, 1)
    along_m = y_m if spot.side in ("east", "west") else x_m
    return 1 if along_m > spot.along_m else -1


def add_kitchen_row(layout: RoomLayout, style: Style) -> Spot | None:
    """Add a row of kitchen units at the end of a wall, as long a one as fits. Its worktop may pass below a window.

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
            for along in (first_m, last_m):
                place = _row_place(layout, layout.spot(side, along), length_m)
                if _fits(layout, place):
                    _add_row(layout, style, place)
                    return place.spot
    return None


def _row_place(layout: RoomLayout, spot: Spot, length_m: float) -> _RowPlace:
    """The place of a row at a spot, with the windows behind it."""
    windows_m = []
    for window in layout.plan.windows_of(layout.room):
        start_m, end_m = along_m(spot.side, window.rect)
        is_behind = start_m < spot.along_m + length_m / 2 and end_m > spot.along_m - length_m / 2
        if is_behind and layout.room.side_at(window.rect) == spot.side:
            windows_m.append((start_m, end_m))
    return _RowPlace(spot, length_m, tuple(windows_m))


def _fits(layout: RoomLayout, place: _RowPlace) -> bool:
    """Whether a row can stand at a place."""
    # The fridge and the unit at the other end are too high to stand in front of a window.
    ends_are_clear = all(
        start_m - place.start_m > END_UNIT_M and place.end_m - end_m > END_UNIT_M for start_m, end_m in place.windows_m
    )
    height_m = WORKTOP_HEIGHT_M if place.windows_m else ROW_HEIGHT_M
    spot = place.spot
    region = region_around(spot.along_m, place.length_m, 0.0, height_m)
    footprint = spot.footprint(kitchen.ROW_DEPTH_M, place.length_m)
    front = spot.footprint(FRONT_M, place.length_m, kitchen.ROW_DEPTH_M)
    is_wall_free = layout.walls.is_free(spot.side, region)
    return ends_are_clear and is_wall_free and layout.floor.fits([footprint], [front])


def _add_row(layout: RoomLayout, style: Style, place: _RowPlace) -> None:
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
    layout.floor.occupy(spot.footprint(kitchen.ROW_DEPTH_M + WORKTOP_EDGE_M, place.length_m), ROW_HEIGHT_M)
    layout.walls.occupy(spot.side, region_around(spot.along_m, place.length_m, 0.0, ROW_HEIGHT_M))


def middle_of_free_floor(layout: RoomLayout) -> tuple[float, float]:
    """The middle (x, y) of a room, or of the largest rectangle that a row of kitchen units leaves of it."""
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
    """The area of a rectangle; 0 if its ends are in the wrong order."""
    return max(rect.width_m, 0) * max(rect.depth_m, 0)
