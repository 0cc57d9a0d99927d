"""A television at a wall, a sofa that faces it, and a coffee table on a rug between them."""

from dataclasses import dataclass

from vobench.asset import display, household
from vobench.asset.floor_plan import Rect, Side
from vobench.asset.palette import Style
from vobench.asset.room_layout import GAP_M, RoomLayout
from vobench.asset.rug import rug
from vobench.asset.spot import Spot
from vobench.asset.tabletop import add_tabletop_items
from vobench.asset.wall_space import region_around

OPPOSITE: dict[Side, Side] = {"east": "west", "west": "east", "north": "south", "south": "north"}

# The sofa
SOFA_WIDTHS_M = (1.9, 2.1, 2.3)
SMALL_SOFA_M = 1.8  # width, without a television
SOFA_DEPTH_M = 0.92
SOFA_HEIGHT_M = 0.8
SOFA_WALL_HEIGHT_M = 0.75  # of wall that has to be free behind a sofa
SOFA_COVERED_M = 0.82  # of wall that it covers
SOFA_BACK_M = 0.46  # from its back to its middle
SOFA_AT_WALL_M = 4.6  # in rooms that are shallower, the sofa stands at the opposite wall
SOFA_AT_WALL_SHARE = 0.3  # of deeper rooms in which it does, too
SOFA_DISTANCES_M = (3.3, 3.9)  # from the wall of the television to the back of a sofa that stands free
PASSAGE_M = 0.9  # behind a sofa that stands free

# The low board with the television
BOARD_WIDTHS_M = (1.4, 1.7, 1.9)
BOARD_DEPTH_M = 0.46
BOARD_HEIGHT_M = 0.46
BOARD_SPACE_M = 0.5  # height
BOARD_BACK_M = 0.216  # from its back to its middle
BOARD_FRONT_M = 1.2  # of free floor in front of it
TELEVISION_M = 1.25  # the greatest width
TELEVISION_TOP_M = 1.3  # of wall that is covered

# Between them: distances from the front of the board to the front of the sofa
BOARD_EDGE_M = 0.5  # from the wall to the front of the board
VIEW_M = (1.3, 3.6)  # the least and the greatest
TABLE_VIEW_M = 1.7  # with more, there is a coffee table
TABLE_DEPTH_M = 0.55
TABLE_WIDTH_M = 1.0
TABLE_HEIGHT_M = 0.42
TABLE_FOOTPRINT_M = (0.56, 1.0)
TABLE_TO_SOFA_M = 0.42
RUG_SHARE = 0.75  # of coffee tables on a rug
RUG_THICKNESS_M = 0.009


@dataclass(frozen=True, slots=True)
class _TelevisionCorner:
    """The places of a television, a sofa and a coffee table, in the frame of the spot of the television.

    `sofa_spot` is the spot at the wall behind the sofa; the sofa stands at that wall only if `is_at_wall`.
    `board_m` and `sofa_m` are widths.
    `back_m` is the distance from the wall of the television to the back of the sofa.
    `table_x_m` is the x of the middle of the coffee table; None without one.
    """

    spot: Spot
    sofa_spot: Spot
    is_at_wall: bool
    board_m: float
    sofa_m: float
    back_m: float
    table_x_m: float | None

    def occupied(self) -> list[tuple[Rect, float]]:
        """The footprints and the heights of the low board, the sofa and the coffee table."""
        board = self.spot.footprint(BOARD_DEPTH_M, self.board_m, GAP_M)
        front_m = self.back_m - SOFA_DEPTH_M
        sofa = self.spot.rectangle(front_m, self.back_m, -self.sofa_m / 2, self.sofa_m / 2)
        occupied = [(board, BOARD_SPACE_M), (sofa, SOFA_HEIGHT_M)]
        if self.table_x_m is not None:
            half_depth_m = TABLE_FOOTPRINT_M[0] / 2
            half_width_m = TABLE_FOOTPRINT_M[1] / 2
            table = self.spot.rectangle(
                self.table_x_m - half_depth_m, self.table_x_m + half_depth_m, -half_width_m, half_width_m
            )
            occupied.append((table, TABLE_HEIGHT_M))
        return occupied


def add_television_corner(layout: RoomLayout, style: Style) -> Spot | None:
    """Add a television on a low board, a sofa that faces it, and a coffee table between them.

    Without space for a television, only a sofa is added. Returns the spot of the sofa at its wall; None if the sofa
    stands free or there is no space for it.
    """
    sofa_m = float(layout.rng.choice(SOFA_WIDTHS_M))
    board_m = float(layout.rng.choice(BOARD_WIDTHS_M))
    for spot in layout.free_spots_at_walls((BOARD_DEPTH_M, board_m, BOARD_SPACE_M), front_m=BOARD_FRONT_M):
        corner = _corner(layout, spot, board_m=board_m, sofa_m=sofa_m)
        if corner is not None:
            _furnish_corner(layout, style, corner)
            return corner.sofa_spot if corner.is_at_wall else None
    sofa = layout.add_at_wall(
        "sofa",
        household.couch,
        (SOFA_DEPTH_M, SMALL_SOFA_M, SOFA_HEIGHT_M),
        back_m=SOFA_BACK_M,
        front_m=0.7,
        width_m=SMALL_SOFA_M,
        colour=style.cloths[0],
    )
    return sofa[1] if sofa else None


