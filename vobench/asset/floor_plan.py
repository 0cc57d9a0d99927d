"""Floor plans by rule and seed: rooms beside corridors, doorways that reach every room, windows in outer walls."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vobench.asset.picture import Rng

Side = Literal["east", "north", "west", "south"]
SIDES: dict[Side, tuple[float, float]] = {"east": (1, 0), "north": (0, 1), "west": (-1, 0), "south": (0, -1)}
WALL_M = 0.12  # thickness of inner walls
TOUCHING_M = 1e-6
DOOR_M = 1.0  # width of the hole for a door, whose frame and open leaf leave 0.9 m
DOOR_HIGH_M = 2.08
LINING_M = 0.16  # of wall that a door leaves beside it, for its frame


@dataclass(frozen=True, slots=True)
class Rect:
    """A rectangle on the floor, from (x0, y0) to (x1, y1) in metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width_m(self) -> float:
        """The extent along x."""
        return self.x1 - self.x0

    @property
    def depth_m(self) -> float:
        """The extent along y."""
        return self.y1 - self.y0

    @property
    def area_m2(self) -> float:
        """The area."""
        return self.width_m * self.depth_m

    @property
    def center_m(self) -> tuple[float, float]:
        """The middle (x, y)."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2

    def grown(self, by_m: float) -> "Rect":
        """The rectangle with all sides moved outwards."""
        return Rect(self.x0 - by_m, self.y0 - by_m, self.x1 + by_m, self.y1 + by_m)

    def overlaps(self, other: "Rect") -> bool:
        """Whether the two have an area in common."""
        is_beside = self.x1 <= other.x0 + TOUCHING_M or other.x1 <= self.x0 + TOUCHING_M
        is_behind = self.y1 <= other.y0 + TOUCHING_M or other.y1 <= self.y0 + TOUCHING_M
        return not (is_beside or is_behind)

    def contains(self, other: "Rect") -> bool:
        """Whether the other one lies within this one."""
        is_within_x = self.x0 <= other.x0 + TOUCHING_M and other.x1 <= self.x1 + TOUCHING_M
        is_within_y = self.y0 <= other.y0 + TOUCHING_M and other.y1 <= self.y1 + TOUCHING_M
        return is_within_x and is_within_y

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a point lies inside."""
        return self.x0 < x_m < self.x1 and self.y0 < y_m < self.y1


def box_around(corners: Sequence[tuple[float, float]]) -> Rect:
    """The smallest rectangle around points (x, y)."""
    x = [corner[0] for corner in corners]
    y = [corner[1] for corner in corners]
    return Rect(min(x), min(y), max(x), max(y))


@dataclass(frozen=True, slots=True)
class Room:
    """A room: its name, what it is used for, and the rectangle between the faces of its walls."""

    name: str
    use: str
    rect: Rect

    def side_at(self, rect: Rect) -> Side:
        """The side of the room that a hole in one of its walls touches."""
        gaps: dict[Side, float] = {
            "east": abs(rect.x0 - self.rect.x1),
            "north": abs(rect.y0 - self.rect.y1),
            "west": abs(rect.x1 - self.rect.x0),
            "south": abs(rect.y1 - self.rect.y0),
        }
        return min(gaps, key=lambda side: gaps[side])

    def face_m(self, side: Side) -> float:
        """The coordinate of the face of a wall: x for east and west, y for north and south."""
        faces = {"east": self.rect.x1, "north": self.rect.y1, "west": self.rect.x0, "south": self.rect.y0}
        return faces[side]

    def span_m(self, side: Side) -> tuple[float, float]:
        """The first and last coordinate along a wall: y for east and west, x for north and south."""
        if side in ("east", "west"):
            return self.rect.y0, self.rect.y1
        return self.rect.x0, self.rect.x1


def along_m(side: Side, rect: Rect) -> tuple[float, float]:
    """The first and last coordinate of a rectangle along a wall."""
    if side in ("east", "west"):
        return rect.y0, rect.y1
    return rect.x0, rect.x1


