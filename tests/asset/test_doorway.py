"""Doorways: linings leave the hole open, leaves fill it when they are closed."""

import numpy as np
import pytest

from vobench.asset import doorway
from vobench.asset.furniture import WHITE, Part


def box_of(parts: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


def test_a_lining_leaves_nine_tenths_of_a_metre_open_with_the_leaf_ajar() -> None:
    parts = doorway.lining(1.0, 2.08, 0.12, WHITE)
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    low = corners[(corners[:, 2] < 1.5)]
    inner_m = np.abs(low[:, 1]).min()
    assert 2 * inner_m - doorway.LEAF_M >= 0.9
    assert np.abs(corners[:, 0]).max() == pytest.approx(0.06 + doorway.CASING_DEPTH_M, abs=0.002)


def test_a_leaf_hangs_at_zero_and_has_handles_on_both_faces() -> None:
    low, high = box_of(doorway.leaf(np.random.default_rng(0), 0.95, 2.05, WHITE))
    assert low[1] == pytest.approx(0, abs=0.01)
    assert high[1] == pytest.approx(0.95, abs=1e-6)
    assert low[0] < -0.05
    assert high[0] > 0.05
    assert low[2] > 0


def test_a_front_door_stands_before_its_wall() -> None:
    low, high = box_of(doorway.entrance(np.random.default_rng(0), 0.92, 2.05, WHITE))
    assert low[0] >= -0.07
    assert high[0] < 0.12
    assert high[1] == pytest.approx(-low[1], abs=0.01)
