"""Houses keep to their lots, have windows in their fronts, and shops have a room behind their pane."""

import numpy as np
import pytest

from vobench.asset.facade import House, house
from vobench.asset.fitting import PANE
from vobench.asset.house_body import FOUNDATION_M
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.street_plan import KERB_M, Lot
from vobench.geometry.se3 import Array

LOT = Lot(PlanFrame(0.0, 0.0, 0.0), 9.0, 10.0)
AWNING_M = 1.4  # that a house may reach over the pavement


def vertices_m(made: House) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in (*made.parts, *made.shop_parts)])


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("has_shop", [False, True])
def test_a_house_keeps_to_its_lot_and_stands_on_the_pavement(seed: int, has_shop: bool) -> None:
    made = house(np.random.default_rng(seed), LOT, has_shop=has_shop, number=7)
    low_m = vertices_m(made).min(axis=0)
    high_m = vertices_m(made).max(axis=0)
    assert low_m[0] > -LOT.depth_m - 0.05
    assert high_m[0] < AWNING_M
    assert max(-low_m[1], high_m[1]) < LOT.width_m / 2 + 0.1
    assert low_m[2] == pytest.approx(KERB_M - FOUNDATION_M)
    assert low_m[2] < 0
    assert made.windows


def test_a_shop_has_a_pane_with_goods_and_lamps_behind_it() -> None:
    made = house(np.random.default_rng(4), LOT, has_shop=True, number=7)
    (pane,) = (part for part in made.shop_parts if part.material == PANE)
    pane_x = pane.arrays.vertices_m[:, 0]
    assert np.ptp(pane_x) == 0
    others = np.concatenate([part.arrays.vertices_m for part in made.shop_parts if part.material != PANE])
    assert others[:, 0].max() < pane_x[0]
    assert others[:, 0].min() < -2.5
    for lamp in made.shop_lamps:
        assert (lamp.normals[:, 2] < -0.99).all(), "they shine down"


def test_without_a_shop_there_is_no_pane() -> None:
    made = house(np.random.default_rng(4), LOT, has_shop=False, number=7)
    assert not made.shop_parts
    assert not made.shop_lamps
