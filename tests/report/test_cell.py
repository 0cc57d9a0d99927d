"""A cell: what the trials of one estimator on one case amount to."""

from math import isnan

import pytest

from vobench.estimator.sandbox import Sandbox
from vobench.report.cell import CaseFacts, make_cell
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board, make_cells
from vobench.runner.consistency import CovarianceConsistency


def test_a_still_case_shows_the_largest_drift_of_its_trials_and_no_error(scored):
    scores = [scored("a", repeat=n, drift_m=drift, ate_m=9.0) for n, drift in enumerate((0.0023, 0.001))]
    (cell,) = make_board(scores, {}).cells
    assert (cell.drift_mm, cell.spread("ate_mm"), cell.failed) == (2.3, None, 0)


NOTHING = EstimatorStatistics()


def make(trials, answered=NOTHING):
    return make_cell("down", trials, answered, CaseFacts())


def score_of(**statistics):
    return {"metrics": [{"name": name, "rmse": value, "mean": value} for name, value in statistics.items()]}


def test_a_spread_leaves_out_failures_and_missing_values(scored):
    errors = [0.02, 0.04, 0.01]
    trials = [scored("a", repeat=n, ate_m=ate) for n, ate in enumerate(errors)]
    failed = [scored("a", "lost", repeat=3), scored("a", repeat=4, ate_m=None)]
    cell = make([*trials, *failed])
    assert cell.spread("ate_mm") == pytest.approx((20.0, 10.0, 40.0))
    assert make(failed).spread("ate_mm") is None
    assert (cell.trials, cell.failed, cell.failures) == (5, 1, (False, False, False, True, False))


def test_status_and_reason_are_those_of_the_gravest_trial(scored):
    trials = [scored("a"), scored("a", "lost", repeat=1, reason="dark"), scored("a", repeat=2)]
    assert (make(trials).status, make(trials).reason) == ("lost", "dark")


def test_a_cell_has_the_name_of_the_first_case_although_a_repeat_with_new_noise_failed(scored):
    trials = [scored("a"), scored("a", "lost", case="down-repeat1", reason="dark"), scored("a", case="down-repeat2")]
    facts = {"down": CaseFacts()}
    facts |= {f"down-repeat{number}": CaseFacts(repeat_of="down") for number in (1, 2)}
    (cell,) = make_cells(trials, {}, facts)
    assert (cell.case, cell.status, cell.failures) == ("down", "lost", (False, True, False))


def test_a_loss_is_one_minus_the_score_and_missing_for_a_stationary_trial(scored):
    perfect = scored("a", ate_m=0.0)
    worse = scored("a", repeat=1, ate_m=0.05)
    stationary = scored("a", repeat=2, drift_m=0.1)
    losses = make([perfect, worse, stationary]).losses
    assert losses[0] == pytest.approx(0.005)  # as an error of a millimetre on a path of a metre
    assert losses[1] == pytest.approx(0.25)
    assert isnan(losses[2])


def test_revised_poses_and_scale_are_means_over_the_trials_that_survived(scored):
    def trial(repeat, value, status="ok", **changes):
        score = score_of(ate_trans=value, scale_drift=value / 10)
        revised = score_of(ate_trans=value / 2, kitti_t_rel=value)
        return scored("a", status, repeat=repeat, score=score, revised=revised, **changes)

    cell = make([trial(0, 0.02), trial(1, 0.04), trial(2, 9.0, "lost"), trial(3, 9.0, drift_m=0.1)])
    assert cell.revised_ate_mm == pytest.approx(15.0)
    assert cell.revised_segment_percent == pytest.approx(3.0)
    assert cell.scale_drift_percent_per_m == pytest.approx(0.3)
    plain = make([scored("a")])
    assert (plain.revised_ate_mm, plain.scale_drift_percent_per_m, plain.drift_mm) == (None, None, None)


def test_the_consistency_is_that_of_the_median_trial_that_survived(scored):
    def trial(repeat, gap, status="ok"):
        consistency = CovarianceConsistency(poses=9, nees_mean=1.0, nees_median=1.0, scale_gap=gap, covered_90=0.9)
        return scored("a", status, repeat=repeat, consistency=consistency)

    cell = make([trial(0, 3.0), trial(1, 1.0), trial(2, 2.0), trial(3, 99.0, "lost"), trial(4, 98.0, "lost")])
    assert cell.scale_gap == 2.0
    assert "errors are 2 x" in cell.consistency
    assert (make([scored("a")]).scale_gap, make([scored("a")]).consistency) == (None, "")


def test_costs_are_one_value_for_all_trials(scored):
    cell = make([scored("a"), scored("a", repeat=1)], EstimatorStatistics(ms_per_frame=2.5, memory_mib=40.0))
    assert (cell.values["cpu_ms"], cell.values["memory_mib"]) == ((2.5,), (40.0,))
    assert make([scored("a")]).values["cpu_ms"] == (None,)


def test_what_trials_saw_is_named_once_each(scored):
    full = scored("a", sandbox=Sandbox("full"))
    none = scored("a", repeat=1, sandbox=Sandbox("none", ("the network",)))
    again = scored("a", repeat=2, sandbox=Sandbox("full"))
    assert make([full, again]).saw == "only its own files"
    assert make([full, none, again]).saw == "not sandboxed: it could see the network; only its own files"
