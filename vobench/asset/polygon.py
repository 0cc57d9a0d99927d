"""Triangulation of polygons with holes by ear clipping."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array


def oriented(ring_m: ArrayLike, *, counter_clockwise: bool) -> Array:
    """A closed polygon (N, 2) in the given orientation, reversed where it has the other one."""
    ring = np.asarray(ring_m, float)
    is_counter_clockwise = _signed_area(ring) > 0
    return ring if is_counter_clockwise == counter_clockwise else ring[::-1]


def triangulated(rings: Sequence[Array]) -> Array:
    """Triangles (F, 3, 2) of a counter-clockwise polygon, less holes that are clockwise, by ear clipping."""
    outline = _bridged(rings)
    corners = list(range(len(outline)))
    ears = []

    while len(corners) > 3:
        convex = (k for k in range(len(corners)) if _is_ear(outline, corners, k))
        tip = next(convex, 0)
        ears.append(_neighbours(corners, tip))
        del corners[tip]

    triangles = outline[np.array([*ears, corners])]
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    has_area = _cross(b - a, c - a) > 0
    return np.asarray(triangles[has_area])


def _bridged(rings: Sequence[Array]) -> Array:
    """One outline (N, 2) that visits every hole along a bridge and comes back along it, rightmost holes first."""
    outline = rings[0]
    holes = sorted(rings[1:], key=lambda ring: -float(ring[:, 0].max()))

    for hole in holes:
        start = int(hole[:, 0].argmax())
        distance_m = np.linalg.norm(outline - hole[start], axis=1)
        edges = np.concatenate([_edges(ring) for ring in (outline, *rings[1:])])
        nearest_first = np.argsort(distance_m, kind="stable")
        visible = (int(k) for k in nearest_first if not _crosses(outline[k], hole[start], edges))
        bridge = next(visible)

        round_trip = np.roll(hole, -start, axis=0)
        outline = np.concatenate([outline[: bridge + 1], round_trip, hole[[start]], outline[bridge:]])
    return outline


def _edges(ring: Array) -> Array:
    """The edges (N, 2, 2) of a closed polygon, each from a corner to the next."""
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


def _signed_area(ring: Array) -> float:
    """The area of a polygon, negative where it is clockwise (shoelace formula)."""
    following = np.roll(ring, -1, axis=0)
    return float(np.sum(_cross(ring, following))) / 2


def _cross(a: Array, b: Array) -> Array:
    """The z component (...) of the cross product of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _crosses(a: Array, b: Array, edges: Array) -> bool:
    """Whether the segment from a to b properly crosses one of some edges (E, 2, 2)."""
    p = edges[:, 0]
    q = edges[:, 1]
    separates_edge = _cross(b - a, p - a) * _cross(b - a, q - a) < 0
    separates_segment = _cross(q - p, a - p) * _cross(q - p, b - p) < 0
    return bool(np.any(separates_edge & separates_segment))


def _neighbours(corners: list[int], k: int) -> list[int]:
    """The corner before the kth one, that one and the one after it."""
    return [corners[k - 1], corners[k], corners[(k + 1) % len(corners)]]


def _is_ear(outline: Array, corners: list[int], k: int) -> bool:
    """Whether the triangle at the kth corner is convex and has no other corner in it."""
    triangle = outline[_neighbours(corners, k)]
    if _cross(triangle[1] - triangle[0], triangle[2] - triangle[0]) <= 0:
        return False

    others = outline[corners]
    differs = (others[:, None] != triangle).any(axis=2)
    others = others[differs.all(axis=1)]

    # Corners are inside where they are to the left of all three sides.
    left_of_side = [_cross(triangle[i - 2] - triangle[i], others - triangle[i]) >= 0 for i in range(3)]
    is_inside = np.all(left_of_side, axis=0)
    return not is_inside.any()
