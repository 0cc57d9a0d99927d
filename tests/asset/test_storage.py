"""Pallets with loads keep to their height and stand on the ground; racks carry decks at their levels."""

import numpy as np
import pytest

from vobench.asset import storage
from vobench.asset.furniture import Part, matt
from vobench.asset.storage import LOADS, PALLET_M, Rack
from vobench.geometry.se3 import Array


def vertices_m(parts: list[Part]) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in parts])


def test_a_pallet_has_its_size() -> None:
    points_m = vertices_m(storage.pallet())
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


def test_a_rack_has_a_deck_at_each_level_and_uprights_between_its_bays() -> None:
    rack = Rack(3, 2.7, 1.1, (1.5, 3.0), matt("#24427a"), matt("#d8641e"))
    uprights, beams, decks = rack.parts()
    assert np.ptp(uprights.arrays.vertices_m[:, 0]) == pytest.approx(rack.length_m, abs=0.05)
    tops_m = np.unique(decks.arrays.vertices_m[:, 2].round(3))
    assert {1.499, 2.999} <= set(tops_m.tolist())
    assert beams.arrays.vertices_m[:, 2].max() == pytest.approx(3.0)
    assert rack.bay_x_m(1) == pytest.approx(0)


@pytest.mark.parametrize("make", [storage.forklift, storage.pallet_truck])
def test_machines_stand_on_the_floor(make) -> None:  # type: ignore[no-untyped-def]
    assert abs(vertices_m(make(np.random.default_rng(1)))[:, 2].min()) < 0.012


def test_a_dock_tells_its_number_above_a_door_on_the_floor() -> None:
    points_m = vertices_m(storage.roller_door(np.random.default_rng(1), 7))
    assert points_m[:, 2].min() == pytest.approx(0, abs=1e-9)
    assert points_m[:, 0].min() >= -1e-9
