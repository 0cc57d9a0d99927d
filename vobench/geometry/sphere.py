"""Cameras by way of a sphere: the double sphere for fisheyes, and all around in one picture."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.camera import DepthAlong, camera_matrix, from_pixels, pixel_centres, to_pixels, unit
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class DoubleSphere:
    """A fisheye with an inverse in closed form. Source: Usenko, Demmel and Cremers (2018), equations 40 to 46.

    |xi| < 1 shifts the second sphere, 0 <= alpha < 1 the pinhole behind it.
    """

    depth_along: ClassVar[DepthAlong] = "axis"
    coefficients: ClassVar[tuple[str, ...]] = ("xi", "alpha")
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    xi: float
    alpha: float

    @property
    def K(self) -> Array:
        """The (3, 3) matrix of the pinhole that the lens is like about its axis."""
        magnified = 1 + self.xi
        return camera_matrix(self.fx_px / magnified, self.fy_px / magnified, self.cx_px, self.cy_px)

    @property
    def least_cosine(self) -> float:
        """Cosine of the angle on the second sphere at which the lens folds over or its picture ends at infinity."""
        larger, smaller = max(self.alpha, 1 - self.alpha), min(self.alpha, 1 - self.alpha)
        return -smaller / larger

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN outside the cone that the lens sees."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        # The paper states its bound in z; on the second sphere it is exact, and short.
        z = self.xi * np.sqrt(x * x + y * y + z * z) + z
        d = np.sqrt(x * x + y * y + z * z)
        seen = z > self.least_cosine * d
        scale = np.where(seen, self.alpha * d + (1 - self.alpha) * z, np.nan)
        return to_pixels(self, x / scale, y / scale)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = from_pixels(self, uv_px)
        s = x * x + y * y
        under_root = 1 - (2 * self.alpha - 1) * s
        root = np.sqrt(np.where(under_root > 0, under_root, np.nan))
        z = (1 - self.alpha**2 * s) / (self.alpha * root + 1 - self.alpha)
        scale = (z * self.xi + np.sqrt(z * z + (1 - self.xi**2) * s)) / (z * z + s)
        return unit(np.stack([scale * x, scale * y, scale * z - self.xi], -1))

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""
        return pixel_centres(self.width_px, self.height_px)


@dataclass(frozen=True, slots=True)
class Equirectangular:
    """All directions in one picture: columns are longitudes, rows latitudes, ahead is in the middle.

    Its depth is the distance along the ray, since z would be negative for half of what it sees.
    """

    depth_along: ClassVar[DepthAlong] = "ray"
    coefficients: ClassVar[tuple[str, ...]] = ()
    width_px: int
    height_px: int

    @property
    def K(self) -> Array:
        """The (3, 3) matrix of the pinhole that the picture is like about its middle."""
        fx, fy = self.width_px / (2 * np.pi), self.height_px / np.pi
        return camera_matrix(fx, fy, (self.width_px - 1) / 2, (self.height_px - 1) / 2)

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for the camera's own place only."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        somewhere = np.where((x != 0) | (y != 0) | (z != 0), 1.0, np.nan)
        longitude, latitude = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
        (fx, _, cx), (_, fy, cy), _ = self.K
        return np.stack([fx * longitude + cx, fy * latitude + cy], -1) * somewhere[..., None]

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for what lies off the picture's sphere."""
        (fx, _, cx), (_, fy, cy), _ = self.K
        u, v = np.moveaxis(np.asarray(uv_px, float), -1, 0)
        longitude, latitude = (u - cx) / fx, (v - cy) / fy
        latitude = np.where((np.abs(longitude) <= np.pi) & (np.abs(latitude) <= np.pi / 2), latitude, np.nan)
        across = np.cos(latitude)
        return np.stack([across * np.sin(longitude), np.sin(latitude), across * np.cos(longitude)], -1)

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""
        return pixel_centres(self.width_px, self.height_px)
