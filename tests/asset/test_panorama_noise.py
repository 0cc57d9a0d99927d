"""Tiles of noise: reading them between pixels, smoothing them, and fading them with distance."""

import numpy as np
import pytest

from vobench.asset.panorama_noise import BAND_ROWS, fade_pattern, sample_tile, smooth_tile

TILE = np.random.default_rng(0).random((8, 8)).astype(np.float32)


def test_a_tile_has_its_own_values_at_its_pixels_and_repeats() -> None:
    row, column = np.meshgrid(np.arange(8), np.arange(8), indexing="ij")
    u = (column / 8).astype(np.float32)
    v = (row / 8).astype(np.float32)
    np.testing.assert_array_equal(sample_tile(TILE, u, v), TILE)
    np.testing.assert_array_equal(sample_tile(TILE, u + 2, v - 3), TILE)


def test_a_value_between_pixels_is_the_mean_of_both_neighbours() -> None:
    column = np.arange(8)
    u = ((column + 0.5) / 8).astype(np.float32)[None]
    v = np.full((1, 8), 2 / 8, np.float32)
    np.testing.assert_allclose(sample_tile(TILE, u, v)[0], (TILE[2] + np.roll(TILE[2], -1)) / 2, rtol=1e-6)


def test_rows_are_sampled_alike_whichever_band_they_are_in() -> None:
    u = np.random.default_rng(1).random((3 * BAND_ROWS + 5, 4)).astype(np.float32)
    v = np.random.default_rng(2).random(u.shape).astype(np.float32)
    row_by_row = np.concatenate([sample_tile(TILE, u[[row]], v[[row]]) for row in range(len(u))])
    np.testing.assert_array_equal(sample_tile(TILE, u, v), row_by_row)


def test_smoothing_keeps_the_mean_and_lowers_the_variance() -> None:
    smooth = smooth_tile(TILE)
    assert smooth.mean() == pytest.approx(TILE.mean(), rel=1e-6)
    assert smooth.std() < TILE.std()
    np.testing.assert_allclose(smooth_tile(np.roll(TILE, (3, 5), (0, 1))), np.roll(smooth, (3, 5), (0, 1)), rtol=1e-6)


def test_a_pattern_is_whole_where_pixels_are_small_and_gone_where_they_cover_two_cells() -> None:
    footprint_m = np.array([0.1, 1.0, 2.0, 5.0])
    assert fade_pattern(np.ones(4), footprint_m, 1.0).tolist() == [1.0, 0.5, 0.0, 0.0]
