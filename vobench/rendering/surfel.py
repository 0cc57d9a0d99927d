"""Surfels: groups of neighbouring points that receive and send indirect light together."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.sobol_pattern import SobolPattern
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import chunked
from vobench.rendering.unwrap import nearest_axis
from vobench.rendering.visibility import Visibility

RAISED = 0.25  # the height above the surface at which the visibility between points is tested, in sides of a cell
PATTERN_SIDE = 64  # the number of cells after which the sample pattern of surfels repeats


@dataclass(frozen=True, slots=True)
class Surfels:
    """S groups of P points. The points of a group belong to one thing and lie in one cell of a grid.

    Their normals are nearest to the same axis direction, and nothing is between them and the middle of the group.

    `of` (P,) is the surfel of each point.
    `middle` (S,) is the point in the middle of each surfel, which represents it.
    `step_m` (S,) is the side of the cell of each surfel.
    """

    of: Indices
    middle: Rows
    step_m: Floats

    def __len__(self) -> int:
        return len(self.middle)

    def mean(self, values: Floats, weights: Floats) -> Floats:
        """The means (S, C) over each surfel of the values (P, C) of its points, with weights (P,)."""
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
    """Group points to surfels. `thing` (P,) is the thing of each point, `step_m` (P,) the side of its cell."""
    cell = np.floor(points.points_m / step_m[:, None]).astype(np.int64)  # (P, 3)
    cell -= cell.min(0, initial=0)
    key = thing.astype(np.int64) * 6 + nearest_axis(points.planes)
    for coordinate in cell.T:
        key = key * (coordinate.max(initial=0) + 1) + coordinate
    raised_m = points.points_m + RAISED * step_m[:, None] * points.planes

    # Points close behind something, as those of a cabinet behind its drawers, are no surfel with the points before it.
    def are_covered(part: slice) -> Mask:
        return visibility.opaque.occluded(points.points_m[part], raised_m[part])

    is_covered = chunked(are_covered, len(points))
    group, middle = _grouped(2 * key + is_covered, points.points_m)

    # A group whose middle is hidden from some of its points, for example by a thin wall, is divided into two.
    def are_hidden_from_middle(part: slice) -> Mask:
        middle_of_point = middle[group[part]]
        return visibility.opaque.occluded(raised_m[part], raised_m[middle_of_point])

    is_hidden = chunked(are_hidden_from_middle, len(points))
    group, middle = _grouped(2 * group + is_hidden, points.points_m)
    return Surfels(group.astype(np.int32), middle, step_m[middle].astype(np.float32))


def stratified_middles(middles: Texels, step_m: Floats) -> Texels:
    """The middles (S,) of surfels with random numbers that stratify the rays of neighbouring surfels together.

    Light from far surfels is averaged over neighbours, as if their rays came from one point.
    """
    cell = np.floor(middles.points_m / step_m[:, None]).astype(np.int64)
    axis = nearest_axis(middles.planes) // 2
    # The row and the column in the pattern are the two coordinates of the cell that are not along the axis.
    row = np.where(axis == 0, cell[:, 1], cell[:, 0]) % PATTERN_SIDE
    column = np.where(axis == 2, cell[:, 1], cell[:, 2]) % PATTERN_SIDE
    pattern = SobolPattern(PATTERN_SIDE, 1, middles.dither[:1])
    return replace(middles, dither=pattern.offsets(row * PATTERN_SIDE + column, middles.dither))


def _grouped(key: Rows, points_m: Floats) -> tuple[Rows, Rows]:
    """Group points (P, 3) with equal keys (P,).

    Returns the group (P,) of each point, and the point (G,) of each group that is nearest to the mean of the group.
    """
    group = np.unique(key, return_inverse=True)[1].ravel()
    count = np.bincount(group)
    coordinate_sums_m = [np.bincount(group, coordinate) for coordinate in points_m.T]
    sums_m = np.stack(coordinate_sums_m, -1)
    mean_m = sums_m / np.maximum(count, 1)[:, None]
    squared_distance_m2 = ((points_m - mean_m[group]) ** 2).sum(1)
    nearest_first = np.lexsort((squared_distance_m2, group))  # group by group
    start_of_group = np.cumsum(count) - count
    return group, nearest_first[start_of_group]
