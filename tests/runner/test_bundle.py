"""A bundle holds all that it takes to score a run again, and nothing that comes back harms whoever opens it."""

import json
from zipfile import ZipFile

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.runner.bundle import bundle, merged, opened, scored_again, separate_labels
from vobench.runner.environment import read_environment
from vobench.runner.folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATORS,
    NO_SEQUENCE,
    SCORE,
    SUITE,
    UNTIL,
    RunFolder,
    TrialScore,
    read_tum,
    write_hashes,
)
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.runner.score import score_estimate
from vobench.runner.store import write_json
from vobench.suite.catalog import builtin_root
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

CASES = ("down", "ahead")


def path(noise_m, seed=0):
    T = np.tile(np.eye(4), (20, 1, 1))
    T[:, :3, 3] = np.linspace(0, 1, 20)[:, None] ** (1, 2, 3)
    T[:, :3, 3] += noise_m * np.random.default_rng(seed).normal(size=(20, 3))
    return Trajectory(np.arange(20) * 100_000_000, T)


@pytest.fixture
def make(tmp_path):
    def run(name, *, code="1", truth_m=0.0):
        folder = RunFolder(tmp_path / name / "stamp")
        folder.path.mkdir(parents=True)
        write_json(folder.path / SUITE, {"name": name})
        write_json(folder.path / ESTIMATORS, [{"label": "mine", "code": code}])
        gt = path(truth_m, 9)
        for k, case in enumerate(CASES):
            place = folder.estimate(case, "mine", 0)
            place.mkdir(parents=True)
            write_json(folder.case(case) / CASE, {"name": case})
            est = path(0.01, k)
            (folder.case(case) / GROUND_TRUTH).write_text(format_tum(gt))
            (place / "estimate.tum").write_text(format_tum(est))
            with new_table(place / FRAMES, COLUMNS), new_table(place / TIMES, TIME_COLUMNS):
                pass
            scored = json.loads(json.dumps(score_estimate(est, gt, ()).as_dict()))
            path_m = float(gt.distances_m()[-1])
            facts = {"variant": {}, "repeat": 0, "reason": "", "coverage": 1.0, "frames": 20, "path_m": path_m}
            score = TrialScore(case=case, estimator="mine", status="ok", score=scored, **facts)
            write_json(place / SCORE, score.model_dump(mode="json"))
        write_hashes(folder)
        return folder

    return run


