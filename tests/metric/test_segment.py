"""Segments: the devkit's rule, and what becomes of it where frames are missing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.score import ScoreSettings, score
from vobench.metric.segment import devkit_distances, mean_drift, scale_errors, segment_errors, segment_pairs
from vobench.trajectory.trajectory import Trajectory

STEP_M = 0.25  # a power of two, so that path lengths are exact and "strictly beyond" shows


def straight(n, step_m=STEP_M):
    return se3.transform(np.eye(3), np.arange(n)[:, None] * [step_m, 0.0, 0.0])


def path(n):
    return np.arange(n) * STEP_M


def test_a_segment_ends_at_the_first_frame_strictly_beyond_its_length():
    first, last, over_m = segment_pairs(np.arange(10), path(10), 0.5)
    assert first.tolist() == list(range(7))
    assert last.tolist() == list(range(3, 10))
    assert over_m.tolist() == [0.5] * 7


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 5.0), st.integers(1, 4))
def test_pairs_are_those_of_the_rule_word_for_word(seed, length_m, step):
    rng = np.random.default_rng(seed)
    distances_m = np.cumsum(rng.uniform(0, 0.5, 40) * rng.integers(0, 2, 40))
    frames = np.flatnonzero(rng.random(40) < 0.7)
    expected = []
    for i, frame in enumerate(frames):
        beyond = [f for f in range(40) if distances_m[f] > distances_m[frame] + length_m]
        later = [j for j, f in enumerate(frames) if beyond and f >= beyond[0]]
        if frame % step == 0 and later:
            travelled_m = distances_m[frames[later[0]]] - distances_m[frame]
            expected.append((i, later[0], length_m if frames[later[0]] == beyond[0] else travelled_m))
    assert list(zip(*segment_pairs(frames, distances_m, length_m, step_frames=step), strict=True)) == expected


def test_across_a_gap_the_path_really_travelled_divides():
    frames = np.array([0, 1, 9])
    first, last, over_m = segment_pairs(frames, path(10), 0.5)
    assert (first.tolist(), last.tolist(), over_m.tolist()) == ([0, 1], [2, 2], [2.25, 2.0])


def test_lengths_longer_than_the_path_give_no_segment():
    T = straight(9)
    s = segment_errors(T, T, np.arange(9), path(9), lengths_m=(1.0, 2.0, 3.0))
    assert set(s.length_m) == {1.0}
    assert len(segment_errors(T, T, np.arange(9), path(9), lengths_m=(2.0,))) == 0


def test_two_percent_of_drift_is_two_percent_at_every_length():
    n = 400
    T_gt, T_est = straight(n, 1 / 1024), straight(n, 1.02 / 1024)
    s = segment_errors(T_gt, T_est, np.arange(n), np.arange(n) / 1024, lengths_m=(0.1, 0.3))
    # A segment is up to one frame longer than its length.
    assert s.trans_ratio == pytest.approx(0.02, rel=0.01)
    assert (s.rot_radpm < 1e-12).all()


def test_a_turn_of_a_tenth_of_a_radian_a_metre_is_found():
    n = 400
    T_gt = straight(n, 1 / 1024)
    T_est = T_gt.copy()
    T_est[:, :3, :3] = se3.rotation_z(0.1 * np.arange(n) / 1024)
    s = segment_errors(T_gt, T_est, np.arange(n), np.arange(n) / 1024, lengths_m=(0.1, 0.3))
    assert s.rot_radpm == pytest.approx(0.1, rel=0.01)


def wandering(rng, n=500):
    """A path of unequal steps that turns, and an estimate of it."""
    yaw = np.cumsum(rng.normal(scale=0.05, size=n))
    steps = rng.uniform(0.5, 1.5, n)[:, None] * np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    T_gt = se3.transform(se3.rotation_z(yaw), np.cumsum(steps, axis=0))
    drift = se3.transform(se3.rotation_z(1e-4 * np.arange(n)), np.zeros((n, 3)))
    return T_gt, drift @ T_gt


def test_the_devkits_rounding_changes_little_and_only_the_last_digits():
    T_gt, T_est = wandering(np.random.default_rng(1))
    lengths = (20.0, 50.0, 100.0)
    frames, way = np.arange(len(T_gt)), np.linalg.norm(np.diff(T_gt[:, :3, 3], axis=0), axis=1)
    exact = segment_errors(T_gt, T_est, frames, np.concatenate([[0.0], np.cumsum(way)]), lengths_m=lengths)
    sums = devkit_distances(T_gt[:, :3, 3])
    rounded = segment_errors(T_gt, T_est, frames, sums, lengths_m=lengths, precision="devkit")
    assert (sums.dtype, rounded.trans_ratio.dtype, rounded.rot_radpm.dtype) == (np.float32,) * 3
    np.testing.assert_array_equal(rounded.first, exact.first)
    same = rounded.last == exact.last
    assert same.mean() > 0.99
    np.testing.assert_allclose(rounded.trans_ratio[same], exact.trans_ratio[same], rtol=1e-5)
    # Near 1 a float32 cosine has steps of 6e-8: angles below a milliradian drown in them.
    np.testing.assert_allclose(rounded.rot_radpm[same], exact.rot_radpm[same], atol=3.5e-4 / 20)


def test_segments_come_start_after_start():
    T_gt, T_est = wandering(np.random.default_rng(2), 100)
    s = segment_errors(T_gt, T_est, np.arange(100), np.arange(100.0), lengths_m=(20.0, 5.0, 10.0), step_frames=10)
    assert list(zip(s.first, s.length_m, strict=True)) == sorted(zip(s.first, s.length_m, strict=True))


def test_micro_counts_segments_and_macro_counts_lengths():
    errors, length_m = np.array([1.0, 1.0, 1.0, 5.0]), np.array([10.0, 10.0, 10.0, 20.0])
    assert mean_drift(errors, length_m) == 2.0
    assert mean_drift(errors, length_m, mean="macro") == 3.0


def test_a_float32_mean_rounds_after_every_sum():
    errors = np.full(10**6, 0.1, np.float32)
    assert mean_drift(errors, errors) != pytest.approx(0.1, rel=1e-4)
    assert mean_drift(errors.astype(float), errors) == pytest.approx(0.1, rel=1e-7)


@pytest.mark.parametrize(("angle", "half_turns"), [(0.0, 0.0), (np.pi, 1.0)])
def test_the_devkits_cosine_that_six_digits_push_beyond_one_is_cut(angle, half_turns):
    T_gt = straight(4, 1.0)
    T_est = T_gt.copy()
    T_est[1:, :3, :3] = (1 - 1e-6) * se3.rotation_z(angle)  # its inverse is as much too large
    s = segment_errors(T_gt, T_est, np.arange(4), np.arange(4.0), lengths_m=(2.5,), precision="devkit")
    assert s.rot_radpm == pytest.approx(half_turns * np.pi / 2.5)


# Scale: found where it is, and its drift with it.
N = 200
ALONG_M = np.arange(N) * 0.1
FIRST = np.arange(N - 10)


def line(positions_m):
    return se3.transform(np.eye(3), np.asarray(positions_m)[:, None] * [0.6, 0.8, 0.0])


@given(st.floats(0.01, 100))
def test_a_constant_scale_is_found_everywhere_and_does_not_drift(factor):
    found = scale_errors(line(ALONG_M), line(factor * ALONG_M), ALONG_M, FIRST, FIRST + 10)
    np.testing.assert_allclose(found.error, factor - 1, atol=1e-9 * max(factor, 1))
    assert found.drift_per_m == pytest.approx(0.0, abs=1e-9)


def test_a_scale_that_grows_by_a_percent_a_metre_drifts_by_a_percent_a_metre():
    steps = 0.1 * np.exp(0.01 * (ALONG_M[:-1] + 0.05))
    found = scale_errors(line(ALONG_M), line(np.concatenate([[0], np.cumsum(steps)])), ALONG_M, FIRST, FIRST + 10)
    assert found.drift_per_m == pytest.approx(0.01, rel=1e-6)


def test_segments_that_come_back_show_no_scale():
    there_and_back = np.concatenate([ALONG_M[:100], ALONG_M[100:0:-1]])
    found = scale_errors(line(there_and_back), line(1.1 * there_and_back), ALONG_M, FIRST, FIRST + 10)
    np.testing.assert_allclose(found.error, 0.1, atol=1e-9)
    assert len(found.error) < len(FIRST)


def test_a_truth_that_stands_shows_no_scale():
    found = scale_errors(line(0 * ALONG_M), line(ALONG_M), ALONG_M, FIRST, FIRST + 10)
    assert (len(found.error), found.drift_per_m) == (0, 0.0)
    none = scale_errors(line(ALONG_M), line(ALONG_M), ALONG_M, FIRST[:0], FIRST[:0])
    assert (len(none.error), none.drift_per_m) == (0, 0.0)


def test_a_score_in_full_has_the_ten_percent_that_rpgs_index_bug_hides():
    T = line(ALONG_M)
    T[:, 2, 3] = np.sin(ALONG_M)
    scaled = T.copy()
    scaled[:, :3, 3] *= 1.1
    t_ns = np.arange(N) * 10**8
    result = score(Trajectory(t_ns, T), Trajectory(t_ns, scaled), settings=ScoreSettings(full=True))
    assert result.metric("scale_error").statistics.mean == pytest.approx(0.1)


def test_a_segment_that_ends_within_a_tenth_of_the_median_distance_shows_no_scale():
    x_m = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 0.11, 0.0, 0.09])
    first = np.array([0, 2, 4, 6])
    found = scale_errors(line(x_m), line(3 * x_m), np.arange(8.0), first, first + 1)

    assert len(found.error) == 4  # the median is 0.555
    first_long = np.array([0, 0, 0, 4, 6])
    found = scale_errors(line(x_m), line(3 * x_m), np.arange(8.0), first_long, np.array([1, 3, 1, 5, 7]))
    np.testing.assert_allclose(found.error, [2.0] * 4)  # the median is 1: 0.11 counts, 0.09 does not


def test_the_drift_of_scale_is_the_slope_over_the_middles_of_segments():
    along_m = np.array([0.0, 2.0, 10.0, 14.0])
    gt = line([0.0, 1.0, 2.0, 3.0])
    est = line([0.0, 1.0, 0.0, np.e])
    found = scale_errors(gt, est, along_m, np.array([0, 2]), np.array([1, 3]))

    np.testing.assert_allclose(found.error, [0.0, np.e - 1])
    assert found.drift_per_m == pytest.approx(1 / (12 - 1))  # the logarithm rises by 1 from 1 m to 12 m
