"""The option groups of vobench run."""

from types import SimpleNamespace

import pytest

from vobench.cli.run import Changes, Execution, TrialLimits
from vobench.errors import InputError


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
