"""Furnishes the living room of a home: a television and a sofa that faces it, a dining table, shelves, lamps."""

from typing import NamedTuple

from vobench.asset import bed_place, furnishing, household
from vobench.asset.floor_plan import Rect, Side
from vobench.asset.palette import Style
from vobench.asset.room_layout import GAP_M, RoomLayout, Span, Spot

OPPOSITE: dict[Side, Side] = {"east": "west", "west": "east", "north": "south", "south": "north"}
SOFA_DEPTH_M = 0.92
BOARD_DEPTH_M = 0.46  # of the low board under a television
TABLE_M = (0.55, 1.0)  # depth and width of a coffee table


def furnish_living_room(layout: RoomLayout, style: Style) -> None:
    """Furnish a living room. Without bedrooms, it has a bed, and without a large kitchen, a dining table."""
    sofa_spot = _add_television_corner(layout, style)
    _add_dining_table(layout, style)
    sideboard_spot = furnishing.sideboard(layout, style) if layout.chance(0.8) else None
    furnishing.shelf(layout, style)
    if layout.chance(0.3):
        furnishing.shelf(layout, style)
    if layout.chance(0.6):
        furnishing.floor_lamp(layout)
    has_bedroom = any(room.use == "bedroom" for room in layout.plan.rooms)
    if not has_bedroom:
        bed_place.add_bed(layout, style, (1.2, 1.4))
    if layout.chance(0.4):
        furnishing.desk(layout, style)
    if layout.chance(0.5):
        furnishing.armchair(layout, style)
    for _ in range(int(layout.rng.integers(1, 3))):
        furnishing.floor_plant(layout)
    furnishing.pictures(layout, style, int(layout.rng.integers(1, 4)), [sofa_spot, sideboard_spot])
    furnishing.sockets(layout, 1)


def _add_dining_table(layout: RoomLayout, style: Style) -> None:
    """Add a dining table if there is space for one, and mostly only if the kitchen has none."""
    area_m2 = layout.room.rect.area_m2
    if area_m2 <= 18:
        return
    has_kitchen_table = any(room.use == "kitchen" and room.rect.area_m2 > 9 for room in layout.plan.rooms)
    is_wanted = not has_kitchen_table or area_m2 > 24 or layout.chance(0.4)
    if is_wanted:
        is_large = area_m2 > 26 and layout.chance(0.6)
        furnishing.dining_table(layout, style, 6 if is_large else 4)


# --- The television and the sofa that faces it ---


class _Corner(NamedTuple):
    """The places of a television, a sofa and a coffee table, in the frame of the spot of the television.

    `sofa_spot` is the spot at the wall behind the sofa; the sofa stands at it only if `is_at_wall`.
    `table_x` is the middle of the coffee table, None without one.
    """

    spot: Spot
    sofa_spot: Spot
    is_at_wall: bool
    board_m: float
    sofa_m: float
    back_m: float
    table_x: float | None

    @property
    def front_m(self) -> float:
        """The distance of the front of the sofa from the wall of the television."""
        return self.back_m - SOFA_DEPTH_M

    def bodies(self) -> list[Rect]:
        """The footprints of the low board, the sofa and the coffee table."""
        board = self.spot.body(BOARD_DEPTH_M, self.board_m, GAP_M)
        sofa = self.spot.rect(self.front_m, self.back_m, -self.sofa_m / 2, self.sofa_m / 2)
        if self.table_x is None:
            return [board, sofa]
        return [board, sofa, self.spot.rect(self.table_x - 0.28, self.table_x + 0.28, -0.5, 0.5)]


def _add_television_corner(layout: RoomLayout, style: Style) -> Spot | None:
    """Add a television on a low board, a sofa that faces it, and a table on a rug between them.

    Returns the spot of the sofa at its wall; None if it stands at none. Without space for a television, only a sofa is
    added.
    """
    sofa_m = float(layout.rng.choice([1.9, 2.1, 2.3]))
    board_m = float(layout.rng.choice([1.4, 1.7, 1.9]))
    for spot in layout.spots(max(board_m, 1.2), BOARD_DEPTH_M, 0.5, front_m=1.2):
        corner = _corner(layout, spot, board_m=board_m, sofa_m=sofa_m)
        if corner is not None:
            _furnish_corner(layout, style, corner)
            return corner.sofa_spot if corner.is_at_wall else None
    sofa = layout.stand(
        "sofa", household.couch, (SOFA_DEPTH_M, 1.8, 0.8), back_m=0.46, front_m=0.7, width_m=1.8, colour=style.cloths[0]
    )
    return sofa[1] if sofa else None


