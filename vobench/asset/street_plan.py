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
        corners = [lot.corners_m for lot in plan.lots]
        blocked = [*corners, *(area.corners_m for area in (*plan.roads, *plan.pavements))]
        lots_meet = has_overlap(corners, TOUCHING_M)
        if not lots_meet and not _covers_a_street(corners, blocked[len(corners) :]):
            return plan
    raise AssertionError("no plan of a street without overlaps was found")


def _covers_a_street(lots: Sequence[Array], streets: Sequence[Array]) -> bool:
    """Whether any lot reaches into a road or a pavement."""
    return any(has_overlap([lot, street], 0.05) for lot in lots for street in streets)


def _drawn(rng: Rng) -> StreetPlan:
    """A plan, in which lots may overlap."""
    parking: tuple[int, ...] = ((LEFT,), (RIGHT,), (LEFT, RIGHT), ())[int(rng.choice(4, p=[0.3, 0.3, 0.25, 0.15]))]
    road_m = float(rng.uniform(5.8, 7.4)) + PARKING_M * len(parking)
    pavement_m = float(rng.uniform(2.2, 4.6))
    segments = _segments(rng)
    sides = tuple(_side_streets(rng, segments))
    front_m = road_m / 2 + pavement_m
    builder = _Builder(road_m, pavement_m)
    for index, segment in enumerate(segments):
        builder.add_segment(rng, segment, [side for side in sides if side.segment == index], _ends(segments, index))
    for side in sides:
        segment = segments[side.segment]
        builder.add_side(rng, segment.frame.frame(side.x_m, 0, 90.0 * side.side), side)
    first = segments[0].frame.frame(0, 0, 180.0)
    last = segments[-1].frame.frame(segments[-1].length_m, 0)
    for end in (first, last):
        builder.add_end(rng, end, front_m)
    return StreetPlan(
        segments,
        sides,
        road_m,
        pavement_m,
        parking,
        _crossing(rng, segments, sides),
        tuple(builder.roads),
        tuple(builder.pavements),
        tuple(builder.kerbs),
        tuple(builder.walks),
        tuple(builder.lots),
    )


def _segments(rng: Rng) -> tuple[StreetSegment, ...]:
    """One to three straight parts, centred around the origin."""
    count = int(rng.choice([1, 2, 2, 3]))
    length_m = float(rng.uniform(54, 74))
    shares = rng.uniform(0.7, 1.3, count)
    lengths_m = (length_m * shares / shares.sum()).tolist()
    turns_deg = [0.0, *(rng.uniform(6, 17, count - 1) * rng.choice([-1, 1], count - 1)).tolist(), 0.0]
    heading_deg = float(rng.uniform(0, 360))
    corners = [np.zeros(2)]
    headings = []
    for index in range(count):
        heading_deg += turns_deg[index]
        headings.append(heading_deg)
        angle_rad = np.deg2rad(heading_deg)
        corners.append(corners[-1] + lengths_m[index] * np.array([np.cos(angle_rad), np.sin(angle_rad)]))
    middle = (corners[0] + corners[-1]) / 2
    found = []
    for index in range(count):
        x, y = (corners[index] - middle).tolist()
        turns = (turns_deg[index], turns_deg[index + 1])
        found.append(StreetSegment(PlanFrame(x, y, headings[index]), lengths_m[index], turns))
    return tuple(found)


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
    both = choice > 0.75
    first = LEFT if rng.random() < 0.5 else RIGHT
    yield SideStreet(index, x_m, first, road_m, pavement_m)
    if both:
        yield SideStreet(index, x_m, -first, road_m, pavement_m)


def _crossing(rng: Rng, segments: Sequence[StreetSegment], sides: Sequence[SideStreet]) -> tuple[int, float] | None:
    """A place for a pedestrian crossing, clear of bends, ends and side streets."""
    if rng.random() < 0.3:
        return None
    for _ in range(20):
        index = int(rng.integers(len(segments)))
        x_m = float(rng.uniform(7, max(segments[index].length_m - 7, 8)))
        near = [side for side in sides if side.segment == index and abs(side.x_m - x_m) < side.half_m + 5]
        if not near and x_m < segments[index].length_m - 6:
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
            gaps = sorted(
                (street.x_m - street.half_m, street.x_m + street.half_m, street.pavement_m)
                for street in sides
                if street.side == side
            )
            self._side_of(rng, segment, side, gaps, at_end)

    def _side_of(
        self,
        rng: Rng,
        segment: StreetSegment,
        side: int,
        gaps: Sequence[tuple[float, float, float]],
        at_end: tuple[bool, bool],
    ) -> None:
        """Kerb, pavement and lots on one side, with gaps for side streets (start, end, width of their pavement)."""
        frame = segment.frame
        near_m = side * self.road_m / 2
        far_m = side * self.front_m
        near = segment.reach_m(near_m)
        far = segment.reach_m(far_m)
        corner_m = self.pavement_m  # of the pavement along the street at an end
        starts: list[float | None] = [None, *(gap[1] for gap in gaps)]
        ends: list[float | None] = [*(gap[0] for gap in gaps), None]
        kerb_trim = [0.0, *(gap[2] for gap in gaps)]
        for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
            near_start = near[0] if start is None else start
            near_end = near[1] if end is None else end
            far_start = far[0] if start is None else start
            far_end = far[1] if end is None else end
            kerb_start = near_start - (0.0 if start is None else kerb_trim[index])
            kerb_end = near_end + (0.0 if end is None else gaps[index][2])
            self._kerb(frame, (kerb_start, near_m), (kerb_end, near_m))
            if start is None and at_end[0]:
                near_start += corner_m
                far_start += corner_m
            if end is None and at_end[1]:
                near_end -= corner_m
                far_end -= corner_m
            ring = [(near_start, near_m), (near_end, near_m), (far_end, far_m), (far_start, far_m)]
            corners = np.array([frame.point(x, y) for x, y in ring])
            self._pavement(corners if side == LEFT else corners[::-1])
            inner_start = max(near_start, far_start)
            inner_end = min(near_end, far_end)
            self.walks.append(
                Walk(frame.frame(inner_start, near_m), inner_end - inner_start, self.pavement_m, side == RIGHT)
            )
            self._lots_of(rng, segment, side, span_m=(far_start, far_end), cuts=(start, end), at_end=at_end)

    def _lots_of(
        self,
        rng: Rng,
        segment: StreetSegment,
        side: int,
        *,
        span_m: tuple[float, float],
        cuts: tuple[float | None, float | None],
        at_end: tuple[bool, bool],
    ) -> None:
        """The lots along a stretch of one side of a segment."""
        tangents = np.tan(np.deg2rad(segment.turn_deg) / 2).tolist()
        start_skew_m = side * tangents[0] * LOT_DEPTH_M if cuts[0] is None else 0.0
        end_skew_m = -side * tangents[1] * LOT_DEPTH_M if cuts[1] is None else 0.0
        start_open = at_end[0] or cuts[0] is not None
        end_open = at_end[1] or cuts[1] is not None
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
