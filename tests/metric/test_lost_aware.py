"""The lost-aware score falls with every error and every lost pose, and no failed run outranks a survivor."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.coverage import coverage, slots
from vobench.metric.lost_aware import lost_aware_score, tracking_result
from vobench.metric.score import ScoreSettings, score
from vobench.trajectory.trajectory import Trajectory

T_NS = np.arange(10, dtype=np.int64) * 100_000_000
N = 40
T_NS_failure = np.arange(N, dtype=np.int64) * 10**8
ERRORS = st.lists(st.floats(0, 1e3), min_size=N, max_size=N).map(np.array)
FRAMES = st.sets(st.integers(0, N - 1), min_size=1)
FAIL_M = st.floats(1e-3, 1e3)


def scored(errors_m, frames, fail_m, t_ns=T_NS_failure):
    kept = np.array(sorted(frames), np.int64)
    return tracking_result(
        errors_m[kept], slots(t_ns, "auto").of_frame[kept], coverage(t_ns, kept, rule="auto"), fail_m=fail_m
    )


PACES = pytest.mark.parametrize("t_ns", [T_NS_failure, T_NS_failure // 5], ids=["frames", "time"])


@PACES
@given(errors_m=ERRORS, frames=FRAMES, fail_m=FAIL_M)
def test_an_error_more_never_raises_the_score(t_ns, errors_m, frames, fail_m):
    more = errors_m.copy()
    more[min(frames)] += fail_m / 3
    before = scored(errors_m, frames, fail_m, t_ns).lost_aware
    assert scored(more, frames, fail_m, t_ns).lost_aware <= before


@PACES
@given(errors_m=ERRORS, frames=FRAMES, fail_m=FAIL_M)
def test_a_pose_less_never_raises_the_score(t_ns, errors_m, frames, fail_m):
    before = scored(errors_m, frames, fail_m, t_ns).lost_aware
    for frame in sorted(frames)[:: max(len(frames) // 4, 1)]:
        assert scored(errors_m, frames - {frame}, fail_m, t_ns).lost_aware <= before + 1e-15


def test_few_poses_cannot_pass_for_a_slow_camera():
    T = se3.transform(se3.rotation_z(np.linspace(0, 5, 300)), np.cumsum(np.ones((300, 3)) * [0.1, 0.0, 0.0], axis=0))
    t_ns = np.arange(300) * 33_333_333
    kept = np.array([0, 149, 299])
    result = score(Trajectory(t_ns, T), Trajectory(t_ns[kept], T[kept]))
    assert (result.failure.survived, result.coverage.ratio) == (False, 0.01)
    assert result.failure.lost_aware < 0.01


@given(ERRORS, ERRORS, st.integers(1, N - 1), FAIL_M)
def test_no_crash_outranks_a_survivor(crashing_m, surviving_m, crash, fail_m):
    survivor = scored(surviving_m, range(N), fail_m)
    crashed = scored(crashing_m, range(crash), fail_m)
    assert (survivor.survived, crashed.survived) == (True, False)
    assert crashed.lost_aware < 0.5 <= survivor.lost_aware


def test_a_perfect_survivor_has_one_and_one_wrong_everywhere_has_a_half():
    assert scored(np.zeros(N), range(N), 1.0).lost_aware == 1.0
    wrong = scored(np.full(N, 2.0), range(N), 1.0)
    assert (wrong.lost_aware, wrong.confidently_wrong) == (0.5, N)


def test_it_is_the_area_under_the_cumulative_error_curve():
    rng = np.random.default_rng(1)
    errors_m, kept = rng.exponential(0.4, N), np.sort(rng.permutation(N)[:30])
    thresholds = np.linspace(0, 1, 100_001)
    curve = (errors_m[kept][:, None] <= thresholds).sum(0) / N
    area = np.trapezoid(curve, thresholds)
    assert lost_aware_score(errors_m[kept], 30 / N, survived=True, fail_m=1.0) == pytest.approx(
        0.5 + area / 2, abs=1e-5
    )
    assert lost_aware_score(errors_m[kept], 30 / N, survived=False, fail_m=1.0) == pytest.approx(area / 2, abs=1e-5)


def test_less_than_half_is_no_survivor_even_with_a_pose_at_the_end():
    assert not scored(np.zeros(N), [0, N - 1], 1.0).survived
    assert scored(np.zeros(N), range(0, N, 1), 1.0).survived


def test_a_crash_of_millions_of_frames_does_not_round_to_a_survivor():
    assert lost_aware_score(np.zeros(3), 1.0, survived=False, fail_m=1.0) < 0.5


def test_where_the_truth_stands_still_there_is_no_lost_aware_score():
    still = Trajectory(T_NS_failure, np.broadcast_to(np.eye(4), (N, 4, 4)))
    result = score(still, still)
    assert (result.failure.lost_aware, result.failure.confidently_wrong) == (None, None)
    assert any(warning.startswith("no lost-aware score") for warning in result.warnings)


def test_frames_claimed_far_off_are_confidently_wrong():
    T = se3.transform(np.eye(3), np.linspace(0, 10, N)[:, None] * [1.0, 0.0, 0.0])
    T[:, 1, 3] = np.linspace(0, 1, N) ** 2
    jumped = T.copy()
    jumped[-4:, 2, 3] += 3.0
    result = score(
        Trajectory(T_NS_failure, T), Trajectory(T_NS_failure, jumped), settings=ScoreSettings(alignment="origin")
    )
    assert result.failure.confidently_wrong == 4
    assert result.as_dict()["failure"]["confidently_wrong"] == 4


@pytest.mark.parametrize(("share", "survived"), [(5, True), (4, False)])
def test_an_estimate_survives_with_half_of_the_frames_and_a_pose_at_the_end(share, survived):
    frames = np.arange(10 - share, 10)
    covered = coverage(T_NS, frames)
    result = tracking_result(np.zeros(share), frames, covered, fail_m=1.0)
    assert result.survived == survived
    assert result.lost_aware == pytest.approx(0.5 + 0.5 * share / 10 if survived else 0.5 * share / 10)

    without_end = coverage(T_NS, np.arange(9))
    assert not tracking_result(np.zeros(9), np.arange(9), without_end, fail_m=1.0).survived


def test_a_stationary_truth_has_no_lost_aware_score():
    covered = coverage(T_NS, np.arange(10))
    result = tracking_result(np.ones(10), np.arange(10), covered, fail_m=0.0)
    assert (result.survived, result.lost_aware, result.fail_m, result.confidently_wrong) == (True, None, 0.0, None)


def test_poses_beyond_the_limit_are_confidently_wrong_and_the_best_of_a_slot_counts():
    covered = coverage(T_NS, np.arange(10))
    errors_m = np.array([0.5, 1.0, 1.5, 0.0])
    result = tracking_result(errors_m, np.array([0, 0, 1, 2]), covered, fail_m=1.0)
    assert result.confidently_wrong == 1
    accuracy = np.mean([0.5, 0.0, 1.0])
    assert result.lost_aware == pytest.approx(0.5 + 0.5 * accuracy)
