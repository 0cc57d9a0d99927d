"""Whether a run is unchanged: any changed file is found, and the difference is named."""

import json

import numpy as np
import pytest

from vobench.report.practice import PRACTICES
from vobench.report.verify import first_difference, verify_run
from vobench.runner.estimate import ESTIMATE, REVISED
from vobench.runner.folder import CASE, SCORE, SEQUENCE, write_hashes
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.score import score_estimate
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum


def path(error_m):
    turn = np.linspace(0, 2, 30)
    T = np.tile(np.eye(4), (30, 1, 1))
    T[:, 0, 3] = turn
    T[:, 1, 3] = turn**2 / 4 + error_m * np.sin(9 * turn)
    return Trajectory(np.arange(30, dtype=np.int64) * 100_000_000, T)


def as_json(scored):
    return json.loads(json.dumps(scored.as_dict()))


@pytest.fixture
def folder(scored, write_run, tmp_path):
    """A run with one trial whose score is that of its estimate and of its revised estimate, and with hashes."""
    truth = path(0.0)
    score = as_json(score_estimate(path(0.02), truth, ()))
    revised = as_json(score_estimate(path(0.01), truth, ()))
    run = write_run(tmp_path / "run", [scored("a", score=score, revised=revised, frames=30)])
    place = run.estimate("down", "a", 0)
    (run.case("down") / GROUND_TRUTH).write_text(format_tum(truth))
    (place / ESTIMATE).write_text(format_tum(path(0.02)))
    (place / REVISED).write_text(format_tum(path(0.01)))
    write_hashes(run)
    return run


def faults(run):
    return {(item.kind, item.what): item.wrong for item in verify_run(run) if item.wrong}


def edit(file, change):
    file.write_text(change(file.read_text()))


def edit_score(run, change):
    file = run.estimate("down", "a", 0) / SCORE
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    write_hashes(run)


SEQUENCE_IS_GONE = {
    ("ground truth", "down"): "its sequence is no longer in the cache; run the suite again to recreate it"
}


def test_an_unchanged_run_lacks_nothing_but_its_sequence(folder):
    assert faults(folder) == SEQUENCE_IS_GONE
    kinds = [item.kind for item in verify_run(folder)]
    assert kinds == sorted(kinds, key=["hash", "ground truth", "cache", "score"].index)
    assert ("score", "a on down, 0") in {(item.kind, item.what) for item in verify_run(folder)}


def test_a_changed_and_a_missing_file_are_found_by_their_hashes(folder):
    place = folder.estimate("down", "a", 0)
    edit(place / "times.csv", lambda text: text + "\n")
    (place / "frames.csv").unlink()
    found = faults(folder)
    assert found["hash", "cases/down/estimates/a/0/times.csv"] == "the file has changed since the run wrote it"
    assert found["hash", "cases/down/estimates/a/0/frames.csv"] == "the file is missing"


def test_a_changed_score_is_found_by_its_estimate_even_with_a_new_hash(folder):
    def change(content):
        content["score"]["metrics"][0]["rmse"] = 9.0

    edit_score(folder, change)
    (sentence,) = [wrong for (kind, _), wrong in faults(folder).items() if kind == "score"]
    assert sentence.startswith("the score differs: metrics ate_trans rmse: 9 is stated, 0.0")
    assert sentence.endswith(" is computed")


def test_so_is_a_changed_score_of_the_revised_poses(folder):
    def change(content):
        content["revised"]["coverage"] = 0.5

    edit_score(folder, change)
    assert faults(folder)["score", "a on down, 0"] == "the score differs: coverage: 0.5 is stated, 1 is computed"


def test_a_score_without_its_estimate_is_computed_from_nothing(folder):
    (folder.estimate("down", "a", 0) / ESTIMATE).unlink()
    write_hashes(folder)
    wrong = faults(folder)["score", "a on down, 0"]
    assert wrong.startswith("the score differs: all of it: ")
    assert wrong.endswith(" entries is stated, nothing is computed")


