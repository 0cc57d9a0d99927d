"""Flat things as seen from points: their solid angle, spots spread evenly over it, and the light they give."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.render.geometry import Floats
from vobench.scene.surface import Surface

FLAT_M = 1e-6  # a point nearer than this to a rectangle's plane sees none of it


class SolidAngle:
    """A rectangle as seen from points, and spots on it spread evenly over its solid angle.

    Source: Ureña, Fajardo, King (2013), An area-preserving parametrization for spherical rectangles.
    """

    def __init__(self, surface: Surface, points_m: Floats) -> None:
        way = surface.corner_m - points_m.astype(float)
        x_axis, y_axis = (edge / np.linalg.norm(edge) for edge in (surface.edge_u_m, surface.edge_v_m))
        height = way @ surface.normal
        # The paper's axes: the rectangle lies at negative z.
        self._axes = np.stack([x_axis, y_axis, surface.normal]), np.where(height > 0, -1.0, 1.0)
        self._z0 = np.minimum(-np.abs(height), -FLAT_M)
        self._x0, self._y0 = way @ x_axis, way @ y_axis
        self._x1, self._y1 = self._x0 + surface.size_m[0], self._y0 + surface.size_m[1]
        n0, n2 = (-self._y0 / np.hypot(self._z0, self._y0), self._y1 / np.hypot(self._z0, self._y1))
        n1, n3 = (self._x1 / np.hypot(self._z0, self._x1), -self._x0 / np.hypot(self._z0, self._x0))
        g0, g1, g2, g3 = (np.arccos(np.clip(-a * b, -1, 1)) for a, b in ((n0, n1), (n1, n2), (n2, n3), (n3, n0)))
        self._b0, self._b1, self._k = n0, n2, 2 * np.pi - g2 - g3
        self.steradian = np.where(np.abs(height) > FLAT_M, np.maximum(g0 + g1 - self._k, 0), 0)

    def spot(self, a: Floats, b: Floats) -> Floats:
        """Ways (P, 3) to spots."""
        au = a * self.steradian + self._k
        sine = np.sin(au)
        fu = (np.cos(au) * self._b0 - self._b1) / np.where(sine == 0, 1e-12, sine)
        cu = np.clip(np.copysign(1.0, fu) / np.sqrt(fu * fu + self._b0 * self._b0), -1, 1)
        xu = np.clip(-cu * self._z0 / np.sqrt(np.maximum(1 - cu * cu, 1e-30)), self._x0, self._x1)
        d = np.hypot(xu, self._z0)
        h0, h1 = self._y0 / np.hypot(d, self._y0), self._y1 / np.hypot(d, self._y1)
        hv = h0 + b * (h1 - h0)
        yv = np.clip(hv * d / np.sqrt(np.maximum(1 - hv * hv, 1e-30)), self._y0, self._y1)
        axes, flip = self._axes
        spots: Floats = (np.stack([xu, yv, self._z0 * flip], -1) @ axes).astype(np.float32)
        return spots


def polygon_illuminance(corners_m: Array, points_m: Floats, normals: Floats) -> Floats:
    """Illuminance (P,) by a polygon of luminance 1 and corners (C, 3), NaN where the horizon cuts it.

    Source: Lambert (1760); Arvo (1995), Analytic methods for simulated light transport, eq. 2.30.
    """
    ways = corners_m[:, None] - points_m.astype(float)
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    total, normals = np.zeros(len(points_m)), normals.astype(float)
    for first, second in zip(ways, np.roll(ways, -1, axis=0), strict=True):
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", first, second), -1, 1))
        edge = np.cross(first, second)
        total += angle * np.einsum("ij,ij->i", edge, normals) / np.maximum(np.linalg.norm(edge, axis=1), 1e-12)
    whole = (np.einsum("kij,ij->ki", ways, normals) > 0).all(0)
    return np.where(whole, np.abs(total) / 2, np.nan).astype(np.float32)
