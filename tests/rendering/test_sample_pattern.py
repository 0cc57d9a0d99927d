"""Samples are spread evenly over a pixel."""

import numpy as np
import pytest

from vobench.rendering.sample_pattern import FINE_GRID, FINE_SAMPLES, HALVES, PIXEL_CENTRE, ROTATED_GRID


@pytest.mark.parametrize("pattern", [ROTATED_GRID, *HALVES, PIXEL_CENTRE])
def test_the_mean_of_the_positions_is_the_centre_of_the_pixel(pattern) -> None:
    np.testing.assert_array_equal(np.mean(pattern.positions, axis=0), [0.5, 0.5])
    assert len(pattern.lod_bias) == len(pattern.positions)


def test_each_sample_of_the_rotated_grid_has_its_own_row_and_column() -> None:
    x, y = np.sort(np.array(ROTATED_GRID.positions).T)
    np.testing.assert_array_equal(x, [0.125, 0.375, 0.625, 0.875])
    np.testing.assert_array_equal(y, [0.125, 0.375, 0.625, 0.875])


def test_the_two_halves_are_the_rotated_grid() -> None:
    outer, inner = HALVES
    assert {*outer.positions, *inner.positions} == {*ROTATED_GRID.positions}
    of_grid = dict(zip(ROTATED_GRID.positions, ROTATED_GRID.lod_bias, strict=True))
    for half in HALVES:
        assert [of_grid[position] for position in half.positions] == list(half.lod_bias)


def test_each_of_sixteen_samples_has_its_own_row_and_column() -> None:
    positions = np.array([position for pattern in FINE_GRID for position in pattern.positions])
    x, y = np.sort(positions.T)
    middles = (np.arange(FINE_SAMPLES) + 0.5) / FINE_SAMPLES
    np.testing.assert_array_equal(x, middles)
    np.testing.assert_array_equal(y, middles)
    cells = {(int(4 * column), int(4 * row)) for column, row in positions}
    assert len(cells) == FINE_SAMPLES


@pytest.mark.parametrize("pattern", FINE_GRID)
def test_each_quarter_of_sixteen_samples_replaces_a_rotated_grid(pattern) -> None:
    assert len(pattern.positions) == len(ROTATED_GRID.positions)
    assert pattern.lod_bias == ROTATED_GRID.lod_bias
