"""Who performs a plan, and what its display is shown."""

import json

import pytest

from vobench.errors import InputError
from vobench.runner import launch
from vobench.runner.executor import LocalProcesses, Serial
from vobench.runner.launch import default_jobs, make_executor, run_plan, typical_seconds
from vobench.runner.store import SilentProgress, Store


class Recorder:
    """A display that keeps what it is shown."""

    def __init__(self):
        self.began, self.events, self.entered = None, [], 0

    def __enter__(self):
        self.entered += 1
        return self

    def __exit__(self, *_):
        self.entered -= 1

    def begin(self, tasks, seconds):
        self.began = (list(tasks), dict(seconds))

    def hear(self, event):
        self.events.append(event)

    def say(self, sentence): ...


def run(bench, tmp_path, monkeypatch, display, **options):
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    return run_plan(bench.plan(), out=tmp_path / "runs", finish=lambda *_: None, display=display, jobs=1, **options)


def test_a_display_is_told_of_every_task_and_left_at_the_end(bench, tmp_path, monkeypatch):
    display = Recorder()
    run(bench, tmp_path, monkeypatch, display)
    tasks, seconds = display.began
    assert seconds == {}
    assert {event.task.key for event in display.events if event.what == "done"} == {task.key for task in tasks}
    assert display.entered == 0

    again = Recorder()
    run(bench, tmp_path, monkeypatch, again)
    assert again.began[0] == again.events == []
    assert again.began[1].keys() >= {"bake", "sequence", "estimate"}


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_made(bench, tmp_path, monkeypatch):
    (tmp_path / "runs").write_text("a file")
    with pytest.raises(InputError, match=r"^out should be a folder that can be written \(.*\): .*runs"):
        run(bench, tmp_path, monkeypatch, Recorder())
    assert not (tmp_path / "cache").exists()


def test_one_job_runs_in_this_process_and_several_in_others():
    assert isinstance(make_executor(1, None, SilentProgress()), Serial)
    several = make_executor(3, None, SilentProgress())
    assert isinstance(several, LocalProcesses)
    assert several.slots == 3


def test_the_environment_says_how_many_jobs_there_are(monkeypatch):
    monkeypatch.setenv("VOBENCH_JOBS", "3")
    assert default_jobs() == 3
    monkeypatch.setenv("VOBENCH_JOBS", "0")
    with pytest.raises(InputError, match="VOBENCH_JOBS should be a number of tasks, 1 or more, got '0'"):
        default_jobs()


def test_by_default_there_is_a_job_a_core_and_no_more_than_eight(monkeypatch):
    monkeypatch.delenv("VOBENCH_JOBS", raising=False)
    for cores, jobs in ((1, 1), (5, 5), (64, 8)):
        monkeypatch.setattr(launch.os, "sched_getaffinity", lambda _, n=cores: set(range(n)))
        assert default_jobs() == jobs


def test_typical_seconds_are_medians_of_the_stages_that_were_timed(tmp_path):
    store = Store(tmp_path)
    for seconds in (1.0, 2.0, 40.0):
        store.note_seconds("bake", seconds)
    assert json.loads(json.dumps(typical_seconds(tmp_path))) == {"bake": 2.0}
