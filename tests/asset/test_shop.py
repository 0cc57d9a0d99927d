"""Shops of every kind fill the room behind their window, and no goods reach through the pane or the walls."""

import numpy as np
import pytest

from vobench.asset import shop

WIDTH_M = 4.5
DEPTH_M = 4.0


@pytest.mark.parametrize("kind", sorted(shop.GOODS))
def test_goods_stay_in_the_room(kind: str) -> None:
    for seed in range(3):
        made = shop.interior(np.random.default_rng(seed), kind, width_m=WIDTH_M, sill_m=0.42, depth_m=DEPTH_M)
        vertices_m = np.concatenate([part.arrays.vertices_m for part in made.parts])
        assert vertices_m[:, 0].max() < 0.08
        assert vertices_m[:, 0].min() > -DEPTH_M - 0.05
        assert np.abs(vertices_m[:, 1]).max() < WIDTH_M / 2 + 0.1
        assert -0.02 < vertices_m[:, 2].min() <= 0.01
        assert vertices_m[:, 2].max() <= shop.HEIGHT_M


def test_every_kind_has_names() -> None:
    assert shop.NAMES.keys() == shop.GOODS.keys()
    assert {shop.drawn_kind(np.random.default_rng(seed)) for seed in range(60)} == set(shop.GOODS)
