"""Depth is completed along the edges of an image."""

import numpy as np
import pytest

from vobench.analysis.depth_completion import completed, smoothed

HEIGHT_PX = 40
WIDTH_PX = 60
EDGE_PX = 30  # the column from which a bright, near surface is seen
FAR = 0.2
NEAR = 0.5


def two_surfaces() -> np.ndarray:
    """A dark, far surface and a bright, near one, both with texture."""
    rng = np.random.default_rng(0)
    image = np.full((HEIGHT_PX, WIDTH_PX), 60.0)
    image[:, EDGE_PX:] = 180
    return np.clip(image + rng.uniform(-6, 6, image.shape), 0, 255).astype(np.uint8)


def depth_of_two() -> np.ndarray:
    rho = np.full((HEIGHT_PX, WIDTH_PX), FAR)
    rho[:, EDGE_PX:] = NEAR
    return rho


def complete(rho: np.ndarray, image: np.ndarray) -> np.ndarray:
    return completed(rho, image, edge_rho=0.1, least_rho=0.01)


def test_a_depth_edge_is_moved_to_the_edge_of_the_image() -> None:
    fattened = depth_of_two()
    fattened[:, EDGE_PX - 2 : EDGE_PX] = NEAR  # as a matcher with a window sees it
    error = np.abs(complete(fattened, two_surfaces()) - depth_of_two())
    assert error.max() < 0.1 * (NEAR - FAR)


def test_unknown_depth_is_that_of_the_same_surface() -> None:
    unknown = depth_of_two()
    unknown[:, EDGE_PX - 15 : EDGE_PX + 15] = np.nan
    error = np.abs(complete(unknown, two_surfaces()) - depth_of_two())
    assert error.max() < 0.1 * (NEAR - FAR)


def test_known_depth_of_a_textured_surface_is_kept() -> None:
    rng = np.random.default_rng(1)
    image = rng.integers(0, 255, (HEIGHT_PX, WIDTH_PX)).astype(np.uint8)
    rho = np.tile(np.linspace(FAR, NEAR, WIDTH_PX), (HEIGHT_PX, 1))
    assert complete(rho, image) == pytest.approx(rho, rel=0.02)


def test_nothing_known_is_far_away() -> None:
    image = two_surfaces()
    assert complete(np.full(image.shape, np.nan), image) == pytest.approx(np.full(image.shape, 0.01))


def test_even_values_stay_even_and_smoothing_preserves_the_sum() -> None:
    image = two_surfaces()
    even = np.full((1, HEIGHT_PX, WIDTH_PX), 3.0)
    assert smoothed(even, image, 1.0) == pytest.approx(even)
    values = np.random.default_rng(2).uniform(0, 1, (2, HEIGHT_PX, WIDTH_PX))
    smooth = smoothed(values, image, 1.0)
    assert smooth.sum((1, 2)) == pytest.approx(values.sum((1, 2)))
    assert smooth.std() < 0.5 * values.std()


def test_little_is_smoothed_across_an_edge_of_the_image() -> None:
    smooth = smoothed(depth_of_two()[None], two_surfaces(), 1.0)[0]
    assert smooth[:, : EDGE_PX - 1] == pytest.approx(np.full((HEIGHT_PX, EDGE_PX - 1), FAR), abs=0.02)
    assert smooth[:, EDGE_PX + 1 :] == pytest.approx(np.full((HEIGHT_PX, WIDTH_PX - EDGE_PX - 1), NEAR), abs=0.02)
