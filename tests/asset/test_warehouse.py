"""Warehouses by seed: valid, equal for equal seeds, different for others; the lighting is that of the outside alone."""

import numpy as np
import pytest

from vobench.asset import site_check, warehouse
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.site import Site
from vobench.scene.light import AreaLight, Sky

SEEDS = (2, 3)
MANY_SEEDS = range(1, 13)


@pytest.fixture(scope="module")
def halls() -> dict[int, Site]:
    return {seed: warehouse.generated_warehouse(seed, LIGHTINGS[seed % 4]) for seed in SEEDS}


@pytest.mark.slow
@pytest.mark.parametrize("seed", MANY_SEEDS)
def test_nothing_is_wrong_with_warehouses(seed: int) -> None:
    assert site_check.complaints(warehouse.generated_warehouse(seed, LIGHTINGS[seed % 4])) == []


def test_a_seed_gives_the_same_bytes_each_time(halls: dict[int, Site]) -> None:
    first = halls[3].place()
    second = warehouse.generated_warehouse(3, LIGHTINGS[3]).place()
    assert [thing.name for thing in first.things] == [thing.name for thing in second.things]
    for one, other in zip(first.things, second.things, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
        assert one.mesh.visual.uv.tobytes() == other.mesh.visual.uv.tobytes()
    assert first.materials == second.materials


def test_lamps_shine_by_day_and_by_night_and_the_sky_only_by_day() -> None:
    sky_lx = {}
    lamps_lm = {}
    for lighting in ("day", "night"):
        lights = warehouse.generated_warehouse(5, lighting).lights
        sky_lx[lighting] = sum(light.illuminance_lx for light in lights if isinstance(light, Sky))
        lamps_lm[lighting] = sum(light.power_lm for light in lights if isinstance(light, AreaLight))
    assert sky_lx["day"] > 1000 * sky_lx["night"]
    assert lamps_lm["day"] == lamps_lm["night"] > 0


def test_plans_differ_in_rows_bays_blocks_and_cross_aisles() -> None:
    plans = [warehouse.hall_plan(np.random.default_rng([seed, 0])) for seed in range(40)]
    assert len({plan.size_m for plan in plans}) == len(plans)
    assert len({len(plan.rows_y_m) for plan in plans}) >= 3
    assert {plan.gap_bay >= 0 for plan in plans} == {False, True}
    assert {bool(plan.blocks) for plan in plans} == {False, True}


def test_rows_and_aisles_fill_the_width_without_overlaps() -> None:
    for seed in range(20):
        plan = warehouse.hall_plan(np.random.default_rng([seed, 0]))
        rows = sorted(plan.rows_y_m)
        assert min(np.diff(rows), default=9.0) >= plan.rack.depth_m + warehouse.BACK_GAP_M - 1e-9
        for aisle in plan.aisles_y_m:
            assert min(abs(aisle - row) for row in rows) > 1.2 + plan.rack.depth_m / 2
        assert max(np.abs(rows)) + plan.rack.depth_m / 2 < plan.half_m[1]


def test_loads_stand_on_the_floor_or_on_a_deck_of_their_rack(halls: dict[int, Site]) -> None:
    site = halls[2]
    plan = warehouse.hall_plan(np.random.default_rng([2, 0]))
    bases_m = {piece.base_m for piece in site.pieces if piece.name.startswith("load_")}
    assert bases_m == {0.0, *plan.rack.levels_m}
