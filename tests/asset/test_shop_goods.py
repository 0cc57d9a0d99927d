"""Goods of every kind of shop stand on the floor of its room, and rows are centred."""

import numpy as np
import pytest

from vobench.asset.shop_goods import GOODS, SHELF_HEIGHT_M, _in_a_row, _shelves


@pytest.mark.parametrize("kind", sorted(GOODS))
def test_goods_stand_on_the_floor(kind: str) -> None:
    for seed in range(2):
        parts = GOODS[kind](np.random.default_rng(seed), 4.5, 4.0)
        vertices_m = np.concatenate([part.arrays.vertices_m for part in parts])
        assert vertices_m[:, 2].min() == pytest.approx(0, abs=0.01)


def test_a_row_is_centred_and_its_places_are_a_pitch_apart_or_more() -> None:
    places_m = _in_a_row(5.0, 1.4)
    assert len(places_m) == 3
    assert sum(places_m) == pytest.approx(0)
    assert np.diff(places_m).min() >= 1.4
    assert _in_a_row(1.0, 1.4) == [0.0]


def test_a_shelf_has_its_height_and_faces_x() -> None:
    parts = _shelves(np.random.default_rng(0), 0.0, 0.0, 2.0, yaw_deg=0.0)
    vertices_m = np.concatenate([part.arrays.vertices_m for part in parts])
    assert SHELF_HEIGHT_M <= vertices_m[:, 2].max() < SHELF_HEIGHT_M + 0.15
    assert vertices_m[:, 0].min() >= -1e-9
