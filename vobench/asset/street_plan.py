"""Plans of streets by seed: a street that may bend, side streets, the streets at its ends, and lots for houses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset.picture import Rng
from vobench.asset.site import Area, has_overlap
from vobench.geometry.se3 import Array

KERB_M = 0.12
LOT_DEPTH_M = 10.0
PARKING_M = 2.2
TRIES = 400
TOUCHING_M = 0.02  # that lots may share
LEFT = 1
RIGHT = -1
PARKING_SIDES: tuple[tuple[int, ...], ...] = ((LEFT,), (RIGHT,), (LEFT, RIGHT), ())
PARKING_SHARES = (0.3, 0.3, 0.25, 0.15)  # of streets with cars on these sides
CLEAR_OF_BEND_M = 11.0  # from a side street to a bend or an end


@dataclass(frozen=True, slots=True)
class PlanFrame:
    """A place and a heading in the plane; x is ahead, y to the left."""

    x_m: float
    y_m: float
    heading_deg: float

    def point(self, x_m: float, y_m: float) -> Array:
        """The point (2,) of the plan at a point of the frame."""
        angle_rad = np.deg2rad(self.heading_deg)
        cosine = np.cos(angle_rad)
        sine = np.sin(angle_rad)
        return np.array([self.x_m + cosine * x_m - sine * y_m, self.y_m + sine * x_m + cosine * y_m])

    def frame(self, x_m: float, y_m: float, turn_deg: float = 0.0) -> "PlanFrame":
        """A frame at a point of this one, turned relative to it."""
        x, y = self.point(x_m, y_m).tolist()
        return PlanFrame(x, y, self.heading_deg + turn_deg)

    def rectangle(self, x0: float, x1: float, y0: float, y1: float) -> Array:
        """The corners (4, 2) of a rectangle of the frame, counter-clockwise."""
        return np.array([self.point(x0, y0), self.point(x1, y0), self.point(x1, y1), self.point(x0, y1)])


@dataclass(frozen=True, slots=True)
class Lot:
    """The place of a house. Its front is on x = 0 of its frame and faces x; y is to the left of who leaves the house.

    skew_m are what the right and the left back corner are displaced along y, at bends of the street. is_open tells
    whether the right and the left side are seen from a street.
    """

    frame: PlanFrame
    width_m: float
    depth_m: float
    skew_m: tuple[float, float] = (0.0, 0.0)
    is_open: tuple[bool, bool] = (False, False)
    is_far: bool = False

    @property
    def local_corners_m(self) -> Array:
        """The corners (4, 2) in the lot's frame: front right, front left, back left, back right."""
        half_m = self.width_m / 2
        right_m, left_m = self.skew_m
        return np.array(
            [[0, -half_m], [0, half_m], [-self.depth_m, half_m + left_m], [-self.depth_m, -half_m + right_m]]
        )

    @property
    def corners_m(self) -> Array:
        """The corners (4, 2) in the plan, counter-clockwise."""
        return np.array([self.frame.point(x, y) for x, y in self.local_corners_m.tolist()])


@dataclass(frozen=True, slots=True)
class Kerb:
    """A kerb along a line of the plan."""

    start_m: Array
    end_m: Array


@dataclass(frozen=True, slots=True)
class Walk:
    """A stretch of pavement beside a road: x runs along the kerb, which is y = 0, and y to the houses."""

    frame: PlanFrame
    length_m: float
    width_m: float
    is_mirrored: bool  # the houses are to the right of x


@dataclass(frozen=True, slots=True)
class StreetSegment:
    """A straight part of the main street. turn_deg are the turns at its start and its end, 0 at the ends."""

    frame: PlanFrame
    length_m: float
    turn_deg: tuple[float, float]

    def reach_m(self, y_m: float) -> tuple[float, float]:
        """The first and the last x of the segment at a distance from its middle line."""
        start, end = np.tan(np.deg2rad(self.turn_deg) / 2).tolist()
        return start * y_m, self.length_m - end * y_m


@dataclass(frozen=True, slots=True)
class SideStreet:
    """A street that leaves a segment at x to one side."""

    segment: int
    x_m: float
    side: int
    road_m: float
    pavement_m: float

    @property
    def half_m(self) -> float:
        """Half its width between the houses."""
        return self.road_m / 2 + self.pavement_m


