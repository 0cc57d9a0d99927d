"""How a metric is read from a trial: units, failures and stationary cases."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.report.boards import ates, scores_of
from vobench.metric.lost_aware import lost_aware_score
from vobench.report.board_metric import COSTS, METRICS, lost_aware
from vobench.runner.folder import STATUSES, SURVIVED


@given(st.sampled_from(STATUSES), st.sampled_from(STATUSES), ates, ates)
def test_no_failed_trial_scores_more_than_one_that_survived(one, other, ate, its_ate):
    trials = scores_of({"p": [(one, ate)] * 2, "q": [(other, its_ate)] * 2})
    survivor, loser = trials[0], trials[2]
    if survivor.status in SURVIVED and loser.status not in SURVIVED:
        assert lost_aware(survivor) >= 0.5 >= lost_aware(loser)


STATISTICS = [
    {"name": "ate_trans", "rmse": 0.02},
    {"name": "kitti_t_rel", "mean": 0.03},
    {"name": "rpe_trans", "rmse": 0.004},
    {"name": "rpe_rot", "rmse": 0.5},
]


def test_every_metric_has_the_unit_of_its_heading(scored):
    trial = scored("a", score={"metrics": STATISTICS}, path_m=4.0, coverage=0.75)
    values = {name: metric.value(trial) for name, metric in METRICS.items() if name != "score"}
    assert values == pytest.approx(
        {
            "ate": 0.5,
            "ate_mm": 20.0,
            "segments": 3.0,
            "rpe_mm": 4.0,
            "rpe_deg": 0.5,
            "coverage": 0.75,
            "cpu_ms": None,
            "memory_mib": None,
        }
    )


def test_an_error_in_percent_of_the_path_does_not_depend_on_the_unit_of_length(scored):
    ate = METRICS["ate"]
    assert ate.value(scored("a", ate_m=0.03, path_m=2.0)) == pytest.approx(ate.value(scored("a", ate_m=3, path_m=200)))
    assert ate.value(scored("a", ate_m=0.03, path_m=0.0)) is None
    assert ate.value(scored("a", ate_m=None)) is None


def test_a_failed_trial_has_infinite_errors_and_keeps_coverage_and_score(scored):
    trial = scored("a", "lost", ate_m=0.01, coverage=0.25)
    values = {name: metric.value(trial) for name, metric in METRICS.items()}
    assert {name for name, value in values.items() if value == inf} == {
        "ate",
        "ate_mm",
        "segments",
        "rpe_mm",
        "rpe_deg",
    }
    assert values["coverage"] == 0.25
    assert values["score"] < 0.5


@pytest.mark.parametrize("status", ["ok", "lost"])
def test_a_stationary_trial_has_no_error_and_no_score(scored, status):
    trial = scored("a", status, drift_m=0.001)
    assert {METRICS[name].value(trial) for name in METRICS if name != "coverage"} == {None}
    assert lost_aware(trial) is None


def test_the_lost_aware_score_is_that_of_the_score_file(scored):
    score = {"metrics": STATISTICS, "failure": {"lost_aware": 0.8125}}
    assert lost_aware(scored("a", score=score)) == 0.8125


@given(st.floats(0, 0.2), st.floats(0, 0.2), st.floats(1, 100))
def test_without_one_it_falls_with_the_error_relative_to_the_path(one, other, scale):
    trials = scores_of({"p": [("ok", one)] * 2, "q": [("ok", other)] * 2, "r": [("ok", one * scale)] * 2})
    first, second, longer = trials[0], trials[2], trials[4].model_copy(update={"path_m": scale})
    if one < other:
        assert lost_aware(first) >= lost_aware(second)
    assert lost_aware(longer) == pytest.approx(lost_aware(first), abs=1e-9)


def test_an_error_of_a_tenth_of_the_path_is_a_survivors_worst_score(scored):
    expected = lost_aware_score(np.array([0.05]), 0.9, survived=True, fail_m=0.1)
    assert lost_aware(scored("a", ate_m=0.05, coverage=0.9)) == pytest.approx(expected)
    assert lost_aware(scored("a", ate_m=0.1)) == lost_aware(scored("a", ate_m=5.0)) == pytest.approx(0.5)
    assert lost_aware(scored("a", ate_m=1e-10, path_m=0.0)) == pytest.approx(0.5)
    assert lost_aware(scored("a", "lost", ate_m=0.05)) == pytest.approx(0.25)
    assert lost_aware(scored("a", ate_m=None)) == pytest.approx(0.5)
    assert lost_aware(scored("a", "lost", ate_m=None)) == pytest.approx(1e-9, abs=1e-6)


def test_higher_is_better_for_scores_and_coverage_alone():
    assert {name for name, metric in METRICS.items() if metric.higher_is_better} == {"score", "coverage"}
    assert {name for name, metric in METRICS.items() if metric.includes_failures} == {"score", "coverage", *COSTS}
