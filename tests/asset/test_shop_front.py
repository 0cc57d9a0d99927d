"""Shop fronts: a pane as large as the hole, the name above it, and nothing over the pavement of a far house."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.fitting import PANE
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.shop_front import FASCIA_LENGTH_PX, FASCIA_PX, fascia, shop_front
from vobench.asset.street_plan import Lot

LOT = Lot(PlanFrame(0.0, 0.0, 0.0), 9.0, 10.0)
HOLE = (0.5, 6.5, 0.42, 2.85)


def reach_m(lot: Lot, seed: int) -> float:
    front = shop_front(np.random.default_rng(seed), lot, HOLE, 9.0)
    return float(max(part.arrays.vertices_m[:, 0].max() for part in front.parts))


def test_the_pane_fills_the_hole() -> None:
    front = shop_front(np.random.default_rng(0), LOT, HOLE, 9.0)
    (pane,) = (part for part in front.room_parts if part.material == PANE)
    low_m = pane.arrays.vertices_m.min(axis=0)
    high_m = pane.arrays.vertices_m.max(axis=0)
    assert low_m[1:] == pytest.approx([HOLE[0] - LOT.width_m / 2, HOLE[2]])
    assert high_m[1:] == pytest.approx([HOLE[1] - LOT.width_m / 2, HOLE[3]])
    assert front.lamps


def test_awnings_and_signs_reach_over_the_pavement_of_near_houses_alone() -> None:
    near_m = [reach_m(LOT, seed) for seed in range(12)]
    far_m = [reach_m(replace(LOT, is_far=True), seed) for seed in range(12)]
    assert max(near_m) > 0.8
    assert max(far_m) < 0.2


def test_names_are_written_dark_on_bright_boards_and_bright_on_dark_ones() -> None:
    bright = np.asarray(fascia("CAFE", "#e6e3da").pixels())
    dark = np.asarray(fascia("CAFE", "#262b30").pixels())
    assert bright.shape == (FASCIA_PX, FASCIA_LENGTH_PX, 3)
    assert bright.min() < 80
    assert dark.max() > 200
