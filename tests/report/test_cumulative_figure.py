"""Cumulative error curves: a failure never counts as below any error."""

import numpy as np
import pytest

from tests.report.paths import case_of, labels, line_of, path, without
from vobench.errors import InputError
from vobench.report.cumulative_figure import cumulative_figure, pose_distributions, trial_distributions
from vobench.report.leaderboard import make_board


def test_a_curve_rises_by_one_trial_at_each_error_and_a_failure_keeps_it_below_one(scored):
    trials = [
        scored("a", case="x", ate_m=0.01),
        scored("a", case="y", ate_m=0.04),
        scored("a", "lost", case="z", ate_m=0.001),
    ]
    (distribution,) = trial_distributions(make_board(trials, {}).cells, {"a": 0})
    assert distribution.errors.tolist() == [1.0, 4.0]  # percent of a path of 1 m
    assert distribution.count == 3
    (axes,) = cumulative_figure([distribution], 3.5, over_trials=True).axes
    shares = line_of(axes, "a").get_ydata()
    assert shares.max() == pytest.approx(2 / 3)
    assert np.unique(shares).tolist() == pytest.approx([0, 1 / 3, 2 / 3])


def test_curves_of_all_estimators_span_the_same_errors(scored):
    trials = [scored("a", ate_m=0.01), scored("b", ate_m=0.3)]
    distributions = trial_distributions(make_board(trials, {}).cells, {"a": 0, "b": 1})
    (axes,) = cumulative_figure(distributions, 3.5, over_trials=True).axes
    assert labels(axes) == ["a", "b"]
    for name in ("a", "b"):
        x = line_of(axes, name).get_xdata()
        assert (x.min(), x.max()) == pytest.approx((1.0, 30.0))


def test_over_poses_frames_without_a_pose_never_count():
    case = case_of(without(path(0.02), range(10)), None)
    first, second = pose_distributions(case)
    assert (len(first.errors), first.count) == (40, 50)
    assert (len(second.errors), second.count) == (0, 50)
    (axes,) = cumulative_figure([first, second], 3.5, over_trials=False).axes
    assert line_of(axes, "e0").get_ydata().max() == pytest.approx(0.8)
    assert axes.get_xlabel() == "position error, at most (m)"


def test_without_an_error_there_is_nothing_to_draw():
    with pytest.raises(InputError, match="no trial has an error to plot"):
        cumulative_figure(pose_distributions(case_of(None)), 3.5, over_trials=False)
