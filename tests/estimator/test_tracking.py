"""Corners, tracks and local contrast: every picture is a known shift or change of brightness of another."""

import numpy as np
import pytest

from tests.estimator.textures import grid, shifted, texture
from vobench.estimator.tracking import (
    GRID_COLUMNS,
    GRID_ROWS,
    comparable,
    corners_per_cell,
    follow,
    follow_predicted,
    inside,
    local_contrast,
)


def test_every_cell_has_its_corners_and_none_is_near_the_border():
    corners = corners_per_cell(texture(), 5, distance_px=8, margin_px=12)
    assert len(corners) == 5 * GRID_COLUMNS * GRID_ROWS
    assert inside(corners, texture(), 12).all()
    columns = np.linspace(12, 708, GRID_COLUMNS + 1)
    assert set(np.histogram(corners[:, 0], columns)[0]) == {5 * GRID_ROWS}


def test_the_cells_of_a_picture_of_three_to_two_are_squares():
    assert GRID_COLUMNS / GRID_ROWS == 3 / 2


def test_corners_are_found_though_only_one_cell_has_any():
    image = np.full((480, 720), 90, np.uint8)
    image[200:260, 300:360] = texture()[200:260, 300:360]
    corners = corners_per_cell(image, 5, distance_px=8, margin_px=12)
    assert len(corners) > 0
    assert np.all((corners > [290, 190]) & (corners < [370, 270]))


@pytest.mark.parametrize("window_px", [9, 21])
def test_a_picture_that_moves_by_a_fraction_is_followed_by_it(window_px):
    moved, found = follow(texture(), shifted(texture(), 3.25, -1.5), grid(), window_px=window_px)
    off = np.linalg.norm((moved - grid())[found] - [3.25, -1.5], axis=1)
    assert found.mean() > 0.95
    assert off.mean() < 0.05
    assert off.max() < 0.2


def test_what_is_too_far_to_be_found_is_found_from_a_guess():
    later = shifted(texture(), 120, 40)
    points = grid()[(grid() < [560, 400]).all(1)]
    _, alone = follow(texture(), later, points)
    there, found = follow_predicted(texture(), later, points, points + np.float32([118, 43]))
    assert alone.mean() < 0.2
    assert found.mean() > 0.95
    np.testing.assert_allclose(there[found] - points[found], np.broadcast_to([120, 40], (found.sum(), 2)), atol=0.1)


def test_a_guess_that_misleads_costs_nothing_but_time():
    later = shifted(texture(), 2, 1)
    plain, misled = follow(texture(), later, grid()), follow_predicted(texture(), later, grid(), grid() + 150)
    np.testing.assert_array_equal(misled[1], plain[1])
    np.testing.assert_array_equal(misled[0], plain[0])


def test_no_points_are_followed_nowhere():
    none = np.zeros((0, 2), np.float32)
    there, found = follow_predicted(texture(), texture(), none, none)
    assert there.shape == (0, 2)
    assert found.shape == (0,)


def test_pictures_of_like_light_are_compared_as_they_are():
    other = np.clip(texture() * 1.05, 0, 255).astype(np.uint8)
    assert comparable(texture(), other)[1] is other


@pytest.mark.parametrize(("gain", "bias"), [(0.84, 0.0), (0.75, 20.0), (1.0, 40.0)])
def test_local_contrast_does_not_see_gain_nor_bias(gain, bias):
    dim = (texture() * 0.6).astype(np.uint8)
    changed = np.round(dim * gain + bias).astype(np.uint8)
    one, other = comparable(dim, changed)
    assert one is not dim
    assert np.abs(one.astype(float) - other).mean() < 2
    assert np.abs(local_contrast(dim).astype(float) - one).max() == 0


def test_local_contrast_uses_most_grey_values_and_saturates_almost_nowhere():
    """Three standard deviations on either side of the mean fit into a byte, as large noise shows."""
    noise = np.clip(np.random.default_rng(3).normal(128, 40, (240, 360)), 0, 255).astype(np.uint8)
    contrast = local_contrast(noise)
    is_saturated = (contrast == 0) | (contrast == 255)
    assert is_saturated.mean() < 0.01
    assert np.std(contrast) > 30
    assert np.mean(contrast) == pytest.approx(128, abs=1)


def test_local_contrast_of_an_even_picture_is_the_middle_grey_and_shows_little_of_its_noise():
    even = np.full((240, 360), 200, np.uint8)
    assert set(local_contrast(even).ravel()) == {128}
    noisy = (even + np.random.default_rng(4).integers(0, 2, even.shape)).astype(np.uint8)  # deviation 0.5
    assert np.std(local_contrast(noisy)) < 10


def test_tracks_in_an_eye_of_another_gain_are_as_many_and_as_good():
    points, later = grid(15), shifted(texture(), 1.4, 0.3)
    equal, found = follow(*comparable(texture(), later), points)
    dim = np.round(later * 0.84).astype(np.uint8)
    unlike, found_unlike = follow(*comparable(texture(), dim), points)
    assert found_unlike.sum() > 0.9 * found.sum()
    both = found & found_unlike
    assert np.abs(unlike - equal)[both].max() < 0.1
