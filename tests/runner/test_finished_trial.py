"""A trial of a run, read back and run again on variants of its case."""

import shutil
from dataclasses import replace

import pytest

from vobench.errors import InputError, SuiteError, UnknownNameError
from vobench.runner.finished_trial import read_finished_trial, read_simulated_case, run_variants


@pytest.fixture
def run_plan(bench):
    """Runs a plan as every other of these tests."""
    return lambda plan, /: bench.run_plan(plan, root=bench.folder / "variants", cache="cache")


def test_a_trial_is_found_by_its_name_by_its_repeat_and_by_its_folder(first):
    by_name = read_finished_trial(first.path / "dim" / "wheel_odometry")
    by_repeat = read_finished_trial(first.path / "dim" / "wheel_odometry" / "0")
    by_folder = read_finished_trial(first.estimate("dim", "wheel_odometry", 0))
    assert by_name == by_repeat == by_folder
    assert by_name.path == first.estimate("dim", "wheel_odometry", 0)


def test_case_estimator_and_suite_are_those_of_the_plan(bench, first):
    plan = bench.plan()
    trial = read_finished_trial(first.path / "dim" / "wheel_odometry")
    assert trial.case == next(case for case in plan.simulated if case.name == "dim")
    assert trial.estimator_entry == plan.estimator_entries[0]
    assert trial.suite == plan.suite


@pytest.mark.parametrize(
    ("path", "kind", "sentence"),
    [
        ("dark/wheel_odometry", UnknownNameError, "no case named 'dark'"),
        ("dim/wheels", UnknownNameError, "no estimator named 'wheels'"),
        ("dim/wheel_odometry/3", InputError, "no repeat 3 of wheel_odometry on dim"),
    ],
)
def test_a_trial_that_is_not_there_is_a_sentence_that_names_the_run(first, path, kind, sentence):
    with pytest.raises(kind) as raised:
        read_finished_trial(first.path / path)
    assert sentence in str(raised.value)
    assert str(first.path) in str(raised.value)


def test_a_word_is_no_trial(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="is named as RUN/CASE/ESTIMATOR, got quickstart"):
        read_finished_trial(type(tmp_path)("quickstart"))


def test_an_estimator_that_has_changed_since_the_run_is_told_of(first, tmp_path):
    trial = read_finished_trial(first.path / "dim" / "wheel_odometry")
    changed = tmp_path / "wheel_odometry"
    shutil.copytree(trial.estimator_entry.folder, changed)
    (changed / "notes.txt").write_text("changed")
    heard = []

    class Listening:
        def say(self, sentence):
            heard.append(sentence)

    again = read_finished_trial(first.path / "dim" / "wheel_odometry", estimator=changed, progress=Listening())
    assert again.estimator_entry.folder == changed
    (sentence,) = heard
    assert sentence == f"{changed} has changed since the run, whose wheel_odometry this is"


def test_a_recording_and_a_case_of_another_version_cannot_be_simulated(first, tmp_path):
    copied = tmp_path / "run"
    shutil.copytree(first.path, copied, symlinks=True)
    folder = replace(first, path=copied)
    (folder.case("dim") / "case.json").write_text('{"source": {}}')
    with pytest.raises(InputError, match="'dim' is a recording"):
        read_simulated_case(folder, "dim")
    (folder.case("dim") / "case.json").write_text('{"name": "dim"}')
    with pytest.raises(InputError, match="of another vobench, whose cases"):
        read_simulated_case(folder, "dim")


def test_variants_are_run_under_their_names_with_the_estimator_alone(first, run_plan):
    trial = read_finished_trial(first.path / "dim" / "stand_still")
    shorter = replace(trial.case, frames=(0, 4))
    folder = run_variants(trial, {"whole": trial.case, "part": shorter}, name="again", run_plan=run_plan)
    assert folder.path.parent.name == "again"
    scores = {score.case: score for score in folder.scores()}
    assert {score.estimator for score in scores.values()} == {"stand_still"}
    assert scores["part"].frames == 4
    # The same case gives the same score, byte for byte.
    assert scores["whole"].score == trial.score.score


def test_a_variant_that_cannot_be_simulated_is_refused_before_anything_is_run(first):
    def never(plan, /):
        raise AssertionError("nothing should be run")

    trial = read_finished_trial(first.path / "dim" / "stand_still")
    impossible = replace(trial.case, frames=(0, 10_000))
    with pytest.raises(SuiteError, match="frames should be"):
        run_variants(trial, {"too_long": impossible}, name="again", run_plan=never)
