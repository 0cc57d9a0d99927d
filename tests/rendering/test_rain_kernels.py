"""Moving discs: the area and the place of what they cover."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.rendering.rain_kernels import draw_disc, draw_streaks

V, U = np.mgrid[:40, :60]


def disc(u: float, v: float, diameter_px: float, area_px2: float = 1.0) -> Array:
    cover = np.zeros(U.shape)
    draw_disc(cover, u, v, diameter_px, area_px2)
    return cover


def middle(cover: Array) -> tuple[float, float]:
    return float((cover * U).sum() / cover.sum()), float((cover * V).sum() / cover.sum())


@pytest.mark.parametrize("diameter_px", [0.01, 0.7, 1.5, 6.0, 15.0])
def test_a_disc_covers_its_area_around_its_place(diameter_px: float) -> None:
    cover = disc(25.3, 18.6, diameter_px, area_px2=2.5)
    assert cover.sum() == pytest.approx(2.5)
    assert middle(cover) == pytest.approx((25.3, 18.6), abs=0.08)


def test_a_large_disc_is_even_and_as_wide_as_its_diameter() -> None:
    diameter_px = 16.0
    cover = disc(30.0, 20.0, diameter_px, area_px2=np.pi / 4 * diameter_px**2)
    assert cover[20, 30] == pytest.approx(1, rel=0.02)
    assert cover[20, 30 + 7] == pytest.approx(1, rel=0.02)
    assert cover[20, 30 + 9] == 0


def test_what_is_beyond_the_border_is_lost() -> None:
    assert disc(-0.5, 20.0, 0.1).sum() == pytest.approx(0.5)
    assert disc(-5.0, 20.0, 4.0).sum() == 0
    assert disc(30.0, 39.5, 0.1).sum() == pytest.approx(0.5)


def test_a_streak_is_even_along_its_path() -> None:
    cover = np.zeros(U.shape)
    start, end = np.array([[10.0, 5.0]]), np.array([[10.0, 35.0]])
    draw_streaks(cover, start, end, np.array([0.5]), np.array([3.0]))
    by_row = cover.sum(1)
    assert by_row.sum() == pytest.approx(3.0)
    np.testing.assert_allclose(by_row[8:33], 0.1, rtol=0.02)
    assert middle(cover) == pytest.approx((10.0, 20.0), abs=0.01)


def test_streaks_add_up() -> None:
    starts, ends = np.array([[10.0, 5.0], [40.0, 9.0]]), np.array([[20.0, 30.0], [30.0, 9.0]])
    diameters, areas = np.array([0.5, 5.0]), np.array([1.0, 7.0])
    both = np.zeros(U.shape)
    draw_streaks(both, starts, ends, diameters, areas)
    apart = np.zeros(U.shape)
    for one in range(2):
        rows = slice(one, one + 1)
        draw_streaks(apart, starts[rows], ends[rows], diameters[rows], areas[rows])
    np.testing.assert_allclose(both, apart)