def _corner(layout: RoomLayout, spot: Spot, *, board_m: float, sofa_m: float) -> _Corner | None:
    """The corner with a television at a spot; None if the sofa does not fit at a good distance from it."""
    depth_m = layout.depth_m(spot.side)
    is_at_wall = depth_m < 4.6 or layout.chance(0.3)
    back_m = depth_m - GAP_M if is_at_wall else float(layout.rng.uniform(3.3, min(3.9, depth_m - 0.9)))
    front_m = back_m - SOFA_DEPTH_M
    gap_m = front_m - 0.5
    if not 1.3 < gap_m < 3.6:
        return None
    table_x = front_m - 0.42 - TABLE_M[0] / 2 if gap_m > 1.7 else None
    sofa_spot = layout.spot(OPPOSITE[spot.side], spot.along_m)
    corner = _Corner(spot, sofa_spot, is_at_wall, board_m, sofa_m, back_m, table_x)
    if is_at_wall and not _is_wall_free_for_sofa(layout, sofa_spot, sofa_m):
        return None
    return corner if layout.fits(corner.bodies()) else None


def _is_wall_free_for_sofa(layout: RoomLayout, spot: Spot, width_m: float) -> bool:
    span = Span(spot.along_m - width_m / 2, spot.along_m + width_m / 2, 0.0, 0.75)
    return layout.is_wall_free(spot.side, span)


def _furnish_corner(layout: RoomLayout, style: Style, corner: _Corner) -> None:
    """Add the pieces of a corner, and note what they take of the floor and of the walls."""
    spot = corner.spot
    _add_television(layout, style, spot, corner.board_m)
    layout.add(
        "sofa",
        household.couch,
        spot.at(corner.back_m - 0.46),
        yaw_deg=spot.yaw_deg + 180,
        width_m=corner.sofa_m,
        colour=style.cloths[0],
        tones=style.tones,
        accents=(style.accent_cloths[0], style.accent_cloths[1]),
    )
    if corner.table_x is not None:
        _add_coffee_table(layout, style, spot, corner.table_x)

    heights_m = (0.5, 0.8, 0.42)  # of board, sofa and table
    for body, height_m in zip(corner.bodies(), heights_m, strict=False):
        layout.take(body, height_m)
    if corner.is_at_wall:
        along_m = corner.sofa_spot.along_m
        half_m = corner.sofa_m / 2
        layout.take_wall(corner.sofa_spot.side, along_m - half_m, along_m + half_m, 0.0, 0.82)
    half_m = corner.board_m / 2
    layout.take_wall(spot.side, spot.along_m - half_m, spot.along_m + half_m, 0.0, 1.3)


def _add_television(layout: RoomLayout, style: Style, spot: Spot, board_m: float) -> None:
    board = layout.add(
        "low_board",
        household.low_board,
        spot.at(GAP_M + 0.216),
        yaw_deg=spot.yaw_deg,
        width_m=board_m,
        tones=style.second_tones,
    )
    screen_m = min(1.25, board_m - 0.3)
    layout.add(
        "television",
        furnishing.television,
        spot.at(GAP_M + 0.2),
        0.46,
        yaw_deg=spot.yaw_deg,
        support=board,
        width_m=screen_m,
        seed=style.rugs[0],
    )


def _add_coffee_table(layout: RoomLayout, style: Style, spot: Spot, x_m: float) -> None:
    """Add a coffee table with a few things on it, mostly on a rug."""
    rng = layout.rng
    depth_m, width_m = TABLE_M
    rug_width_m = float(rng.uniform(1.9, 2.4))
    rug_depth_m = float(rng.uniform(1.3, 1.6))
    below = spot.rect(x_m - rug_depth_m / 2, x_m + rug_depth_m / 2, -rug_width_m / 2, rug_width_m / 2)
    has_rug = layout.chance(0.75) and layout.room.rect.contains(below)
    if has_rug:
        layout.add(
            "rug",
            furnishing.rug,
            spot.at(x_m),
            yaw_deg=spot.yaw_deg,
            width_m=rug_width_m,
            depth_m=rug_depth_m,
            seed=style.rugs[0],
        )
    table = layout.add(
        "coffee_table",
        household.table,
        spot.at(x_m),
        0.009 if has_rug else 0.0,
        yaw_deg=spot.yaw_deg,
        width_m=width_m,
        depth_m=depth_m,
        height_m=0.42,
        tones=style.tones,
    )
    top_m = 0.429 if has_rug else 0.42
    kinds = ("mug", "books", "plant", "papers")
    shuffled = [kinds[index] for index in rng.permutation(len(kinds)).tolist()]
    chosen = shuffled[: int(rng.integers(1, 4))]
    furnishing.scatter(layout, table, spot, chosen, x_m=x_m, width_m=width_m - 0.1, z_m=top_m)