@dataclass(frozen=True, slots=True)
class Passage:
    """A hole in the wall between two rooms.

    `rect` reaches from the face of one room's wall to that of the other. A `door` has a frame, and a leaf that stands
    open in the room `opens_into`; an `opening` has neither; a `glass` passage is a window between rooms, with a sill.
    """

    rooms: tuple[str, str]
    rect: Rect
    kind: Literal["door", "opening", "glass"]
    head_m: float = DOOR_HIGH_M
    sill_m: float = 0.0
    opens_into: str = ""
    leaf_end: int = 0  # the end of the hole at which the leaf hangs: 0 the lower, 1 the upper coordinate
    has_leaf: bool = True

    @property
    def is_walkable(self) -> bool:
        """Whether a body can pass."""
        return self.sill_m == 0


@dataclass(frozen=True, slots=True)
class Window:
    """A hole in the outer wall of a room; `rect` reaches from the face of the wall to the pane."""

    room: str
    rect: Rect
    sill_m: float
    head_m: float


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Rooms on one floor, the holes between them, windows, and the closed entrance in the wall of a room."""

    rooms: tuple[Room, ...]
    passages: tuple[Passage, ...]
    windows: tuple[Window, ...]
    entrance: Window
    height_m: float

    def room(self, name: str) -> Room:
        """The room with a name."""
        return next(room for room in self.rooms if room.name == name)

    @property
    def outer(self) -> Rect:
        """The smallest rectangle around all rooms."""
        corners = [(room.rect.x0, room.rect.y0) for room in self.rooms]
        corners += [(room.rect.x1, room.rect.y1) for room in self.rooms]
        return box_around(corners)

    @property
    def area_m2(self) -> float:
        """The area of all rooms."""
        return sum(room.rect.area_m2 for room in self.rooms)

    def passages_of(self, room: Room) -> Iterator[Passage]:
        """The passages of a room."""
        return (passage for passage in self.passages if room.name in passage.rooms)

    def windows_of(self, room: Room) -> Iterator[Window]:
        """The windows of a room."""
        return (window for window in self.windows if window.room == room.name)


# --- Dividing ---


@dataclass(frozen=True, slots=True)
class RoomCell:
    """A part of a storey that becomes a room: its use, and its rectangle to the middle of its walls."""

    use: str
    rect: Rect


LEAST_WIDTH_M = {
    "bath": 1.9,
    "kitchen": 2.6,
    "bedroom": 3.0,
    "living": 4.0,
    "study": 2.6,
    "hall": 2.2,
    "cell": 2.9,
    "meeting": 4.2,
    "open": 6.0,
    "pantry": 2.6,
}


def least_length_m(uses: Sequence[str]) -> float:
    """The length that a row of rooms needs."""
    return sum(LEAST_WIDTH_M[use] for use in uses)


def divided(rng: Rng, row: Rect, uses: Sequence[str]) -> list[RoomCell]:
    """A row along x divided into rooms: each has its least width, and the rest is shared at random."""
    spare_m = row.width_m - least_length_m(uses)
    least_m = np.array([LEAST_WIDTH_M[use] for use in uses])
    weights = rng.uniform(0.4, 1.0, len(uses)) * least_m**2
    widths_m = least_m + spare_m * weights / weights.sum()
    ends_m = row.x0 + np.cumsum(widths_m).round(2)
    ends_m[-1] = row.x1
    starts_m = np.array([row.x0, *ends_m[:-1]])
    return [
        RoomCell(use, Rect(x0, row.y0, x1, row.y1))
        for use, x0, x1 in zip(uses, starts_m.tolist(), ends_m.tolist(), strict=True)
    ]


def longest_that_fits(rng: Rng, length_m: float, choices: Sequence[Sequence[str]]) -> list[str]:
    """Of several rows of rooms, one of those with most rooms that fit a length."""
    fitting = [uses for uses in choices if least_length_m(uses) <= length_m]
    most = max(len(uses) for uses in fitting)
    best = [uses for uses in fitting if len(uses) == most]
    return list(best[int(rng.integers(len(best)))])


def rooms_of(cells: Sequence[RoomCell]) -> list[Room]:
    """A room for each cell, named after its use and numbered."""
    counts = dict[str, int]()
    rooms = []
    for cell in cells:
        counts[cell.use] = counts.get(cell.use, 0) + 1
        rooms.append(Room(f"{cell.use}_{counts[cell.use]}", cell.use, cell.rect.grown(-WALL_M / 2)))
    return rooms


# --- Holes ---


def shared_wall(one: Room, other: Room) -> Rect | None:
    """The piece of wall between two rooms, from face to face; None if they have none."""
    a = one.rect
    b = other.rect
    x0 = max(a.x0, b.x0)
    x1 = min(a.x1, b.x1)
    y0 = max(a.y0, b.y0)
    y1 = min(a.y1, b.y1)
    is_wall_across_x = abs(x0 - x1 - WALL_M) < TOUCHING_M and y1 > y0
    is_wall_across_y = abs(y0 - y1 - WALL_M) < TOUCHING_M and x1 > x0
    if is_wall_across_x:
        return Rect(x1, y0, x0, y1)
    if is_wall_across_y:
        return Rect(x0, y1, x1, y0)
    return None


def _hole(wall: Rect, first_m: float, width_m: float) -> Rect:
    """The part of a wall that begins at a distance from its first end."""
    if is_along_y(wall):
        return Rect(wall.x0, wall.y0 + first_m, wall.x1, wall.y0 + first_m + width_m)
    return Rect(wall.x0 + first_m, wall.y0, wall.x0 + first_m + width_m, wall.y1)


def is_along_y(hole: Rect) -> bool:
    """Whether a hole in an inner wall is in a wall along y."""
    return abs(hole.width_m - WALL_M) < TOUCHING_M


def _length_m(wall: Rect) -> float:
    return wall.depth_m if is_along_y(wall) else wall.width_m


def door_between(rng: Rng, room: Room, other: Room, *, leaf_share: float = 0.6) -> Passage | None:
    """A door near a corner of `room`, into which it opens; None if the wall between the two is too short."""
    wall = shared_wall(room, other)
    if wall is None:
        return None
    spare_m = _length_m(wall) - DOOR_M - 2 * LINING_M
    if spare_m < 0:
        return None
    offset_m = min(float(rng.choice([0.0, 0.0, 0.1])), spare_m)
    end = int(rng.integers(2))
    first_m = LINING_M + (spare_m - offset_m if end else offset_m)
    hole = _hole(wall, round(first_m, 3), DOOR_M)
    # The leaf stands open along a wall of the room, so it hangs at the end that is nearer to a corner of the room.
    first_wall_m, last_wall_m = room.span_m(room.side_at(hole))
    first_hole_m, last_hole_m = along_m(room.side_at(hole), hole)
    leaf_end = int(last_wall_m - last_hole_m < first_hole_m - first_wall_m)
    has_leaf = rng.random() < leaf_share
    return Passage(
        (room.name, other.name), hole, "door", opens_into=room.name, leaf_end=leaf_end, has_leaf=bool(has_leaf)
    )


def opening_between(rng: Rng, room: Room, other: Room, *, head_m: float, most_m: float = 2.4) -> Passage | None:
    """A wide opening without a door; None if the wall between the two is too short."""
    wall = shared_wall(room, other)
    if wall is None:
        return None
    length_m = _length_m(wall) - 0.5
    if length_m < 1.0:
        return None
    width_m = float(np.clip(rng.uniform(0.6, 1.0) * length_m, 1.0, most_m))
    first_m = 0.25 + rng.uniform(0, 1) * (length_m - width_m)
    return Passage((room.name, other.name), _hole(wall, round(first_m, 3), round(width_m, 3)), "opening", head_m)


def outer_sides(room: Room, outer: Rect) -> list[Side]:
    """The sides of a room that are at the outer walls of a storey."""
    faces: dict[Side, float] = {"east": outer.x1, "north": outer.y1, "west": outer.x0, "south": outer.y0}
    return [side for side, face_m in faces.items() if abs(room.face_m(side) - face_m) < TOUCHING_M]


def hole_outwards(room: Room, side: Side, first_m: float, last_m: float, depth_m: float) -> Rect:
    """A hole in an outer wall, from the face of the wall outwards."""
    face_m = room.face_m(side)
    outward_x, outward_y = SIDES[side]
    beyond_m = face_m + depth_m * (outward_x + outward_y)
    if side in ("east", "west"):
        return Rect(min(face_m, beyond_m), first_m, max(face_m, beyond_m), last_m)
    return Rect(first_m, min(face_m, beyond_m), last_m, max(face_m, beyond_m))


@dataclass(frozen=True, slots=True)
class WindowStyle:
    """The windows of a building."""

    width_m: float
    sill_m: float
    head_m: float
    depth_m: float
    every_m: float  # of wall there is about one
    low_share: float = 0.0  # the share of windows of living rooms that reach down to the floor


def windows_along(rng: Rng, room: Room, side: Side, style: WindowStyle) -> Iterator[Window]:
    """Windows spread evenly along an outer wall of a room."""
    first_m, last_m = room.span_m(side)
    length_m = last_m - first_m
    width_m = min(style.width_m, length_m - 0.9)
    sill_m = style.sill_m
    if room.use == "bath":
        width_m = min(0.7, width_m)
        sill_m = 1.35
    if room.use == "kitchen":
        sill_m = max(sill_m, 1.12)
    if room.use == "living" and rng.random() < style.low_share:
        sill_m = 0.1
    if width_m < 0.5:
        return
    count = max(1, int(length_m / max(style.every_m, width_m + 0.7)))
    if room.use == "bath":
        count = 1
    for k in range(count):
        middle_m = first_m + (k + 0.5) * length_m / count
        slack_m = max(0.0, (length_m / count - width_m) / 2 - 0.35)
        if count == 1:
            middle_m += rng.uniform(-0.6, 0.6) * slack_m
        rect = hole_outwards(room, side, middle_m - width_m / 2, middle_m + width_m / 2, style.depth_m)
        yield Window(room.name, rect, sill_m, style.head_m)


# --- Symmetry ---


@dataclass(frozen=True, slots=True)
class Symmetry:
    """A rotation or reflection of a plan: x and y may be exchanged, and each may be negated."""

    exchanges: bool
    x_sign: int
    y_sign: int

    def rect(self, rect: Rect) -> Rect:
        """A rectangle under the symmetry."""
        corners = [(rect.x0, rect.y0), (rect.x1, rect.y1)]
        moved = [(self.x_sign * x, self.y_sign * y) for x, y in corners]
        if self.exchanges:
            moved = [(y, x) for x, y in moved]
        return box_around(moved)

    def leaf_end(self, passage: Passage) -> int:
        """At which end the leaf of a door hangs after the symmetry."""
        sign = self.y_sign if is_along_y(passage.rect) else self.x_sign
        return passage.leaf_end if sign > 0 else 1 - passage.leaf_end

    def plan(self, plan: FloorPlan) -> FloorPlan:
        """A plan under the symmetry."""
        rooms = tuple(replace(room, rect=self.rect(room.rect)) for room in plan.rooms)
        passages = tuple(
            replace(passage, rect=self.rect(passage.rect), leaf_end=self.leaf_end(passage)) for passage in plan.passages
        )
        windows = tuple(replace(window, rect=self.rect(window.rect)) for window in plan.windows)
        entrance = replace(plan.entrance, rect=self.rect(plan.entrance.rect))
        return FloorPlan(rooms, passages, windows, entrance, plan.height_m)


def shifted(plan: FloorPlan, x_m: float, y_m: float) -> FloorPlan:
    """A plan moved by (x, y)."""

    def moved(rect: Rect) -> Rect:
        return Rect(rect.x0 + x_m, rect.y0 + y_m, rect.x1 + x_m, rect.y1 + y_m)

    rooms = tuple(replace(room, rect=moved(room.rect)) for room in plan.rooms)
    passages = tuple(replace(passage, rect=moved(passage.rect)) for passage in plan.passages)
    windows = tuple(replace(window, rect=moved(window.rect)) for window in plan.windows)
    entrance = replace(plan.entrance, rect=moved(plan.entrance.rect))
    return FloorPlan(rooms, passages, windows, entrance, plan.height_m)


def _turned_at_random(rng: Rng, plan: FloorPlan) -> FloorPlan:
    """A plan turned and mirrored at random, with its middle at the origin."""
    signs = rng.choice([-1, 1], 2)
    symmetry = Symmetry(bool(rng.random() < 0.5), int(signs[0]), int(signs[1]))
    turned = symmetry.plan(plan)
    x_m, y_m = turned.outer.center_m
    return shifted(turned, -x_m, -y_m)


Layout = tuple[list[RoomCell], list[Side]]  # the rooms of a storey, and its sides without windows

# --- Offices ---


def office_plan(rng: Rng) -> FloorPlan:
    """The plan of an office: a large room or a corridor, and cells, meeting rooms and a pantry along it."""
    layouts = (_office_with_row, _office_along_corridor, _office_with_end)
    cells, closed_sides = layouts[int(rng.choice(len(layouts), p=[0.4, 0.3, 0.3]))](rng)
    height_m = round(float(rng.uniform(2.7, 3.2)), 2)
    rooms = rooms_of(cells)
    halls = [room for room in rooms if room.use == "hall"]
    open_rooms = [room for room in rooms if room.use == "open"]
    hub = [*halls, *open_rooms][0]  # the room that all others open to
    passages = _office_passages(rng, rooms, hub)

    entrance = _entrance(hub)
    outer = FloorPlan(tuple(rooms), (), (), entrance, height_m).outer
    style = WindowStyle(
        width_m=round(float(rng.uniform(1.3, 2.3)), 2),
        sill_m=round(float(rng.uniform(0.75, 0.95)), 2),
        head_m=round(min(height_m - 0.25, float(rng.uniform(2.3, 2.6))), 2),
        depth_m=round(float(rng.uniform(0.14, 0.24)), 2),
        every_m=float(rng.uniform(2.4, 3.2)),
    )
    windows = list[Window]()
    for room in rooms:
        for side in outer_sides(room, outer):
            if side not in closed_sides and room.use != "hall":
                windows += windows_along(rng, room, side, style)
    plan = FloorPlan(tuple(rooms), tuple(passages), tuple(windows), entrance, height_m)
    return _turned_at_random(rng, plan)


def _office_passages(rng: Rng, rooms: Sequence[Room], hub: Room) -> list[Passage]:
    """A door from each room to the hub, beside it perhaps a pane."""
    has_glass = bool(rng.random() < 0.7)
    passages = list[Passage]()
    for room in rooms:
        if room is hub:
            continue
        door = door_between(rng, room, hub, leaf_share=0.45)
        if door is None:
            raise ValueError(f"the wall between {room.name} and {hub.name} is too short for a door")
        passages.append(door)
        if has_glass and room.use in ("meeting", "cell"):
            passages += _glass_beside(room, hub, door)
    return without_obstructing_leaves(rooms, passages)


def _glass_beside(room: Room, hub: Room, door: Passage) -> Iterator[Passage]:
    """A pane beside a door, in the rest of the wall between a room and what it opens to."""
    wall = shared_wall(room, hub)
    if wall is None:
        return
    side = room.side_at(wall)
    first_m, last_m = along_m(side, wall)
    door_first_m, door_last_m = along_m(side, door.rect)
    before = (first_m + 0.2, door_first_m - 0.25)
    after = (door_last_m + 0.25, last_m - 0.2)
    start_m, end_m = max((before, after), key=lambda span: span[1] - span[0])
    end_m = min(end_m, start_m + 2.6)
    if end_m - start_m > 0.8:
        hole = _hole(wall, start_m - first_m, end_m - start_m)
        yield Passage((room.name, hub.name), hole, "glass", sill_m=0.12)


def _office_with_row(rng: Rng) -> Layout:
    """A large room with a row of smaller ones along one side."""
    south_m = rng.uniform(5.8, 7.4)
    north_m = rng.uniform(3.2, 4.2)
    length_m = rng.uniform(11.0, 16.0)
    choices = [["meeting", "cell", "pantry"], ["cell", "cell", "pantry"], ["pantry", "meeting", "cell", "cell"]]
    choices += [["cell", "meeting", "cell", "pantry"], ["meeting", "cell", "cell"]]
    row = longest_that_fits(rng, length_m, choices)
    cells = [
        RoomCell("open", Rect(0, 0, length_m, south_m)),
        *divided(rng, Rect(0, south_m, length_m, south_m + north_m), row),
    ]
    return cells, _ends(rng)


def _office_along_corridor(rng: Rng) -> Layout:
    """Cells on both sides of a corridor, and a larger room among them."""
    south_m = rng.uniform(4.4, 5.6)
    hall_m = rng.uniform(1.9, 2.4)
    north_m = rng.uniform(3.4, 4.4)
    length_m = rng.uniform(11.0, 14.5)
    south = longest_that_fits(rng, length_m, [["open", "cell"], ["open", "meeting"], ["cell", "open"]])
    north_choices = [["cell", "meeting", "pantry"], ["pantry", "cell", "cell"], ["cell", "cell", "meeting"]]
    north = longest_that_fits(rng, length_m, north_choices)
    depth_m = south_m + hall_m + north_m
    cells = [
        RoomCell("hall", Rect(0, south_m, length_m, south_m + hall_m)),
        *divided(rng, Rect(0, 0, length_m, south_m), south),
        *divided(rng, Rect(0, south_m + hall_m, length_m, depth_m), north),
    ]
    return cells, _ends(rng)


def _office_with_end(rng: Rng) -> Layout:
    """A large room, and two or three smaller ones at its end."""
    depth_m = rng.uniform(8.6, 10.4)
    length_m = rng.uniform(8.5, 11.5)
    end_m = rng.uniform(3.2, 4.4)
    choices = [["meeting", "pantry"], ["cell", "meeting"], ["cell", "pantry", "cell"]]
    column = longest_that_fits(rng, depth_m, choices)
    transposed = divided(rng, Rect(0, length_m, depth_m, length_m + end_m), column)
    cells = [RoomCell("open", Rect(0, 0, length_m, depth_m))]
    for cell in transposed:
        rect = cell.rect
        cells.append(RoomCell(cell.use, Rect(rect.y0, rect.x0, rect.y1, rect.x1)))
    return cells, _ends(rng)


# --- Flats ---


def flat_plan(rng: Rng) -> FloorPlan:
    """The plan of a flat: a hall, and rooms along it."""
    layouts = (_flat_with_end_room, _flat_on_one_side, _flat_on_both_sides, _flat_of_one_room)
    layout = layouts[int(rng.choice(len(layouts), p=[0.3, 0.25, 0.3, 0.15]))]
    cells, closed_sides = layout(rng)
    height_m = round(float(rng.choice([2.5, 2.6, 2.75, 3.05])), 2)
    rooms = rooms_of(cells)
    passages = _flat_passages(rng, rooms, height_m)
    entrance = _entrance(next(room for room in rooms if room.use == "hall"))
    outer = FloorPlan(tuple(rooms), (), (), entrance, height_m).outer

    style = WindowStyle(
        width_m=round(float(rng.uniform(1.0, 1.75)), 2),
        sill_m=round(float(rng.uniform(0.72, 0.95)), 2),
        head_m=round(min(height_m - 0.22, float(rng.uniform(2.2, 2.5))), 2),
        depth_m=round(float(rng.uniform(0.14, 0.24)), 2),
        every_m=float(rng.uniform(2.2, 3.4)),
        low_share=float(rng.choice([0.0, 0.4, 1.0])),
    )
    windows = list[Window]()
    for room in rooms:
        open_sides = [side for side in outer_sides(room, outer) if side not in closed_sides and room.use != "hall"]
        for k, side in enumerate(open_sides):
            is_wanted = k == 0 or rng.random() < 0.6
            if is_wanted:
                windows += windows_along(rng, room, side, style)
    plan = FloorPlan(tuple(rooms), tuple(passages), tuple(windows), entrance, height_m)
    return _turned_at_random(rng, plan)


def _ends(rng: Rng) -> list[Side]:
    """The sides without windows of a flat whose front and back are open: its neighbours' sides."""
    choices: list[list[Side]] = [["west"], ["west", "east"]]
    return choices[int(rng.integers(2))]


