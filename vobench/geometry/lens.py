"""Lenses that bend lines: Brown and Conrady's for mild distortion, Kannala and Brandt's for fisheyes.

k1..k4, p1, p2   coefficients in the order of OpenCV, ROS and Kalibr
x, y             place on the plane z = 1; s = x² + y²
theta            angle between ray and optical axis
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.camera import (
    DepthAlong,
    camera_matrix,
    from_pixels,
    on_plane,
    pixel_centres,
    to_pixels,
    unit,
)
from vobench.geometry.root import plane_root, rising_root
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class BrownConrady:
    """Radial and tangential distortion (ROS: plumb_bob, Kalibr: radtan). Source: Brown (1966), OpenCV.

    Beyond `fold_radius` the polynomials turn back and far directions would land on near ones: no pixel.
    """

    depth_along: ClassVar[DepthAlong] = "axis"
    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3")
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    k1: float
    k2: float
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def K(self) -> Array:
        """The (3, 3) camera matrix."""
        return camera_matrix(self.fx_px, self.fy_px, self.cx_px, self.cy_px)

    @property
    def fold_radius(self) -> float:
        """Radius on the plane z = 1 up to which the lens is one-to-one; infinite for most."""
        return _fold_radius(self.k1, self.k2, self.k3, float(np.hypot(self.p1, self.p2)))

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN behind the camera and beyond the fold."""
        x, y = on_plane(points_camera)
        seen = x * x + y * y < self.fold_radius**2
        x, y = np.where(seen, x, np.nan), np.where(seen, y, np.nan)
        return to_pixels(self, *self._bent(x, y)[:2])

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = from_pixels(self, uv_px)
        x, y = self._straight(x.ravel(), y.ravel()).reshape(2, *x.shape)
        return unit(np.stack([x, y, np.ones_like(x)], -1))

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""
        return pixel_centres(self.width_px, self.height_px)

    def _bent(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Where the lens sends x and y, and the entries xx, xy, yy of the Jacobian, which is symmetric."""
        k1, k2, k3, p1, p2 = self.k1, self.k2, self.k3, self.p1, self.p2
        s = x * x + y * y
        radial = 1 + s * (k1 + s * (k2 + s * k3))
        slope = 2 * (k1 + s * (2 * k2 + s * 3 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x)
        v = y * radial + 2 * p2 * x * y + p1 * (s + 2 * y * y)
        xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        return u, v, xx, x * y * slope + 2 * (p1 * x + p2 * y), yy

    def _straight(self, u: Array, v: Array) -> Array:
        """The places (2, N) that the lens sends to u and v; NaN beyond the fold."""

        def radial(r: Array) -> Array:
            return r * (1 + r**2 * (self.k1 + r**2 * (self.k2 + r**2 * self.k3)))

        def radial_slope(r: Array) -> Array:
            return 1 + r**2 * (3 * self.k1 + r**2 * (5 * self.k2 + r**2 * 7 * self.k3))

        far = np.hypot(u, v)
        limit = _reach(radial, far.max(initial=1.0, where=np.isfinite(far)), self.fold_radius)
        # Tangential terms move a point by at most 3 |p| s, so what is farther out has no origin.
        edge = float(radial(np.array(limit))) * (1 - 1e-12)
        possible = far <= edge + 3 * np.hypot(self.p1, self.p2) * limit**2
        u, v, far = u[possible], v[possible], far[possible]
        scale = rising_root(radial, radial_slope, np.minimum(far, edge), limit) / np.maximum(far, 1e-300)
        out = np.full((2, len(possible)), np.nan)
        out[:, possible] = plane_root(self._bent, (u, v), (u * scale, v * scale), limit)
        return out


@dataclass(frozen=True, slots=True)
class KannalaBrandt:
    """A fisheye by a polynomial in the angle (ROS: equidistant, Kalibr: equi). Source: Kannala and Brandt (2006).

    Works on directions, so it sees past 180°, up to `fold_rad` from the axis.
    """

    depth_along: ClassVar[DepthAlong] = "axis"
    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    k1: float
    k2: float
    k3: float
    k4: float

    @property
    def K(self) -> Array:
        """The (3, 3) matrix of the pinhole that the lens is like about its axis."""
        return camera_matrix(self.fx_px, self.fy_px, self.cx_px, self.cy_px)

    @property
    def fold_rad(self) -> float:
        """Angle from the axis up to which the lens is one-to-one; at most 180°."""
        return min(np.pi, _first_root((1, 0, 3 * self.k1, 0, 5 * self.k2, 0, 7 * self.k3, 0, 9 * self.k4)))

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN beyond the fold, straight behind and at the centre."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        aside = np.hypot(x, y)
        theta = np.arctan2(aside, z)
        seen = (theta < self.fold_rad) & ((aside > 0) | (z > 0))
        scale = np.where(seen, self._bent(theta), np.nan) / np.where(aside > 0, aside, 1.0)
        return to_pixels(self, x * scale, y * scale)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = from_pixels(self, uv_px)
        far = np.hypot(x, y)
        theta = rising_root(self._bent, self._slope, far.ravel(), self.fold_rad).reshape(far.shape)
        aside = np.sin(theta) / np.where(far > 0, far, 1.0)
        return np.stack([x * aside, y * aside, np.cos(theta)], -1)

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""
        return pixel_centres(self.width_px, self.height_px)

    def _bent(self, theta: Array) -> Array:
        t = theta * theta
        return theta * (1 + t * (self.k1 + t * (self.k2 + t * (self.k3 + t * self.k4))))

    def _slope(self, theta: Array) -> Array:
        t = theta * theta
        return 1 + t * (3 * self.k1 + t * (5 * self.k2 + t * (7 * self.k3 + t * 9 * self.k4)))


@cache
def _fold_radius(k1: float, k2: float, k3: float, p: float) -> float:
    """Where the smallest eigenvalue of the Jacobian may first reach zero.

    Along the radius the radial part has d(r R)/dr, across it R. At radius r the tangential part has
    eigenvalues within 6 p r. While both stay above that the symmetric Jacobian is positive on a disc,
    which is convex, so the lens is one-to-one there.
    """
    along = _first_root((1, -6 * p, 3 * k1, 0, 5 * k2, 0, 7 * k3))
    across = _first_root((1, -6 * p, k1, 0, k2, 0, k3))
    return min(along, across)


@cache
def _first_root(coefficients: tuple[float, ...]) -> float:
    """The smallest positive root of a polynomial, lowest power first; infinite without one."""
    roots = np.roots(np.trim_zeros(np.array(coefficients[::-1], float), "f"))
    positive = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(positive.min(initial=np.inf))


def _reach(g: Callable[[Array], Array], farthest: float, limit: float) -> float:
    """The limit, or a smaller radius that g sends beyond the farthest."""
    radius = 1.0
    while radius < limit and g(np.array(radius)) < farthest:
        radius *= 2
    return min(radius, limit)