@dataclass(frozen=True, slots=True)
class StreetPlan:
    """A street with its surroundings.

    parking: the sides with parked cars. crossing_m: where pedestrians cross (segment, x), if anywhere.
    """

    segments: tuple[StreetSegment, ...]
    sides: tuple[SideStreet, ...]
    road_m: float
    pavement_m: float
    parking: tuple[int, ...]
    crossing: tuple[int, float] | None
    roads: tuple[Area, ...]
    pavements: tuple[Area, ...]
    kerbs: tuple[Kerb, ...]
    walks: tuple[Walk, ...]
    lots: tuple[Lot, ...]

    @property
    def stations_m(self) -> Array:
        """Places (N, 2) on the street that a car has to reach: near both ends, and at the bends."""
        first = self.segments[0].frame.point(4.0, 0.0)
        bends = [segment.frame.point(0, 0) for segment in self.segments[1:]]
        last = self.segments[-1].frame.point(self.segments[-1].length_m - 4.0, 0.0)
        return np.array([first, *bends, last])


def street_plan(rng: Rng) -> StreetPlan:
    """A plan in which no two lots overlap."""
    for _ in range(TRIES):
        plan = _drawn(rng)
        lots_m = [lot.corners_m for lot in plan.lots]
        streets_m = [area.corners_m for area in (*plan.roads, *plan.pavements)]
        if not has_overlap(lots_m, TOUCHING_M) and not _covers_a_street(lots_m, streets_m):
            return plan
    raise AssertionError("no plan of a street without overlaps was found")


def _covers_a_street(lots: Sequence[Array], streets: Sequence[Array]) -> bool:
    """Whether any lot reaches into a road or a pavement."""
    return any(has_overlap([lot, street], 0.05) for lot in lots for street in streets)


def _drawn(rng: Rng) -> StreetPlan:
    """A plan, in which lots may overlap."""
    parking = PARKING_SIDES[int(rng.choice(len(PARKING_SIDES), p=PARKING_SHARES))]
    road_m = float(rng.uniform(5.8, 7.4)) + PARKING_M * len(parking)
    pavement_m = float(rng.uniform(2.2, 4.6))
    segments = _segments(rng)
    sides = tuple(_side_streets(rng, segments))
    front_m = road_m / 2 + pavement_m
    builder = _Builder(road_m, pavement_m)
    for index, segment in enumerate(segments):
        leaving = [side for side in sides if side.segment == index]
        builder.add_segment(rng, segment, leaving, _ends(segments, index))
    for side in sides:
        segment = segments[side.segment]
        builder.add_side(rng, segment.frame.frame(side.x_m, 0, 90.0 * side.side), side)
    first = segments[0].frame.frame(0, 0, 180.0)
    last = segments[-1].frame.frame(segments[-1].length_m, 0)
    for end in (first, last):
        builder.add_end(rng, end, front_m)
    return StreetPlan(
        segments=segments,
        sides=sides,
        road_m=road_m,
        pavement_m=pavement_m,
        parking=parking,
        crossing=_crossing(rng, segments, sides),
        roads=tuple(builder.roads),
        pavements=tuple(builder.pavements),
        kerbs=tuple(builder.kerbs),
        walks=tuple(builder.walks),
        lots=tuple(builder.lots),
    )


def _segments(rng: Rng) -> tuple[StreetSegment, ...]:
    """One to three straight parts, centred around the origin."""
    count = int(rng.choice([1, 2, 2, 3]))
    length_m = float(rng.uniform(54, 74))
    shares = rng.uniform(0.7, 1.3, count)
    lengths_m = (length_m * shares / shares.sum()).tolist()
    bends_deg = rng.uniform(6, 17, count - 1) * rng.choice([-1, 1], count - 1)
    turns_deg = [0.0, *bends_deg.tolist(), 0.0]

    heading_deg = float(rng.uniform(0, 360))
    corners_m = [np.zeros(2)]
    headings_deg = []
    for length_m, turn_deg in zip(lengths_m, turns_deg, strict=False):  # the last turn is at the end of the street
        heading_deg += turn_deg
        headings_deg.append(heading_deg)
        angle_rad = np.deg2rad(heading_deg)
        direction = np.array([np.cos(angle_rad), np.sin(angle_rad)])
        corners_m.append(corners_m[-1] + length_m * direction)

    middle_m = (corners_m[0] + corners_m[-1]) / 2
    segments = []
    for index in range(count):
        x_m, y_m = (corners_m[index] - middle_m).tolist()
        frame = PlanFrame(x_m, y_m, headings_deg[index])
        segments.append(StreetSegment(frame, lengths_m[index], (turns_deg[index], turns_deg[index + 1])))
    return tuple(segments)


