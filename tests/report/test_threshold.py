"""Thresholds on results: what they accept, and who is beyond them."""

import pytest

from vobench.errors import InputError
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board
from vobench.report.threshold import Threshold, parse_threshold


def broken(text, trials, answered=None):
    return list(parse_threshold(text).broken_by(trials, make_board(trials, answered or {})))


@pytest.mark.parametrize(
    ("text", "threshold"),
    [
        ("ate_trans.rmse > 0.2", Threshold("ate_trans", "rmse", ">", 0.2)),
        ("ate_trans>0.2", Threshold("ate_trans", "rmse", ">", 0.2)),
        ("kitti_t_rel > .01", Threshold("kitti_t_rel", "mean", ">", 0.01)),
        (" rpe_rot.max <= 1e-3 ", Threshold("rpe_rot", "max", "<=", 1e-3)),
        ("ate_trans.p95 > 1", Threshold("ate_trans", "p95", ">", 1.0)),
        ("coverage < .9", Threshold("coverage", "", "<", 0.9)),
        ("score < .9", Threshold("score", "", "<", 0.9)),
        ("failed > 0", Threshold("failed", "", ">", 0.0)),
        ("cpu_ms > 40", Threshold("cpu_ms", "", ">", 40.0)),
        ("ate_trans.mean >= -1", Threshold("ate_trans", "mean", ">=", -1.0)),
    ],
)
def test_a_threshold_is_read_from_its_text(text, threshold):
    assert parse_threshold(text) == threshold


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ate_trans", "should be a metric, a comparison and a number, as in 'ate_trans.rmse > 0.2', got 'ate_trans'"),
        ("ate_trans = 3", "should be a metric, a comparison and a number"),
        ("ate_tran > 3", "no metric named 'ate_tran'. Did you mean 'ate_trans'"),
        ("ate_trans.rms > 3", "no statistic named 'rms'. Did you mean 'rmse'"),
        ("ate_trans > three", "should be compared with a number, got 'three' in 'ate_trans > three'"),
        ("nees_pose.mean > 12", "a run does not measure nees_pose; it measures ate, ate_mm,"),
        ("score.mean < 0.9", "score has no statistics; write 'score' without '.mean'"),
    ],
)
def test_a_mistake_is_a_sentence(text, message):
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        parse_threshold(text)


@pytest.mark.parametrize(
    ("comparison", "beyond"),
    [(">", [0.3]), (">=", [0.2, 0.3]), ("<", [0.1]), ("<=", [0.1, 0.2])],
)
def test_a_comparison_breaks_what_is_beyond_it(scored, comparison, beyond):
    sentences = [s for ate in (0.1, 0.2, 0.3) for s in broken(f"ate_trans {comparison} 0.2", [scored("a", ate_m=ate)])]
    assert sentences == [f"a on down: ate_trans.rmse is {ate}, which is {comparison} 0.2" for ate in beyond]


def test_coverage_has_no_statistic(scored):
    assert broken("coverage < 0.9", [scored("a", coverage=0.5)]) == ["a on down: coverage is 0.5, which is < 0.9"]
    assert broken("coverage < 0.9", [scored("a", coverage=0.95)]) == []


def test_a_failure_breaks_every_threshold_on_an_error_and_a_case_without_a_sequence_none(scored):
    trials = [scored("a", "lost"), scored("b", ate_m=None), scored("c", "no_sequence", ate_m=None), scored("d")]
    assert broken("ate_trans > 1e9", trials) == [
        "a on down: lost, so it has no ate_trans.rmse",
        "b on down: ok, so it has no ate_trans.rmse",
    ]


def test_a_score_counts_failed_trials_too(scored):
    trials = [scored("a", ate_m=0.01), scored("b", "lost", ate_m=0.01)]
    (sentence,) = broken("score < 0.9", trials)
    assert sentence.startswith("b on down: score is 0.")


def test_failed_trials_are_counted_by_estimator(scored):
    trials = [scored("a", "lost", repeat=n) for n in range(2)] + [scored("a", repeat=2), scored("b")]
    assert broken("failed > 0", trials) == ["a: failed is 2, which is > 0"]
    assert broken("failed > 2", trials) == []


def test_a_cost_is_that_of_a_cell(scored):
    trials = [scored("a"), scored("b")]
    answered = {("down", "a"): EstimatorStatistics(50.0)}
    assert broken("cpu_ms > 40", trials, answered) == [
        "a on down: cpu_ms is 50, which is > 40",
        "b on down: no cpu_ms was measured",
    ]


def test_a_baseline_breaks_nothing_unless_nothing_else_was_run(scored):
    still = scored("still", ate_m=0.5, claims=("baseline",))
    assert broken("ate_trans > 0.2", [scored("a"), still]) == []
    assert broken("ate_trans > 0.2", [still]) == ["still on down: ate_trans.rmse is 0.5, which is > 0.2"]
