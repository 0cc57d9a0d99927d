"""The layout of texels on the light map: their neighbours, what fills the rest of the map, interpolation, smoothing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas
from vobench.rendering.shadow_kernels import blur_along, dilate
from vobench.rendering.texel_owner import Owners
from vobench.rendering.thread_pool import chunked
from vobench.rendering.visibility import Visibility

STRAIGHT = np.cos(np.deg2rad(1.5))  # between texels that lie in one plane
CREASE = np.cos(
    np.deg2rad(30)
)  # between the normals of texels, across which light is neither smoothed nor interpolated
BLURS = 2
WIDEST_M = 0.22  # between points of a grid; light changes over such distances
STRIDES = (4, 2)  # of the grids of texels at which light is computed first


@dataclass(frozen=True, slots=True)
class TexelLayout:
    """How P points lie on a map of a height and width.

    source (H·W,) is the point that each texel takes its value from, P for none: texels beside a face are read by
    interpolation, and those inside things have the light of the nearest of their chart, so that no darkness reaches
    out. neighbours (4, P) are the points left, right, above and below in the same chart, the point itself for none.
    Texels on both sides of a crease, as on top and side of a board, count as being in two charts.
    grids (N, P): which points are on the grid of each of STRIDES; the last points of rows and columns of a chart are.
    """

    height: int
    width: int
    source: Indices
    neighbours: Indices
    grids: Mask

    def on_grid(self, rows: Rows, stride: int) -> Rows:
        """Those of the points at rows (N,) that are on the grid of a stride, which is 1 or one of STRIDES."""
        return rows if stride == 1 else rows[self.grids[STRIDES.index(stride), rows]]

    def filled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (P, ...) as a map (H, W, ...)."""
        no_value = np.zeros((1, *values.shape[1:]), values.dtype)  # of the point P
        padded = np.concatenate([values, no_value])
        return padded[self.source].reshape(self.height, self.width, *values.shape[1:])

    def dilated(self, marked: Mask, *, steps: int) -> Mask:
        """Points (P,) that so many steps from texel to texel lead to from a marked one."""
        for _ in range(steps):
            result = np.empty_like(marked)
            dilate(marked, self.neighbours, result)
            marked = result
        return marked

    def blurred(self, values: Floats) -> Floats:
        """Values (P,) smoothed by about one texel, each chart by itself."""
        return _blurred(values.astype(np.float32), self.neighbours)

    def blurred_among(self, values: Floats, rows: Rows, counts: Mask) -> Floats:
        """Values (N,) of the points at rows smoothed as by `blurred`, of those of them alone that count (N,)."""
        place = np.full(len(values), -1, np.int32)
        place[rows] = np.arange(len(rows))
        beside = place[self.neighbours[:, rows]]
        beside = np.where(beside < 0, np.arange(len(rows), dtype=np.int32), beside)
        weight = counts.astype(np.float32)
        weighted = values[rows].astype(np.float32) * weight
        return _blurred(weighted, beside) / np.maximum(_blurred(weight, beside), np.float32(1e-6))


def _blurred(values: Floats, beside: Indices) -> Floats:
    """Values (P,) float32 smoothed by about one texel, among neighbours (4, P)."""
    left, right, above, below = beside
    for _ in range(BLURS):
        along_row = np.empty_like(values)
        blur_along(values, left, right, along_row)
        values = np.empty_like(values)
        blur_along(along_row, above, below, values)
    return values


def neighbours(index: Rows, atlas: Atlas, owner: Owners) -> Indices:
    """The points (4, P) left, right, above and below of those at flat indices (P,) in the same chart, else itself."""
    point_at = np.full(atlas.height * atlas.width, -1, np.int32)
    point_at[index] = np.arange(len(index))
    chart = atlas.chart[owner.face[index]]
    column = index % atlas.width
    result = np.empty((4, len(index)), np.int32)
    for side, step in enumerate((-1, 1, -atlas.width, atlas.width)):
        other = point_at[np.clip(index + step, 0, len(point_at) - 1)]
        is_next_in_row = np.abs(column[other] - column) == 1
        is_next_in_column = np.abs(index[other] - index) == atlas.width
        adjoins = is_next_in_row if side < 2 else is_next_in_column
        is_neighbour = (other >= 0) & (chart[other] == chart) & adjoins
        result[side] = np.where(is_neighbour, other, np.arange(len(index)))
    return result


