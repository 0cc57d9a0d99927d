"""Only a run whose hashes, true paths and scores are right is a submission, and only equal cases share a board."""

import json

import numpy as np
import pytest

from tests.forgery import forger_of
from vobench.errors import InputError
from vobench.runner.bundle import SEQUENCES, bundle
from vobench.runner.environment import Environment, Processor
from vobench.runner.folder import CASE, ENVIRONMENT, ESTIMATORS, SCORE, SUITE, RunFolder, TrialScore, write_hashes
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.runner.score import score_estimate
from vobench.runner.store import write_json
from vobench.runner.submission import opened_submission, why_not_comparable
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

FRAME_COUNT = 20
RECORDING = "cases/down/sequence/sensors.mcap"


def path(noise_m, seed=0):
    T = np.tile(np.eye(4), (FRAME_COUNT, 1, 1))
    T[:, :3, 3] = np.linspace(0, 1, FRAME_COUNT)[:, None] ** (1, 2, 3)
    T[:, :3, 3] += noise_m * np.random.default_rng(seed).normal(size=(FRAME_COUNT, 3))
    return Trajectory(np.arange(FRAME_COUNT) * 100_000_000, T)


@pytest.fixture
def packed(tmp_path):
    """Packs a run of a suite with cases that are not of this version, so that their true paths cannot be computed."""

    def pack(name="a", *, cases=("down", "ahead"), settings=None, truth_m=0.0, environment=None):
        folder = RunFolder(tmp_path / "runs" / name)
        folder.path.mkdir(parents=True)
        write_json(folder.path / SUITE, {"name": "two_paths"})
        write_json(folder.path / ESTIMATORS, [{"label": "mine"}])
        write_json(folder.path / ENVIRONMENT, {"vobench": "0.1.0", "commit": "c0ffee", **(environment or {})})
        gt = path(truth_m, 9)
        for number, case in enumerate(cases):
            trial = folder.estimate(case, "mine", 0)
            trial.mkdir(parents=True)
            write_json(folder.case(case) / CASE, {"name": case, "rig": "wide", **(settings or {}).get(case, {})})
            est = path(0.01, number)
            (folder.case(case) / GROUND_TRUTH).write_text(format_tum(gt))
            (trial / "estimate.tum").write_text(format_tum(est))
            with new_table(trial / FRAMES, COLUMNS), new_table(trial / TIMES, TIME_COLUMNS):
                pass
            scored = json.loads(json.dumps(score_estimate(est, gt, ()).as_dict()))
            facts = {"variant": {}, "repeat": 0, "reason": "", "coverage": 1.0, "frames": FRAME_COUNT}
            path_m = float(gt.distances_m()[-1])
            score = TrialScore(case=case, estimator="mine", status="ok", score=scored, path_m=path_m, **facts)
            write_json(trial / SCORE, score.model_dump(mode="json"))
        write_hashes(folder)
        packed_path = tmp_path / f"{name}.zip"
        bundle(folder, packed_path)
        return packed_path

    return pack


def compared(one, other):
    with opened_submission(one) as first, opened_submission(other) as second:
        return why_not_comparable(first, second)


def with_recording(bundle_path, sha):
    forger = forger_of(bundle_path)
    forger.files[SEQUENCES] = json.dumps({RECORDING: sha}).encode()
    forger.write(bundle_path)
    return bundle_path


def test_a_submission_states_suite_version_cases_and_recordings(packed):
    with opened_submission(with_recording(packed(), "1f")) as submission:
        assert submission.suite == "two_paths"
        assert submission.environment == Environment(vobench="0.1.0", commit="c0ffee")
        assert sorted(submission.cases) == ["ahead", "down"]
        assert submission.recordings == {RECORDING: "1f"}
        assert [score.case for score in submission.scores] == ["ahead", "down"]


def test_a_folder_is_a_submission_as_its_bundle_is(packed, tmp_path):
    packed()
    with opened_submission(tmp_path / "runs" / "a") as submission:
        assert submission.suite == "two_paths"
    assert compared(tmp_path / "a.zip", tmp_path / "runs" / "a") == ""


