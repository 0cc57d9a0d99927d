"""Draws of a suite: other places, drives and noise each time, and the same ones for the same numbers."""

import pytest

from vobench.errors import SuiteError
from vobench.suite.draw import DRAWS, SEEDS_PER_DRAW, Draws, joined, random_base_seed
from vobench.suite.suite_spec import LARGEST_BASE_SEED

SUITE = """name: drawn
seed: 3
scenes: [{name: flat, seeds: 2}]
trajectories: {tour: {kind: wander, body: pioneer, length_m: 2, seeds: 3}}
estimators: [wheel_odometry, lk_epipolar]
"""


@pytest.fixture
def suite(tmp_path):
    path = tmp_path / "drawn.yaml"
    path.write_text(SUITE)
    return str(path)


def places(plan):
    return {case.variant["scene"] for case in plan.simulated}


def drives(plan):
    return {case.variant["trajectory"] for case in plan.simulated}


def test_draws_follow_each_other_without_a_common_place_drive_or_noise(suite):
    draws = Draws(suite, {})
    first, second, third = (draws.plan(number) for number in range(3))
    assert places(first) == {"flat.1", "flat.2"}
    assert places(second) == {"flat.4", "flat.5"}  # three seeds of drives are used up
    assert not places(first) & places(second) | places(second) & places(third)
    assert not drives(first) & drives(second) | drives(second) & drives(third)
    assert [plan.suite.seed for plan in (first, second, third)] == [3, 4, 5]


def test_the_same_draw_has_the_same_cases(suite):
    draws = Draws(suite, {"base_seed": "20000"})
    assert draws.plan(1).simulated == draws.plan(1).simulated
    assert places(draws.plan(0)) == {"flat.20001", "flat.20002"}


def test_the_estimators_of_every_draw_are_those_that_are_asked_for(suite):
    draws = Draws(suite, {}, ("wheel_odometry",))
    assert [[entry.label for entry in draws.plan(number).estimator_entries] for number in (0, 1)] == [
        ["wheel_odometry"],
        ["wheel_odometry"],
    ]


def test_a_suite_without_seeds_of_places_cannot_be_drawn_from(tmp_path):
    path = tmp_path / "fixed.yaml"
    path.write_text("name: fixed\nscenes: [room]\nestimators: [lk_epipolar]\n")
    with pytest.raises(SuiteError, match="fresh units require places that can be drawn"):
        Draws(str(path), {}).plan(0)


def test_joined_draws_have_all_cases_under_names_of_their_own(suite):
    draws = Draws(suite, {})
    first, second = draws.plan(0), draws.plan(1)
    both = joined([first, second])
    assert len(both.simulated) == len(first.simulated) + len(second.simulated)
    twice = joined([first, first])
    names = [case.name for case in twice.simulated]
    assert len(set(names)) == len(names) == 2 * len(first.simulated)


def test_random_base_seeds_leave_room_for_draws_below_the_largest():
    seeds = {random_base_seed() for _ in range(20)}
    assert len(seeds) > 1
    assert all(seed % SEEDS_PER_DRAW == 0 for seed in seeds)
    assert all(0 < seed < LARGEST_BASE_SEED for seed in seeds)
    assert (DRAWS + 1) * SEEDS_PER_DRAW < LARGEST_BASE_SEED


def test_a_suite_may_be_run_with_any_random_base_seed(suite):
    seed = random_base_seed()
    plan = Draws(suite, {"base_seed": str(seed)}).plan(0)
    assert places(plan) == {f"flat.{seed + 1}", f"flat.{seed + 2}"}