def _side_streets(rng: Rng, segments: Sequence[StreetSegment]) -> Iterator[SideStreet]:
    """No side street, one to the left or to the right, or one to each side."""
    choice = rng.random()
    if choice < 0.35:
        return
    index = int(np.argmax([segment.length_m for segment in segments]))
    length_m = segments[index].length_m
    if length_m < 2 * CLEAR_OF_BEND_M + 6:
        return
    x_m = float(rng.uniform(CLEAR_OF_BEND_M + 3, length_m - CLEAR_OF_BEND_M - 3))
    road_m = float(rng.uniform(5.0, 6.5))
    pavement_m = float(rng.uniform(1.6, 2.4))
    is_on_both_sides = choice > 0.75
    first = LEFT if rng.random() < 0.5 else RIGHT
    yield SideStreet(index, x_m, first, road_m, pavement_m)
    if is_on_both_sides:
        yield SideStreet(index, x_m, -first, road_m, pavement_m)


def _crossing(rng: Rng, segments: Sequence[StreetSegment], sides: Sequence[SideStreet]) -> tuple[int, float] | None:
    """A place for a pedestrian crossing, clear of bends, ends and side streets."""
    if rng.random() < 0.3:
        return None
    for _ in range(20):
        index = int(rng.integers(len(segments)))
        x_m = float(rng.uniform(7, max(segments[index].length_m - 7, 8)))
        is_clear = all(side.segment != index or abs(side.x_m - x_m) >= side.half_m + 5 for side in sides)
        if is_clear and x_m < segments[index].length_m - 6:
            return index, x_m
    return None


def _ends(segments: Sequence[StreetSegment], index: int) -> tuple[bool, bool]:
    """Whether a segment begins at the start of the street, and whether it ends at its end."""
    return index == 0, index == len(segments) - 1


def _split(rng: Rng, length_m: float, least_m: float = 6.0, most_m: float = 12.5) -> list[float]:
    """Widths of lots along a frontage."""
    mean_m = float(rng.uniform(least_m + 1, most_m - 1))
    count = max(1, round(length_m / mean_m))
    weights = rng.uniform(0.75, 1.25, count)
    widths_m: list[float] = (length_m * weights / weights.sum()).tolist()
    return widths_m


@dataclass(frozen=True, slots=True)
class _Stretch:
    """A part of one side of a segment between two side streets; None at an end of the segment."""

    before: SideStreet | None
    after: SideStreet | None

    @property
    def before_m(self) -> float:
        """The width of the pavement of the side street before it, 0 at an end of the segment."""
        return self.before.pavement_m if self.before else 0.0

    @property
    def after_m(self) -> float:
        """The width of the pavement of the side street after it, 0 at an end of the segment."""
        return self.after.pavement_m if self.after else 0.0

    def along_m(self, reach_m: tuple[float, float]) -> tuple[float, float]:
        """The first and the last x of the stretch, given those of the segment at the same distance from its middle."""
        start_m = self.before.x_m + self.before.half_m if self.before else reach_m[0]
        end_m = self.after.x_m - self.after.half_m if self.after else reach_m[1]
        return start_m, end_m


