"""The option groups of vobench run."""

from types import SimpleNamespace

import pytest

from vobench.cli.run import Changes, Execution, TrialLimits
from vobench.errors import InputError, SuiteError
from vobench.suite.draw import SEEDS_PER_DRAW
from vobench.suite.suite import read_plan
from vobench.suite.suite_spec import LARGEST_BASE_SEED


@pytest.mark.parametrize(
    ("options", "is_serial"),
    [
        ({"jobs": 1}, True),
        ({"jobs": 2}, False),
        ({}, False),
        ({"jobs": 1, "scheduler": "tcp://host:8786"}, False),
    ],
)
def test_one_job_in_this_process_is_serial(options, is_serial):
    assert Execution(**options).is_serial is is_serial


class Planned:
    """Records the limits that a plan is given."""

    def __init__(self):
        self.limits = None

    def limited(self, **limits):
        self.limits = limits
        return self


@pytest.mark.parametrize(
    ("options", "limits"),
    [
        ({}, {}),
        ({"timeout": 3.0}, {"trial_s": 3.0}),
        ({"memory": 512}, {"memory_mib": 512}),
        ({"timeout": 3.0, "memory": 512}, {"trial_s": 3.0, "memory_mib": 512}),
    ],
)
def test_only_the_limits_that_are_given_are_set(options, limits):
    plan = Planned()
    assert TrialLimits(**options).apply(plan) is plan
    assert plan.limits == limits


def test_a_number_of_frames_cuts_the_plan(monkeypatch):
    monkeypatch.setattr("vobench.cli.run.cut", lambda plan, frames: SimpleNamespace(plan=plan, frames=frames))
    plan = Planned()
    assert TrialLimits(limit=5).apply(plan).frames == 5


@pytest.mark.parametrize(
    ("options", "values"),
    [
        ({}, {}),
        ({"changes": ["seed=3"]}, {"seed": "3"}),
        ({"changes": ["a.b=x=y", "c="]}, {"a.b": "x=y", "c": ""}),
        ({"repeats": 2}, {"repeats": "2"}),
        ({"changes": ["repeats=5"], "repeats": 2}, {"repeats": "2"}),
    ],
)
def test_changes_are_values_by_key_and_repeats_is_one_of_them(options, values):
    assert Changes(**options).values("quickstart") == values


def test_a_change_without_an_equals_sign_is_refused():
    with pytest.raises(InputError, match=r"--set should be key=value, as in rigs\.ahead\.pitch_deg=20, got 'seed'"):
        Changes(changes=["seed"]).values("quickstart")


SPREAD = """name: cells
scenes: [{name: flat, seeds: 4}, room]
trajectories: {tour: {kind: wander, length_m: 3, seeds: 1}}
spread: {units: 5, each: 2}
estimators: [stand_still]
"""


@pytest.fixture
def spread_suite(tmp_path):
    path = tmp_path / "cells.yaml"
    path.write_text(SPREAD)
    return str(path)


def test_more_units_have_more_seeds_of_the_places_and_not_of_other_scenes(spread_suite):
    changes = Changes(units=10).values(spread_suite)
    assert changes == {"spread.units": "10", "scenes.0.seeds": "12"}  # eight flats and the room are nine
    plan = read_plan(spread_suite, changes=changes)
    assert plan.suite.spread.units == 10
    assert all(case.scene.generated or case.variant["scene"] == "room" for case in plan.simulated)


def test_fewer_units_leave_the_places_as_they_are(spread_suite):
    assert Changes(units=3).values(spread_suite) == {"spread.units": "3"}


def test_units_of_a_suite_without_a_design_are_refused():
    with pytest.raises(SuiteError, match="--units is for suites with `spread`, and this suite has none"):
        Changes(units=3).values("regression")


def test_fresh_units_have_a_base_seed_of_their_own_that_is_far_from_any_other():
    drawn = [int(Changes(fresh_units=True).values("quickstart")["base_seed"]) for _ in range(20)]
    assert len(set(drawn)) > 15
    assert all(seed >= SEEDS_PER_DRAW and seed % SEEDS_PER_DRAW == 0 for seed in drawn)
    assert max(drawn) <= LARGEST_BASE_SEED
