"""Rasterising the light map: which face each texel belongs to, and the nearest place on it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vobench import stop
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas, doubled_areas_px2

CLAIMED_PX = 0.7072  # half a texel's diagonal: every place of a face is nearest to a texel that belongs to it
READ_PX = 1.4143  # from a face, texels that interpolation on it can read
PAIRS = 1 << 14  # of faces and texels at once: their arrays fit the processor's cache


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
    for face, column, row in _nearby(atlas, corners_px):
        stop.check()
        middle_px = np.asarray(np.stack([column, row], -1) + 0.5, float)
        uv, distance_px = _nearest_on(corners_px[face], middle_px)
        texel = row * atlas.width + column
        nearer = np.flatnonzero(distance_px < result.distance_px[texel])
        # A texel that stands here several times takes the last value: that of the nearest face.
        nearer = nearer[np.argsort(-distance_px[nearer], kind="stable")]
        texel = texel[nearer]
        result.face[texel] = face[nearer]
        result.uv[texel] = uv[nearer]
        result.distance_px[texel] = distance_px[nearer]
    return result


def _nearby(atlas: Atlas, corners_px: Array) -> Iterator[tuple[Rows, Rows, Rows]]:
    """All faces with all texels in their boxes, READ_PX larger: face, column and row (N,), some PAIRS at a time."""
    size_px = (atlas.width, atlas.height)
    box_low_px = corners_px.min(1) - READ_PX - 0.5
    low = np.maximum(np.ceil(box_low_px), 0).astype(np.int64)
    box_high_px = corners_px.max(1) + READ_PX - 0.5
    high = np.minimum(np.floor(box_high_px) + 1, size_px).astype(np.int64)
    is_charted = (atlas.chart >= 0) & (doubled_areas_px2(corners_px) != 0)
    size = np.where(is_charted[:, None], high - low, 0)  # (F, 2): columns and rows of each face's box

    ends = np.cumsum(size.prod(1))
    pair_count = int(ends[-1]) if len(ends) else 0
    limits = np.arange(PAIRS, pair_count + PAIRS, PAIRS)
    cuts = np.unique(np.searchsorted(ends, limits) + 1)
    for faces in np.split(np.arange(len(corners_px)), cuts):
        counts = size[faces].prod(1)
        face = np.repeat(faces, counts)
        first = np.repeat(np.cumsum(counts) - counts, counts)
        nth = np.arange(len(face)) - first  # texel in the face's box
        column = low[face, 0] + nth % size[face, 0]
        row = low[face, 1] + nth // size[face, 0]
        yield face, column, row


def _nearest_on(corners: Array, points: Array) -> tuple[Array, Array]:
    """The nearest places of triangles (N, 3, 2) to points (N, 2): weights (N, 2) of corners two and three, distance.

    What is farther than READ_PX from the line of an edge is infinitely far.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    from_corners = points[:, None] - corners
    area = _cross(edges[:, 0], edges[:, 1])  # twice the triangle's, signed
    across = _cross(edges, from_corners)
    inwards = across * np.sign(area)[:, None]
    squared_lengths = np.einsum("nij,nij->ni", edges, edges)
    is_inside = (inwards >= 0).all(1) & (area != 0)
    is_in_reach = inwards**2 <= READ_PX**2 * squared_lengths
    is_near = ((inwards > 0) | is_in_reach).all(1)

    # The first edge lies across from the third corner.
    divisor = np.where(area == 0, 1, area)[:, None]
    weights = np.roll(across, -1, axis=1) / divisor
    distance = np.where(is_inside, 0, np.inf)
    beside = np.flatnonzero(is_near & ~is_inside)
    edge_weights, edge_distance = _nearest_on_edges(edges[beside], from_corners[beside], squared_lengths[beside])
    weights[beside] = edge_weights
    distance[beside] = edge_distance
    return weights[:, 1:], distance


def _cross(a: Array, b: Array) -> Array:
    """Cross products (...) of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _nearest_on_edges(
    edges: Array,
    from_corners: Array,
    squared_lengths: Array,
) -> tuple[Array, Array]:
    """Weights (N, 3) of corners, and distance, of the nearest places on edges (N, 3, 2) to points."""
    along = np.einsum("nij,nij->ni", from_corners, edges) / np.maximum(squared_lengths, 1e-12)
    along = np.clip(along, 0, 1)
    from_edges = from_corners - along[..., None] * edges
    distances = np.linalg.norm(from_edges, axis=-1)
    nearest = distances.argmin(1)
    rows = np.arange(len(edges))
    weights = np.zeros((len(edges), 3))
    weights[rows, nearest] = 1 - along[rows, nearest]
    weights[rows, (nearest + 1) % 3] = along[rows, nearest]
    return weights, distances[rows, nearest]


def claimed(owner: Owners, among: Mask) -> Rows:
    """The flat indices (P,) of the texels that belong to those among the faces (F,)."""
    is_near = owner.distance_px <= CLAIMED_PX
    is_claimed = (owner.face >= 0) & is_near & among[owner.face]
    return np.flatnonzero(is_claimed)
