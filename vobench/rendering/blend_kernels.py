"""Compiled kernels of the weights by which the light of surfels is laid on the light map."""

import math
from typing import NamedTuple

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled

WIDTH = 1.2  # the square of the width of the blend, in cells
TURNED = 2.0  # the distance in cells that counts as much as two normals whose difference has the length 1
LEAST = 0.02  # the share of the weights of a texel below which a weight counts as 0


class Blending(NamedTuple):
    """The points (P,) whose light is that of surfels (S,), and the surfels near to each surfel.

    `points_m` and `point_normals` (P, 3) are those of the points, and `surfel_of_point` (P,) is the surfel of each.
    `neighbours` (S, K) are the surfels near to each surfel, and `is_hidden` (S, K) is whether something is in between.
    `middles_m` and `normals` (S, 3) are those of surfels, and `step_m` (S,) is the side of their cells.
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
    """Write the squared distances (K,) of a point from the neighbours of its surfel, in cells; infinity if hidden.

    Normals that differ count as a distance, too.
    """
    surfel = blending.surfel_of_point[point]
    step_m = blending.step_m[surfel]
    for k in range(len(squared)):
        neighbour = blending.neighbours[surfel, k]
        distance_m2 = 0.0
        turn2 = 0.0
        for axis in range(3):
            distance_m2 += (blending.points_m[point, axis] - blending.middles_m[neighbour, axis]) ** 2
            turn2 += (blending.point_normals[point, axis] - blending.normals[neighbour, axis]) ** 2
        in_cells = distance_m2 / (step_m * step_m) + turn2 * TURNED * TURNED
        squared[k] = np.inf if blending.is_hidden[surfel, k] else in_cells


@compiled
def _weigh(blending: Blending, point: int, weights: Floats) -> int:
    """Write the weights (K,) of the neighbours of a point's surfel; they add up to 1. How many are not 0."""
    _write_squared_distances(blending, point, weights)
    nearest = np.inf
    for k in range(len(weights)):
        nearest = min(nearest, weights[k])

    total = 0.0
    for k in range(len(weights)):
        weights[k] = 0.0 if math.isinf(weights[k]) else math.exp(-(weights[k] - nearest) / WIDTH)
        total += weights[k]

    kept_total = 0.0
    count = 0
    for k in range(len(weights)):
        if weights[k] < LEAST * total:
            weights[k] = 0.0
        if weights[k] > 0:
            kept_total += weights[k]
            count += 1
    for k in range(len(weights)):
        weights[k] /= kept_total
    return count


@compiled
def count_weights(source: Indices, blending: Blending, counts: Indices) -> None:
    """Write how many surfels each of the texels takes its light from (N,).

    `source` (N,) is the point that stands for each texel, the number of points for none.
    """
    weights = np.empty(blending.neighbours.shape[1])
    for texel in range(len(source)):
        has_point = source[texel] < len(blending.points_m)
        counts[texel] = _weigh(blending, source[texel], weights) if has_point else 0


@compiled
def write_weights(source: Indices, blending: Blending, columns: Indices, values: Floats) -> None:
    """Write the surfels that texels take their light from, and their weights, one texel after the other.

    The sum of what `count_weights` writes is the length of `columns` and of `values`.
    """
    weights = np.empty(blending.neighbours.shape[1])
    entry = 0
    for texel in range(len(source)):
        point = source[texel]
        if point >= len(blending.points_m):
            continue
        _weigh(blending, point, weights)
        surfel = blending.surfel_of_point[point]
        for k in range(len(weights)):
            if weights[k] > 0:
                columns[entry] = blending.neighbours[surfel, k]
                values[entry] = weights[k]
                entry += 1
