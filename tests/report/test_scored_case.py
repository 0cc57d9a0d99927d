"""Estimates with their scores, from runs and from files."""

from pathlib import Path

import pytest

from tests.report.paths import path
from vobench.errors import InputError
from vobench.report.scored_case import file_labels, scored_case, scored_files
from vobench.runner.estimate import ESTIMATE
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.trajectory_pair import TrajectorySource
from vobench.trajectory.tum import format_tum


def test_of_several_repeats_the_one_with_the_median_error_is_shown(scored, write_run, tmp_path):
    errors_m = [0.03, 0.01, 0.02]
    trials = [scored("a", repeat=repeat, ate_m=error_m) for repeat, error_m in enumerate(errors_m)]
    folder = write_run(tmp_path / "run", trials)
    (folder.case("down") / GROUND_TRUTH).write_text(format_tum(path()))
    for trial, error_m in zip(trials, errors_m, strict=True):
        (folder.estimate("down", "a", trial.repeat) / ESTIMATE).write_text(format_tum(path(error_m)))
    case = scored_case(folder, trials, {"a": 0})
    of_median = scored_case(folder, trials[2:], {"a": 0})
    assert case.scores[0][1].ate_trans_m.tolist() == of_median.scores[0][1].ate_trans_m.tolist()


def test_no_trial_is_an_error(run):
    with pytest.raises(InputError, match="there is no trial to plot"):
        scored_case(run, [], {})


def test_an_estimator_that_a_case_is_not_for_is_left_out(scored, write_run, tmp_path):
    trials = [scored("a", ate_m=0.01), scored("imu", status="not_applicable")]
    folder = write_run(tmp_path / "run", trials)
    (folder.case("down") / GROUND_TRUTH).write_text(format_tum(path()))
    (folder.estimate("down", "a", 0) / ESTIMATE).write_text(format_tum(path(0.01)))
    case = scored_case(folder, trials, {"a": 0, "imu": 1})
    assert [estimate.label for estimate in case.estimates] == ["a"]
    with pytest.raises(InputError, match="there is no trial to plot"):
        scored_case(folder, trials[1:], {"imu": 1})


def test_files_are_scored_against_one_ground_truth_under_their_own_names(tmp_path):
    for name, error_m in {"gt": 0.0, "mine": 0.01, "yours": 0.03}.items():
        (tmp_path / f"{name}.txt").write_text(format_tum(path(error_m)))
    gt, mine, yours = (TrajectorySource(tmp_path / f"{name}.txt") for name in ("gt", "mine", "yours"))
    case = scored_files(gt, [mine, yours])
    assert [estimate.label for estimate in case.estimates] == ["mine", "yours"]
    errors_m = [score.metric("ate_trans").statistics.rmse for _, score in case.scores]
    assert errors_m[1] == pytest.approx(3 * errors_m[0], rel=0.05)
    assert len(case.truth) == 50
    with pytest.raises(InputError, match="there is no estimate to plot beside"):
        scored_files(gt, [])


@pytest.mark.parametrize(
    ("paths", "labels"),
    [
        (["a/orb.txt", "a/lk.txt"], ["orb", "lk"]),
        (["orb/est.txt", "lk/est.txt"], ["orb/est", "lk/est"]),
        (["a/est.txt", "a/est.tum"], ["a/est (1)", "a/est (2)"]),
    ],
)
def test_a_label_is_the_shortest_end_of_a_path_that_tells_it_apart(paths, labels):
    assert file_labels([Path(text) for text in paths]) == labels