def test_what_is_bundled_scores_the_same_and_equal_runs_make_equal_bundles(make, tmp_path):
    folder = make("a")
    assert bundle(folder, tmp_path / "a.zip") == 3 + len(CASES) * (2 + 4)
    bundle(folder, tmp_path / "b.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with opened(tmp_path / "a.zip") as again:
        assert (again.path.parent.name, again.path.name) == ("a", "stamp")
        assert again.scores() == folder.scores()
        assert [same for _, same in scored_again(again)] == [True, True]


def test_a_bundle_keeps_the_date_of_its_run_and_not_where_vobench_is(make, tmp_path):
    folder = make("a")
    dated = RunFolder(folder.path.rename(folder.path.with_name("20261128T101500_1a2b3c4d")))
    maker = builtin_root() / "scenes" / "car_park" / "maker.py"
    write_json(dated.case("down") / CASE, {"name": "down", "scene": {"maker": str(maker)}})
    write_json(dated.path / ENVIRONMENT, {"vobench": "0.1.0"})
    bundle(dated, tmp_path / "any_name.zip")
    with opened(tmp_path / "any_name.zip") as again:
        assert read_environment(again).date == "2026-11-28"
        case = json.loads((again.case("down") / CASE).read_text())
    assert case["scene"]["maker"] == "scenes/car_park/maker.py"


def test_labels_of_separate_runs_never_meet(make):
    runs = [make("a"), make("b"), make("c")]
    labels = separate_labels(runs, ["a", "mine", "mine"])
    assert labels == [{"mine": "mine"}, {"mine": "mine of mine"}, {"mine": "mine of mine.3"}]
    with merged(runs, ["a", "mine", "mine"], labels) as together:
        found = sorted((s.estimator, s.repeat) for s in together.scores() if s.case == "down")
    assert found == [("mine", 0), ("mine of mine", 0), ("mine of mine.3", 0)]


def test_a_score_that_is_not_its_estimates_is_found_and_scored_anew(make, tmp_path):
    folder = make("a")
    file = folder.estimate("down", "mine", 0) / SCORE
    honest = TrialScore.model_validate_json(file.read_bytes())
    file.write_text(file.read_text().replace('"coverage": 1.0', '"coverage": 0.9'))
    bundle(folder, tmp_path / "a.zip")
    with opened(tmp_path / "a.zip") as again:
        found = {score.case: (score, same) for score, same in scored_again(again)}
    assert found["ahead"][1]
    assert found["down"] == (honest, False)


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("cases/down/ground_truth.tum", "0 0 0 0 0 0 0 1\n", "holds a file twice"),
        ("../outside.txt", "x", "whose path is outside"),
        ("/etc/outside.txt", "x", "whose path is outside"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_bundle_that_was_meddled_with_is_a_sentence(make, tmp_path, name, text, sentence):
    bundle(make("a"), tmp_path / "a.zip")
    with ZipFile(tmp_path / "a.zip", "a") as file:
        file.writestr(name, text)
    with pytest.raises(InputError, match=sentence), opened(tmp_path / "a.zip"):
        pass


def test_what_is_no_bundle_is_a_sentence(tmp_path):
    (tmp_path / "a.zip").write_bytes(b"PK, but not for long")
    with pytest.raises(InputError, match="neither the folder of a run nor a bundle"), opened(tmp_path / "a.zip"):
        pass


def test_the_same_estimators_trials_are_repeats_of_one_another_and_another_ones_are_not(make):
    with merged([make("a"), make("b"), make("c", code="2")], ["a", "b", "c"]) as together:
        found = sorted((s.estimator, s.repeat) for s in together.scores() if s.case == "down")
    assert found == [("mine", 0), ("mine", 1), ("mine of c", 0)]


def test_a_run_without_a_name_is_not_left_out_of_a_merge(make):
    runs = [make("a"), make("b")]
    with pytest.raises(ValueError, match="shorter"), merged(runs, ["a"]):
        pass


def test_a_case_that_one_of_two_merged_runs_could_not_make_is_the_others(make):
    partial, whole = make("partial"), make("whole")
    case, *_ = CASES
    (partial.case(case) / GROUND_TRUTH).unlink()
    score = partial.scores()[-1]
    unmade = score.model_copy(update={"case": case, "status": NO_SEQUENCE, "score": None, "frames": 0})
    write_json(partial.estimate(case, "mine", 0) / SCORE, unmade.model_dump(mode="json"))
    assert [group.cases for group in partial.unmade()] == [(case,)]
    for order in ([partial, whole], [whole, partial]):
        with merged(order, ["a", "b"]) as both:
            assert both.unmade() == ()
            assert (both.case(case) / GROUND_TRUTH).read_bytes() == (whole.case(case) / GROUND_TRUTH).read_bytes()


def test_a_true_path_of_other_last_digits_is_the_same_path(make):
    one, other = make("a"), make("b")
    truth = other.case(CASES[0]) / GROUND_TRUTH
    gt = read_tum(truth)
    T = gt.T_world_frame.copy()
    T[:, 0, 3] += 1e-14
    truth.write_text(format_tum(Trajectory(gt.t_ns, T)))
    assert truth.read_bytes() != (one.case(CASES[0]) / GROUND_TRUTH).read_bytes()
    with merged([one, other], ["a", "b"]) as both:
        assert len(both.scores()) == 2 * len(CASES)


def test_another_case_of_the_same_name_cannot_be_merged(make):
    runs = [make("a"), make("b", truth_m=0.1)]
    with pytest.raises(InputError, match="case 'ahead' is another one in b"), merged(runs, ["a", "b"]):
        pass


@pytest.mark.parametrize("which", [0, 1])
def test_a_merged_run_keeps_what_an_adaptive_run_had_shown(make, which):
    runs = [make("a"), make("b")]
    (runs[which].path / UNTIL).write_text('{"ratio": 1.5}')
    with merged(runs, ["a", "b"]) as both:
        assert (both.path / UNTIL).read_text() == '{"ratio": 1.5}'


def test_merged_runs_that_were_not_adaptive_say_nothing_of_it(make):
    with merged([make("a"), make("b")], ["a", "b"]) as both:
        assert not (both.path / UNTIL).exists()