def test_a_trial_that_never_began_has_nothing_to_compare(folder):
    def change(content):
        content.update(score=None, revised=None, frames=0)

    edit_score(folder, change)
    assert faults(folder) == SEQUENCE_IS_GONE


def test_a_score_that_the_hashes_do_not_list_is_not_part_of_the_run(folder):
    (folder.case("down") / "estimates" / "mine").symlink_to("a")
    assert faults(folder)["score", "mine on down, 0"] == "not part of the run: its hashes do not list this file"


def test_a_score_that_cannot_be_read_is_a_fault_of_its_own(folder):
    edit(folder.estimate("down", "a", 0) / SCORE, lambda text: "{" + text)
    assert "not a score as vobench writes it" in faults(folder)["score", "a on down, 0"]


@pytest.fixture
def recorded(folder):
    """The same run with a sequence, whose path is the ground truth."""
    sequence = PRACTICES["drive"].write(folder.path / "cache" / "sequence")
    (folder.case("down") / SEQUENCE).symlink_to(sequence)
    (folder.case("down") / CASE).write_text("{}")
    (folder.case("down") / GROUND_TRUTH).write_text((sequence / GROUND_TRUTH).read_text())
    return folder


def truth_fault(run):
    return faults(run).get(("ground truth", "down"))


def test_a_truth_that_is_the_recorded_path_is_right_and_another_one_is_not(recorded):
    assert truth_fault(recorded) is None
    edit(recorded.case("down") / GROUND_TRUTH, lambda text: text.replace(" 0.255 ", " 0.256 ", 1))
    assert truth_fault(recorded) == "ground_truth.tum differs from the path in the sequence"


def test_a_truth_with_noise_is_compared_with_the_noise_of_its_case(recorded):
    noise = {"truth_noise": {"position_m": 0.001, "rotation_deg": 0.0}, "seed": 3, "frames": None}
    (recorded.case("down") / CASE).write_text(json.dumps(noise))
    assert truth_fault(recorded) == "ground_truth.tum differs from the path in the sequence"
    (recorded.case("down") / CASE).write_text(json.dumps({**noise, "truth_noise": None}))
    assert truth_fault(recorded) is None


def test_settings_that_cannot_be_read_are_a_fault(recorded):
    (recorded.case("down") / CASE).write_text("{")
    assert "Expecting property name" in truth_fault(recorded)


def test_a_file_of_a_sequence_that_is_gone_says_how_to_get_it_back(recorded):
    write_hashes(recorded)
    (recorded.case("down") / SEQUENCE).unlink()
    gone = "the file is no longer in the cache; run the suite again to recreate it"
    assert faults(recorded)["hash", "cases/down/sequence/sensors.mcap"] == gone


def test_a_case_that_was_never_simulated_has_no_truth_to_miss(folder):
    (folder.case("down") / GROUND_TRUTH).unlink()
    assert truth_fault(folder) is None


@pytest.mark.parametrize(
    ("stated", "computed", "sentence"),
    [
        ({"a": 1}, {"a": 1}, ""),
        ({"a": {"b": [1, 2]}}, {"a": {"b": [1, 3]}}, "a b 1: 2 is stated, 3 is computed"),
        ([{"name": "x", "v": 1.5}], [{"name": "x", "v": 2.5}], "x v: 1.5 is stated, 2.5 is computed"),
        ({"a": 1, "b": 2}, {"a": 0, "b": 0}, "a: 1 is stated, 0 is computed"),
        ({"a": 1}, {"b": 1}, "all of it: 1 entries is stated, 1 entries is computed"),
        ([1], [1, 2], "all of it: 1 entries is stated, 2 entries is computed"),
        ({"a": None}, {"a": "x"}, "a: nothing is stated, 'x' is computed"),
    ],
)
def test_the_first_difference_of_two_values_is_named_with_its_path(stated, computed, sentence):
    assert first_difference(stated, computed) == sentence