def texel_layout(
    index: Rows,
    beside: Indices,
    is_valid: Mask,
    *,
    points_m: Floats,
    normals: Floats,
    planes: Floats,
    atlas: Atlas,
    owner: Owners,
    visibility: Visibility | None,
) -> tuple[TexelLayout, Mask]:
    """The layout of the valid ones (P,) among points (A,), and which of their neighbours (4, P) lie in one plane.

    index (A,), beside (4, A) and is_valid (A,) are of all points; points_m, normals of the shape and planes (P, 3) of
    the valid ones.
    """
    count = len(points_m)
    new_index = np.where(is_valid, np.cumsum(is_valid) - 1, -1)
    nearest_valid = np.append(new_index[_nearest_valid(beside, is_valid)], -1)
    source = nearest_valid[_read_points(index, atlas, owner)]
    source = np.where(source < 0, count, source).astype(np.int32)

    valid_beside = new_index[beside[:, is_valid]]
    itself = np.arange(count)
    valid_beside = np.where(valid_beside < 0, itself, valid_beside).astype(np.int32)
    for side in valid_beside:
        is_beyond_crease = np.einsum("ij,ij->i", normals[side], normals) < CREASE
        side[is_beyond_crease] = itself[is_beyond_crease]
    in_plane = _in_plane(points_m, planes, valid_beside, visibility)
    grids = _grids(index[is_valid], points_m, valid_beside, atlas.width)
    return TexelLayout(atlas.height, atlas.width, source, valid_beside, grids), in_plane


def _read_points(index: Rows, atlas: Atlas, owner: Owners) -> Rows:
    """The point (H·W,) that each texel takes its value from, of those at flat indices (P,); P for none."""
    point = np.full(atlas.height * atlas.width, len(index))
    point[index] = np.arange(len(index))
    # A texel beside a face reads the one that the nearest place of the face lies in.
    read = np.flatnonzero((owner.face >= 0) & (point == len(index)))
    uv = owner.uv[read]
    corner_weights = np.column_stack([1 - uv.sum(1), uv])
    nearest_px = np.einsum("ni,nij->nj", corner_weights, atlas.light_px[owner.face[read]])
    point[read] = point[atlas.index(nearest_px)]
    return point


def _in_plane(
    points_m: Floats,
    planes: Floats,
    beside: Indices,
    visibility: Visibility | None,
) -> Mask:
    """Whether points (P, 3) lie in one plane with their neighbours (4, P), which no wall hides from them."""
    is_other = beside != np.arange(len(points_m))
    cosine = np.einsum("nij,ij->ni", planes[beside], planes)
    in_plane: Mask = is_other & (cosine > STRAIGHT)
    if visibility is None:
        return in_plane
    # A texel that reaches behind a thin wall has its light from its middle alone.
    opaque = visibility.opaque
    for first, second in ((0, 1), (2, 3)):
        neighbour = beside[second]

        def hidden(part: slice, others: Indices = neighbour) -> Mask:
            return np.asarray(opaque.occluded(points_m[part], points_m[others[part]]))

        is_hidden = chunked(hidden, len(points_m))
        in_plane[second] &= ~is_hidden
        in_plane[first] &= ~is_hidden[beside[first]]
    return in_plane


def _grids(index: Rows, points_m: Floats, beside: Indices, width: int) -> Mask:
    """Which points (P, 3) are on the grid of each of STRIDES (N, P): every so many along rows and columns.

    At rims, where a row or a column ends, its last point is, too. Where points of a grid would be more than WIDEST_M
    apart, the next finer one stands for it.
    """
    at_rim = beside == np.arange(len(index), dtype=np.int32)
    row, column = np.divmod(index, width)
    spacing_m = np.zeros(len(index), np.float32)
    for neighbour in beside:
        np.maximum(spacing_m, np.linalg.norm(points_m[neighbour] - points_m, axis=1), out=spacing_m)
    grids = np.empty((len(STRIDES), len(index)), bool)
    finer = np.ones(len(index), bool)
    for nth, stride in reversed(list(enumerate(STRIDES))):
        in_column = (column % stride == 0) | at_rim[:2].any(0)
        in_row = (row % stride == 0) | at_rim[2:].any(0)
        is_wide = stride * spacing_m > WIDEST_M
        finer = np.where(is_wide, finer, in_column & in_row)
        grids[nth] = finer
    return grids


def _nearest_valid(beside: Indices, is_valid: Mask) -> Rows:
    """For each point (P,) itself if valid, else the nearest valid one by steps within its chart, or itself."""
    nearest = np.arange(len(is_valid))
    candidate = np.full(len(is_valid), -1)
    is_known = is_valid.copy()
    frontier = np.flatnonzero(is_valid)
    while len(frontier):
        around = beside[:, frontier]
        is_new = ~is_known[around]
        reached = around[is_new]
        sources = np.broadcast_to(nearest[frontier], around.shape)[is_new]
        np.maximum.at(candidate, reached, sources)
        frontier = np.unique(reached)
        nearest[frontier] = candidate[frontier]
        is_known[frontier] = True
    return nearest