def _flat_with_end_room(rng: Rng) -> Layout:
    """A living room at the end of a hall, which has rooms on both sides."""
    south_m = rng.uniform(3.1, 3.9)
    hall_m = rng.uniform(1.45, 1.75)
    north_m = rng.uniform(2.4, 3.0)
    length_m = rng.uniform(4.8, 6.4)
    end_m = rng.uniform(3.7, 4.5)
    depth_m = south_m + hall_m + north_m
    south = longest_that_fits(rng, length_m, [["bedroom"], ["bedroom", "study"], ["study", "bedroom"]])
    north = longest_that_fits(rng, length_m, [["bath", "kitchen"]])
    cells = [
        RoomCell("hall", Rect(0, south_m, length_m, south_m + hall_m)),
        *divided(rng, Rect(0, 0, length_m, south_m), south),
        *divided(rng, Rect(0, south_m + hall_m, length_m, depth_m), north),
        RoomCell("living", Rect(length_m, 0, length_m + end_m, depth_m)),
    ]
    return cells, _ends(rng)


def _flat_on_one_side(rng: Rng) -> Layout:
    """Rooms along one side of a hall, and a bathroom at its end."""
    south_m = rng.uniform(3.6, 4.6)
    hall_m = rng.uniform(2.0, 2.4)
    length_m = rng.uniform(8.6, 10.8)
    bath_m = rng.uniform(2.2, 2.9)
    choices = [["living", "kitchen"], ["bedroom", "living", "kitchen"]]
    choices += [["kitchen", "living", "bedroom"], ["study", "living", "kitchen"]]
    south = longest_that_fits(rng, length_m, choices)
    cells = [
        RoomCell("hall", Rect(0, south_m, length_m - bath_m, south_m + hall_m)),
        RoomCell("bath", Rect(length_m - bath_m, south_m, length_m, south_m + hall_m)),
        *divided(rng, Rect(0, 0, length_m, south_m), south),
    ]
    return cells, ["north", *_ends(rng)]


