"""Noise that was added is measured, whatever else an image shows."""

import cv2
import numpy as np
import pytest

from vobench.analysis import image_noise
from vobench.analysis.image_noise import PATCH_PX, noise_dn


def boards(*, sigma_px: float = 0.8, size: tuple[int, int] = (240, 320)) -> np.ndarray:
    """An image of rectangles of even grey, blurred."""
    rng = np.random.default_rng(0)
    picture = np.full(size, 128.0)
    for _ in range(40):
        x, y = rng.integers(0, size[1]), rng.integers(0, size[0])
        picture[y : y + rng.integers(10, 60), x : x + rng.integers(10, 80)] = rng.uniform(40, 220)
    return cv2.GaussianBlur(picture, (0, 0), sigma_px)


def as_grey(picture: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def noisy(picture: np.ndarray, sigma: float, *, seed: int = 1) -> np.ndarray:
    return as_grey(picture + np.random.default_rng(seed).normal(0, sigma, picture.shape))


@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0])
def test_noise_is_found_beside_texture(sigma: float) -> None:
    assert noise_dn(noisy(boards(), sigma))[0] == pytest.approx(sigma, rel=0.1)


def test_an_image_without_noise_has_little() -> None:
    assert noise_dn(as_grey(boards()))[0] < 0.4


@pytest.mark.parametrize("size", [(80, 100), (240, 320), (600, 800)])
def test_the_noise_of_a_flat_image_is_found_whatever_its_size(size: tuple[int, int]) -> None:
    sigma = noise_dn(noisy(np.full(size, 120.0), 3.0))[0]
    assert sigma == pytest.approx(np.hypot(3.0, 12**-0.5), rel=0.04)  # with that of rounding


def stripes(period_px: float = 5.0) -> np.ndarray:
    """An image that is flat in its left half and has vertical stripes in its right one."""
    column = np.arange(320)
    row = np.where(column < 160, 120.0, 120 + 40 * np.sin(2 * np.pi * column / period_px))
    return np.tile(row, (240, 1))


@pytest.mark.parametrize("is_turned", [False, True])
def test_stripes_are_texture_whichever_their_direction(is_turned: bool) -> None:
    picture = stripes()
    picture = noisy(np.ascontiguousarray(picture.T) if is_turned else picture, 2.0)
    sigma, flat_dn = noise_dn(picture)
    assert sigma == pytest.approx(2.0, rel=0.1)
    assert flat_dn == pytest.approx(120, abs=1.5)


def test_a_mirrored_or_turned_image_has_the_same_noise() -> None:
    picture = noisy(boards(), 2.0)
    sigma = noise_dn(picture)[0]
    for other in (picture.T, picture[::-1], picture[:, ::-1]):
        assert noise_dn(np.ascontiguousarray(other))[0] == pytest.approx(sigma, rel=0.05)


def test_the_gradient_energy_is_the_sum_of_squared_differences_of_neighbours_on_both_axes() -> None:
    rng = np.random.default_rng(2)
    for patch in rng.standard_normal((5, PATCH_PX, PATCH_PX)):
        energy = ((image_noise._patch_differences() @ patch.ravel()) ** 2).sum()
        by_rows, by_columns = ((np.diff(patch, axis=axis) ** 2).sum() for axis in (0, 1))
        assert energy == pytest.approx(by_rows + by_columns, rel=1e-4)


def test_one_patch_of_noise_in_a_thousand_is_taken_for_textured() -> None:
    patches = np.random.default_rng(3).standard_normal((200_000, PATCH_PX**2)).astype(np.float32)
    energy = ((patches @ image_noise._patch_differences().T) ** 2).sum(1)
    share = (energy > image_noise._max_energy_of_noise()).mean()
    assert 0.0005 < share < 0.0025


@pytest.mark.parametrize("magnitude", [8, 10, 12])
def test_the_smallest_variance_of_noise_is_that_of_as_many_patches(magnitude: int) -> None:
    patches = np.random.default_rng(4).standard_normal((2**magnitude * 2, PATCH_PX**2)).astype(np.float32)
    # Overlapping patches of one image are less independent than these, so their smallest variance is smaller.
    bound = image_noise._smallest_variance(patches)
    assert 0.3 * bound < image_noise._smallest_variance_of_noise(magnitude) < bound < 1


def test_grey_values_of_flat_parts_are_quantiles_over_them() -> None:
    picture = np.full((240, 320), 60.0)
    picture[:, 160:] = 180.0
    flat_dn = noise_dn(noisy(picture, 1.0))[1]
    assert len(flat_dn) == 10
    assert (np.diff(flat_dn) >= 0).all()
    assert flat_dn[0] == pytest.approx(60, abs=1)
    assert flat_dn[-1] == pytest.approx(180, abs=1)


@pytest.mark.parametrize("grey", [0.0, 255.0])
def test_black_and_saturated_parts_are_left_out(grey: float) -> None:
    picture = np.full((240, 320), 120.0)
    picture[:, 160:] = grey
    sigma, flat_dn = noise_dn(noisy(picture, 3.0))
    assert sigma == pytest.approx(3.0, rel=0.07)
    assert flat_dn == pytest.approx(120, abs=2)


@pytest.mark.parametrize(("level", "is_measured"), [(3, True), (2, False), (251, True), (252, False)])
def test_patches_of_grey_values_from_3_to_251_count(level: int, is_measured: bool) -> None:
    flat_dn = noise_dn(np.full((240, 320), level, np.uint8))[1]
    assert len(flat_dn) == (10 if is_measured else 0)


def test_of_an_image_with_too_few_patches_nothing_is_known() -> None:
    assert noise_dn(noisy(np.full((60, 60), 120.0), 3.0))[0] > 2  # 324 patches
    sigma, flat_dn = noise_dn(noisy(np.full((57, 57), 120.0), 3.0))  # 289
    assert (sigma, len(flat_dn)) == (0.0, 0)
