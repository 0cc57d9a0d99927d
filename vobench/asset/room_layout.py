"""A room while it is being furnished: places for furniture at its walls and on its floor, and what is already there."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
import scipy

from vobench.asset.floor_plan import SIDES, FloorPlan, Passage, Rect, Room, Side, along_m, box_around
from vobench.asset.furniture import WHITE, Part
from vobench.asset.picture import Rng
from vobench.asset.shape import at
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Rgb

if TYPE_CHECKING:
    from trimesh import Trimesh

SHELL = "shell"  # supports of pieces: part of the building, floor, wall or ceiling, or else the name of a piece
FLOOR = "floor"
WALL = "wall"
CEILING = "ceiling"
YAW_DEG: dict[Side, float] = {"west": 0.0, "south": 90.0, "east": 180.0, "north": -90.0}  # of what stands at a wall
GAP_M = 0.025  # between furniture and walls, where the skirting is
LANDING_M = 0.75  # in front of a doorway nothing stands
BODY_RADIUS_M = 0.28  # of what has to get through, with a little room
CELL_M = 0.1  # of the map of free floor
CASING_M = 0.08  # beside and above a door
TRIES = 7  # places along a wall


@dataclass(frozen=True, slots=True)
class PlacedPiece:
    """A piece of furniture: its name, its room, its parts in the frame of the place, and what holds it.

    `beside` names pieces whose bounding boxes it may enter, as a chair does under a table.
    """

    name: str
    room: str
    parts: tuple[Part, ...]
    support: str
    beside: tuple[str, ...] = ()


def corners_of(parts: Sequence[Part]) -> Array:
    """The vertices (N, 3) of parts."""
    return np.concatenate([part.arrays.vertices_m for part in parts])


@dataclass(frozen=True, slots=True)
class Spot:
    """A place on the floor, from which x points into the room (away from a wall) and y along the wall."""

    x_m: float
    y_m: float
    yaw_deg: float
    side: Side

    @property
    def along_m(self) -> float:
        """The coordinate along the wall."""
        return self.y_m if self.side in ("east", "west") else self.x_m

    def at(self, dx_m: float, dy_m: float = 0.0) -> tuple[float, float]:
        """The place (x, y) in the room of a place in the frame of the spot."""
        angle = np.deg2rad(self.yaw_deg)
        cosine = float(np.cos(angle).round(9))
        sine = float(np.sin(angle).round(9))
        return self.x_m + cosine * dx_m - sine * dy_m, self.y_m + sine * dx_m + cosine * dy_m

    def rect(self, x0: float, x1: float, y0: float, y1: float) -> Rect:
        """A rectangle in the frame of the spot."""
        return box_around([self.at(x0, y0), self.at(x1, y1)])

    def body(self, depth_m: float, width_m: float, first_m: float = 0.0) -> Rect:
        """A rectangle that begins `first_m` from the wall, and is centred along it."""
        return self.rect(first_m, first_m + depth_m, -width_m / 2, width_m / 2)


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a wall that is taken, from the first to the last coordinate along it, and from the floor upwards."""

    first_m: float
    last_m: float
    low_m: float
    high_m: float


@dataclass(frozen=True, slots=True)
class _Body:
    """A piece of furniture on the floor: its footprint and its height."""

    rect: Rect
    height_m: float


Maker = Callable[..., list[Part]]