class _Builder:
    """Gathers the areas, kerbs and lots of a plan."""

    def __init__(self, road_m: float, pavement_m: float) -> None:
        self.road_m = road_m
        self.pavement_m = pavement_m
        self.front_m = road_m / 2 + pavement_m
        self.roads: list[Area] = []
        self.pavements: list[Area] = []
        self.kerbs: list[Kerb] = []
        self.walks: list[Walk] = []
        self.lots: list[Lot] = []

    def _road(self, corners_m: Array) -> None:
        self.roads.append(Area(corners_m, 0.0))

    def _pavement(self, corners_m: Array) -> None:
        self.pavements.append(Area(corners_m, KERB_M))

    def _kerb(self, frame: PlanFrame, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.kerbs.append(Kerb(frame.point(*start), frame.point(*end)))

    def _frontage(
        self,
        rng: Rng,
        frame: PlanFrame,
        length_m: float,
        *,
        skew_m: tuple[float, float] = (0.0, 0.0),
        is_open: tuple[bool, bool] = (False, False),
        depth_m: float = LOT_DEPTH_M,
        is_far: bool = False,
    ) -> None:
        """Lots along a line from the origin of a frame along y, whose houses face x."""
        widths_m = _split(rng, length_m)
        y_m = 0.0
        for index, width_m in enumerate(widths_m):
            is_first = index == 0
            is_last = index == len(widths_m) - 1
            self.lots.append(
                Lot(
                    frame.frame(0.0, y_m + width_m / 2),
                    width_m,
                    depth_m,
                    (skew_m[0] if is_first else 0.0, skew_m[1] if is_last else 0.0),
                    (is_open[0] and is_first, is_open[1] and is_last),
                    is_far,
                )
            )
            y_m += width_m

    def add_segment(
        self, rng: Rng, segment: StreetSegment, sides: Sequence[SideStreet], at_end: tuple[bool, bool]
    ) -> None:
        """The road, the pavements and the lots of a straight part of the main street."""
        half_m = self.road_m / 2
        frame = segment.frame
        right = segment.reach_m(-half_m)
        left = segment.reach_m(half_m)
        corners = [(right[0], -half_m), (right[1], -half_m), (left[1], half_m), (left[0], half_m)]
        self._road(np.array([frame.point(x, y) for x, y in corners]))
        for side in (LEFT, RIGHT):
            on_side = sorted((street for street in sides if street.side == side), key=lambda street: street.x_m)
            befores = [None, *on_side]  # the side street before and after each stretch; None at the segment's ends
            afters = [*on_side, None]
            for before, after in zip(befores, afters, strict=True):
                self._add_stretch(rng, segment, side, _Stretch(before, after), at_end)

    def _add_stretch(
        self, rng: Rng, segment: StreetSegment, side: int, stretch: "_Stretch", at_end: tuple[bool, bool]
    ) -> None:
        """Kerb, pavement and lots along one side of a segment, from one side street to the next."""
        frame = segment.frame
        kerb_y_m = side * self.road_m / 2
        front_y_m = side * self.front_m
        kerb_x_m = stretch.along_m(segment.reach_m(kerb_y_m))
        front_x_m = stretch.along_m(segment.reach_m(front_y_m))
        self._kerb(frame, (kerb_x_m[0] - stretch.before_m, kerb_y_m), (kerb_x_m[1] + stretch.after_m, kerb_y_m))

        # The pavement along the street at an end has the corner.
        start_corner_m = self.pavement_m if stretch.before is None and at_end[0] else 0.0
        end_corner_m = self.pavement_m if stretch.after is None and at_end[1] else 0.0
        kerb_start_m = kerb_x_m[0] + start_corner_m
        kerb_end_m = kerb_x_m[1] - end_corner_m
        front_start_m = front_x_m[0] + start_corner_m
        front_end_m = front_x_m[1] - end_corner_m
        corners = [
            frame.point(kerb_start_m, kerb_y_m),
            frame.point(kerb_end_m, kerb_y_m),
            frame.point(front_end_m, front_y_m),
            frame.point(front_start_m, front_y_m),
        ]
        self._pavement(np.array(corners if side == LEFT else corners[::-1]))

        walk_start_m = max(kerb_start_m, front_start_m)
        walk_length_m = min(kerb_end_m, front_end_m) - walk_start_m
        self.walks.append(Walk(frame.frame(walk_start_m, kerb_y_m), walk_length_m, self.pavement_m, side == RIGHT))
        self._add_lots(rng, segment, side, stretch, span_m=(front_start_m, front_end_m), at_end=at_end)

    def _add_lots(
        self,
        rng: Rng,
        segment: StreetSegment,
        side: int,
        stretch: "_Stretch",
        *,
        span_m: tuple[float, float],
        at_end: tuple[bool, bool],
    ) -> None:
        """The lots along a stretch of one side of a segment. They are skewed at bends, and open to side streets."""
        start_tangent, end_tangent = np.tan(np.deg2rad(segment.turn_deg) / 2).tolist()
        start_skew_m = side * start_tangent * LOT_DEPTH_M if stretch.before is None else 0.0
        end_skew_m = -side * end_tangent * LOT_DEPTH_M if stretch.after is None else 0.0
        start_open = at_end[0] or stretch.before is not None
        end_open = at_end[1] or stretch.after is not None
        length_m = span_m[1] - span_m[0]
        far_m = side * self.front_m
        if side == LEFT:
            frame = segment.frame.frame(span_m[0], far_m, -90.0)
            self._frontage(rng, frame, length_m, skew_m=(start_skew_m, end_skew_m), is_open=(start_open, end_open))
        else:
            frame = segment.frame.frame(span_m[1], far_m, 90.0)
            self._frontage(rng, frame, length_m, skew_m=(-end_skew_m, -start_skew_m), is_open=(end_open, start_open))

    def add_side(self, rng: Rng, frame: PlanFrame, street: SideStreet) -> None:
        """A side street, whose frame begins on the middle line of the main street."""
        start_m = self.road_m / 2
        lots_from_m = self.front_m + LOT_DEPTH_M
        end_m = lots_from_m + float(rng.uniform(9, 13))
        half_m = street.road_m / 2
        self._road(frame.rectangle(start_m, end_m, -half_m, half_m))
        for side in (LEFT, RIGHT):
            low_m, high_m = sorted((side * half_m, side * street.half_m))
            self._pavement(frame.rectangle(start_m, end_m, low_m, high_m))
            self._kerb(frame, (start_m, side * half_m), (end_m, side * half_m))
        length_m = end_m - lots_from_m
        left = frame.frame(lots_from_m, street.half_m, -90.0)
        right = frame.frame(end_m, -street.half_m, 90.0)
        for side_frame in (left, right):
            self._frontage(rng, side_frame, length_m, depth_m=8.0, is_far=True)
        closing = frame.frame(end_m, -street.half_m, 180.0).frame(0, -2 * street.half_m)
        self._frontage(rng, closing, 2 * street.half_m, depth_m=8.0, is_far=True)

    def add_end(self, rng: Rng, frame: PlanFrame, front_m: float) -> None:
        """The street across an end of the main street. x of the frame points out of the main street."""
        road_m = float(rng.uniform(6.0, 8.0))
        far_pavement_m = float(rng.uniform(2.0, 3.0))
        near_m = self.pavement_m
        half_m = front_m + LOT_DEPTH_M + float(rng.uniform(6, 9))
        far_x = road_m + far_pavement_m
        self._road(frame.rectangle(0, road_m, -half_m, half_m))
        self._pavement(frame.rectangle(road_m, far_x, -half_m, half_m))
        self._kerb(frame, (road_m, -half_m), (road_m, half_m))
        for side in (LEFT, RIGHT):
            low_m, high_m = sorted((side * self.road_m / 2, side * half_m))
            self._pavement(frame.rectangle(-near_m, 0, low_m, high_m))
            self._kerb(frame, (0, side * self.road_m / 2), (0, side * half_m))
        across = frame.frame(far_x, half_m, 180.0)
        self._frontage(rng, across, 2 * half_m, depth_m=8.0, is_far=True)
        width_m = near_m + far_x
        self._frontage(rng, frame.frame(-near_m, half_m, -90.0), width_m, depth_m=7.0, is_far=True)
        self._frontage(rng, frame.frame(far_x, -half_m, 90.0), width_m, depth_m=7.0, is_far=True)
        beside_m = half_m - front_m - LOT_DEPTH_M
        left = frame.frame(-near_m, front_m + LOT_DEPTH_M)
        right = frame.frame(-near_m, -half_m)
        for near in (left, right):
            self._frontage(rng, near, beside_m, depth_m=7.0, is_far=True)