def _flat_on_both_sides(rng: Rng) -> Layout:
    """A hall through the whole flat, with rooms on both sides."""
    south_m = rng.uniform(3.6, 4.4)
    hall_m = rng.uniform(1.45, 1.7)
    north_m = rng.uniform(2.5, 3.3)
    length_m = rng.uniform(7.4, 10.2)
    south = longest_that_fits(rng, length_m, [["living", "bedroom"], ["bedroom", "living"]])
    north_choices = [["bath", "kitchen", "bedroom"], ["kitchen", "bath", "study"], ["study", "bath", "kitchen"]]
    north = longest_that_fits(rng, length_m, north_choices)
    depth_m = south_m + hall_m + north_m
    cells = [
        RoomCell("hall", Rect(0, south_m, length_m, south_m + hall_m)),
        *divided(rng, Rect(0, 0, length_m, south_m), south),
        *divided(rng, Rect(0, south_m + hall_m, length_m, depth_m), north),
    ]
    return cells, _ends(rng)


def _flat_of_one_room(rng: Rng) -> Layout:
    """A large room with a kitchen beside it, behind a hall and a bathroom."""
    south_m = rng.uniform(4.2, 5.2)
    north_m = rng.uniform(2.0, 2.5)
    length_m = rng.uniform(7.2, 8.8)
    bath_m = rng.uniform(2.3, 3.0)
    cells = [
        RoomCell("hall", Rect(0, south_m, length_m - bath_m, south_m + north_m)),
        RoomCell("bath", Rect(length_m - bath_m, south_m, length_m, south_m + north_m)),
        *divided(rng, Rect(0, 0, length_m, south_m), ["living", "kitchen"]),
    ]
    return cells, ["north", *_ends(rng)]


