"""Means of a repeated texture over rectangles."""

import numpy as np

from vobench.rendering.texture_mean import rectangle_means

TILE = np.random.default_rng(0).random((4, 6, 3)).astype(np.float32)


def test_a_pixel_over_itself_is_its_value_wherever_the_tile_is_repeated() -> None:
    column_and_row = np.array([[2.5, 1.5], [2.5 + 6, 1.5 - 8], [2.5 - 60, 1.5 + 4]])
    means = rectangle_means(TILE, column_and_row, np.ones((3, 2)))
    np.testing.assert_allclose(means, np.tile(TILE[1, 2], (3, 1)), rtol=1e-5)


def test_between_pixels_the_mean_is_linear() -> None:
    means = rectangle_means(TILE, np.array([[3.25, 0.5]]), np.ones((1, 2)))
    np.testing.assert_allclose(means[0], 0.25 * TILE[0, 2] + 0.75 * TILE[0, 3], rtol=1e-5)


def test_less_than_a_pixel_counts_as_one() -> None:
    centre = np.array([[0.8, 3.1]])
    np.testing.assert_array_equal(
        rectangle_means(TILE, centre, np.full((1, 2), 0.01)), rectangle_means(TILE, centre, np.ones((1, 2)))
    )


def test_whole_tiles_have_the_mean_of_the_tile_wherever_they_begin() -> None:
    centres = np.random.default_rng(1).uniform(-20, 20, (9, 2))
    means = rectangle_means(TILE, centres, np.tile([6.0, 8.0], (9, 1)))
    np.testing.assert_allclose(means, np.tile(TILE.mean((0, 1)), (9, 1)), rtol=1e-5)


def test_a_rectangle_over_the_rim_has_the_mean_of_the_repeated_tile() -> None:
    repeated = np.tile(TILE, (3, 3, 1))
    means = rectangle_means(TILE, np.array([[5.0, 4.0]]), np.array([[4.0, 2.0]]))
    expected = repeated[7:9, 9:13].mean((0, 1))
    np.testing.assert_allclose(means[0], expected, rtol=1e-5)
