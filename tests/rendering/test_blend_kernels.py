"""Weights of surfels at texels: what they add up to, and which surfels they leave out."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.rendering.blend_kernels import LEAST_SHARE, SQUARED_WIDTH, Blending, count_weights, write_weights

Z = np.array([0.0, 0.0, 1.0], np.float32)
SPACING_M = 0.1


def row_of_surfels(*points_m: float, hidden: tuple[int, ...] = (), turned: tuple[int, ...] = ()) -> Array:
    """The weights (N, 5) of five surfels in a row along x at points beside them, the middle one being their own."""
    count = len(points_m)
    middles_m = np.zeros((5, 3), np.float32)
    middles_m[:, 0] = SPACING_M * np.arange(-2, 3)
    normals = np.tile(Z, (5, 1))
    for surfel in turned:
        normals[surfel] = -normals[surfel]
    is_hidden = np.zeros((5, 5), bool)
    is_hidden[2, list(hidden)] = True
    positions_m = np.zeros((count, 3), np.float32)
    positions_m[:, 0] = points_m
    source = np.arange(count + 1, dtype=np.int32)  # the last texel has no point
    blending = Blending(
        points_m=positions_m,
        point_normals=np.tile(Z, (count, 1)),
        surfel_of_point=np.full(count, 2, np.int32),
        neighbours=np.tile(np.arange(5), (5, 1)),
        is_hidden=is_hidden,
        middles_m=middles_m,
        normals=normals,
        step_m=np.full(5, SPACING_M, np.float32),
    )
    counts = np.zeros(count + 1, np.int32)
    count_weights(source, blending, counts)
    assert counts[-1] == 0
    columns = np.full(counts.sum(), -1, np.int32)
    values = np.zeros(counts.sum(), np.float32)
    write_weights(source, blending, columns, values)
    result = np.zeros((count, 5))
    result[np.repeat(np.arange(count), counts[:-1]), columns] = values
    return result


def test_weights_add_up_to_one_and_fall_with_the_square_of_the_distance() -> None:
    weights = row_of_surfels(0.0, 0.02, -0.05)
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    assert weights[0, 3] / weights[0, 2] == pytest.approx(np.exp(-1 / SQUARED_WIDTH), rel=1e-5)
    np.testing.assert_allclose(weights[0], weights[0, ::-1], rtol=1e-6)
    assert weights[1, 3] > weights[1, 1]
    assert weights[2, 1] == pytest.approx(weights[2, 2], rel=1e-5)


def test_hidden_surfels_and_those_that_look_elsewhere_give_no_light() -> None:
    weights = row_of_surfels(0.0, hidden=(1,), turned=(3,))
    assert weights[0, 1] == 0
    assert weights[0, 3] == 0
    assert weights[0].sum() == pytest.approx(1, abs=1e-6)


def test_small_weights_are_dropped() -> None:
    weights = row_of_surfels(0.05)
    assert (weights[weights > 0] >= LEAST_SHARE).all()
    assert weights[0, 0] == 0
