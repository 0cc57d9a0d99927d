"""Pallets with loads keep to their height and stand on the ground."""

import numpy as np
import pytest

from vobench.asset import pallet
from vobench.asset.furniture import Part
from vobench.asset.pallet import LOADS, PALLET_M
from vobench.geometry.se3 import Array


def vertices_m(parts: list[Part]) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in parts])


def test_a_pallet_has_its_size() -> None:
    points_m = vertices_m(pallet.pallet())
    np.testing.assert_allclose(np.ptp(points_m, axis=0), PALLET_M, atol=1e-9)
    assert points_m[:, 2].min() == 0


@pytest.mark.parametrize("kind", sorted(LOADS))
def test_a_load_stands_on_its_pallet_and_is_no_higher_than_asked(kind: str) -> None:
    for seed in range(8):
        high_m = (0.9, 1.5)[seed % 2]
        points_m = vertices_m(LOADS[kind](np.random.default_rng(seed), high_m))
        assert -0.016 < points_m[:, 2].min() < 0.006
        assert points_m[:, 2].max() <= high_m + 0.02
        assert np.abs(points_m[:, 0]).max() < 0.64
        assert np.abs(points_m[:, 1]).max() < 0.45


def test_a_pallet_with_its_load_is_no_higher_than_asked() -> None:
    for seed in range(12):
        points_m = vertices_m(pallet.load(np.random.default_rng(seed), 1.4))
        assert points_m[:, 2].min() == 0
        assert PALLET_M[2] < points_m[:, 2].max() <= 1.4 + 0.02
