"""The pinhole camera: OpenCV axes (x right, y down, z forward), pixel centres at integers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A pinhole camera with pixels that need not be square; (0, 0) is the centre of the top-left pixel."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    @property
    def K(self) -> Array:
        """The (3, 3) camera matrix."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in metres; NaN for points not in front of the camera."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        z = np.where(z > 0, z, np.nan)
        return np.stack([self.fx_px * x / z + self.cx_px, self.fy_px * y / z + self.cy_px], -1)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Directions (..., 3) with z = 1 through pixels (..., 2): the inverse of `project` at depth 1."""
        u, v = np.moveaxis(np.asarray(uv_px, float), -1, 0)
        x, y = (u - self.cx_px) / self.fx_px, (v - self.cy_px) / self.fy_px
        return np.stack([x, y, np.ones_like(x)], -1)

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""
        u, v = np.meshgrid(np.arange(self.width_px, dtype=float), np.arange(self.height_px, dtype=float))
        return np.stack([u, v], -1)
