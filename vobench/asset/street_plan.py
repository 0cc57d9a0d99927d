"""Plans of streets: segments of the main street, side streets, roads, pavements, kerbs, and lots for houses."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vobench.asset.plan_frame import PlanFrame
from vobench.asset.site import Area
from vobench.geometry.se3 import Array

KERB_M = 0.12  # height of pavements above roads
PARKING_M = 2.2  # width of a parking lane
STATION_M = 4.0  # from an end of the street to the point near it that a car has to reach
LEFT = 1  # sides of a segment: the signs of y
RIGHT = -1


@dataclass(frozen=True, slots=True)
class Lot:
    """The lot of a house, whose front is on x = 0 of its frame and faces x. Its right side is that of -y.

    `width_m` is the extent along y, and `depth_m` that along -x.
    `skew_m` are the displacements along y of the right and the left back corner, at bends of the street.
    `is_open` tells of the right and the left side whether a street passes there.
    `is_far` marks a house that is only seen from a distance.
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
class Footway:
    """A straight stretch of pavement: x of its frame runs along the kerb, at y = 0.

    The houses are to the left of x, or to the right if `is_mirrored`.
    """

    frame: PlanFrame
    length_m: float
    width_m: float
    is_mirrored: bool


@dataclass(frozen=True, slots=True)
class StreetSegment:
    """A straight part of the main street: x of its frame is its middle line.

    `turn_deg` are the turns to the next segment at its start and at its end, 0 at the ends of the street.
    """

    frame: PlanFrame
    length_m: float
    turn_deg: tuple[float, float]

    def reach_m(self, y_m: float) -> tuple[float, float]:
        """The first and the last x of the segment at a y. Segments meet on the line that halves the angle of a bend."""
        start_tangent, end_tangent = np.tan(np.deg2rad(self.turn_deg) / 2).tolist()
        return start_tangent * y_m, self.length_m - end_tangent * y_m


@dataclass(frozen=True, slots=True)
class SideStreet:
    """A street that leaves a segment at x to one side, LEFT or RIGHT.

    `segment` is the index of the segment; `road_m` and `pavement_m` are the widths of the road and of each pavement.
    """

    segment: int
    x_m: float
    side: int
    road_m: float
    pavement_m: float

    @property
    def half_m(self) -> float:
        """Half its width between the houses."""
        return self.road_m / 2 + self.pavement_m


class Crossing(NamedTuple):
    """A pedestrian crossing: the index of its segment, and the x of its middle."""

    segment: int
    x_m: float


@dataclass(frozen=True, slots=True)
class StreetPlan:
    """A street with its surroundings.

    `road_m` and `pavement_m` are the widths of the main road, with its parking lanes, and of each of its pavements.
    `parking` are the sides with parked cars.
    `crossing` is where pedestrians cross the main road, if anywhere.
    """

    segments: tuple[StreetSegment, ...]
    side_streets: tuple[SideStreet, ...]
    road_m: float
    pavement_m: float
    parking: tuple[int, ...]
    crossing: Crossing | None
    roads: tuple[Area, ...]
    pavements: tuple[Area, ...]
    kerbs: tuple[Kerb, ...]
    footways: tuple[Footway, ...]
    lots: tuple[Lot, ...]

    @property
    def stations_m(self) -> Array:
        """Points (N, 2) on the street that a car has to reach: near both ends, and at the bends."""
        first = self.segments[0].frame.point(STATION_M, 0.0)
        bends = [segment.frame.point(0, 0) for segment in self.segments[1:]]
        last = self.segments[-1].frame.point(self.segments[-1].length_m - STATION_M, 0.0)
        return np.array([first, *bends, last])
