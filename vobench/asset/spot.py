"""Spots: frames on the floor of a room, in which furniture is placed."""

from dataclasses import dataclass

import numpy as np

from vobench.asset.floor_plan import Rect, Room, Side, box_around

# The direction of the x axis of a spot at each wall: into the room.
YAW_DEG: dict[Side, float] = {"west": 0.0, "south": 90.0, "east": 180.0, "north": -90.0}
DECIMALS = 9  # of cosines and sines, so that footprints turned by 90° have sides along the axes exactly


@dataclass(frozen=True, slots=True)
class Spot:
    """A frame on the floor: x points into the room, away from the wall at `side`, and y runs along that wall.

    `x_m` and `y_m` are the origin in the frame of the place; `yaw_deg` is the direction of the x axis.
    """

    x_m: float
    y_m: float
    yaw_deg: float
    side: Side

    @property
    def along_m(self) -> float:
        """The coordinate of the origin along the wall: y for east and west, x for north and south."""
        return self.y_m if self.side in ("east", "west") else self.x_m

    def point(self, x_m: float, y_m: float = 0.0) -> tuple[float, float]:
        """The point (x, y) of the place at a point of this frame, in metres."""
        angle_rad = np.deg2rad(self.yaw_deg)
        cosine = float(np.cos(angle_rad).round(DECIMALS))
        sine = float(np.sin(angle_rad).round(DECIMALS))
        return self.x_m + cosine * x_m - sine * y_m, self.y_m + sine * x_m + cosine * y_m

    def rectangle(self, x0: float, x1: float, y0: float, y1: float) -> Rect:
        """The rectangle of the place for a rectangle of this frame, in metres."""
        return box_around([self.point(x0, y0), self.point(x1, y1)])

    def footprint(self, depth_m: float, width_m: float, wall_gap_m: float = 0.0) -> Rect:
        """A rectangle that begins at a distance from the wall and whose middle along the wall is the origin."""
        return self.rectangle(wall_gap_m, wall_gap_m + depth_m, -width_m / 2, width_m / 2)


def spot_at_wall(room: Room, side: Side, along_m: float) -> Spot:
    """The spot at a coordinate along a wall of a room."""
    face_m = room.face_m(side)
    if side in ("east", "west"):
        return Spot(face_m, along_m, YAW_DEG[side], side)
    return Spot(along_m, face_m, YAW_DEG[side], side)
