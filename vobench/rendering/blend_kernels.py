"""Compiled kernels for the weights with which the light of surfels is blended into the light map."""

import math
from typing import NamedTuple

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled

SQUARED_WIDTH = 1.2  # the squared distance, in squared cells, at which a weight falls by a factor of e
NORMAL_WEIGHT = 2.0  # the distance in cells that is equivalent to a difference of length 1 between two unit normals
LEAST_SHARE = 0.02  # a weight that is a smaller share of the weights of its texel is set to 0


class Blending(NamedTuple):
    """P points, the S surfels that they take their light from, and the K neighbours of each surfel.

    `points_m` (P, 3) are the positions of the points.
    `point_normals` (P, 3) are the unit normals at the points.
    `surfel_of_point` (P,) is the index of the surfel that each point belongs to.
    `neighbours` (S, K) are the indices of the surfels near each surfel, which include the surfel itself.
    `is_hidden` (S, K) is whether an opaque face is between a surfel and its neighbour.
    `middles_m` (S, 3) are the middles of the surfels.
    `normals` (S, 3) are the unit normals of the surfels.
    `step_m` (S,) is the side of the cell of each surfel.
    """

    points_m: Floats
    point_normals: Floats
    surfel_of_point: Indices
    neighbours: Rows
    is_hidden: Mask
    middles_m: Floats
    normals: Floats
    step_m: Floats


@compiled
def _write_squared_distances(blending: Blending, point: int, squared: Floats) -> None:
    """Write the squared distances (K,), in squared cells, between a point and the neighbours of its surfel.

    A difference between the normals counts as a distance, too. The distance of a hidden neighbour is infinite.
    """
    surfel = blending.surfel_of_point[point]
    step_m = blending.step_m[surfel]
    for k in range(len(squared)):
        neighbour = blending.neighbours[surfel, k]
        if blending.is_hidden[surfel, k]:
            squared[k] = np.inf
            continue
        distance_m2 = 0.0
        normal_difference2 = 0.0
        for axis in range(3):
            distance_m2 += (blending.points_m[point, axis] - blending.middles_m[neighbour, axis]) ** 2
            normal_difference2 += (blending.point_normals[point, axis] - blending.normals[neighbour, axis]) ** 2
        distance_cells2 = distance_m2 / (step_m * step_m)
        squared[k] = distance_cells2 + normal_difference2 * NORMAL_WEIGHT * NORMAL_WEIGHT


@compiled
def _write_point_weights(blending: Blending, point: int, squared: Floats, weights: Floats) -> int:
    """Write the normalised weights (K,) of the neighbours of a point's surfel. Returns how many of them are not 0.

    `squared` (K,) is a buffer for the squared distances.
    """
    _write_squared_distances(blending, point, squared)
    smallest = np.inf
    for k in range(len(squared)):
        smallest = min(smallest, squared[k])

    # Gaussian weights. Subtracting the smallest distance prevents that all of them are rounded to 0.
    total = 0.0
    for k in range(len(weights)):
        weights[k] = 0.0
        if not math.isinf(squared[k]):
            weights[k] = math.exp(-(squared[k] - smallest) / SQUARED_WIDTH)
        total += weights[k]

    # Drop small weights, so that the table of weights has few entries.
    remaining_total = 0.0
    count = 0
    for k in range(len(weights)):
        if weights[k] < LEAST_SHARE * total:
            weights[k] = 0.0
        if weights[k] > 0:
            remaining_total += weights[k]
            count += 1

    for k in range(len(weights)):
        weights[k] /= remaining_total
    return count


@compiled
def count_weights(source: Indices, blending: Blending, counts: Indices) -> None:
    """Write the number (N,) of surfels that each texel takes its light from.

    `source` (N,) is the index of the point that each texel belongs to, or the number of points if it belongs to none.
    """
    neighbour_count = blending.neighbours.shape[1]
    squared = np.empty(neighbour_count)
    weights = np.empty(neighbour_count)
    for texel in range(len(source)):
        point = source[texel]
        counts[texel] = 0
        if point < len(blending.points_m):
            counts[texel] = _write_point_weights(blending, point, squared, weights)


@compiled
def write_weights(source: Indices, blending: Blending, columns: Indices, values: Floats) -> None:
    """Write the surfels that each texel takes its light from, and their weights, one texel after the other.

    `source` (N,) is as in `count_weights`.
    `columns` (M,) receives the indices of the surfels.
    `values` (M,) receives their weights.

    M is the sum of the counts that `count_weights` writes.
    """
    neighbour_count = blending.neighbours.shape[1]
    squared = np.empty(neighbour_count)
    weights = np.empty(neighbour_count)
    entry = 0
    for texel in range(len(source)):
        point = source[texel]
        if point >= len(blending.points_m):
            continue
        _write_point_weights(blending, point, squared, weights)
        surfel = blending.surfel_of_point[point]
        for k in range(len(weights)):
            if weights[k] > 0:
                columns[entry] = blending.neighbours[surfel, k]
                values[entry] = weights[k]
                entry += 1
