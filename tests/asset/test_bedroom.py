"""Bedrooms and halls: pieces keep to the sizes that their rooms reserve for them."""

import numpy as np
import pytest

from vobench.asset import bedroom
from vobench.asset.furniture import Part


def box_of(parts: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("width_m", [0.9, 1.4, 1.8])
def test_a_bed_keeps_to_its_place_with_whatever_lies_on_it(width_m: float, seed: int) -> None:
    low, high = box_of(bedroom.bed(np.random.default_rng(seed), width_m))
    assert low[0] >= 0
    assert high[0] <= bedroom.BED_LENGTH_M + 0.03
    assert max(-low[1], high[1]) <= width_m / 2 + 0.08
    assert low[2] == pytest.approx(0, abs=1e-9)
    assert high[2] < 1.2


@pytest.mark.parametrize("width_m", [1.0, 1.5, 2.4])
def test_a_wardrobe_keeps_to_its_place(width_m: float) -> None:
    for seed in range(6):
        low, high = box_of(bedroom.wardrobe(np.random.default_rng(seed), width_m))
        assert low[0] >= -0.006
        assert high[0] <= 0.66
        assert high[1] - low[1] <= width_m + 0.021
        assert high[2] <= 2.35


def test_coats_hang_below_their_board_and_not_into_the_wall() -> None:
    for seed in range(12):
        low, high = box_of(bedroom.coat_rack(np.random.default_rng(seed)))
        assert low[0] >= -0.001
        assert low[2] >= -0.65
        assert high[2] <= 0.65


def test_a_quilt_covers_the_mattress_and_hangs_over_both_sides() -> None:
    parts = bedroom.bed(np.random.default_rng(0), 1.6, cover="#ff0000")
    quilt = next(part for part in parts if part.material.colour[0] == 1 and part.material.colour[1] == 0)
    low, high = box_of([quilt])
    assert low[1] < -0.8 < 0.8 < high[1]
    assert low[2] < 0.4
    assert high[2] > 0.54


def test_seats_and_cabinets_stand_on_the_floor() -> None:
    rng = np.random.default_rng(0)
    for parts in (bedroom.armchair(rng), bedroom.bedside_table(rng), bedroom.shoe_cabinet(rng), bedroom.shoes(rng)):
        low, _ = box_of(parts)
        assert low[2] == pytest.approx(0, abs=0.006)
