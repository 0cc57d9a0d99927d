"""Frames in the plane of a plan."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class PlanFrame:
    """A frame in the plane of a plan: x is ahead and y to the left.

    `x_m` and `y_m` are its origin; `heading_deg` is the direction of its x axis.
    """

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
        """A frame at a point of this one, turned by an angle, counter-clockwise."""
        x, y = self.point(x_m, y_m).tolist()
        return PlanFrame(x, y, self.heading_deg + turn_deg)

    def rectangle(self, x0: float, x1: float, y0: float, y1: float) -> Array:
        """The corners (4, 2) of a rectangle of the frame, counter-clockwise."""
        return np.array([self.point(x0, y0), self.point(x1, y0), self.point(x1, y1), self.point(x0, y1)])