def test_a_changed_estimate_is_refused_with_its_old_hash_and_with_a_new_one(packed, tmp_path):
    honest = packed()
    name = "cases/down/estimates/mine/0/estimate.tum"
    for hashes_fit, sentence in ((False, f"{name} is not the file"), (True, "mine on down, 0: another score")):
        forger = forger_of(honest)
        forger.files[name] = format_tum(path(0.001)).encode()
        forger.hashes_fit = hashes_fit
        forger.write(tmp_path / "forged.zip")
        with pytest.raises(InputError, match=f"{sentence}.*forged.zip"), opened_submission(tmp_path / "forged.zip"):
            pass


def test_a_changed_score_is_refused_although_all_hashes_are_right(packed, tmp_path):
    forger = forger_of(packed())
    forger.edit("cases/down/estimates/mine/0/score.json", coverage=0.9)
    forger.write(tmp_path / "forged.zip")
    sentence = "mine on down, 0: another score than its run states: coverage: 0.9 is stated, 1 computed: .*forged.zip"
    with pytest.raises(InputError, match=sentence), opened_submission(tmp_path / "forged.zip"):
        pass


def test_a_bundle_without_an_estimate_is_refused(packed, tmp_path):
    forger = forger_of(packed())
    name = "cases/down/estimates/mine/0/estimate.tum"
    del forger.files[name]
    forger.write(tmp_path / "forged.zip")
    with (
        pytest.raises(InputError, match=r"there is no estimate\.tum.*forged\.zip"),
        opened_submission(tmp_path / "forged.zip"),
    ):
        pass


def test_a_bundle_without_a_suite_is_refused(packed, tmp_path):
    forger = forger_of(packed())
    forger.files[SUITE] = b"{}"
    forger.write(tmp_path / "forged.zip")
    with (
        pytest.raises(InputError, match="does not state the name of its suite"),
        opened_submission(tmp_path / "forged.zip"),
    ):
        pass


def test_equal_runs_share_a_board(packed):
    assert compared(packed("a"), packed("b")) == ""


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"environment": {"vobench": "0.2.0"}}, "it was made by vobench 0.2.0, not 0.1.0"),
        ({"cases": ("down",)}, "it lacks ahead"),
        ({"cases": ("down", "ahead", "up")}, "it has other cases too: up"),
        ({"settings": {"down": {"rig": "narrow"}}}, "its down is another case, of other settings: rig"),
        ({"truth_m": 0.001}, "its ahead has another true path"),
    ],
)
def test_another_version_case_or_true_path_is_named(packed, changes, reason):
    assert compared(packed("a"), packed("b", **changes)) == reason


def test_other_recordings_of_the_same_machine_are_of_another_simulator(packed):
    one = with_recording(packed("a"), "1f")
    other = with_recording(packed("b", environment={"commit": "decaf"}), "2f")
    reason = compared(one, other)
    assert "its recordings of down differ on the same processor" in reason
    assert "commits c0ffee and decaf" in reason


def test_other_recordings_of_another_processor_may_be_those_of_the_same_simulator(packed):
    processors = [{"model": model, "simd": "x86-64-v3"} for model in ("one", "two")]
    one = with_recording(packed("a", environment={"processors": processors[:1]}), "1f")
    other = with_recording(packed("b", environment={"processors": processors[1:]}), "2f")
    with opened_submission(one) as first:
        assert first.environment.processors == (Processor("one", "x86-64-v3"),)
    assert compared(one, other) == ""


def test_the_repeats_of_a_case_with_other_noise_are_no_other_cases(packed):
    names = ("down", "ahead", "down-repeat2")
    repeat = {"repeat_of": "down", "repeat": 1, "seed": 7}
    repeated = packed("b", cases=names, settings={"down-repeat2": repeat})
    assert compared(packed("a"), repeated) == ""
    easier = packed("c", cases=names, settings={"down-repeat2": {**repeat, "rig": "narrow"}})
    assert compared(packed("d"), easier) == "it has other cases too: down-repeat2"


def test_where_a_maker_lies_does_not_matter_but_which_one_it_is_does(packed):
    places = ("/home/ada/scenes/hall/maker.py", "scenes/hall/maker.py", "scenes/hut/maker.py")
    one, same, other = (
        packed(f"run{number}", settings={"down": {"scene": {"maker": place}}}) for number, place in enumerate(places)
    )
    assert compared(one, same) == ""
    assert "of other settings: scene" in compared(one, other)
