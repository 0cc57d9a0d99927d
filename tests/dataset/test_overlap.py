import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.dataset.overlap import overlap, overlapping_imu, overlapping_truth
from vobench.sensor.imu import ImuReadings
from vobench.trajectory.trajectory import Trajectory

STAMPS = st.lists(st.integers(-50, 50), min_size=1, max_size=12, unique=True).map(sorted)


def truth_at(t_ns: list[int]) -> Trajectory:
    return Trajectory(np.array(t_ns, np.int64), np.tile(np.eye(4), (len(t_ns), 1, 1)))


@given(STAMPS, STAMPS)
def test_the_overlap_brackets_the_pictures_with_one_stamp_before_and_one_after(
    t_ns: list[int], frames_ns: list[int]
) -> None:
    rows = overlap(np.array(t_ns), np.array(frames_ns))
    first, last = frames_ns[0], frames_ns[-1]
    if t_ns[-1] < first or t_ns[0] > last:
        assert rows is None
        return
    assert rows is not None
    selected = t_ns[rows]
    assert [t for t in t_ns if first <= t <= last] == [t for t in selected if first <= t <= last]
    assert sum(t < first for t in selected) == (any(t < first for t in t_ns) and first not in t_ns)
    assert sum(t > last for t in selected) == (any(t > last for t in t_ns) and last not in t_ns)


def test_no_stamps_overlap_with_nothing() -> None:
    assert overlap(np.array([], np.int64), np.array([1])) is None


@pytest.mark.parametrize(
    ("frames", "dropped", "bare"),
    [([10, 40], 0, 0), ([9, 40], 0, 1), ([10, 41], 0, 1), ([20, 30], 2, 0), ([5, 25], 1, 1), ([9, 41], 0, 2)],
)
def test_the_truth_says_how_many_poses_and_pictures_are_without_the_other(
    frames: list[int], dropped: int, bare: int
) -> None:
    truth, notes = overlapping_truth(truth_at([10, 20, 30, 40]), np.array(frames))
    assert truth is not None
    assert len(truth) == 4 - dropped
    expected = []
    if dropped:
        expected.append(f"{dropped} of 4 true poses lie outside the images' time; dropped.")
    if bare:
        expected.append(f"{bare} of 2 images lie outside the truth's time; they have no true pose.")
    assert notes == expected


def test_what_shares_no_time_is_dropped_with_both_times() -> None:
    truth, notes = overlapping_truth(truth_at([1, 2, 3]), np.array([5, 6, 7]))
    assert truth is None
    assert notes == ["The truth (1 to 3 ns) was dropped: it shares no time with the images (5 to 7 ns)."]
    readings = ImuReadings(np.array([8, 9, 11]), np.zeros((3, 3)), np.zeros((3, 3)))
    imu, notes = overlapping_imu(readings, np.array([5, 6, 7]))
    assert imu is None
    assert notes == ["The IMU (8 to 11 ns) was dropped: it shares no time with the images (5 to 7 ns)."]


def test_readings_stay_together_and_their_durations_are_in_seconds() -> None:
    t_ns = np.arange(0, 5_000_000_000, 1_000_000_000)
    values = np.arange(15.0).reshape(5, 3)
    imu, notes = overlapping_imu(ImuReadings(t_ns, values, -values), np.array([1_000_000_000, 1_500_000_000]))
    assert imu is not None
    np.testing.assert_array_equal(imu.t_ns, t_ns[1:3])
    np.testing.assert_array_equal(imu.gyro_radps, values[1:3])
    np.testing.assert_array_equal(imu.accel_mps2, -values[1:3])
    assert notes == ["3 of 5 IMU readings lie outside the images' time (4.0 s beside 0.5 s); dropped."]
    same, notes = overlapping_imu(ImuReadings(t_ns, values, -values), t_ns)
    assert same is not None
    assert len(same.t_ns) == 5
    assert notes == []
