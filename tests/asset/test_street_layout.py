"""Plans of streets: lots side by side along the pavements, none in a street or in another, and kerbs at the roads."""

import numpy as np
import pytest

from vobench.asset.site import has_overlap, overlap_m
from vobench.asset.street_layout import street_plan
from vobench.asset.street_plan import KERB_M, StreetPlan

SEEDS = range(20)


@pytest.fixture(scope="module")
def plans() -> list[StreetPlan]:
    return [street_plan(np.random.default_rng(seed)) for seed in SEEDS]


def test_no_lot_enters_another_one_or_a_street(plans: list[StreetPlan]) -> None:
    for plan in plans:
        lots = [lot.corners_m for lot in plan.lots]
        assert not has_overlap(lots, 0.021)
        for area in (*plan.roads, *plan.pavements):
            assert max(overlap_m(lot, area.corners_m) for lot in lots) < 0.051


def test_every_front_is_at_the_edge_of_a_pavement_or_of_a_road(plans: list[StreetPlan]) -> None:
    for plan in plans:
        areas = (*plan.roads, *plan.pavements)
        for lot in plan.lots:
            before_m = lot.frame.point(0.05, 0.0)[None]
            behind_m = lot.frame.point(-0.1, 0.0)[None]
            assert any(area.contains(before_m)[0] for area in areas)
            assert not any(area.contains(behind_m)[0] for area in areas)


def test_a_kerb_has_a_road_on_one_side_and_a_pavement_on_the_other(plans: list[StreetPlan]) -> None:
    for plan in plans:
        for kerb in plan.kerbs:
            middle_m = (kerb.start_m + kerb.end_m) / 2
            along = (kerb.end_m - kerb.start_m) / np.linalg.norm(kerb.end_m - kerb.start_m)
            across = 0.05 * np.array([-along[1], along[0]])
            sides = [middle_m + across, middle_m - across]
            is_road = [any(area.contains(point[None])[0] for area in plan.roads) for point in sides]
            is_pavement = [any(area.contains(point[None])[0] for area in plan.pavements) for point in sides]
            assert sorted(is_road) == sorted(is_pavement) == [False, True]
            assert is_road != is_pavement


def test_pavements_are_a_kerb_above_the_roads(plans: list[StreetPlan]) -> None:
    assert {area.height_m for plan in plans for area in plan.roads} == {0.0}
    assert {area.height_m for plan in plans for area in plan.pavements} == {KERB_M}


def test_plans_have_bends_side_streets_and_parking_of_all_kinds(plans: list[StreetPlan]) -> None:
    assert {len(plan.segments) for plan in plans} == {1, 2, 3}
    assert {len(plan.parking) for plan in plans} == {0, 1, 2}
    assert {bool(plan.side_streets) for plan in plans} == {False, True}
