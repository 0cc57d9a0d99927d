"""Compiled kernels of the weights by which the light of surfels is laid on the light map."""

import math

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled

WIDTH = 1.2  # the square of the width of the blend, in cells
TURNED = 2.0  # the distance in cells that counts as much as two normals whose difference has the length 1
LEAST = 0.02  # the share of the weights of a texel below which a weight counts as 0


@compiled
def _weigh(
    position_m: Floats,
    normal: Floats,
    candidates: Rows,
    is_hidden: Mask,
    middles_m: Floats,
    normals: Floats,
    step_m: float,
    weights: Floats,
) -> int:
    """Write the weights (K,) of the candidates (K,) at a texel; they add up to 1. How many are not 0."""
    nearest = np.inf
    for nth in range(len(candidates)):
        surfel = candidates[nth]
        apart_m2 = 0.0
        turn2 = 0.0
        for axis in range(3):
            apart_m2 += (position_m[axis] - middles_m[surfel, axis]) ** 2
            turn2 += (normal[axis] - normals[surfel, axis]) ** 2
        squared = apart_m2 / (step_m * step_m) + turn2 * TURNED * TURNED
        weights[nth] = np.inf if is_hidden[nth] else squared
        nearest = min(nearest, weights[nth])

    total = 0.0
    for nth in range(len(candidates)):
        weights[nth] = 0.0 if math.isinf(weights[nth]) else math.exp(-(weights[nth] - nearest) / WIDTH)
        total += weights[nth]
    kept_total = 0.0
    count = 0
    for nth in range(len(candidates)):
        if weights[nth] < LEAST * total:
            weights[nth] = 0.0
        if weights[nth] > 0:
            kept_total += weights[nth]
            count += 1
    for nth in range(len(candidates)):
        weights[nth] /= kept_total
    return count


@compiled
def count_weights(
    source: Indices,
    points_m: Floats,
    point_normals: Floats,
    of: Indices,
    neighbours: Rows,
    is_hidden: Mask,
    middles_m: Floats,
    normals: Floats,
    step_m: Floats,
    counts: Indices,
) -> None:
    """Write how many surfels each of the texels takes its light from (N,).

    `source` (N,) is the point that stands for each texel, the number of points for none.
    `of` (P,) is the surfel of each point; `neighbours` (S, K) are the surfels near to each surfel, and `is_hidden`
    (S, K) is whether something is in between. `middles_m` and `normals` (S, 3) are those of surfels, and `step_m` (S,)
    is the side of their cells.
    """
    weights = np.empty(neighbours.shape[1])
    for texel in range(len(source)):
        point = source[texel]
        counts[texel] = 0
        if point < len(points_m):
            surfel = of[point]
            counts[texel] = _weigh(
                points_m[point],
                point_normals[point],
                neighbours[surfel],
                is_hidden[surfel],
                middles_m,
                normals,
                step_m[surfel],
                weights,
            )


@compiled
def write_weights(
    source: Indices,
    points_m: Floats,
    point_normals: Floats,
    of: Indices,
    neighbours: Rows,
    is_hidden: Mask,
    middles_m: Floats,
    normals: Floats,
    step_m: Floats,
    columns: Indices,
    values: Floats,
) -> None:
    """Write the surfels that texels take their light from, and their weights, one texel after the other.

    The other arguments are those of `count_weights`, whose sum is the length of `columns` and of `values`.
    """
    weights = np.empty(neighbours.shape[1])
    entry = 0
    for texel in range(len(source)):
        point = source[texel]
        if point >= len(points_m):
            continue
        surfel = of[point]
        _weigh(
            points_m[point],
            point_normals[point],
            neighbours[surfel],
            is_hidden[surfel],
            middles_m,
            normals,
            step_m[surfel],
            weights,
        )
        for nth in range(len(weights)):
            if weights[nth] > 0:
                columns[entry] = neighbours[surfel, nth]
                values[entry] = weights[nth]
                entry += 1
