"""Rectangles as seen from points: places spread evenly over their solid angle, and the light that they give."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Mask, Rows

FILLED = 1e-4  # share by which triangles may miss the rectangle that they fill
FLAT = 1e-6  # difference of a normal from that of its plane
LEVEL_M = 1e-6  # a point nearer than this to a rectangle's plane sees none of it


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A corner, two edges at right angles and the normal edge_u × edge_v (3,) of a rectangle."""

    corner_m: Array
    edge_u_m: Array
    edge_v_m: Array
    normal: Array


def rectangle(corners_m: Array) -> Rectangle | None:
    """The rectangle that triangles (K, 3, 3) fill between them, if they do."""
    first, second, third = corners_m[0]
    normal = unit(np.cross(second - first, third - first))
    edges = np.roll(corners_m[0], -1, axis=0) - corners_m[0]
    square = np.abs([edges[i] @ edges[i - 1] for i in range(3)]).argmin()  # the corner with the right angle
    u_axis = unit(edges[square])
    v_axis = np.cross(normal, u_axis)

    local_m = (corners_m - first) @ np.stack([u_axis, v_axis, normal]).T
    low_m = local_m.min((0, 1))
    size_m = np.ptp(local_m, axis=(0, 1))
    first_edge_m = local_m[:, 1] - local_m[:, 0]
    second_edge_m = local_m[:, 2] - local_m[:, 0]
    doubled_areas = np.cross(first_edge_m, second_edge_m)[:, 2]
    area_m2 = doubled_areas.sum() / 2
    box_area_m2 = size_m[0] * size_m[1]
    is_thick = size_m[2] > FILLED * size_m.max()
    tolerance_m2 = FILLED * size_m[0] * size_m[1]
    if is_thick or abs(area_m2 - box_area_m2) > tolerance_m2:
        return None
    corner_m = first + low_m[0] * u_axis + low_m[1] * v_axis
    return Rectangle(corner_m, size_m[0] * u_axis, size_m[1] * v_axis, normal)


class SeenRectangle:
    """A rectangle in the frame of its edges, as seen from points (P, 3); it lies `depth_m` (P,) ahead along z."""

    def __init__(self, face: Rectangle, points_m: Floats) -> None:
        to_corner_m = face.corner_m - points_m.astype(float)
        width_m = np.linalg.norm(face.edge_u_m)
        length_m = np.linalg.norm(face.edge_v_m)
        x_axis = face.edge_u_m / width_m
        y_axis = face.edge_v_m / length_m
        height_m = to_corner_m @ face.normal
        self._axes = np.stack([x_axis, y_axis, face.normal])
        self._ahead = np.where(height_m > 0, 1.0, -1.0)
        self.is_before = height_m < -LEVEL_M
        self.is_seen = np.abs(height_m) > LEVEL_M
        self.depth_m = np.maximum(np.abs(height_m), LEVEL_M)
        self.x0_m = to_corner_m @ x_axis
        self.y0_m = to_corner_m @ y_axis
        self.x1_m = self.x0_m + width_m
        self.y1_m = self.y0_m + length_m

    def vectors_m(self, x_m: Floats, y_m: Floats) -> Floats:
        """Vectors (P, 3) float32 to the places x, y (P,) in its plane."""
        local_m = np.stack([x_m, y_m, self.depth_m * self._ahead], -1)
        return np.asarray((local_m @ self._axes).astype(np.float32))

    def projected_sr(self, normals: Floats, planes: Floats) -> Floats:
        """Its solid angle (P,) weighted by the cosine to normals (P, 3), of the part before the planes (P, 3).

        NaN where it is only in part before both and these differ. Half the sum over the edges of the angle that each
        is seen under, times the normal of the plane through it and the point. Source: Lambert, Photometria, 1760.
        """
        near_y_m = np.hypot(self.depth_m, self.y0_m)
        far_y_m = np.hypot(self.depth_m, self.y1_m)
        near_x_m = np.hypot(self.depth_m, self.x0_m)
        far_x_m = np.hypot(self.depth_m, self.x1_m)
        near_y = _angle_between(self.x0_m, self.x1_m, near_y_m) / near_y_m
        far_y = _angle_between(self.x0_m, self.x1_m, far_y_m) / far_y_m
        near_x = _angle_between(self.y0_m, self.y1_m, near_x_m) / near_x_m
        far_x = _angle_between(self.y0_m, self.y1_m, far_x_m) / far_x_m
        along_x = self.depth_m * (near_x - far_x)
        along_y = self.depth_m * (near_y - far_y)
        across_x = self.x1_m * far_x - self.x0_m * near_x
        across_y = self.y1_m * far_y - self.y0_m * near_y

        local = self._local(normals)
        projected = along_x * local[0] + along_y * local[1] + (across_x + across_y) * local[2]
        local_planes = self._local(planes)
        is_whole = self._is_above(local) & self._is_above(local_planes)
        result = np.where(is_whole, projected / 2, np.nan)
        is_flat = (np.abs(local - local_planes) < FLAT).all(0)
        cut = np.flatnonzero(is_flat & ~is_whole)
        result[cut] = self._cut_sr(local_planes[:, cut], cut)
        return result

    def _cut_sr(self, normals: Floats, rows: Rows) -> Floats:
        """The weighted solid angle (N,) of what is above the planes with normals (3, N) through the points at rows."""
        depth_m = self.depth_m[rows]
        near_x_m = self.x0_m[rows]
        near_y_m = self.y0_m[rows]
        far_x_m = self.x1_m[rows]
        far_y_m = self.y1_m[rows]
        places = ((near_x_m, near_y_m), (far_x_m, near_y_m), (far_x_m, far_y_m), (near_x_m, far_y_m))
        corners = [np.stack([x_m, y_m, depth_m]) for x_m, y_m in places]
        heights = [(normals * corner).sum(0) for corner in corners]

        total = np.zeros(len(rows))
        leaves_at = np.ones((3, len(rows)))
        enters_at = np.ones((3, len(rows)))
        for nth in range(4):
            start = corners[nth - 1]
            end = corners[nth]
            start_height = heights[nth - 1]
            end_height = heights[nth]
            rise = end_height - start_height
            share = np.clip(-start_height / np.where(rise == 0, 1, rise), 0, 1)
            crossing = start + share * (end - start)
            leaves = (start_height > 0) & (end_height <= 0)
            enters = (start_height <= 0) & (end_height > 0)
            leaves_at = np.where(leaves, crossing, leaves_at)
            enters_at = np.where(enters, crossing, enters_at)
            above_start = np.where(enters, crossing, start)
            above_end = np.where(leaves, crossing, end)
            is_above = (start_height > 0) | (end_height > 0)
            total += np.where(is_above, _edge_term(above_start, above_end, normals), 0)
        is_above_in_part = np.max(heights, axis=0) > 0
        is_cut = is_above_in_part & (np.min(heights, axis=0) <= 0)
        total += np.where(is_cut, _edge_term(leaves_at, enters_at, normals), 0)
        return np.where(is_above_in_part, np.abs(total) / 2, 0)

    def _local(self, vectors: Floats) -> Floats:
        """The parts (3, P) of vectors (P, 3) along the edges and ahead."""
        local: Floats = self._axes @ vectors.T.astype(float)
        local[2] *= self._ahead
        return local

    def _is_above(self, normals: Floats) -> Mask:
        """Whether all four corners lie above the planes through the points that have normals (3, P)."""
        lowest_x_m = np.minimum(normals[0] * self.x0_m, normals[0] * self.x1_m)
        lowest_y_m = np.minimum(normals[1] * self.y0_m, normals[1] * self.y1_m)
        return np.asarray(lowest_x_m + lowest_y_m + normals[2] * self.depth_m > 0)


