"""The layout of points on the light map: their neighbours, the texels that show their light, grids and smoothing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas
from vobench.rendering.shadow_kernels import blur_along, dilate
from vobench.rendering.texel_owner import Owners
from vobench.rendering.thread_pool import chunked
from vobench.rendering.visibility import Visibility

STRAIGHT = np.cos(np.deg2rad(1.5))  # the smallest cosine between the normals of neighbours that are in one plane
# Light is neither smoothed nor interpolated between neighbours with a smaller cosine between their normals.
CREASE = np.cos(np.deg2rad(30))
BLURS = 2  # the number of passes of the blur
WIDEST_M = 0.22  # the largest distance between the points of a grid, because light changes over such distances
STRIDES = (4, 2)  # the grids at which light is computed first have every fourth and every second texel


@dataclass(frozen=True, slots=True)
class TexelLayout:
    """The layout of P points on a light map (height, width).

    `source` (H·W,) is the point whose value each texel shows, P for none. Texels beside a face have a source, because
    interpolation reads them. Texels inside things show the nearest point of their chart, so that no darkness leaks out.
    `neighbours` (4, P) are the points to the left, to the right, above and below in the same chart. A point that has no
    neighbour on a side is its own neighbour. There are no neighbours across a crease, such as the edge of a board.
    `grids` (N, P) is whether a point is on the grid of each of STRIDES. The points at the ends of the rows and columns
    of a chart are on all grids.
    """

    height: int
    width: int
    source: Indices
    neighbours: Indices
    grids: Mask

    def on_grid(self, rows: Rows, stride: int) -> Rows:
        """The points among the rows (N,) that are on the grid of a stride, which is 1 or one of STRIDES."""
        if stride == 1:
            return rows
        is_on_grid: Mask = self.grids[STRIDES.index(stride)]
        return np.asarray(rows[is_on_grid[rows]])

    def filled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The map (H, W, ...) that shows the values (P, ...) of points; 0 in texels without a source."""
        no_value = np.zeros((1, *values.shape[1:]), values.dtype)  # of the source P
        padded = np.concatenate([values, no_value])
        return padded[self.source].reshape(self.height, self.width, *values.shape[1:])

    def dilated(self, marked: Mask, *, steps: int) -> Mask:
        """Whether a point (P,) is within this number of steps between neighbours from a marked point (P,)."""
        for _ in range(steps):
            result = np.empty_like(marked)
            dilate(marked, self.neighbours, result)
            marked = result
        return marked

    def blurred(self, values: Floats) -> Floats:
        """The values (P,) smoothed by about one texel, within each chart."""
        return _blurred(values.astype(np.float32), self.neighbours)

    def blurred_among(self, values: Floats, rows: Rows, counts: Mask) -> Floats:
        """The values (N,) of the points at rows (N,), smoothed as by `blurred`.

        Only the points for which `counts` (N,) is true contribute.
        """
        place = np.full(len(values), -1, np.int32)
        place[rows] = np.arange(len(rows))
        beside = place[self.neighbours[:, rows]]
        beside = np.where(beside < 0, np.arange(len(rows), dtype=np.int32), beside)
        weight = counts.astype(np.float32)
        weighted = values[rows].astype(np.float32) * weight
        return _blurred(weighted, beside) / np.maximum(_blurred(weight, beside), np.float32(1e-6))


def _blurred(values: Floats, beside: Indices) -> Floats:
    """The values (P,) float32 smoothed by about one texel, given the neighbours (4, P) of points."""
    left, right, above, below = beside
    for _ in range(BLURS):
        along_row = np.empty_like(values)
        blur_along(values, left, right, along_row)
        values = np.empty_like(values)
        blur_along(along_row, above, below, values)
    return values


def neighbours(index: Rows, atlas: Atlas, owner: Owners) -> Indices:
    """The neighbours (4, P) of the points at flat indices (P,): left, right, above and below in the same chart.

    A point without a neighbour on a side is its own neighbour.
    """
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
    """The layout of the P valid points among A points, and whether each neighbour (4, P) is in the plane of its point.

    `index` (A,), `beside` (4, A) and `is_valid` (A,) are the flat indices, the neighbours and the validity of all
    points. `points_m`, `normals` and `planes` (P, 3) are those of the valid points.
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
    """The point (H·W,) whose value each texel shows, given the flat indices (P,) of points; P for none."""
    point = np.full(atlas.height * atlas.width, len(index))
    point[index] = np.arange(len(index))
    # A texel beside a face shows the point of the texel that contains the nearest place of the face.
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
    """Whether points (P, 3) are in one plane with their neighbours (4, P), and nothing is between them."""
    is_other = beside != np.arange(len(points_m))
    cosine = np.einsum("nij,ij->ni", planes[beside], planes)
    in_plane: Mask = is_other & (cosine > STRAIGHT)
    if visibility is None:
        return in_plane
    # If a neighbour is behind a thin wall, the light of a texel is that of its middle only.
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
    """Whether points (P, 3) are on the grid of each of STRIDES (N, P): every stride-th along rows and columns.

    The last point of a row or a column is on the grid, too. Where the points of a grid would be more than WIDEST_M
    apart, the next finer grid is used instead.
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
    """The valid point (P,) that is nearest to each point, by steps between neighbours (4, P).

    A valid point is nearest to itself. A point without a valid one in its chart is returned itself.
    """
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
