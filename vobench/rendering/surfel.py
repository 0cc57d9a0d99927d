"""Surfels: groups of neighbouring points that receive and send indirect light together."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.sobol_pattern import SobolPattern
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import chunked
from vobench.rendering.unwrap import nearest_axis
from vobench.rendering.visibility import Visibility

RAISED = 0.25  # height above the surface at which the visibility between points is tested, in sides of a cell
PATTERN_SIDE = 64  # cells after which the sample pattern of surfels repeats


@dataclass(frozen=True, slots=True)
class Surfels:
    """Groups of points of one thing in one cell, whose normals are nearest to one axis and that see each other.

    of (P,): the surfel of each point. middle (S,): the point in the middle of each surfel, which stands for it.
    step_m (S,): the side of its cell.
    """

    of: Indices
    middle: Rows
    step_m: Floats

    def __len__(self) -> int:
        return len(self.middle)

    def mean(self, values: Floats, weights: Floats) -> Floats:
        """The means (S, C) of the values (P, C) of points, with weights (P,)."""
        weight_sums = np.maximum(np.bincount(self.of, weights, len(self)), 1e-30)
        sums = [np.bincount(self.of, weights * column, len(self)) for column in values.T]
        means = np.stack(sums, -1) / weight_sums[:, None]
        return means.astype(np.float32)


def surfels(
    points: Texels,
    thing: Indices,
    step_m: Floats,
    visibility: Visibility,
) -> Surfels:
    """The surfels of points, given the thing (P,) of each and the side (P,) of its cell."""
    cell = np.floor(points.points_m / step_m[:, None]).astype(np.int64)
    cell -= cell.min(0, initial=0)
    key = thing.astype(np.int64) * 6 + nearest_axis(points.planes)
    for coordinate in cell.T:
        key = key * (coordinate.max(initial=0) + 1) + coordinate
    raised_m = points.points_m + RAISED * step_m[:, None] * points.planes

    # Points close behind something, as those of a cabinet behind its drawers, are no surfel with the points before it.
    def covered(part: slice) -> Mask:
        return visibility.opaque.occluded(points.points_m[part], raised_m[part])

    is_covered = chunked(covered, len(points))
    group, middle = _grouped(2 * key + is_covered, points.points_m)

    # Points on both sides of a thin wall are not one surfel.
    def hidden(part: slice) -> Mask:
        return visibility.opaque.occluded(raised_m[part], raised_m[middle[group[part]]])

    is_hidden_from_middle = chunked(hidden, len(points))
    group, middle = _grouped(2 * group + is_hidden_from_middle, points.points_m)
    return Surfels(group.astype(np.int32), middle, step_m[middle].astype(np.float32))


def stratified_middles(middles: Texels, step_m: Floats) -> Texels:
    """The middles (S,) of surfels with sample offsets by which the rays of neighbours are stratified together.

    Light from far surfels is averaged over neighbours, so their rays count as if they were those of one point.
    """
    cell = np.floor(middles.points_m / step_m[:, None]).astype(np.int64)
    axis = nearest_axis(middles.planes) // 2
    # The two coordinates of the cell across the axis.
    row = np.where(axis == 0, cell[:, 1], cell[:, 0]) % PATTERN_SIDE
    column = np.where(axis == 2, cell[:, 1], cell[:, 2]) % PATTERN_SIDE
    pattern = SobolPattern(PATTERN_SIDE, 1, middles.dither[:1])
    return replace(middles, dither=pattern.offsets(row * PATTERN_SIDE + column, middles.dither))


def _grouped(key: Rows, points_m: Floats) -> tuple[Rows, Rows]:
    """The group (P,) of each point, equal for equal keys (P,), and for each group the point nearest to its mean."""
    group = np.unique(key, return_inverse=True)[1].ravel()
    count = np.bincount(group)
    coordinate_sums_m = [np.bincount(group, coordinate) for coordinate in points_m.T]
    sums_m = np.stack(coordinate_sums_m, -1)
    mean_m = sums_m / np.maximum(count, 1)[:, None]
    squared_m2 = ((points_m - mean_m[group]) ** 2).sum(1)
    nearest_first = np.lexsort((squared_m2, group))
    first = np.cumsum(count) - count
    return group, nearest_first[first]
