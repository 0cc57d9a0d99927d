"""Draws the route of a street: its segments and bends, its side streets, and a pedestrian crossing."""

from collections.abc import Iterator, Sequence

import numpy as np

from vobench.asset.picture import Rng
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.street_plan import LEFT, RIGHT, Crossing, SideStreet, StreetSegment

SEGMENT_COUNTS = (1, 2, 2, 3)
STREET_M = (54, 74)  # the least and the greatest length of the main street
BENDS_DEG = (6, 17)  # to either side
NO_SIDE_STREET_SHARE = 0.35
TWO_SIDE_STREETS_SHARE = 0.25
CLEAR_OF_BEND_M = 11.0  # from the edge of a side street to a bend or an end
SIDE_STREET_HALF_M = 3.0  # half of the road of a side street, about
NO_CROSSING_SHARE = 0.3
CROSSING_TRIES = 20
CROSSING_TO_SIDE_STREET_M = 5


def segments_of_street(rng: Rng) -> tuple[StreetSegment, ...]:
    """Draw one to three segments. The middle between the ends of the street is the origin."""
    count = int(rng.choice(SEGMENT_COUNTS))
    length_m = float(rng.uniform(*STREET_M))
    shares = rng.uniform(0.7, 1.3, count)
    lengths_m = (length_m * shares / shares.sum()).tolist()
    bends_deg = rng.uniform(*BENDS_DEG, count - 1) * rng.choice([-1, 1], count - 1)
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


def side_streets_of(rng: Rng, segments: Sequence[StreetSegment]) -> Iterator[SideStreet]:
    """Draw no side street, one, or two on opposite sides, in the longest segment."""
    choice = rng.random()
    if choice < NO_SIDE_STREET_SHARE:
        return
    index = int(np.argmax([segment.length_m for segment in segments]))
    length_m = segments[index].length_m
    least_m = CLEAR_OF_BEND_M + SIDE_STREET_HALF_M
    if length_m < 2 * least_m:
        return
    x_m = float(rng.uniform(least_m, length_m - least_m))
    road_m = float(rng.uniform(5.0, 6.5))
    pavement_m = float(rng.uniform(1.6, 2.4))
    is_on_both_sides = choice > 1 - TWO_SIDE_STREETS_SHARE
    first = LEFT if rng.random() < 0.5 else RIGHT
    yield SideStreet(index, x_m, first, road_m, pavement_m)
    if is_on_both_sides:
        yield SideStreet(index, x_m, -first, road_m, pavement_m)


def crossing_of(rng: Rng, segments: Sequence[StreetSegment], side_streets: Sequence[SideStreet]) -> Crossing | None:
    """Draw a pedestrian crossing that is clear of bends, ends and side streets; None for streets without one."""
    if rng.random() < NO_CROSSING_SHARE:
        return None
    for _ in range(CROSSING_TRIES):
        index = int(rng.integers(len(segments)))
        x_m = float(rng.uniform(7, max(segments[index].length_m - 7, 8)))
        is_clear = all(
            street.segment != index or abs(street.x_m - x_m) >= street.half_m + CROSSING_TO_SIDE_STREET_M
            for street in side_streets
        )
        if is_clear and x_m < segments[index].length_m - 6:
            return Crossing(index, x_m)
    return None
