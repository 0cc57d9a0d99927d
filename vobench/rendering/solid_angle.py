"""Rectangles as seen from points: their projected solid angle, and places that sample their solid angle uniformly."""

import math
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats
from vobench.rendering.compiled import compiled

FILLED = 1e-4  # the relative tolerance with which triangles fill a rectangle
FLAT = 1e-6  # the largest difference of a normal from that of its flat face
LEVEL_M = 1e-6  # a point that is nearer than this to the plane of a rectangle sees none of it


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle: a corner, two perpendicular edges, and the unit normal (3,), in the direction of edge_u × edge_v."""

    corner_m: Array
    edge_u_m: Array
    edge_v_m: Array
    normal: Array


def rectangle(corners_m: Array) -> Rectangle | None:
    """The rectangle that triangles (K, 3, 3) fill together; None if they do not fill one."""
    first, second, third = corners_m[0]
    normal = unit(np.cross(second - first, third - first))
    edges = np.roll(corners_m[0], -1, axis=0) - corners_m[0]
    corner_cosines = np.abs([edges[corner] @ edges[corner - 1] for corner in range(3)])
    right_angled = corner_cosines.argmin()
    u_axis = unit(edges[right_angled])
    v_axis = np.cross(normal, u_axis)

    # The triangles fill their bounding box in this frame if they are flat and have its area.
    local_m = (corners_m - first) @ np.stack([u_axis, v_axis, normal]).T
    low_m = local_m.min((0, 1))
    size_m = np.ptp(local_m, axis=(0, 1))
    first_edge_m = local_m[:, 1] - local_m[:, 0]
    second_edge_m = local_m[:, 2] - local_m[:, 0]
    doubled_areas = np.cross(first_edge_m, second_edge_m)[:, 2]
    area_m2 = doubled_areas.sum() / 2
    box_area_m2 = size_m[0] * size_m[1]
    tolerance_m2 = FILLED * size_m[0] * size_m[1]
    is_thick = size_m[2] > FILLED * size_m.max()
    if is_thick or abs(area_m2 - box_area_m2) > tolerance_m2:
        return None
    corner_m = first + low_m[0] * u_axis + low_m[1] * v_axis
    return Rectangle(corner_m, size_m[0] * u_axis, size_m[1] * v_axis, normal)


# The columns of `SeenRectangle.table`, in a frame with its origin at the point and axes along the edges: the limits of
# the rectangle along x and y, the distance of its plane, and 1 or -1 if its normal points away from or to the point.
X0 = 0
Y0 = 1
X1 = 2
Y1 = 3
DEPTH = 4
AHEAD = 5
# The columns of the table of `SolidAngle`. K, B0 and B1 are named as in its source.
STERADIAN = 0
K = 1
B0 = 2
B1 = 3


class SeenRectangle:
    """A rectangle as seen from points (P, 3).

    `is_before` (P,) is whether the rectangle faces the point.
    `is_seen` (P,) is whether the point is not in the plane of the rectangle.
    `axes` (3, 3) are the unit vectors along its edges and its normal.
    `table` (P, 6) has the columns X0, Y0, X1, Y1, DEPTH and AHEAD.
    """

    def __init__(self, face: Rectangle, points_m: Floats) -> None:
        width_m = float(np.linalg.norm(face.edge_u_m))
        length_m = float(np.linalg.norm(face.edge_v_m))
        self.axes = np.stack([face.edge_u_m / width_m, face.edge_v_m / length_m, face.normal])
        self.table = np.empty((len(points_m), 6))
        height_m = np.empty(len(points_m))
        _see(points_m, face.corner_m, self.axes, (width_m, length_m), self.table, height_m)
        self.is_before = height_m < -LEVEL_M
        self.is_seen = np.abs(height_m) > LEVEL_M

    def projected_sr(self, normals: Floats, planes: Floats) -> Floats:
        """The solid angle (P,) of the rectangle, weighted by the cosine to the normals (P, 3) of points.

        Only the part above the planes counts that are perpendicular to the normals (P, 3) of the flat faces, `planes`.
        NaN if the rectangle is partly below one of the planes that are perpendicular to `normals` and `planes`, and
        these differ.
        """
        result = np.empty(len(self.table))
        _project(self.table, self.axes, normals, planes, result)
        return result


@compiled
def _see(
    points_m: Floats,
    corner_m: Floats,
    axes: Floats,
    size_m: tuple[float, float],
    table: Floats,
    height_m: Floats,
) -> None:
    for point in range(len(points_m)):
        x = corner_m[0] - np.float64(points_m[point, 0])
        y = corner_m[1] - np.float64(points_m[point, 1])
        z = corner_m[2] - np.float64(points_m[point, 2])
        height = x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2]
        height_m[point] = height
        table[point, X0] = x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2]
        table[point, Y0] = x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2]
        table[point, X1] = table[point, X0] + size_m[0]
        table[point, Y1] = table[point, Y0] + size_m[1]
        table[point, DEPTH] = max(abs(height), LEVEL_M)
        table[point, AHEAD] = 1.0 if height > 0 else -1.0


@compiled
def _local(axes: Floats, ahead: float, vector: Floats) -> tuple[float, float, float]:
    """The components of a vector along the two edges, and in the direction from the point to the rectangle."""
    x = np.float64(vector[0])
    y = np.float64(vector[1])
    z = np.float64(vector[2])
    along_u = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
    along_v = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
    forward = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    return along_u, along_v, forward * ahead


@compiled
def _lowest(seen: Floats, normal: tuple[float, float, float]) -> float:
    """The height of the lowest corner above the plane through the point with a normal."""
    along_x = min(normal[0] * seen[X0], normal[0] * seen[X1])
    along_y = min(normal[1] * seen[Y0], normal[1] * seen[Y1])
    lowest: float = along_x + along_y + normal[2] * seen[DEPTH]
    return lowest


@compiled
def _project(table: Floats, axes: Floats, normals: Floats, planes: Floats, result: Floats) -> None:
    for point in range(len(table)):
        seen = table[point]
        normal = _local(axes, seen[AHEAD], normals[point])
        plane = _local(axes, seen[AHEAD], planes[point])
        if _lowest(seen, normal) > 0 and _lowest(seen, plane) > 0:
            result[point] = _whole_sr(seen, normal)
            continue
        turn = max(abs(normal[0] - plane[0]), abs(normal[1] - plane[1]), abs(normal[2] - plane[2]))
        result[point] = _cut_sr(seen, plane) if turn < FLAT else np.nan


@compiled
def _whole_sr(seen: Floats, normal: tuple[float, float, float]) -> float:
    """The cosine-weighted solid angle of a rectangle that is completely above the horizon.

    It is half the dot product of the normal and a sum over the edges. The term of an edge is the angle that the edge
    subtends, times the unit normal of the plane through the edge and the point. Source: Lambert, Photometria, 1760.
    """
    depth = seen[DEPTH]
    near_y_m = math.hypot(depth, seen[Y0])
    far_y_m = math.hypot(depth, seen[Y1])
    near_x_m = math.hypot(depth, seen[X0])
    far_x_m = math.hypot(depth, seen[X1])
    near_y = (math.atan(seen[X1] / near_y_m) - math.atan(seen[X0] / near_y_m)) / near_y_m
    far_y = (math.atan(seen[X1] / far_y_m) - math.atan(seen[X0] / far_y_m)) / far_y_m
    near_x = (math.atan(seen[Y1] / near_x_m) - math.atan(seen[Y0] / near_x_m)) / near_x_m
    far_x = (math.atan(seen[Y1] / far_x_m) - math.atan(seen[Y0] / far_x_m)) / far_x_m
    along_x = depth * (near_x - far_x)
    along_y = depth * (near_y - far_y)
    across = seen[X1] * far_x - seen[X0] * near_x + seen[Y1] * far_y - seen[Y0] * near_y
    doubled_sr: float = along_x * normal[0] + along_y * normal[1] + across * normal[2]
    return doubled_sr / 2


@compiled
def _cut_sr(seen: Floats, normal: tuple[float, float, float]) -> float:
    """The cosine-weighted solid angle of the part of a rectangle above the plane through the point with a normal.

    Each edge is clipped at the plane. The part is closed by the edge from the place where the outline leaves the upper
    half-space to the place where it enters it again.
    """
    depth = seen[DEPTH]
    corners = (
        (seen[X0], seen[Y0], depth),
        (seen[X1], seen[Y0], depth),
        (seen[X1], seen[Y1], depth),
        (seen[X0], seen[Y1], depth),
    )
    total = 0.0
    leaves_at = (1.0, 1.0, 1.0)
    enters_at = (1.0, 1.0, 1.0)
    highest = -np.inf
    lowest = np.inf
    for nth in range(4):
        start = corners[nth - 1]
        end = corners[nth]
        start_height = _dot(start, normal)
        end_height = _dot(end, normal)
        highest = max(highest, end_height)
        lowest = min(lowest, end_height)
        if start_height <= 0 and end_height <= 0:
            continue
        above_start = start
        above_end = end
        if start_height <= 0 or end_height <= 0:
            share = min(max(-start_height / (end_height - start_height), 0.0), 1.0)
            crossing = (
                start[0] + share * (end[0] - start[0]),
                start[1] + share * (end[1] - start[1]),
                start[2] + share * (end[2] - start[2]),
            )
            if start_height > 0:
                leaves_at = crossing
                above_end = crossing
            else:
                enters_at = crossing
                above_start = crossing
        total += _edge_term(above_start, above_end, normal)
    if highest <= 0:
        return 0.0
    if lowest <= 0:
        total += _edge_term(leaves_at, enters_at, normal)
    return abs(total) / 2


@compiled
def _dot(first: tuple[float, float, float], second: tuple[float, float, float]) -> float:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


@compiled
def _edge_term(
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    normal: tuple[float, float, float],
) -> float:
    """The angle between two vectors, times the cosine between a normal and the normal of the plane through both."""
    across = (
        start[1] * end[2] - start[2] * end[1],
        start[2] * end[0] - start[0] * end[2],
        start[0] * end[1] - start[1] * end[0],
    )
    length = math.sqrt(_dot(across, across))
    angle = math.atan2(length, _dot(start, end))
    return angle * _dot(across, normal) / max(length, 1e-30)


class SolidAngle:
    """Uniform sampling of the solid angle `steradian` (P,) of a rectangle as seen from points.

    Source, also of the names: Ureña, Fajardo, King (2013), An area-preserving parametrization for spherical rectangles.
    """

    def __init__(self, seen: SeenRectangle) -> None:
        self._seen = seen
        self._table = np.empty((len(seen.table), 4))
        _span(seen.table, self._table)
        self.steradian = np.where(seen.is_seen, self._table[:, STERADIAN], 0)

    def vectors_m(self, a: Floats, b: Floats) -> Floats:
        """The vectors (P, 3) float32 to places on the rectangle, given two random numbers (P,) in [0, 1)."""
        result = np.empty((len(self._table), 3), np.float32)
        _aim(self._seen.table, self._seen.axes, self._table, a, b, result)
        return result


@compiled
def _span(table: Floats, angles: Floats) -> None:
    for point in range(len(table)):
        seen = table[point]
        z0 = -seen[DEPTH]
        n0 = -seen[Y0] / math.hypot(z0, seen[Y0])
        n1 = seen[X1] / math.hypot(z0, seen[X1])
        n2 = seen[Y1] / math.hypot(z0, seen[Y1])
        n3 = -seen[X0] / math.hypot(z0, seen[X0])
        k = 2 * math.pi - _angle(n2, n3) - _angle(n3, n0)
        angles[point, STERADIAN] = max(_angle(n0, n1) + _angle(n1, n2) - k, 0.0)
        angles[point, K] = k
        angles[point, B0] = n0
        angles[point, B1] = n2


@compiled
def _angle(a: float, b: float) -> float:
    """The inner angle of a spherical rectangle between two sides, given the z of their normals."""
    return math.acos(min(max(-a * b, -1.0), 1.0))


@compiled
def _aim(table: Floats, axes: Floats, angles: Floats, a: Floats, b: Floats, vectors_m: Floats) -> None:
    for point in range(len(table)):
        seen = table[point]
        z0 = -seen[DEPTH]
        b0 = angles[point, B0]
        au = a[point] * angles[point, STERADIAN] + angles[point, K]
        sine = math.sin(au)
        fu = (math.cos(au) * b0 - angles[point, B1]) / (sine if sine != 0 else 1e-12)
        cu = math.copysign(1.0, fu) / math.sqrt(fu * fu + b0 * b0)
        cu = min(max(cu, -1.0), 1.0)
        xu = -cu * z0 / math.sqrt(max(1 - cu * cu, 1e-30))
        xu = min(max(xu, seen[X0]), seen[X1])
        d = math.hypot(xu, z0)
        h0 = seen[Y0] / math.hypot(d, seen[Y0])
        h1 = seen[Y1] / math.hypot(d, seen[Y1])
        hv = h0 + b[point] * (h1 - h0)
        yv = hv * d / math.sqrt(max(1 - hv * hv, 1e-30))
        yv = min(max(yv, seen[Y0]), seen[Y1])
        forward = seen[DEPTH] * seen[AHEAD]
        vectors_m[point, 0] = xu * axes[0, 0] + yv * axes[1, 0] + forward * axes[2, 0]
        vectors_m[point, 1] = xu * axes[0, 1] + yv * axes[1, 1] + forward * axes[2, 1]
        vectors_m[point, 2] = xu * axes[0, 2] + yv * axes[1, 2] + forward * axes[2, 2]
