"""Triangulation of polygons with holes by ear clipping."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array


def oriented(ring_m: ArrayLike, *, counter_clockwise: bool) -> Array:
    """A closed polygon (N, 2) with the given orientation. Its corners are reversed if necessary."""
    ring = np.asarray(ring_m, float)
    is_counter_clockwise = _signed_area(ring) > 0
    return ring if is_counter_clockwise == counter_clockwise else ring[::-1]


def triangulated(rings: Sequence[Array]) -> Array:
    """Triangles (F, 3, 2) of a polygon with holes, by ear clipping.

    `rings` are the counter-clockwise outline, followed by the clockwise holes.
    """
    outline = _bridged(rings)
    remaining = list(range(len(outline)))  # corners of the outline that are not yet cut off
    ears = []
    while len(remaining) > 3:
        tip = _first_ear(outline, remaining)
        ears.append(_neighbours(remaining, tip))
        del remaining[tip]

    # Ears along a bridge can have no area, and are omitted.
    triangles = outline[np.array([*ears, remaining])]
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    has_area = _cross(b - a, c - a) > 0
    return np.asarray(triangles[has_area])


def _first_ear(outline: Array, remaining: list[int]) -> int:
    """The index in `remaining` of the first corner that is an ear; 0 if there is none because of rounding errors."""
    for k in range(len(remaining)):
        if _is_ear(outline, remaining, k):
            return k
    return 0


def _bridged(rings: Sequence[Array]) -> Array:
    """An outline (N, 2) that includes the holes. A bridge, which is passed in both directions, connects each hole.

    The rightmost holes come first. A bridge ends at the nearest corner that is visible from its hole.
    """
    outline = rings[0]
    holes = sorted(rings[1:], key=lambda ring: -float(ring[:, 0].max()))

    for hole in holes:
        start = int(hole[:, 0].argmax())
        distance_m = np.linalg.norm(outline - hole[start], axis=1)
        nearest_first = np.argsort(distance_m, kind="stable")
        edges = np.concatenate([_edges(ring) for ring in (outline, *rings[1:])])
        visible = (int(k) for k in nearest_first if not _crosses(outline[k], hole[start], edges))
        bridge_end = next(visible)

        before = outline[: bridge_end + 1]
        around_hole = np.roll(hole, -start, axis=0)
        after = outline[bridge_end:]
        outline = np.concatenate([before, around_hole, hole[[start]], after])
    return outline


def _edges(ring: Array) -> Array:
    """The edges (N, 2, 2) of a closed polygon, each from a corner to the next."""
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


def _signed_area(ring: Array) -> float:
    """The area of a polygon by the shoelace formula, negative if it is clockwise."""
    following = np.roll(ring, -1, axis=0)
    return float(np.sum(_cross(ring, following))) / 2


def _cross(a: Array, b: Array) -> Array:
    """The z component (...) of the cross product of vectors (..., 2)."""
    xy = a[..., 0] * b[..., 1]
    yx = a[..., 1] * b[..., 0]
    return np.asarray(xy - yx)


def _crosses(a: Array, b: Array, edges: Array) -> bool:
    """Whether the segment from a to b properly crosses any of the edges (E, 2, 2)."""
    p = edges[:, 0]
    q = edges[:, 1]
    segment = b - a
    edge = q - p
    edge_is_cut = _cross(segment, p - a) * _cross(segment, q - a) < 0
    segment_is_cut = _cross(edge, a - p) * _cross(edge, b - p) < 0
    return bool(np.any(edge_is_cut & segment_is_cut))


def _neighbours(corners: list[int], k: int) -> list[int]:
    """The kth corner between the one before it and the one after it."""
    following = (k + 1) % len(corners)
    return [corners[k - 1], corners[k], corners[following]]


def _is_ear(outline: Array, corners: list[int], k: int) -> bool:
    """Whether the triangle at the kth corner is convex and contains no other corner."""
    triangle = outline[_neighbours(corners, k)]
    before, tip, after = triangle
    is_convex = _cross(tip - before, after - before) > 0
    if not is_convex:
        return False

    # A bridge passes through its ends twice, so that other corners may coincide with those of the triangle.
    points = outline[corners]
    differs = (points[:, None] != triangle).any(axis=2)
    others = points[differs.all(axis=1)]

    is_inside = _is_left(others, before, tip) & _is_left(others, tip, after) & _is_left(others, after, before)
    return not is_inside.any()


def _is_left(points: Array, start: Array, end: Array) -> NDArray[np.bool_]:
    """Whether each point (N, 2) is to the left of a directed line, or on it."""
    return _cross(end - start, points - start) >= 0
