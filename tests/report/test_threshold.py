"""Thresholds on scores: what they accept, and who is beyond them."""

import pytest

from vobench.errors import InputError
from vobench.report.threshold import Threshold, parse_threshold


@pytest.mark.parametrize(
    ("text", "threshold"),
    [
        ("ate_trans.rmse > 0.2", Threshold("ate_trans", "rmse", ">", 0.2)),
        ("ate_trans>0.2", Threshold("ate_trans", "rmse", ">", 0.2)),
        (" rpe_rot.max <= 1e-3 ", Threshold("rpe_rot", "max", "<=", 1e-3)),
        ("coverage < .9", Threshold("coverage", "rmse", "<", 0.9)),
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
    ],
)
def test_a_mistake_is_a_sentence(text, message):
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        parse_threshold(text)


@pytest.mark.parametrize(
    ("comparison", "broken"),
    [(">", [0.3]), (">=", [0.2, 0.3]), ("<", [0.1]), ("<=", [0.1, 0.2])],
)
def test_a_comparison_breaks_what_is_beyond_it(scored, comparison, broken):
    threshold = Threshold("ate_trans", "rmse", comparison, 0.2)
    sentences = [s for ate in (0.1, 0.2, 0.3) for s in threshold.broken_by([scored("a", ate_m=ate)])]
    assert sentences == [f"a on down: ate_trans.rmse is {ate}, which is {comparison} 0.2" for ate in broken]


def test_coverage_has_no_statistic(scored):
    threshold = parse_threshold("coverage < 0.9")
    assert list(threshold.broken_by([scored("a", coverage=0.5)])) == ["a on down: coverage is 0.5, which is < 0.9"]
    assert list(threshold.broken_by([scored("a", coverage=0.95)])) == []
    assert str(threshold) == "coverage"


def test_a_failure_breaks_every_threshold_and_a_case_without_a_sequence_none(scored):
    threshold = parse_threshold("ate_trans > 1e9")
    trials = [scored("a", "lost"), scored("b", ate_m=None), scored("c", "no_sequence", ate_m=None), scored("d")]
    assert list(threshold.broken_by(trials)) == [
        "a on down: lost, so it has no ate_trans.rmse",
        "b on down: ok, so it has no ate_trans.rmse",
    ]
