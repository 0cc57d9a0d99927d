"""Lays out streets by seed: roads, pavements, kerbs and lots around the route of a street that may bend."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset.picture import Rng
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.site import Area, has_overlap
from vobench.asset.street_plan import (
    KERB_M,
    LEFT,
    PARKING_M,
    RIGHT,
    Footway,
    Kerb,
    Lot,
    SideStreet,
    StreetPlan,
    StreetSegment,
)
from vobench.asset.street_route import crossing_of, segments_of_street, side_streets_of
from vobench.geometry.se3 import Array

LOT_DEPTH_M = 10.0  # along the main street
FAR_LOT_DEPTH_M = 8.0  # along side streets and opposite the ends of the main street
END_LOT_DEPTH_M = 7.0  # beside the ends of the main street
TRIES = 400
TOUCHING_M = 0.02  # depth by which lots may overlap
COVERING_M = 0.05  # depth by which a lot may overlap a street
PARKING_SIDES: tuple[tuple[int, ...], ...] = ((LEFT,), (RIGHT,), (LEFT, RIGHT), ())
PARKING_SHARES = (0.3, 0.3, 0.25, 0.15)  # of streets with cars on these sides


def street_plan(rng: Rng) -> StreetPlan:
    """Draw a plan in which no lot overlaps another one or a street."""
    for _ in range(TRIES):
        plan = _any_plan(rng)
        lots_m = [lot.corners_m for lot in plan.lots]
        streets_m = [area.corners_m for area in (*plan.roads, *plan.pavements)]
        if not has_overlap(lots_m, TOUCHING_M) and not _covers_a_street(lots_m, streets_m):
            return plan
    raise AssertionError("no plan of a street without overlaps was found")


def _covers_a_street(lots: Sequence[Array], streets: Sequence[Array]) -> bool:
    """Whether any lot reaches into a road or a pavement."""
    return any(has_overlap([lot, street], COVERING_M) for lot in lots for street in streets)


def _any_plan(rng: Rng) -> StreetPlan:
    """Draw a plan, in which lots may overlap."""
    parking = PARKING_SIDES[int(rng.choice(len(PARKING_SIDES), p=PARKING_SHARES))]
    road_m = float(rng.uniform(5.8, 7.4)) + PARKING_M * len(parking)
    pavement_m = float(rng.uniform(2.2, 4.6))
    segments = segments_of_street(rng)
    side_streets = tuple(side_streets_of(rng, segments))
    layout = _StreetLayout(road_m, pavement_m)
    for index, segment in enumerate(segments):
        leaving = [street for street in side_streets if street.segment == index]
        layout.add_segment(rng, segment, leaving, at_end=(index == 0, index == len(segments) - 1))
    for street in side_streets:
        middle_line = segments[street.segment].frame
        layout.add_side_street(rng, middle_line.frame(street.x_m, 0, 90.0 * street.side), street)
    first = segments[0].frame.frame(0, 0, 180.0)
    last = segments[-1].frame.frame(segments[-1].length_m, 0)
    for end in (first, last):
        layout.add_end_street(rng, end)
    return StreetPlan(
        segments=segments,
        side_streets=side_streets,
        road_m=road_m,
        pavement_m=pavement_m,
        parking=parking,
        crossing=crossing_of(rng, segments, side_streets),
        roads=tuple(layout.roads),
        pavements=tuple(layout.pavements),
        kerbs=tuple(layout.kerbs),
        footways=tuple(layout.footways),
        lots=tuple(layout.lots),
    )


def _split(rng: Rng, length_m: float, least_m: float = 6.0, most_m: float = 12.5) -> list[float]:
    """Draw the widths of lots that fill a frontage of a length."""
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


class _StreetLayout:
    """The areas, kerbs, footways and lots of a plan while it is laid out around a main street.

    `front_m` is the distance between the middle line of the main street and the fronts of its houses.
    """

    def __init__(self, road_m: float, pavement_m: float) -> None:
        self.road_m = road_m
        self.pavement_m = pavement_m
        self.front_m = road_m / 2 + pavement_m
        self.roads: list[Area] = []
        self.pavements: list[Area] = []
        self.kerbs: list[Kerb] = []
        self.footways: list[Footway] = []
        self.lots: list[Lot] = []

    def _add_road(self, corners_m: Array) -> None:
        self.roads.append(Area(corners_m, 0.0))

    def _add_pavement(self, corners_m: Array) -> None:
        self.pavements.append(Area(corners_m, KERB_M))

    def _add_kerb(self, frame: PlanFrame, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.kerbs.append(Kerb(frame.point(*start), frame.point(*end)))

    def _add_frontage(
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
        """Add lots along y of a frame, from its origin on, whose houses face x.

        Args:
            rng: draws the widths of the lots.
            frame: the frame of the frontage.
            length_m: the length of the frontage.
            skew_m: the displacements along y of the back corners at the start and at the end.
            is_open: whether a street passes the start and the end.
            depth_m: the depth of the lots.
            is_far: whether the houses are only seen from a distance.
        """
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
        self, rng: Rng, segment: StreetSegment, side_streets: Sequence[SideStreet], *, at_end: tuple[bool, bool]
    ) -> None:
        """Add the road, the pavements and the lots of a segment.

        at_end: whether the street begins at its start, and whether the street ends at its end.
        """
        half_m = self.road_m / 2
        frame = segment.frame
        right = segment.reach_m(-half_m)
        left = segment.reach_m(half_m)
        corners = [(right[0], -half_m), (right[1], -half_m), (left[1], half_m), (left[0], half_m)]
        self._add_road(np.array([frame.point(x, y) for x, y in corners]))
        for side in (LEFT, RIGHT):
            on_side = sorted((street for street in side_streets if street.side == side), key=lambda street: street.x_m)
            befores = [None, *on_side]  # the side street before and after each stretch; None at the segment's ends
            afters = [*on_side, None]
            for before, after in zip(befores, afters, strict=True):
                self._add_stretch(rng, segment, side, _Stretch(before, after), at_end)

    def _add_stretch(
        self, rng: Rng, segment: StreetSegment, side: int, stretch: "_Stretch", at_end: tuple[bool, bool]
    ) -> None:
        """Add kerb, pavement and lots along one side of a segment, from one side street to the next."""
        frame = segment.frame
        kerb_y_m = side * self.road_m / 2
        front_y_m = side * self.front_m
        kerb_x_m = stretch.along_m(segment.reach_m(kerb_y_m))
        front_x_m = stretch.along_m(segment.reach_m(front_y_m))
        self._add_kerb(frame, (kerb_x_m[0] - stretch.before_m, kerb_y_m), (kerb_x_m[1] + stretch.after_m, kerb_y_m))

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
        self._add_pavement(np.array(corners if side == LEFT else corners[::-1]))

        footway_start_m = max(kerb_start_m, front_start_m)
        footway_length_m = min(kerb_end_m, front_end_m) - footway_start_m
        self.footways.append(
            Footway(frame.frame(footway_start_m, kerb_y_m), footway_length_m, self.pavement_m, side == RIGHT)
        )
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
        """Add the lots along a stretch of one side of a segment. They are skewed at bends, and open to side streets."""
        start_tangent, end_tangent = np.tan(np.deg2rad(segment.turn_deg) / 2).tolist()
        start_skew_m = side * start_tangent * LOT_DEPTH_M if stretch.before is None else 0.0
        end_skew_m = -side * end_tangent * LOT_DEPTH_M if stretch.after is None else 0.0
        start_open = at_end[0] or stretch.before is not None
        end_open = at_end[1] or stretch.after is not None
        length_m = span_m[1] - span_m[0]
        far_m = side * self.front_m
        if side == LEFT:
            frame = segment.frame.frame(span_m[0], far_m, -90.0)
            self._add_frontage(rng, frame, length_m, skew_m=(start_skew_m, end_skew_m), is_open=(start_open, end_open))
        else:
            frame = segment.frame.frame(span_m[1], far_m, 90.0)
            self._add_frontage(
                rng, frame, length_m, skew_m=(-end_skew_m, -start_skew_m), is_open=(end_open, start_open)
            )

    def add_side_street(self, rng: Rng, frame: PlanFrame, street: SideStreet) -> None:
        """Add a side street. x of its frame leaves the main street, from the middle line of that on."""
        start_m = self.road_m / 2
        lots_from_m = self.front_m + LOT_DEPTH_M
        end_m = lots_from_m + float(rng.uniform(9, 13))
        half_m = street.road_m / 2
        self._add_road(frame.rectangle(start_m, end_m, -half_m, half_m))
        for side in (LEFT, RIGHT):
            low_m, high_m = sorted((side * half_m, side * street.half_m))
            self._add_pavement(frame.rectangle(start_m, end_m, low_m, high_m))
            self._add_kerb(frame, (start_m, side * half_m), (end_m, side * half_m))
        length_m = end_m - lots_from_m
        left = frame.frame(lots_from_m, street.half_m, -90.0)
        right = frame.frame(end_m, -street.half_m, 90.0)
        for side_frame in (left, right):
            self._add_frontage(rng, side_frame, length_m, depth_m=FAR_LOT_DEPTH_M, is_far=True)
        closing = frame.frame(end_m, -street.half_m, 180.0).frame(0, -2 * street.half_m)
        self._add_frontage(rng, closing, 2 * street.half_m, depth_m=FAR_LOT_DEPTH_M, is_far=True)

    def add_end_street(self, rng: Rng, frame: PlanFrame) -> None:
        """Add the street across an end of the main street. x of the frame points out of the main street."""
        road_m = float(rng.uniform(6.0, 8.0))
        far_pavement_m = float(rng.uniform(2.0, 3.0))
        near_m = self.pavement_m
        half_m = self.front_m + LOT_DEPTH_M + float(rng.uniform(6, 9))
        far_x = road_m + far_pavement_m
        self._add_road(frame.rectangle(0, road_m, -half_m, half_m))
        self._add_pavement(frame.rectangle(road_m, far_x, -half_m, half_m))
        self._add_kerb(frame, (road_m, -half_m), (road_m, half_m))
        for side in (LEFT, RIGHT):
            low_m, high_m = sorted((side * self.road_m / 2, side * half_m))
            self._add_pavement(frame.rectangle(-near_m, 0, low_m, high_m))
            self._add_kerb(frame, (0, side * self.road_m / 2), (0, side * half_m))
        across = frame.frame(far_x, half_m, 180.0)
        self._add_frontage(rng, across, 2 * half_m, depth_m=FAR_LOT_DEPTH_M, is_far=True)
        width_m = near_m + far_x
        self._add_frontage(rng, frame.frame(-near_m, half_m, -90.0), width_m, depth_m=END_LOT_DEPTH_M, is_far=True)
        self._add_frontage(rng, frame.frame(far_x, -half_m, 90.0), width_m, depth_m=END_LOT_DEPTH_M, is_far=True)
        beside_m = half_m - self.front_m - LOT_DEPTH_M
        left = frame.frame(-near_m, self.front_m + LOT_DEPTH_M)
        right = frame.frame(-near_m, -half_m)
        for near in (left, right):
            self._add_frontage(rng, near, beside_m, depth_m=END_LOT_DEPTH_M, is_far=True)
