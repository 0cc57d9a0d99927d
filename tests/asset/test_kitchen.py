"""Kitchens: rows of units that fill their length, and leave windows free."""

import numpy as np
import pytest

from vobench.asset import kitchen
from vobench.asset.furniture import WHITE, Part
from vobench.asset.kitchen import KitchenStyle

STYLE = KitchenStyle("#7f9182", "#e4e0d6", WHITE, WHITE)


def corners_of(parts: list[Part]) -> np.ndarray:
    return np.concatenate([part.arrays.vertices_m for part in parts])


@pytest.mark.parametrize("length_m", [1.8, 2.1, 2.4, 3.0, 3.6])
@pytest.mark.parametrize("seed", range(4))
def test_a_row_fills_its_length_and_stays_within_its_depth_and_height(length_m: float, seed: int) -> None:
    corners = corners_of(kitchen.row(np.random.default_rng(seed), length_m, 2.6, STYLE))
    low_m = corners.min(axis=0)
    high_m = corners.max(axis=0)
    assert high_m[1] - low_m[1] == pytest.approx(length_m, abs=0.02)
    assert low_m[0] > -0.01
    assert high_m[0] < 0.675
    assert low_m[2] == pytest.approx(0, abs=1e-9)
    assert high_m[2] == pytest.approx(2.6, abs=1e-3), "the hood ends at the ceiling"


@pytest.mark.parametrize("seed", range(6))
def test_nothing_hangs_before_a_window(seed: int) -> None:
    window = (-0.5, 0.6)
    parts = kitchen.row(np.random.default_rng(seed), 3.6, 2.6, STYLE, window)
    corners = corners_of(parts)
    is_before = (corners[:, 1] > window[0]) & (corners[:, 1] < window[1])
    assert corners[is_before, 2].max() < 1.36
    beside = corners[~is_before, 2]
    assert beside.max() > 1.8


def test_the_units_of_a_row_stand_side_by_side_and_hold_sink_oven_and_fridge() -> None:
    for seed in range(30):
        units = kitchen._units(np.random.default_rng(seed), 3.3)
        kinds = [unit.kind for unit in units]
        assert {"fridge", "sink", "oven"} <= set(kinds)
        ends = [unit.y + unit.width_m / 2 for unit in units]
        starts = [unit.y - unit.width_m / 2 for unit in units]
        np.testing.assert_allclose(starts[1:], ends[:-1], atol=1e-9)
        assert ends[-1] == pytest.approx(1.65)


def test_pots_and_jars_stand_where_they_are_put() -> None:
    for parts in (kitchen.pot(1, 2, 3), kitchen.kettle(1, 2, 3), kitchen.jar(1, 2, 3), kitchen.bottle(1, 2, 3)):
        corners = corners_of(parts)
        assert corners[:, 2].min() == pytest.approx(3, abs=1e-9)
        assert np.abs(corners[:, :2].mean(axis=0) - [1, 2]).max() < 0.06
