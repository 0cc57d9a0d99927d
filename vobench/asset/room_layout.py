"""The layout of a room while it is being furnished: finds places at its walls and on its floor, and adds pieces."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from vobench.asset.floor_plan import SIDES, FloorPlan, Passage, Rect, Room, Side, along_m
from vobench.asset.floor_space import FloorSpace
from vobench.asset.furniture import WHITE, Part
from vobench.asset.picture import Rng
from vobench.asset.placed_piece import FLOOR, SHELL, WALL, PlacedPiece
from vobench.asset.shape import at
from vobench.asset.spot import YAW_DEG, Spot, spot_at_wall
from vobench.asset.wall_space import WallRegion, WallSpace, region_around
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Rgb

if TYPE_CHECKING:
    from trimesh import Trimesh

GAP_M = 0.025  # between furniture and walls, where the skirting board is
FRONT_M = 0.6  # of free floor in front of a piece, for somebody to stand there

# Doorways
LANDING_M = 0.75  # of free floor in front of a doorway
LANDING_POINT_M = 0.4  # from the wall to the point in front of a doorway that has to be reached
CASING_M = 0.08  # of wall beside and above a doorway, for its casing
HALF_LEAF_M = 0.15  # from the hinge to either side of the footprint of an open leaf

# Windows: free wall around the hole
WINDOW_SIDE_M = 0.08
WINDOW_BELOW_M = 0.08
WINDOW_ABOVE_M = 0.1

# Places that are tried
WALL_TRIES = 7  # random places along a wall, besides its two ends
FLOOR_TRIES = 40
HANGING_TRIES = 4  # random places along a wall, besides its middle
CORNER_FIRST_SHARE = 0.4  # of walls whose ends are tried before other places

# Distances
WALL_END_M = 0.03  # between a piece at a wall and the end of the wall
OPEN_FLOOR_END_M = 0.04  # between a piece on the open floor and a wall
OPEN_FLOOR_SPARE_M = 0.1  # of room that is longer than such a piece
HANGING_MARGIN_M = 0.06  # around what hangs on a wall
HANGING_END_M = 0.1  # between what hangs on a wall and the end of the wall
HANGING_CEILING_M = 0.1
HANGING_FRONT_M = 0.45  # in front of what hangs, where tall furniture would hide it
HIDDEN_M = 0.04  # furniture that ends this far below what hangs does not hide it

PieceMaker = Callable[..., list[Part]]
"""A function (rng, **options) that returns the parts of a piece in its own frame."""


@dataclass(slots=True)
class RoomLayout:
    """A room while it is being furnished: its free floor and walls, and the pieces and lights placed so far.

    Every piece has a random generator of its own (`add`); `rng` draws all choices about the layout.
    """

    plan: FloorPlan
    room: Room
    seed: int
    rng: Rng
    placed: list[PlacedPiece] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    floor: FloorSpace = field(init=False)
    walls: WallSpace = field(default_factory=WallSpace)
    _counts: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.floor = FloorSpace(self.room.rect)
        for passage in self.plan.passages_of(self.room):
            self._keep_passage_clear(passage)
        if self.plan.entrance.room == self.room.name:
            self._keep_doorway_clear(self.plan.entrance.rect, self.plan.entrance.head_m)
        for window in self.plan.windows_of(self.room):
            side = self.room.side_at(window.rect)
            start_m, end_m = along_m(side, window.rect)
            region = WallRegion(
                start_m - WINDOW_SIDE_M,
                end_m + WINDOW_SIDE_M,
                window.sill_m - WINDOW_BELOW_M,
                window.head_m + WINDOW_ABOVE_M,
            )
            self.walls.occupy(side, region)

    # --- Doorways ---

    def _keep_passage_clear(self, passage: Passage) -> None:
        """Keep the wall around a passage clear and, for a door, the floor in front of it and where its leaf swings."""
        if not passage.is_walkable:
            bottom_m = passage.sill_m - CASING_M
            self._keep_casing_clear(passage.rect, bottom_m, passage.head_m)
            return
        self._keep_doorway_clear(passage.rect, passage.head_m)
        has_leaf_here = passage.opens_into == self.room.name and passage.has_leaf
        if has_leaf_here:
            spot = self.spot_at_hole(passage.rect)
            half_m = self.half_width_m(passage.rect)
            self.floor.keep_clear(spot.rectangle(0, 2 * half_m, -half_m, half_m))
            hinge_y_m = self.hinge_y_m(passage, spot)
            open_leaf = spot.rectangle(0, 2 * half_m, hinge_y_m - HALF_LEAF_M, hinge_y_m + HALF_LEAF_M)
            self.floor.occupy(open_leaf, passage.head_m)

    def _keep_doorway_clear(self, hole: Rect, head_m: float) -> None:
        """Keep the wall around a doorway and the floor in front of it clear."""
        self._keep_casing_clear(hole, 0.0, head_m)
        spot = self.spot_at_hole(hole)
        half_m = self.half_width_m(hole) + CASING_M
        self.floor.keep_clear(spot.rectangle(0, LANDING_M, -half_m, half_m))
        self.floor.keep_reachable(spot.point(LANDING_POINT_M))

    def _keep_casing_clear(self, hole: Rect, bottom_m: float, head_m: float) -> None:
        """Keep the wall beside and above a hole clear, from a height upwards."""
        side = self.room.side_at(hole)
        start_m, end_m = along_m(side, hole)
        self.walls.occupy(side, WallRegion(start_m - CASING_M, end_m + CASING_M, bottom_m, head_m + CASING_M))

    def half_width_m(self, hole: Rect) -> float:
        """Half the width of a hole in a wall."""
        start_m, end_m = along_m(self.room.side_at(hole), hole)
        return (end_m - start_m) / 2

    def spot_at_hole(self, hole: Rect) -> Spot:
        """The spot on the floor at the middle of a hole in a wall."""
        side = self.room.side_at(hole)
        start_m, end_m = along_m(side, hole)
        return self.spot(side, (start_m + end_m) / 2)

    def hinge_y_m(self, passage: Passage, spot: Spot) -> float:
        """The y of a door's hinge in the frame of the spot in front of the door: half the width or minus that."""
        half_m = self.half_width_m(passage.rect)
        side = self.room.side_at(passage.rect)
        hinge_along_m = along_m(side, passage.rect)[passage.leaf_end]
        left_x_m, left_y_m = spot.point(0, half_m)
        left_along_m = left_y_m if side in ("east", "west") else left_x_m
        is_left = abs(left_along_m - hinge_along_m) < half_m
        return half_m if is_left else -half_m

    # --- Places ---

    def spot(self, side: Side, coordinate_m: float) -> Spot:
        """The spot at a coordinate along a wall."""
        return spot_at_wall(self.room, side, coordinate_m)

    def length_from_m(self, side: Side) -> float:
        """The distance between a wall and the opposite one."""
        return self.room.rect.width_m if side in ("east", "west") else self.room.rect.depth_m

    def free_spots_at_walls(
        self,
        size_m: tuple[float, float, float],
        *,
        front_m: float = FRONT_M,
        wall_gap_m: float = GAP_M,
        sides: Sequence[Side] = tuple(SIDES),
        in_corner: bool = False,
    ) -> Iterator[Spot]:
        """Free places at the walls for a piece, in random order.

        Args:
            size_m: depth (away from the wall), width and height of the piece.
            front_m: depth of the floor in front of the piece that has to be free.
            wall_gap_m: distance between the piece and the wall.
            sides: the walls that are tried.
            in_corner: whether the ends of all walls are tried before other places.
        """
        depth_m, width_m, height_m = size_m
        for index in self.rng.permutation(len(sides)).tolist():
            side = sides[index]
            for along in self._places_along_wall(side, width_m, in_corner=in_corner):
                spot = self.spot(side, along)
                footprint = spot.footprint(depth_m, width_m, wall_gap_m)
                front = spot.footprint(front_m, width_m, wall_gap_m + depth_m)
                region = region_around(along, width_m=width_m, bottom_m=0.0, top_m=height_m)
                if self.walls.is_free(side, region) and self.floor.fits([footprint], [front] if front_m else []):
                    yield spot

    def _places_along_wall(self, side: Side, width_m: float, *, in_corner: bool) -> list[float]:
        """Coordinates along a wall for the middle of a piece, in the order in which they are tried."""
        start_m, end_m = self.room.span_m(side)
        first_m = start_m + (width_m / 2 + WALL_END_M)
        last_m = end_m - (width_m / 2 + WALL_END_M)
        if last_m < first_m:
            return []
        ends_m = [first_m, last_m] if self.chance(0.5) else [last_m, first_m]
        others_m = self.rng.uniform(first_m, last_m, WALL_TRIES).tolist()
        ends_are_first = in_corner or self.chance(CORNER_FIRST_SHARE)
        return [*ends_m, *others_m] if ends_are_first else [*others_m, *ends_m]

    def free_spot_on_floor(self, depth_m: float, width_m: float) -> Spot | None:
        """A free place away from the walls for a piece whose middle is at the spot; None if none was found."""
        rect = self.room.rect
        for _ in range(FLOOR_TRIES):
            side: Side = "west" if self.chance(0.5) else "south"
            half_x_m = (depth_m if side == "west" else width_m) / 2
            half_y_m = (width_m if side == "west" else depth_m) / 2
            is_too_narrow = rect.width_m < 2 * half_x_m + OPEN_FLOOR_SPARE_M
            is_too_shallow = rect.depth_m < 2 * half_y_m + OPEN_FLOOR_SPARE_M
            if is_too_narrow or is_too_shallow:
                continue
            x_m = self.rng.uniform(rect.x0 + half_x_m + OPEN_FLOOR_END_M, rect.x1 - half_x_m - OPEN_FLOOR_END_M)
            y_m = self.rng.uniform(rect.y0 + half_y_m + OPEN_FLOOR_END_M, rect.y1 - half_y_m - OPEN_FLOOR_END_M)
            spot = Spot(x_m, y_m, YAW_DEG[side], side)
            footprint = spot.rectangle(-depth_m / 2, depth_m / 2, -width_m / 2, width_m / 2)
            if self.floor.fits([footprint]):
                return spot
        return None

    # --- Pieces ---

    def chance(self, probability: float) -> bool:
        """Whether an event of a probability happens."""
        return bool(self.rng.random() < probability)

    def new_name(self, kind: str) -> str:
        """A new name for a piece of a kind: room, kind, and the number of the piece among those of its kind."""
        self._counts[kind] = self._counts.get(kind, 0) + 1
        return f"{self.room.name}.{kind}_{self._counts[kind]}"

    def _piece_rng(self, name: str) -> Rng:
        """The random generator of a piece, which depends on its name and the seed alone."""
        return np.random.default_rng([self.seed, crc32(name.encode())])

    def add(
        self,
        kind: str,
        make: PieceMaker,
        xy_m: tuple[float, float],
        z_m: float = 0.0,
        *,
        yaw_deg: float = 0.0,
        support: str = FLOOR,
        may_overlap: Sequence[str] = (),
        **options: Any,
    ) -> str:
        """Add a piece at a point of the place, and return its name.

        `make(rng, **options)` returns its parts. Nothing is recorded on the floor or on the walls.
        """
        name = self.new_name(kind)
        T_place_piece = at(*xy_m, z_m, yaw=yaw_deg)
        parts = tuple(part.moved(T_place_piece) for part in make(self._piece_rng(name), **options))
        self.placed.append(PlacedPiece(name, self.room.name, parts, support, tuple(may_overlap)))
        return name

    def add_at_wall(
        self,
        kind: str,
        make: PieceMaker,
        size_m: tuple[float, float, float],
        *,
        back_m: float = 0.0,
        front_m: float = FRONT_M,
        wall_gap_m: float = GAP_M,
        sides: Sequence[Side] = tuple(SIDES),
        in_corner: bool = False,
        support: str = FLOOR,
        **options: Any,
    ) -> tuple[str, Spot] | None:
        """Add a piece on the floor at a wall.

        Args:
            kind: the kind in its name.
            make: `make(rng, **options)` returns its parts.
            size_m: depth, width and height of the space that it occupies.
            back_m: distance between its back and its origin.
            front_m: depth of the free floor in front of it.
            wall_gap_m: distance between its back and the wall.
            sides: the walls that are tried.
            in_corner: whether corners are tried first.
            support: what holds it.
            **options: arguments of `make`.

        Returns:
            Its name and the spot at the wall; None if there is no space for it.
        """
        depth_m, width_m, height_m = size_m
        spots = self.free_spots_at_walls(
            size_m, front_m=front_m, wall_gap_m=wall_gap_m, sides=sides, in_corner=in_corner
        )
        spot = next(spots, None)
        if spot is None:
            return None
        origin_m = spot.point(wall_gap_m + back_m)
        name = self.add(kind, make, origin_m, yaw_deg=spot.yaw_deg, support=support, **options)
        self.floor.occupy(spot.footprint(depth_m, width_m, wall_gap_m), height_m)
        return name, spot

    def add_on_wall(
        self,
        kind: str,
        make: PieceMaker,
        size_m: tuple[float, float],
        *,
        middle_m: float = 1.6,
        above: Spot | None = None,
        sides: Sequence[Side] = tuple(SIDES),
        **options: Any,
    ) -> Spot | None:
        """Hang a piece on a wall.

        Args:
            kind: the kind in its name.
            make: `make(rng, **options)` returns its parts.
            size_m: width and height.
            middle_m: height of its middle above the floor.
            above: the spot above which it hangs; None for any place at the walls.
            sides: the walls that are tried.
            **options: arguments of `make`.

        Returns:
            The spot below it; None if there is no space for it.
        """
        width_m, height_m = size_m
        bottom_m = middle_m - height_m / 2
        top_m = middle_m + height_m / 2
        if top_m > self.plan.height_m - HANGING_CEILING_M:
            return None
        candidates = self._hanging_places(width_m, sides) if above is None else [(above.side, above.along_m)]
        for side, along in candidates:
            spot = self.spot(side, along)
            region = WallRegion(
                along - width_m / 2 - HANGING_MARGIN_M,
                along + width_m / 2 + HANGING_MARGIN_M,
                bottom_m - HANGING_MARGIN_M,
                top_m + HANGING_MARGIN_M,
            )
            in_front = spot.footprint(HANGING_FRONT_M, width_m)
            tall = self.floor.footprints_above(bottom_m - HIDDEN_M)
            is_hidden = any(footprint.overlaps(in_front) for footprint in tall)
            if not is_hidden and self.walls.is_free(side, region):
                self.add(kind, make, spot.point(0.0), middle_m, yaw_deg=spot.yaw_deg, support=WALL, **options)
                self.walls.occupy(side, region)
                return spot
        return None

    def _hanging_places(self, width_m: float, sides: Sequence[Side]) -> list[tuple[Side, float]]:
        """Places for something of a width: walls in random order, each with coordinates along it, the middle first."""
        places: list[tuple[Side, float]] = []
        for index in self.rng.permutation(len(sides)).tolist():
            side = sides[index]
            start_m, end_m = self.room.span_m(side)
            if end_m - start_m < width_m + 2 * HANGING_END_M:
                continue
            middle_m = (start_m + end_m) / 2
            first_m = start_m + width_m / 2 + HANGING_END_M
            last_m = end_m - width_m / 2 - HANGING_END_M
            others_m = self.rng.uniform(first_m, last_m, HANGING_TRIES).tolist()
            places += [(side, along) for along in (middle_m, *others_m)]
        return places

    def add_lamp(self, kind: str, mesh: "Trimesh", power_lm: float, *, is_on: bool, colour: Rgb) -> None:
        """Add a lamp that shines, or its white surface if it is off."""
        name = self.new_name(kind)
        if is_on:
            self.lights.append(AreaLight(name, mesh, power_lm, colour=colour))
        else:
            self.placed.append(PlacedPiece(name, self.room.name, (Part(mesh, WHITE),), SHELL))


def room_layouts(plan: FloorPlan, seed: int, stream: int) -> dict[str, RoomLayout]:
    """An empty layout for each room of a plan, by the room's name.

    The choices of each room have a random generator of their own; `stream` tells those of different places apart.
    """
    return {
        room.name: RoomLayout(plan, room, seed, np.random.default_rng([seed, stream, number]))
        for number, room in enumerate(plan.rooms)
    }
