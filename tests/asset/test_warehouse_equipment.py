"""The equipment of warehouses stands on the floor, and docks have their numbers."""

import numpy as np
import pytest

from vobench.asset import warehouse_equipment
from vobench.asset.furniture import Part
from vobench.geometry.se3 import Array


def vertices_m(parts: list[Part]) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in parts])


@pytest.mark.parametrize("make", [warehouse_equipment.forklift, warehouse_equipment.pallet_truck])
def test_machines_stand_on_the_floor(make) -> None:  # type: ignore[no-untyped-def]
    assert abs(vertices_m(make(np.random.default_rng(1)))[:, 2].min()) < 0.012


def test_a_dock_tells_its_number_above_a_door_on_the_floor() -> None:
    points_m = vertices_m(warehouse_equipment.roller_door(np.random.default_rng(1), 7))
    assert points_m[:, 2].min() == pytest.approx(0, abs=1e-9)
    assert points_m[:, 0].min() >= -1e-9
