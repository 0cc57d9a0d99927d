"""Which trials are written to which files, and how the viewer is started."""

import json
import sys

import pytest

from vobench.errors import InputError, MissingDependencyError
from vobench.report import viewer
from vobench.report.viewer import open_viewer, save_recordings


@pytest.fixture
def saved(monkeypatch):
    """The paths and the titles of what would be written."""
    written = []

    def name_of(folder, trial, window, position):
        return trial.estimator, trial.case, trial.repeat

    monkeypatch.setattr(viewer, "trial_view", name_of)
    monkeypatch.setattr(viewer, "save_trial", lambda path, *views, form: written.append((path, views, form)))
    return written


@pytest.fixture
def folder(scored, write_run, tmp_path):
    trials = [scored("a", repeat=n, ate_m=0.1 * (n + 1)) for n in range(2)]
    trials += [scored("b", repeat=n, ate_m=0.5 + n) for n in range(2)]
    return write_run(tmp_path / "run", [*trials, scored("a", case="ahead", ate_m=0.9)])


def test_one_trial_goes_beside_its_estimate(saved, folder):
    (recording,) = save_recordings(folder, case="down", estimator="a")
    assert recording.path == folder.estimate("down", "a", 1) / "run.rrd"
    assert saved == [(recording.path, (("a", "down", 1),), "jpeg")]
    assert [trial.estimator for trial in recording.trials] == ["a"]


def test_two_estimators_are_compared_on_the_same_case_and_repeat(saved, folder):
    (recording,) = save_recordings(folder, case="down", compare=("a", "b"), form="png")
    assert recording.path == folder.estimate("down", "a", 1) / "compare.rrd"
    assert saved[0][1:] == ((("a", "down", 1), ("b", "down", 1)), "png")


def test_without_the_same_repeat_the_worst_one_of_the_other_is_compared(saved, scored, write_run, tmp_path):
    trials = [scored("a", repeat=7), *(scored("b", repeat=n, ate_m=0.1 + n) for n in range(2))]
    save_recordings(write_run(tmp_path / "other", trials), compare=("a", "b"))
    assert saved[0][1] == (("a", "down", 7), ("b", "down", 1))


def test_the_worst_trials_are_files_of_their_own(saved, folder, tmp_path):
    recordings = save_recordings(folder, worst=2, save=tmp_path / "look.rrd")
    assert [recording.path.name for recording in recordings] == ["look_down_b_1.rrd", "look_ahead_a_0.rrd"]
    beside = save_recordings(folder, worst=2)
    assert [recording.path for recording in beside] == [
        folder.estimate("down", "b", 1) / "run.rrd",
        folder.estimate("ahead", "a", 0) / "run.rrd",
    ]


def test_a_view_knows_the_position_of_its_estimator_in_the_suite(saved, folder, monkeypatch):
    positions = {}

    def with_position(folder, trial, window, position):
        positions[trial.estimator] = position
        return trial.estimator

    monkeypatch.setattr(viewer, "trial_view", with_position)
    save_recordings(folder, case="down", compare=("b", "a"))
    assert positions == {"a": 0, "b": 1}  # the run lists none, so the order is that of names
    (folder.path / "estimators.json").write_text(json.dumps([{"label": "b"}, {"label": "a"}]))
    save_recordings(folder, case="down", compare=("a", "b"))
    assert positions == {"b": 0, "a": 1}


def test_a_file_that_is_named_is_written(saved, folder, tmp_path):
    (recording,) = save_recordings(folder, save=tmp_path / "look.rrd")
    assert recording.path == tmp_path / "look.rrd"


def test_a_folder_and_a_place_that_cannot_be_written_are_refused(saved, folder, tmp_path):
    with pytest.raises(InputError, match="--save should name a file, but this is a folder: "):
        save_recordings(folder, save=tmp_path)
    with pytest.raises(InputError, match="--save should name a file in a folder that can be written to, got "):
        save_recordings(folder, save=tmp_path / "missing" / "look.rrd")
    assert saved == []


@pytest.fixture
def commands(monkeypatch):
    started = []
    monkeypatch.setattr(viewer.subprocess, "run", lambda command, check: started.append(("run", command)))
    monkeypatch.setattr(
        viewer.subprocess, "Popen", lambda command, start_new_session: started.append(("open", command))
    )
    return started


def test_the_web_viewer_serves_this_machine_alone_and_needs_no_display(commands, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    open_viewer([tmp_path / "a.rrd"], web=True)
    ((how, command),) = commands
    assert how == "run"
    assert command[-4:] == ["--serve-web", "--bind", "127.0.0.1", str(tmp_path / "a.rrd")]


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_on_a_display_the_viewer_opens_all_files(commands, tmp_path, monkeypatch, variable):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv(variable, ":0")
    open_viewer([tmp_path / "a.rrd", tmp_path / "b.rrd"])
    assert commands == [("open", [*viewer.RERUN, str(tmp_path / "a.rrd"), str(tmp_path / "b.rrd")])]


def test_without_a_display_the_command_for_another_machine_is_given(commands, monkeypatch, tmp_path):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(MissingDependencyError, match=r"there is no display .* run: rerun a\.rrd b\.rrd \(or use --web"):
        open_viewer(["a.rrd", "b.rrd"])
    monkeypatch.setattr(sys, "platform", "darwin")
    open_viewer(["a.rrd"])
    assert len(commands) == 1