def _entrance(hall: Room) -> Window:
    """The closed front door, in the west wall of the hall."""
    middle_m = hall.rect.center_m[1]
    rect = hole_outwards(hall, "west", middle_m - 0.46, middle_m + 0.46, WALL_M)
    return Window(hall.name, rect, 0.0, 2.05)


def _flat_passages(rng: Rng, rooms: Sequence[Room], height_m: float) -> list[Passage]:
    """A door from the hall to each room, and openings between living room, kitchen and hall."""
    hall = next(room for room in rooms if room.use == "hall")
    living = next(room for room in rooms if room.use == "living")
    head_m = round(min(height_m - 0.25, 2.3), 2)
    openings = _kitchen_openings(rng, rooms, living, head_m)
    passages = list(openings.values())
    for room in rooms:
        if room is hall:
            continue
        needs_no_door = room.name in openings and rng.random() < 0.6
        if needs_no_door:
            continue
        passage = _passage_to_hall(rng, room, hall, opening_head_m=head_m if room is living else None)
        if passage is None and room.name not in openings:
            passage = door_between(rng, room, living)
        if passage is not None:
            passages.append(passage)
    return without_obstructing_leaves(rooms, passages)


def _kitchen_openings(rng: Rng, rooms: Sequence[Room], living: Room, head_m: float) -> dict[str, Passage]:
    """The openings to the living room, by the names of the kitchens that have one."""
    openings = {}
    for room in rooms:
        joins_living = room.use == "kitchen" and rng.random() < 0.7
        opening = opening_between(rng, room, living, head_m=head_m) if joins_living else None
        if opening is not None:
            openings[room.name] = opening
    return openings


