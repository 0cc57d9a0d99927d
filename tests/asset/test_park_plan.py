"""Plans of parks: gentle ground, a pond apart from the paths and below its shore, loops that close."""

import numpy as np
import pytest

from vobench.asset.park_plan import SHORE_M, STEP_M, ParkGround, ParkPlan, Pond, park_plan
from vobench.asset.site import polygon_area_m2


@pytest.fixture(scope="module")
def plans() -> list[ParkPlan]:
    return [park_plan(np.random.default_rng([seed, 0])) for seed in range(40)]


def round_pond(radius_m: float = 5.0, depth_m: float = 0.9) -> Pond:
    return Pond(np.array([2.0, -1.0]), radius_m, np.zeros((0, 3)), depth_m)


def test_the_share_of_a_round_pond_is_the_distance_over_its_radius() -> None:
    points_m = np.array([[2.0, -1.0], [7.0, -1.0], [2.0, 9.0]])
    assert round_pond().share(points_m) == pytest.approx([0.0, 1.0, 2.0])


def test_the_shore_of_a_pond_with_lobes_has_its_mean_radius() -> None:
    pond = Pond(np.zeros(2), 5.0, np.array([[2, 0.1, 0.3], [3, 0.05, 1.0]]), 0.9)
    bearings_rad = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    shore_m = pond.shore_m(bearings_rad)
    assert shore_m.mean() == pytest.approx(5.0)
    assert shore_m.max() <= 5.0 * 1.15
    outline_m = pond.center_m + shore_m[:, None] * np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], 1)
    assert pond.share(outline_m) == pytest.approx(np.ones(360))


def test_ground_without_waves_and_rim_is_level_outside_of_a_pond_and_hollow_in_it() -> None:
    pond = round_pond()
    ground = ParkGround((30.0, 25.0), np.zeros((0, 4)), 0.0, pond, 0.0)
    assert ground.at(20.0, 10.0) == 0.0
    assert ground.at(2.0, -1.0) == pytest.approx(-pond.depth_m)
    assert ground.water_m == pytest.approx(-SHORE_M)
    assert np.isnan(ground.heights_m(np.array([[2.0, -1.0]])))[0]


def test_the_water_meets_the_ground_near_the_shore() -> None:
    ground = ParkGround((30.0, 25.0), np.zeros((0, 4)), 0.0, round_pond(), 0.0)
    along_m = np.linspace(0, 10, 1001)
    height_m = ground.surface_m(np.column_stack([2.0 + along_m, np.full(1001, -1.0)]))
    edge_m = along_m[np.argmax(height_m > ground.water_m)]
    assert 0.85 * 5.0 < edge_m < 1.15 * 5.0
    assert (np.diff(height_m) >= -1e-12).all()


def test_the_ground_is_gentle_on_and_beside_the_paths(plans: list[ParkPlan]) -> None:
    for plan in plans:
        for path in plan.paths:
            inner_m = path.points_m[np.max(np.abs(path.points_m) / plan.half_m, axis=1) < 0.8]
            slopes = []
            for step_m in (np.array([0.05, 0.0]), np.array([0.0, 0.05])):
                rise_m = plan.ground.surface_m(inner_m + step_m) - plan.ground.surface_m(inner_m - step_m)
                slopes.append(rise_m / 0.1)
            assert np.hypot(*slopes).max() < 0.4


def test_paths_keep_clear_of_the_water(plans: list[ParkPlan]) -> None:
    for plan in plans:
        if plan.ground.pond is None:
            continue
        for path in plan.paths:
            share = plan.ground.pond.share(path.points_m)
            assert share.min() > 1.2
            beside_m = path.points_m[share < 1.5]
            assert (plan.ground.surface_m(beside_m) > plan.ground.water_m + 0.02).all()


def test_loops_close_and_have_the_same_width_and_direction_at_both_ends(plans: list[ParkPlan]) -> None:
    for plan in plans:
        loop = plan.loop
        assert loop.points_m[0] == pytest.approx(loop.points_m[-1], abs=1e-9)
        assert loop.widths_m[0] == pytest.approx(loop.widths_m[-1])
        assert loop.directions[0] == pytest.approx(loop.directions[-1])


@pytest.mark.parametrize("seed", [10, 97, 107, 151, 372])  # whose first loops have bends sharper than they are wide
def test_the_inner_edge_of_a_loop_does_not_fold(seed: int) -> None:
    loop = park_plan(np.random.default_rng([seed, 0])).loop
    for side in (-0.5, 0.5):
        edge_m = loop.points_m + side * loop.widths_m[:, None] * loop.left
        ahead = (np.diff(edge_m, axis=0) * np.diff(loop.points_m, axis=0)).sum(axis=1)
        assert (ahead > 0).all()


def test_points_of_paths_are_evenly_spaced(plans: list[ParkPlan]) -> None:
    for plan in plans:
        for path in plan.paths:
            steps_m = np.linalg.norm(np.diff(path.points_m, axis=0), axis=1)
            assert steps_m == pytest.approx(np.full(len(steps_m), STEP_M), rel=0.1)


def test_the_areas_of_a_path_add_up_to_its_length_times_its_width(plans: list[ParkPlan]) -> None:
    for plan in plans[:8]:
        area_m2 = sum(polygon_area_m2(area.corners_m) for area in plan.loop.areas(plan.ground))
        assert area_m2 == pytest.approx(plan.loop.length_m * plan.loop.widths_m.mean(), rel=0.05)


def test_plans_differ_in_ponds_links_and_exits(plans: list[ParkPlan]) -> None:
    assert {plan.ground.pond is None for plan in plans} == {False, True}
    assert len({len(plan.paths) for plan in plans}) >= 3
    assert len({plan.half_m for plan in plans}) == len(plans)
