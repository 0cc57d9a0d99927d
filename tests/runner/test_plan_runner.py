"""What an analysis may rely on when it runs a plan, held by the plan runner that vobench makes."""

from pathlib import Path

import pytest

from vobench.dataset.export import export
from vobench.errors import NoSequenceError
from vobench.runner import simulate
from vobench.runner.folder import SEQUENCE
from vobench.runner.launch import plan_runner
from vobench.runner.plan_runner import PlanRunner
from vobench.suite.suite import read_plan


class Display:
    """A display that says nothing and counts the blocks that it was opened for."""

    def __init__(self):
        self.opened = 0

    def __enter__(self):
        self.opened += 1
        return self

    def __exit__(self, *_): ...
    def begin(self, tasks, seconds): ...
    def hear(self, event): ...
    def say(self, sentence): ...


@pytest.fixture
def displays():
    """The displays that were made, in their order."""
    return []


@pytest.fixture
def make(bench, first, displays, monkeypatch, tmp_path):
    """Makes a plan runner whose cache holds what the first run made."""
    monkeypatch.setenv("VOBENCH_CACHE", str(bench.folder / "cache"))

    def make_display():
        displays.append(Display())
        return displays[-1]

    def make(**options) -> PlanRunner:
        return plan_runner(out=tmp_path / "runs", jobs=1, make_display=make_display, **options)

    return make


def names(folder):
    return sorted((score.case, score.estimator, score.repeat) for score in folder.scores())


def test_every_trial_of_a_plan_is_scored_in_a_folder_below_out(bench, make, tmp_path):
    plan = bench.plan()
    folder = make()(plan)
    trials = [trial for case in plan.cases for trial in plan.trials(case)]
    assert names(folder) == sorted((t.case.name, t.estimator_entry.label, t.repeat) for t in trials)
    assert folder.path.is_relative_to(tmp_path / "runs")


def test_each_plan_has_its_own_folder_and_its_own_display_and_equal_plans_equal_scores(bench, make, displays):
    run_plan = make()
    one = run_plan(bench.plan())
    again = run_plan(bench.plan())
    assert one.path != again.path
    assert one.scores() == again.scores()
    assert [display.opened for display in displays] == [1, 1]


def test_reports_are_those_of_finish_and_there_are_none_by_default(bench, make):
    finished = []
    folder = make(finish=lambda *given: finished.append(given))(bench.plan())
    ((of_folder, scores),) = finished
    assert sorted(score.case for score in scores) == sorted(score.case for score in folder.scores())
    assert isinstance(of_folder.path, Path)
    assert not list(make()(bench.plan()).path.glob("leaderboard*"))


def test_recordings_of_a_plan_are_read_without_being_asked_for(first, make, tmp_path):
    export((first.case("full") / SEQUENCE).resolve(), tmp_path / "kitti", "kitti")
    suite = tmp_path / "real.yaml"
    suite.write_text("name: real\nsource: kitti\nestimators: [stand_still]\n")
    folder = make()(read_plan(str(suite)))
    assert names(folder) == [("kitti", "stand_still", 0)]


def test_a_plan_of_which_a_case_is_missing_is_no_finished_run(bench, make, monkeypatch):
    def refuse(case, folder, *, light, progress):
        raise OSError(5, "the driver is gone")

    monkeypatch.setattr(simulate, "simulate", refuse)
    unmade = bench.plan(("dim: {lamp: {power_lm: 150}}", "dim: {lamp: {power_lm: 151}}"))  # full is in the cache
    with pytest.raises(NoSequenceError, match="the driver is gone"):
        make()(unmade)
