"""Coverage: how much there is, and where it stops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.metric.coverage import coverage, slots

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
    assert found.slot_kind == "frames"


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
    return coverage(DENSE_NS, np.searchsorted(DENSE_NS, np.round(np.asarray(t_s) * 1e9).astype(np.int64)), rule="auto")


@pytest.mark.parametrize("rate_hz", [10, 15, 30, 60, 100])
def test_a_truth_too_dense_for_frames_is_covered_by_any_camera(rate_hz):
    found = at(np.arange(0, 9.999, 1 / rate_hz))
    assert (found.slot_kind, found.gaps, found.ratio, found.ends_lost) == ("time", 0, 1.0, False)


@pytest.mark.parametrize("phase_s", [0.0, 0.004, 0.02])
def test_time_lost_counts_wherever_the_frames_lay(phase_s):
    t_s = np.arange(phase_s, 9.98, 0.04)
    found = at(t_s[(t_s < 2) | (t_s > 4)])
    assert (found.slot_kind, found.gaps, found.relocalisations) == ("time", 1, 1)
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
    assert coverage(T_NS, every_other, rule="auto") == coverage(T_NS, every_other, rule="frames")
    assert coverage(T_NS, np.array([0, 9]), rule="auto").ratio == 0.2
    assert at([0.0, 9.99]).ratio == 0.04
    assert coverage(DENSE_NS, np.arange(0, 1001, 2), rule="frames").ratio == 501 / 1001


@given(st.sets(st.integers(0, 1000), min_size=1, max_size=60), st.data())
def test_a_pose_less_never_raises_coverage_of_time(frames, data):
    fewer = frames - {data.draw(st.sampled_from(sorted(frames)))}
    more, less = (coverage(DENSE_NS, np.array(sorted(some), np.int64), rule="auto") for some in (frames, fewer))
    assert less.ratio <= more.ratio
    assert less.ends_lost >= more.ends_lost
    assert less.longest_gap_s >= more.longest_gap_s


def test_a_hole_in_the_truth_is_no_time_that_could_be_covered():
    kept = DENSE_NS[(DENSE_NS < 2 * 10**9) | (DENSE_NS > 6 * 10**9)]
    assert coverage(kept, np.arange(0, len(kept), 3), rule="auto").ratio == 1.0


def test_a_dense_truth_of_less_than_two_slots_is_one_slot():
    t_ns = np.arange(61) * 5_000_000  # 0.3 s
    assert slots(t_ns, "auto").of_frame.tolist() == [0] * 61
    assert coverage(t_ns, np.array([30]), rule="auto").ratio == 1.0
    assert slots(np.arange(81) * 5_000_000, "auto").of_frame.tolist() == [0] * 40 + [1] * 41  # 0.4 s


@pytest.mark.parametrize(("step_ns", "is_time"), [(29_999_999, True), (30_000_000, False)])
def test_truth_with_thirty_milliseconds_between_its_poses_has_frames(step_ns, is_time):
    t_ns = np.arange(100) * step_ns
    assert coverage(t_ns, np.arange(100), rule="auto").slot_kind == ("time" if is_time else "frames")
    assert coverage(t_ns, np.arange(100), rule="frames").slot_kind == "frames"


@pytest.mark.parametrize(("left_ns", "ends_lost"), [(100_000_000, False), (105_000_000, True)])
def test_by_time_the_last_tenth_of_a_second_needs_a_pose(left_ns, ends_lost):
    t_ns = np.arange(401) * 5_000_000
    frames = np.flatnonzero(t_ns <= t_ns[-1] - left_ns)
    assert coverage(t_ns, frames, rule="auto").ends_lost == ends_lost