def _corner(layout: RoomLayout, spot: Spot, *, board_m: float, sofa_m: float) -> _TelevisionCorner | None:
    """The corner with a television at a spot; None if the sofa does not fit at a good distance from it."""
    room_m = layout.length_from_m(spot.side)
    is_at_wall = room_m < SOFA_AT_WALL_M or layout.chance(SOFA_AT_WALL_SHARE)
    if is_at_wall:
        back_m = room_m - GAP_M
    else:
        nearest_m, farthest_m = SOFA_DISTANCES_M
        back_m = float(layout.rng.uniform(nearest_m, min(farthest_m, room_m - PASSAGE_M)))
    front_m = back_m - SOFA_DEPTH_M
    view_m = front_m - BOARD_EDGE_M
    least_m, most_m = VIEW_M
    if not least_m < view_m < most_m:
        return None

    table_x_m = front_m - TABLE_TO_SOFA_M - TABLE_DEPTH_M / 2 if view_m > TABLE_VIEW_M else None
    sofa_spot = layout.spot(OPPOSITE[spot.side], spot.along_m)
    corner = _TelevisionCorner(spot, sofa_spot, is_at_wall, board_m, sofa_m, back_m, table_x_m)
    behind_sofa = region_around(sofa_spot.along_m, width_m=sofa_m, bottom_m=0.0, top_m=SOFA_WALL_HEIGHT_M)
    if is_at_wall and not layout.walls.is_free(sofa_spot.side, behind_sofa):
        return None
    footprints = [footprint for footprint, _ in corner.occupied()]
    return corner if layout.floor.fits(footprints) else None


def _furnish_corner(layout: RoomLayout, style: Style, corner: _TelevisionCorner) -> None:
    """Add the pieces of a corner, and record what they occupy of the floor and of the walls."""
    spot = corner.spot
    _add_television(layout, style, spot, corner.board_m)
    layout.add(
        "sofa",
        household.couch,
        spot.point(corner.back_m - SOFA_BACK_M),
        yaw_deg=spot.yaw_deg + 180,
        width_m=corner.sofa_m,
        colour=style.cloths[0],
        tones=style.tones,
        accents=(style.accent_cloths[0], style.accent_cloths[1]),
    )
    if corner.table_x_m is not None:
        _add_coffee_table(layout, style, spot, corner.table_x_m)

    for footprint, height_m in corner.occupied():
        layout.floor.occupy(footprint, height_m)
    if corner.is_at_wall:
        behind_sofa = region_around(corner.sofa_spot.along_m, width_m=corner.sofa_m, bottom_m=0.0, top_m=SOFA_COVERED_M)
        layout.walls.occupy(corner.sofa_spot.side, behind_sofa)
    behind_television = region_around(spot.along_m, width_m=corner.board_m, bottom_m=0.0, top_m=TELEVISION_TOP_M)
    layout.walls.occupy(spot.side, behind_television)


def _add_television(layout: RoomLayout, style: Style, spot: Spot, board_m: float) -> None:
    """Add a low board of a width and a television on it."""
    board = layout.add(
        "low_board",
        household.low_board,
        spot.point(GAP_M + BOARD_BACK_M),
        yaw_deg=spot.yaw_deg,
        width_m=board_m,
        tones=style.second_tones,
    )
    layout.add(
        "television",
        display.television,
        spot.point(GAP_M + 0.2),
        BOARD_HEIGHT_M,
        yaw_deg=spot.yaw_deg,
        support=board,
        width_m=min(TELEVISION_M, board_m - 0.3),
        seed=style.rugs[0],
    )


def _add_coffee_table(layout: RoomLayout, style: Style, spot: Spot, x_m: float) -> None:
    """Add a coffee table whose middle is at an x of a spot, with a few things on it, mostly on a rug."""
    rng = layout.rng
    rug_width_m = float(rng.uniform(1.9, 2.4))
    rug_depth_m = float(rng.uniform(1.3, 1.6))
    rug_footprint = spot.rectangle(x_m - rug_depth_m / 2, x_m + rug_depth_m / 2, -rug_width_m / 2, rug_width_m / 2)
    has_rug = layout.chance(RUG_SHARE) and layout.room.rect.contains(rug_footprint)
    if has_rug:
        layout.add(
            "rug",
            rug,
            spot.point(x_m),
            yaw_deg=spot.yaw_deg,
            width_m=rug_width_m,
            depth_m=rug_depth_m,
            seed=style.rugs[0],
        )
    floor_m = RUG_THICKNESS_M if has_rug else 0.0
    table = layout.add(
        "coffee_table",
        household.table,
        spot.point(x_m),
        floor_m,
        yaw_deg=spot.yaw_deg,
        width_m=TABLE_WIDTH_M,
        depth_m=TABLE_DEPTH_M,
        height_m=TABLE_HEIGHT_M,
        tones=style.tones,
    )
    items = ("mug", "books", "plant", "papers")
    shuffled = [items[index] for index in rng.permutation(len(items)).tolist()]
    chosen = shuffled[: int(rng.integers(1, 4))]
    top_m = floor_m + TABLE_HEIGHT_M
    add_tabletop_items(layout, table, spot, chosen, x_m=x_m, width_m=TABLE_WIDTH_M - 0.1, z_m=top_m)
