"""Rasterising the light map: which face each texel belongs to, and the nearest place on it."""

import math
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas, doubled_areas_px2
from vobench.rendering.compiled import compiled

CLAIMED_PX = 0.7072  # half a texel's diagonal: every place of a face is nearest to a texel that belongs to it
READ_PX = 1.4143  # from a face, texels that interpolation on it can read


@dataclass(frozen=True, slots=True)
class Owners:
    """For each texel (H·W,) the nearest face on the map within READ_PX, -1 for none, u and v there, and how far."""

    face: Indices
    uv: Floats
    distance_px: Floats


def owners(atlas: Atlas) -> Owners:
    """Lay the faces that have charts over the texels."""
    count = atlas.height * atlas.width
    result = Owners(
        face=np.full(count, -1, np.int32),
        uv=np.zeros((count, 2), np.float32),
        distance_px=np.full(count, READ_PX, np.float32),
    )
    corners_px = atlas.light_px.astype(float)
    size_px = (atlas.width, atlas.height)
    box_low_px = corners_px.min(1) - READ_PX - 0.5
    low = np.maximum(np.ceil(box_low_px), 0).astype(np.int64)
    box_high_px = corners_px.max(1) + READ_PX - 0.5
    high = np.minimum(np.floor(box_high_px) + 1, size_px).astype(np.int64)
    doubled_px2 = doubled_areas_px2(corners_px)
    charted = np.flatnonzero((atlas.chart >= 0) & (doubled_px2 != 0))
    _claim(charted, corners_px, doubled_px2, low, high, atlas.width, result.face, result.uv, result.distance_px)
    return result


@compiled
def _claim(
    charted: Rows,
    corners_px: Array,
    doubled_px2: Array,
    low: Rows,
    high: Rows,
    width: int,
    owner: Indices,
    uv: Floats,
    distance_px: Floats,
) -> None:
    """Give each texel in the boxes from `low` to `high` (F, 2) of charted faces to the nearest of them."""
    for face in charted:
        corners = corners_px[face]
        area = doubled_px2[face]
        for row in range(low[face, 1], high[face, 1]):
            for column in range(low[face, 0], high[face, 0]):
                distance, u, v = _nearest_on(corners, area, column + 0.5, row + 0.5)
                texel = row * width + column
                if distance < distance_px[texel]:
                    owner[texel] = face
                    uv[texel, 0] = u
                    uv[texel, 1] = v
                    distance_px[texel] = distance


@compiled
def _nearest_on(corners: Array, area: float, x: float, y: float) -> tuple[float, float, float]:
    """The distance of a point from a triangle (3, 2), and the weights of corners two and three at the nearest place.

    `area` is twice the triangle's, signed.
    """
    # The first edge lies across from the third corner.
    third = _across(corners[0], corners[1], x, y) / area
    first = _across(corners[1], corners[2], x, y) / area
    second = _across(corners[2], corners[0], x, y) / area
    if first >= 0 and second >= 0 and third >= 0:
        return 0.0, second, third
    on_first_edge, to_second = _nearest_on_edge(corners[0], corners[1], x, y)
    on_second_edge, to_third = _nearest_on_edge(corners[1], corners[2], x, y)
    on_third_edge, to_first = _nearest_on_edge(corners[2], corners[0], x, y)
    if on_first_edge <= on_second_edge and on_first_edge <= on_third_edge:
        return on_first_edge, to_second, 0.0
    if on_second_edge <= on_third_edge:
        return on_second_edge, 1 - to_third, to_third
    return on_third_edge, 0.0, 1 - to_first


@compiled
def _across(start: Array, end: Array, x: float, y: float) -> float:
    """Twice the signed area of a triangle between an edge and a point."""
    across: float = (end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0])
    return across


@compiled
def _nearest_on_edge(start: Array, end: Array, x: float, y: float) -> tuple[float, float]:
    """The distance of the nearest place on an edge to a point, and the share of the edge before it."""
    edge_x = end[0] - start[0]
    edge_y = end[1] - start[1]
    squared = max(edge_x * edge_x + edge_y * edge_y, 1e-12)
    along = ((x - start[0]) * edge_x + (y - start[1]) * edge_y) / squared
    along = min(max(along, 0.0), 1.0)
    distance = math.hypot(x - start[0] - along * edge_x, y - start[1] - along * edge_y)
    return distance, along


def claimed(owner: Owners, among: Mask) -> Rows:
    """The flat indices (P,) of the texels that belong to those among the faces (F,)."""
    is_near = owner.distance_px <= CLAIMED_PX
    is_claimed = (owner.face >= 0) & is_near & among[owner.face]
    return np.flatnonzero(is_claimed)