def _passage_to_hall(rng: Rng, room: Room, hall: Room, *, opening_head_m: float | None) -> Passage | None:
    """A door to the hall or, if its height is given, perhaps an opening; None if they share too short a wall."""
    may_be_open = opening_head_m is not None and rng.random() < 0.35
    if may_be_open and opening_head_m is not None:
        opening = opening_between(rng, room, hall, head_m=opening_head_m, most_m=1.7)
        if opening is not None:
            return opening
    return door_between(rng, room, hall)


def without_obstructing_leaves(rooms: Sequence[Room], passages: Sequence[Passage]) -> list[Passage]:
    """The passages, where doors have no leaf if it would stand open before another passage."""
    result = []
    for passage in passages:
        room = next((room for room in rooms if room.name == passage.opens_into), None)
        others = [other for other in passages if other is not passage and passage.opens_into in other.rooms]
        is_obstructing = room is not None and any(_is_near(room, passage.rect, other.rect) for other in others)
        result.append(replace(passage, has_leaf=passage.has_leaf and not is_obstructing))
    return result


def _is_near(room: Room, hole: Rect, other: Rect) -> bool:
    """Whether the leaf of one door of a room obstructs another door."""
    width_m = max(hole.width_m, hole.depth_m)
    return _before(room, hole, width_m + 0.1).overlaps(_before(room, other, 0.8))


def _before(room: Room, hole: Rect, depth_m: float) -> Rect:
    """The floor of a room in front of a hole."""
    side = room.side_at(hole)
    first_m, last_m = along_m(side, hole)
    inside = hole_outwards(room, side, first_m, last_m, -depth_m)
    return inside.grown(0.1)
