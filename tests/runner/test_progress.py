"""A run's progress counts every task once, and its time left follows what tasks really take."""

import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from vobench.runner.executor import TaskEvent
from vobench.runner.progress import RunProgress, spell_time


def task(key: str, stage: str, *needs: str) -> Any:
    return SimpleNamespace(key=key, stage=stage, needs=needs, name=key)


CHAIN = [
    task("light", "bake"),
    task("a", "sequence", "light"),
    task("b", "sequence", "light"),
    task("est_a", "estimate", "a"),
    task("est_b", "estimate", "b"),
]


def done(of: Any, wall_s: float) -> TaskEvent:
    return TaskEvent("done", of, slot=0, wall_s=wall_s)


def test_a_started_task_is_not_done():
    progress = RunProgress(CHAIN)
    progress.count(TaskEvent("started", CHAIN[0], slot=0))
    assert (progress.finished, progress.planned, progress.share) == (0, 5, 0.0)


def test_the_share_is_by_seconds_where_every_stage_has_been_timed():
    progress = RunProgress(CHAIN, {"bake": 30.0, "sequence": 5.0, "estimate": 5.0})
    progress.count(done(CHAIN[0], 30.0))
    assert progress.share == pytest.approx(30 / 50)


def test_the_share_is_by_tasks_where_a_stage_has_never_been_timed():
    progress = RunProgress(CHAIN, {"bake": 30.0})
    progress.count(done(CHAIN[0], 30.0))
    assert progress.share == pytest.approx(1 / 5)


def test_a_failed_task_takes_all_that_need_it_with_it():
    progress = RunProgress(CHAIN)
    progress.count(TaskEvent("failed", CHAIN[0], slot=0, reason="no driver"))
    assert (progress.finished, progress.share) == (5, 1.0)


def test_the_time_left_is_not_told_before_it_is_known():
    progress = RunProgress(CHAIN, {"bake": 30.0})
    assert progress.left_s(0.0) is None
    assert progress.describe(0.0) == "task 1 of 5 · 0 %"


def test_the_time_left_follows_what_tasks_took_in_this_run_and_how_many_ran_at_once():
    progress = RunProgress(CHAIN, {"bake": 30.0, "sequence": 5.0, "estimate": 5.0})
    progress.count(done(CHAIN[0], 10.0))
    progress.count(done(CHAIN[1], 20.0))
    # One sequence of 20 s as in this run, and two estimates of 5 s as in earlier ones, two tasks at once.
    assert progress.left_s(elapsed_s=15.0) == pytest.approx((20 + 2 * 5) / 2)


def test_at_the_end_nothing_is_left():
    progress = RunProgress(CHAIN)
    for each in CHAIN:
        progress.count(done(each, 1.0))
    assert progress.describe(5.0) == "task 5 of 5 · 100 % · 0:00 left"


@pytest.mark.parametrize(("seconds", "spelled"), [(0, "0:00"), (59.6, "1:00"), (61, "1:01"), (3661, "1:01:01")])
def test_times_are_spelled_as_on_a_clock(seconds, spelled):
    assert spell_time(seconds) == spelled


def test_who_shows_progress_imports_nothing_that_performs_tasks():
    code = "import sys, vobench.runner.progress; print('vobench.runner.executor' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "False\n"
