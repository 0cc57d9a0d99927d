"""Coverage: how much there is, and where it stops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.coverage import coverage, failure, lost_aware_score, slots
from vobench.metric.score import ScoreSettings, score
from vobench.trajectory.trajectory import Trajectory

T_NS = np.arange(10, dtype=np.int64) * 100_000_000


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        (range(10), (1.0, 0, 0, 0.0, None)),
        ([], (0.0, 1, 10, 0.9, 0)),
        ([0], (0.1, 1, 9, 0.9, 1)),
        ([9], (0.1, 1, 9, 0.9, 0)),
        ([0, 1, 5, 6, 8, 9], (0.6, 2, 3, 0.4, 2)),
        ([2, 3, 4, 5, 6, 7, 8, 9], (0.8, 1, 2, 0.2, 0)),
    ],
)
def test_gaps_are_runs_of_frames_without_an_estimate(frames, expected):
    found = coverage(T_NS, np.array(frames, np.int64))
    assert (found.ratio, found.gaps, found.longest_gap_frames) == expected[:3]
    assert (found.longest_gap_s, found.first_lost_frame) == expected[3:]
    assert found.of == "frames"


def test_tracks_are_what_lies_between_gaps():
    found = coverage(T_NS, np.array([1, 2, 3, 6, 7]))
    assert (found.gaps, found.relocalisations, found.ends_lost) == (3, 1, True)
    assert (found.time_to_first_pose_s, found.longest_track_s) == (0.1, 0.2)
    whole = coverage(T_NS, np.arange(10))
    assert (whole.relocalisations, whole.ends_lost, whole.time_to_first_pose_s, whole.longest_track_s) == (
        0,
        False,
        0,
        0.9,
    )
    nothing = coverage(T_NS, np.zeros(0, np.int64))
    assert (nothing.relocalisations, nothing.ends_lost, nothing.time_to_first_pose_s) == (0, True, None)


@given(st.sets(st.integers(0, 9)))
def test_a_frame_less_never_raises_coverage(frames):
    ratios = [coverage(T_NS, np.array(sorted(some), np.int64)).ratio for some in (frames, set(sorted(frames)[1:]))]
    assert ratios[1] <= ratios[0]


DENSE_NS = np.arange(1001, dtype=np.int64) * 10_000_000  # ten seconds at 100 Hz


def at(t_s):
    """Coverage of the dense truth by poses at these times."""
    return coverage(DENSE_NS, np.searchsorted(DENSE_NS, np.round(np.asarray(t_s) * 1e9).astype(np.int64)), of="auto")


@pytest.mark.parametrize("rate_hz", [10, 15, 30, 60, 100])
def test_a_truth_too_dense_for_frames_is_covered_by_any_camera(rate_hz):
    found = at(np.arange(0, 9.999, 1 / rate_hz))
    assert (found.of, found.gaps, found.ratio, found.ends_lost) == ("time", 0, 1.0, False)


@pytest.mark.parametrize("phase_s", [0.0, 0.004, 0.02])
def test_time_lost_counts_wherever_the_frames_lay(phase_s):
    t_s = np.arange(phase_s, 9.98, 0.04)
    found = at(t_s[(t_s < 2) | (t_s > 4)])
    assert (found.of, found.gaps, found.relocalisations) == ("time", 1, 1)
    assert found.ratio == pytest.approx(0.8, abs=0.021)
    assert found.longest_gap_s == pytest.approx(2, abs=0.09)
    assert found.longest_gap_frames == pytest.approx(200, abs=9)
    assert DENSE_NS[found.first_lost_frame] / 1e9 == pytest.approx(2, abs=0.05)


def test_a_late_begin_and_an_early_end_are_lost_time():
    found = at(np.arange(3, 7, 0.04))
    assert found.ratio == pytest.approx(0.4, abs=0.021)
    assert (found.time_to_first_pose_s, found.ends_lost, found.gaps) == (3.0, True, 2)


@pytest.mark.parametrize(("end_s", "is_lost"), [(9.92, False), (9.88, True), (9.6, True)])
def test_who_stops_a_tenth_of_a_second_before_the_end_of_a_dense_truth_ends_lost(end_s, is_lost):
    assert at(np.arange(0, end_s, 0.02)).ends_lost == is_lost


def test_the_truth_alone_says_what_is_counted():
    every_other = np.arange(0, 10, 2)
    assert coverage(T_NS, every_other, of="auto") == coverage(T_NS, every_other, of="frames")
    assert coverage(T_NS, np.array([0, 9]), of="auto").ratio == 0.2
    assert at([0.0, 9.99]).ratio == 0.04
    assert coverage(DENSE_NS, np.arange(0, 1001, 2), of="frames").ratio == 501 / 1001


@given(st.sets(st.integers(0, 1000), min_size=1, max_size=60), st.data())
def test_a_pose_less_never_raises_coverage_of_time(frames, data):
    fewer = frames - {data.draw(st.sampled_from(sorted(frames)))}
    more, less = (coverage(DENSE_NS, np.array(sorted(some), np.int64), of="auto") for some in (frames, fewer))
    assert less.ratio <= more.ratio
    assert less.ends_lost >= more.ends_lost
    assert less.longest_gap_s >= more.longest_gap_s


def test_a_hole_in_the_truth_is_no_time_that_could_be_covered():
    kept = DENSE_NS[(DENSE_NS < 2 * 10**9) | (DENSE_NS > 6 * 10**9)]
    assert coverage(kept, np.arange(0, len(kept), 3), of="auto").ratio == 1.0


N = 40
T_NS_failure = np.arange(N, dtype=np.int64) * 10**8
ERRORS = st.lists(st.floats(0, 1e3), min_size=N, max_size=N).map(np.array)
FRAMES = st.sets(st.integers(0, N - 1), min_size=1)
FAIL_M = st.floats(1e-3, 1e3)


def scored(errors_m, frames, fail_m, t_ns=T_NS_failure):
    kept = np.array(sorted(frames), np.int64)
    return failure(errors_m[kept], slots(t_ns, "auto")[kept], coverage(t_ns, kept, of="auto"), fail_m=fail_m)


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


def test_a_dense_truth_of_less_than_two_slots_is_one_slot():
    t_ns = np.arange(61) * 5_000_000  # 0.3 s
    assert slots(t_ns, "auto").tolist() == [0] * 61
    assert coverage(t_ns, np.array([30]), of="auto").ratio == 1.0
    assert slots(np.arange(81) * 5_000_000, "auto").tolist() == [0] * 40 + [1] * 41  # 0.4 s


@pytest.mark.parametrize(("step_ns", "is_time"), [(29_999_999, True), (30_000_000, False)])
def test_truth_with_thirty_milliseconds_between_its_poses_has_frames(step_ns, is_time):
    t_ns = np.arange(100) * step_ns
    assert coverage(t_ns, np.arange(100), of="auto").of == ("time" if is_time else "frames")
    assert coverage(t_ns, np.arange(100), of="frames").of == "frames"


@pytest.mark.parametrize(("left_ns", "ends_lost"), [(100_000_000, False), (105_000_000, True)])
def test_by_time_the_last_tenth_of_a_second_needs_a_pose(left_ns, ends_lost):
    t_ns = np.arange(401) * 5_000_000
    frames = np.flatnonzero(t_ns <= t_ns[-1] - left_ns)
    assert coverage(t_ns, frames, of="auto").ends_lost == ends_lost


@pytest.mark.parametrize(("share", "survived"), [(5, True), (4, False)])
def test_an_estimate_survives_with_half_of_the_frames_and_a_pose_at_the_end(share, survived):
    frames = np.arange(10 - share, 10)
    covered = coverage(T_NS, frames)
    result = failure(np.zeros(share), frames, covered, fail_m=1.0)
    assert result.survived == survived
    assert result.lost_aware == pytest.approx(0.5 + 0.5 * share / 10 if survived else 0.5 * share / 10)

    without_end = coverage(T_NS, np.arange(9))
    assert not failure(np.zeros(9), np.arange(9), without_end, fail_m=1.0).survived


def test_a_stationary_truth_has_no_lost_aware_score():
    covered = coverage(T_NS, np.arange(10))
    result = failure(np.ones(10), np.arange(10), covered, fail_m=0.0)
    assert (result.survived, result.lost_aware, result.fail_m, result.confidently_wrong) == (True, None, 0.0, None)


def test_poses_beyond_the_limit_are_confidently_wrong_and_the_best_of_a_slot_counts():
    covered = coverage(T_NS, np.arange(10))
    errors_m = np.array([0.5, 1.0, 1.5, 0.0])
    result = failure(errors_m, np.array([0, 0, 1, 2]), covered, fail_m=1.0)
    assert result.confidently_wrong == 1
    accuracy = np.mean([0.5, 0.0, 1.0])
    assert result.lost_aware == pytest.approx(0.5 + 0.5 * accuracy)