def _angle_between(start_m: Floats, end_m: Floats, distance_m: Floats) -> Floats:
    """The angle (P,) under which a line is seen from its start to its end, at a distance from it."""
    return np.asarray(np.arctan(end_m / distance_m) - np.arctan(start_m / distance_m))


def _edge_term(start: Floats, end: Floats, normals: Floats) -> Floats:
    """The angle (P,) between vectors (3, P), times the cosine of normals (3, P) to that of the plane through both."""
    across = np.cross(start, end, axis=0)
    length = np.sqrt((across**2).sum(0))
    angle = np.arctan2(length, (start * end).sum(0))
    return np.asarray(angle * (across * normals).sum(0) / np.maximum(length, 1e-30))


class SolidAngle:
    """A rectangle as seen from points, and places on it spread evenly over its solid angle.

    Names are those of the source: Ureña, Fajardo, King (2013), An area-preserving parametrization for spherical
    rectangles.
    """

    def __init__(self, seen: SeenRectangle) -> None:
        self._seen = seen
        self._z0 = -seen.depth_m
        n0 = -seen.y0_m / np.hypot(self._z0, seen.y0_m)
        n2 = seen.y1_m / np.hypot(self._z0, seen.y1_m)
        n1 = seen.x1_m / np.hypot(self._z0, seen.x1_m)
        n3 = -seen.x0_m / np.hypot(self._z0, seen.x0_m)
        g0 = _angle(n0, n1)
        g1 = _angle(n1, n2)
        g2 = _angle(n2, n3)
        g3 = _angle(n3, n0)
        self._b0 = n0
        self._b1 = n2
        self._k = 2 * np.pi - g2 - g3
        self.steradian = np.where(seen.is_seen, np.maximum(g0 + g1 - self._k, 0), 0)

    def vectors_m(self, a: Floats, b: Floats) -> Floats:
        """Vectors (P, 3) to places on the rectangle, by two numbers (P,) in [0, 1) each."""
        seen = self._seen
        au = a * self.steradian + self._k
        sine = np.sin(au)
        divisor = np.where(sine == 0, 1e-12, sine)
        fu = (np.cos(au) * self._b0 - self._b1) / divisor
        cu = np.copysign(1.0, fu) / np.sqrt(fu * fu + self._b0 * self._b0)
        cu = np.clip(cu, -1, 1)
        xu = -cu * self._z0 / np.sqrt(np.maximum(1 - cu * cu, 1e-30))
        xu = np.clip(xu, seen.x0_m, seen.x1_m)
        d = np.hypot(xu, self._z0)
        h0 = seen.y0_m / np.hypot(d, seen.y0_m)
        h1 = seen.y1_m / np.hypot(d, seen.y1_m)
        hv = h0 + b * (h1 - h0)
        yv = hv * d / np.sqrt(np.maximum(1 - hv * hv, 1e-30))
        yv = np.clip(yv, seen.y0_m, seen.y1_m)
        return seen.vectors_m(xu, yv)


def _angle(a: Floats, b: Floats) -> Floats:
    """The inner angle of a spherical rectangle between sides whose normals have these z."""
    return np.asarray(np.arccos(np.clip(-a * b, -1, 1)))
