"""The body of a house: walls where no street passes, a foundation below the pavement, and a roof above the walls."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.front_style import front_style
from vobench.asset.house_body import FOUNDATION_M, RIDGE_M, house_body
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.street_plan import Lot

LOT = Lot(PlanFrame(0.0, 0.0, 0.0), 9.0, 10.0)
HIGH_M = 9.5
STYLE = front_style(np.random.default_rng(0))


def test_a_side_at_a_street_gets_its_wall_elsewhere() -> None:
    counts = []
    for is_open in ((False, False), (True, False), (True, True)):
        walls = house_body(np.random.default_rng(0), replace(LOT, is_open=is_open), STYLE, HIGH_M)[0]
        counts.append(len(walls.arrays.faces))
    assert counts == [6, 4, 2]


@pytest.mark.parametrize("roof", ["flat", "pitched"])
def test_a_pitched_roof_has_a_ridge_above_the_walls_and_a_flat_one_a_parapet(roof: str) -> None:
    for seed in range(5):
        parts = house_body(np.random.default_rng(seed), LOT, replace(STYLE, roof=roof), HIGH_M)
        vertices_m = np.concatenate([part.arrays.vertices_m for part in parts])
        assert vertices_m[:, 2].min() == pytest.approx(-FOUNDATION_M)
        above_m = vertices_m[:, 2].max() - HIGH_M
        if roof == "flat":
            assert 0 < above_m < 0.5
        else:
            assert above_m > RIDGE_M[0]
