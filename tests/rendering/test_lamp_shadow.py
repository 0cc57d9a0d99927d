"""Shadows that neighbours share: the same pixels as by a ray each, with fewer rays."""

import numpy as np
import pytest

from vobench.rendering.array_types import Indices, Mask, Pixels
from vobench.rendering.lamp_shadow import BLOCK_PX, LAMPS_AT_ONCE, Bits, blocks_of, hidden_lamps

HEIGHT = 62
WIDTH = 91  # neither is a multiple of a block


class Asked:
    """Answers from pictures of shadows (L, HEIGHT, WIDTH), and counts the rays."""

    def __init__(self, shadows: Mask) -> None:
        self._shadows = shadows.reshape(len(shadows), -1)
        self.rays = 0

    def __call__(self, lamp: int, pixels: Pixels) -> Mask:
        self.rays += len(pixels)
        return np.asarray(self._shadows[lamp, pixels])


def found(shadows: Mask, plane: Indices, facing: Bits) -> tuple[Mask, int]:
    """Which lamps (L, HEIGHT, WIDTH) are hidden, and how many rays that took."""
    asked = Asked(shadows)
    known = np.uint32((1 << len(shadows)) - 1)
    bits = hidden_lamps(blocks_of(HEIGHT, WIDTH), plane.ravel(), facing.ravel() & known, asked)
    lamps = np.arange(len(shadows), dtype=np.uint32)[:, None]
    return ((bits >> lamps) & 1).astype(bool).reshape(shadows.shape), asked.rays


def shadows_of_discs_and_lines(count: int) -> Mask:
    rng = np.random.default_rng(0)
    down, across = np.mgrid[:HEIGHT, :WIDTH]
    pictures = []
    for _ in range(count):
        v, u = rng.uniform(10, 50, 2)
        disc = np.hypot(down - v, across - u) < rng.uniform(4, 15)
        line = np.abs(down - v + rng.uniform(-0.5, 0.5) * (across - u)) < 1  # through the disc
        pictures.append(disc | line)
    return np.array(pictures)


ONE_PLANE = np.zeros((HEIGHT, WIDTH), np.int32)
ALL_FACE = np.full((HEIGHT, WIDTH), 0xFFFFFFFF, np.uint32)


@pytest.mark.parametrize("count", [1, 5, LAMPS_AT_ONCE])
def test_discs_and_the_thin_lines_through_them_are_found_with_fewer_rays(count: int) -> None:
    shadows = shadows_of_discs_and_lines(count)
    result, rays = found(shadows, ONE_PLANE, ALL_FACE)
    np.testing.assert_array_equal(result, shadows)
    assert rays < 0.5 * shadows.size


def test_light_without_shadows_takes_a_ray_at_each_corner_of_a_block() -> None:
    result, rays = found(np.zeros((1, HEIGHT, WIDTH), bool), ONE_PLANE, ALL_FACE)
    assert not result.any()
    assert rays == (-(-HEIGHT // BLOCK_PX) + 1) * (-(-WIDTH // BLOCK_PX) + 1)


def test_where_planes_meet_and_on_what_is_no_plane_every_pixel_is_asked() -> None:
    rng = np.random.default_rng(1)
    shadows = rng.random((3, HEIGHT, WIDTH)) < 0.5
    result, _ = found(shadows, np.full((HEIGHT, WIDTH), -1, np.int32), ALL_FACE)
    np.testing.assert_array_equal(result, shadows)
    stripes = np.broadcast_to(np.arange(WIDTH, dtype=np.int32) // 2, (HEIGHT, WIDTH))
    result, _ = found(shadows, np.ascontiguousarray(stripes), ALL_FACE)
    np.testing.assert_array_equal(result, shadows)


def test_a_lamp_is_not_asked_for_by_pixels_that_are_turned_away_from_it() -> None:
    plane = ONE_PLANE.copy()
    plane[:, 40:] = 1
    facing = np.where(plane == 0, 1, 2).astype(np.uint32)
    shadows = np.ones((2, HEIGHT, WIDTH), bool)
    result, rays = found(shadows, plane, facing)
    np.testing.assert_array_equal(result[0], plane == 0)
    np.testing.assert_array_equal(result[1], plane == 1)
    assert rays < 0.3 * HEIGHT * WIDTH
