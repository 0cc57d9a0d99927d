"""Accuracy against cost: one point for each ranked estimator, and the line of those that no cheaper one beats."""

import pytest

from tests.report.paths import labels, line_of
from vobench.errors import InputError
from vobench.report.cost_figure import cost_figure
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board

COSTS_MS = {"fast": 1.0, "slow": 50.0, "poor": 60.0}
ERRORS_M = {"fast": 0.05, "slow": 0.01, "poor": 0.02}


def totals_of(scored, *, failing=""):
    trials = [
        scored(name, "lost" if name == failing else "ok", ate_m=error_m, sensors=("stereo",))
        for name, error_m in ERRORS_M.items()
    ]
    answered = {("down", name): EstimatorStatistics(ms_per_frame=cost_ms) for name, cost_ms in COSTS_MS.items()}
    return make_board(trials, answered).totals


INDEX_OF = {"fast": 0, "poor": 1, "slow": 2}


def test_a_point_is_at_the_cpu_time_and_the_median_error(scored):
    (axes,) = cost_figure(totals_of(scored), INDEX_OF, 3.5).axes
    point = line_of(axes, "slow")
    assert (point.get_xdata()[0], point.get_ydata()[0]) == pytest.approx((50.0, 1.0))
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_the_line_joins_estimators_that_no_cheaper_one_beats(scored):
    (axes,) = cost_figure(totals_of(scored), INDEX_OF, 3.5).axes
    front = axes.get_lines()[0]
    assert front.get_xdata() == pytest.approx([1.0, 50.0])
    assert set(labels(axes)[1:]) == {"fast", "slow", "poor"}


def test_all_groups_have_a_panel_and_their_estimators_are_in_one_legend(scored):
    trials = [scored("eyes", ate_m=0.1, sensors=("stereo",)), scored("wheels", ate_m=0.2, sensors=("encoders",))]
    answered = {("down", name): EstimatorStatistics(ms_per_frame=1.0) for name in ("eyes", "wheels")}
    figure = cost_figure(make_board(trials, answered).totals, {"eyes": 0, "wheels": 1}, 3.5)
    assert len(figure.axes) == 2
    (legend,) = figure.legends
    assert {text.get_text() for text in legend.get_texts()} == {"eyes", "wheels"}


def test_without_costs_there_is_nothing_to_draw(scored):
    totals = make_board([scored("a", ate_m=0.1)], {}).totals
    with pytest.raises(InputError, match="no ranked estimator has both an error and a CPU time"):
        cost_figure(totals, {"a": 0}, 3.5)