@dataclass(slots=True)
class RoomLayout:
    """A room while it is being furnished: what stands in it, what must stay free, and what has been placed."""

    plan: FloorPlan
    room: Room
    seed: int
    rng: Rng
    placed: list[PlacedPiece] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    _bodies: list[_Body] = field(default_factory=list)
    _kept_free: list[Rect] = field(default_factory=list)
    _landings: list[tuple[float, float]] = field(default_factory=list)
    _walls: dict[Side, list[Span]] = field(default_factory=dict)
    _counts: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for side in SIDES:
            self._walls[side] = []
        for passage in self.plan.passages_of(self.room):
            self._keep_passage_free(passage)
        if self.plan.entrance.room == self.room.name:
            self._keep_doorway_free(self.plan.entrance.rect, self.plan.entrance.head_m)
        for window in self.plan.windows_of(self.room):
            side = self.room.side_at(window.rect)
            first_m, last_m = along_m(side, window.rect)
            self._walls[side].append(Span(first_m - 0.08, last_m + 0.08, window.sill_m - 0.08, window.head_m + 0.1))

    # What must stay free

    def _keep_passage_free(self, passage: Passage) -> None:
        """Keep the wall around a passage free and, for a door, the floor in front of it and where its leaf swings."""
        if not passage.is_walkable:
            side = self.room.side_at(passage.rect)
            first_m, last_m = along_m(side, passage.rect)
            span = Span(first_m - CASING_M, last_m + CASING_M, passage.sill_m - CASING_M, passage.head_m + CASING_M)
            self._walls[side].append(span)
            return
        self._keep_doorway_free(passage.rect, passage.head_m)
        if passage.opens_into == self.room.name and passage.has_leaf:
            spot = self.spot_at_hole(passage.rect)
            half_m = self.half_width_m(passage.rect)
            swing = spot.rect(0, 2 * half_m, -half_m, half_m)
            self._kept_free.append(swing)
            hinge_y = self.leaf_y(passage, spot)
            leaf = spot.rect(0, 2 * half_m, hinge_y - 0.15, hinge_y + 0.15)
            self._bodies.append(_Body(leaf, passage.head_m))

    def _keep_doorway_free(self, rect: Rect, head_m: float) -> None:
        """Keep the wall around a doorway and the floor in front of it free."""
        side = self.room.side_at(rect)
        first_m, last_m = along_m(side, rect)
        self._walls[side].append(Span(first_m - CASING_M, last_m + CASING_M, 0.0, head_m + CASING_M))
        spot = self.spot_at_hole(rect)
        half_m = self.half_width_m(rect)
        self._kept_free.append(spot.rect(0, LANDING_M, -half_m - CASING_M, half_m + CASING_M))
        self._landings.append(spot.at(0.4))

    def half_width_m(self, rect: Rect) -> float:
        """Half the width of a hole in a wall."""
        first_m, last_m = along_m(self.room.side_at(rect), rect)
        return (last_m - first_m) / 2

    def spot_at_hole(self, rect: Rect) -> Spot:
        """The spot on the floor at the middle of a hole in a wall."""
        side = self.room.side_at(rect)
        first_m, last_m = along_m(side, rect)
        return self.spot(side, (first_m + last_m) / 2)

    def leaf_y(self, passage: Passage, spot: Spot) -> float:
        """The coordinate of a door's hinge along the wall, in the frame of the spot in front of the door."""
        half_m = self.half_width_m(passage.rect)
        side = self.room.side_at(passage.rect)
        first_m, last_m = along_m(side, passage.rect)
        hinge_m = (first_m, last_m)[passage.leaf_end]
        x_m, y_m = spot.at(0, half_m)
        is_upper = abs((y_m if side in ("east", "west") else x_m) - hinge_m) < half_m
        return half_m if is_upper else -half_m

    def spot(self, side: Side, along: float) -> Spot:
        """The spot at a coordinate along a wall."""
        face_m = self.room.face_m(side)
        if side in ("east", "west"):
            return Spot(face_m, along, YAW_DEG[side], side)
        return Spot(along, face_m, YAW_DEG[side], side)

    def depth_m(self, side: Side) -> float:
        """The extent of the room away from a wall."""
        return self.room.rect.width_m if side in ("east", "west") else self.room.rect.depth_m

    def fits(self, bodies: Sequence[Rect], fronts: Sequence[Rect] = ()) -> bool:
        """Whether bodies can stand there: in the room, apart from others, free at their fronts, with a path left."""
        for body in bodies:
            if not self.room.rect.contains(body):
                return False
            if any(body.overlaps(kept) for kept in self._kept_free):
                return False
        for rect in [*bodies, *fronts]:
            if any(rect.overlaps(other.rect) for other in self._bodies):
                return False
        is_front_inside = all(self.room.rect.contains(front) for front in fronts)
        return is_front_inside and self._has_path(bodies)

    def _has_path(self, more: Sequence[Rect]) -> bool:
        """Whether a body gets from each doorway to every other one, and into the room."""
        rect = self.room.rect
        columns = np.arange(rect.x0 + CELL_M / 2, rect.x1, CELL_M)
        rows = np.arange(rect.y0 + CELL_M / 2, rect.y1, CELL_M)
        is_free = np.ones((len(rows), len(columns)), bool)
        # A body may touch walls, as they are thin next to doors, but not furniture.
        for body in [*(each.rect for each in self._bodies), *more]:
            near = body.grown(BODY_RADIUS_M)
            x_range = slice(*np.searchsorted(columns, [near.x0, near.x1]).tolist())
            y_range = slice(*np.searchsorted(rows, [near.y0, near.y1]).tolist())
            is_free[y_range, x_range] = False
        is_free &= (columns > rect.x0 + BODY_RADIUS_M) & (columns < rect.x1 - BODY_RADIUS_M)
        is_free &= ((rows > rect.y0 + BODY_RADIUS_M) & (rows < rect.y1 - BODY_RADIUS_M))[:, None]
        labels, _ = scipy.ndimage.label(is_free)
        found = set()
        for x_m, y_m in self._landings:
            column = int(np.abs(columns - x_m).argmin())
            row = int(np.abs(rows - y_m).argmin())
            found.add(int(labels[row, column]))
        if len(found) != 1 or 0 in found:
            return False
        area_m2 = float((labels == found.pop()).sum()) * CELL_M**2
        return area_m2 > min(0.6, 0.06 * rect.area_m2)

    def free_share(self) -> float:
        """The share of the floor on which nothing stands."""
        taken_m2 = sum(body.rect.area_m2 for body in self._bodies)
        return 1 - taken_m2 / self.room.rect.area_m2

    def tall_bodies(self, height_m: float) -> list[Rect]:
        """The footprints of what is higher than a height."""
        return [body.rect for body in self._bodies if body.height_m > height_m]

    # Placing

    def spots(
        self,
        width_m: float,
        depth_m: float,
        height_m: float,
        *,
        front_m: float = 0.6,
        first_m: float = GAP_M,
        sides: Sequence[Side] = tuple(SIDES),
        in_corner: bool = False,
    ) -> Iterator[Spot]:
        """Free places at the walls for a body of a width, depth and height, in random order."""
        order = self.rng.permutation(len(sides)).tolist()
        for index in order:
            side = sides[index]
            low_m, high_m = self.room.span_m(side)
            low_m += width_m / 2 + 0.03
            high_m -= width_m / 2 + 0.03
            if high_m < low_m:
                continue
            corners = [low_m, high_m] if self.rng.random() < 0.5 else [high_m, low_m]
            others = self.rng.uniform(low_m, high_m, TRIES).tolist()
            places = [*corners, *others] if in_corner or self.rng.random() < 0.4 else [*others, *corners]
            for along in places:
                spot = self.spot(side, along)
                body = spot.body(depth_m, width_m, first_m)
                front = spot.body(front_m, width_m, first_m + depth_m)
                span = Span(along - width_m / 2, along + width_m / 2, 0.0, height_m)
                if self.is_wall_free(side, span) and self.fits([body], [front] if front_m else []):
                    yield spot

    def is_wall_free(self, side: Side, span: Span) -> bool:
        """Whether nothing is on that part of a wall."""
        for taken in self._walls[side]:
            is_apart = taken.last_m <= span.first_m or span.last_m <= taken.first_m
            is_above = taken.high_m <= span.low_m or span.high_m <= taken.low_m
            if not (is_apart or is_above):
                return False
        return True

    def open_spot(self, depth_m: float, width_m: float) -> Spot | None:
        """A free place away from the walls, for something that is walked around."""
        rect = self.room.rect
        for _ in range(40):
            side: Side = "west" if self.rng.random() < 0.5 else "south"
            half_x = (depth_m if side == "west" else width_m) / 2
            half_y = (width_m if side == "west" else depth_m) / 2
            if rect.width_m < 2 * half_x + 0.1 or rect.depth_m < 2 * half_y + 0.1:
                continue
            x_m = self.rng.uniform(rect.x0 + half_x + 0.04, rect.x1 - half_x - 0.04)
            y_m = self.rng.uniform(rect.y0 + half_y + 0.04, rect.y1 - half_y - 0.04)
            spot = Spot(x_m, y_m, YAW_DEG[side], side)
            if self.fits([spot.rect(-depth_m / 2, depth_m / 2, -width_m / 2, width_m / 2)]):
                return spot
        return None

    def name(self, kind: str) -> str:
        """A new name for a piece of a kind."""
        self._counts[kind] = self._counts.get(kind, 0) + 1
        return f"{self.room.name}.{kind}_{self._counts[kind]}"

    def chance(self, probability: float) -> bool:
        """Whether an event of a probability happens."""
        return bool(self.rng.random() < probability)

    def rng_of(self, name: str) -> Rng:
        """The random generator of a piece, which depends on its name and the seed alone."""
        return np.random.default_rng([self.seed, crc32(name.encode())])

    def add(
        self,
        kind: str,
        make: Maker,
        xy_m: tuple[float, float],
        z_m: float = 0.0,
        *,
        yaw_deg: float = 0.0,
        support: str = FLOOR,
        beside: Sequence[str] = (),
        **size: Any,
    ) -> str:
        """Place a piece, and return its name. `make` is a function that makes furniture."""
        name = self.name(kind)
        T_place_piece = at(*xy_m, z_m, yaw=yaw_deg)
        parts = tuple(part.moved(T_place_piece) for part in make(self.rng_of(name), **size))
        self.placed.append(PlacedPiece(name, self.room.name, parts, support, tuple(beside)))
        return name

    def take(self, body: Rect, height_m: float) -> None:
        """Note that a body stands on the floor."""
        self._bodies.append(_Body(body, height_m))

    def take_wall(self, side: Side, first_m: float, last_m: float, low_m: float, high_m: float) -> None:
        """Note that something is on a wall."""
        self._walls[side].append(Span(first_m, last_m, low_m, high_m))

    def stand(
        self,
        kind: str,
        make: Maker,
        size_m: tuple[float, float, float],
        *,
        back_m: float = 0.0,
        front_m: float = 0.6,
        first_m: float = GAP_M,
        sides: Sequence[Side] = tuple(SIDES),
        in_corner: bool = False,
        support: str = FLOOR,
        **size: Any,
    ) -> tuple[str, Spot] | None:
        """Stand a piece at a wall; None if there is no place.

        size_m: its depth, width and height. back_m: how far its origin is from its back.
        """
        depth_m, width_m, height_m = size_m
        places = self.spots(
            width_m, depth_m, height_m, front_m=front_m, first_m=first_m, sides=sides, in_corner=in_corner
        )
        spot = next(places, None)
        if spot is None:
            return None
        name = self.add(kind, make, spot.at(first_m + back_m), yaw_deg=spot.yaw_deg, support=support, **size)
        self.take(spot.body(depth_m, width_m, first_m), height_m)
        return name, spot

    def hang(
        self,
        kind: str,
        make: Maker,
        box_m: tuple[float, float],
        *,
        middle_m: float = 1.6,
        above: Spot | None = None,
        sides: Sequence[Side] = tuple(SIDES),
        **size: Any,
    ) -> Spot | None:
        """Hang a piece of a width and height on a wall, above a spot or anywhere; None if there is no place."""
        width_m, height_m = box_m
        low_m = middle_m - height_m / 2
        high_m = middle_m + height_m / 2
        if high_m > self.plan.height_m - 0.1:
            return None
        candidates = self._places_along_walls(width_m, sides) if above is None else [(above.side, above.along_m)]
        for side, along in candidates:
            spot = self.spot(side, along)
            span = Span(along - width_m / 2 - 0.06, along + width_m / 2 + 0.06, low_m - 0.06, high_m + 0.06)
            before = spot.body(0.45, width_m)
            is_hidden = any(body.height_m > low_m - 0.04 and body.rect.overlaps(before) for body in self._bodies)
            if not is_hidden and self.is_wall_free(side, span):
                self.add(kind, make, spot.at(0.0), middle_m, yaw_deg=spot.yaw_deg, support=WALL, **size)
                self._walls[side].append(span)
                return spot
        return None

    def _places_along_walls(self, width_m: float, sides: Sequence[Side]) -> list[tuple[Side, float]]:
        """Places for something of a width: walls in random order, each with coordinates along it, the middle first."""
        places: list[tuple[Side, float]] = []
        for index in self.rng.permutation(len(sides)).tolist():
            side = sides[index]
            first_m, last_m = self.room.span_m(side)
            if last_m - first_m < width_m + 0.2:
                continue
            middle_m = (first_m + last_m) / 2
            others_m = self.rng.uniform(first_m + width_m / 2 + 0.1, last_m - width_m / 2 - 0.1, 4).tolist()
            places += [(side, along_m) for along_m in [middle_m, *others_m]]
        return places

    def lamp(self, kind: str, mesh: "Trimesh", power_lm: float, *, is_on: bool, colour: Rgb) -> None:
        """A lamp that shines, or what it looks like when it is off."""
        name = self.name(kind)
        if is_on:
            self.lights.append(AreaLight(name, mesh, power_lm, colour=colour))
        else:
            self.placed.append(PlacedPiece(name, self.room.name, (Part(mesh, WHITE),), SHELL))
