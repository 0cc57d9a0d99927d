"""Scale: found where it is, its drift with it, and TartanAir's two factors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.comparison import ate_scale, motion_scale
from vobench.metric.score import ScoreSettings, score
from vobench.metric.segment import scale_errors
from vobench.trajectory.align import align
from vobench.trajectory.trajectory import Trajectory

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


SEEDS = st.integers(0, 2**32 - 1)


def random_path(rng, n=30):
    return se3.transform(np.eye(3), np.cumsum(rng.normal(size=(n, 3)), axis=0))


@given(SEEDS, st.floats(0.1, 10))
def test_a_pure_scale_is_undone_by_both_of_tartanairs(seed, scale):
    T = random_path(np.random.default_rng(seed))
    scaled = se3.transform(T[:, :3, :3], scale * T[:, :3, 3])
    assert (ate_scale(T, scaled), motion_scale(T, scaled)) == pytest.approx((1 / scale, 1 / scale))


@given(SEEDS)
def test_tartanairs_is_never_below_umeyamas(seed):
    rng = np.random.default_rng(seed)
    T = random_path(rng)
    noisy = T.copy()
    noisy[:, :3, 3] += rng.normal(size=(30, 3))
    assert ate_scale(T, noisy) >= align(noisy, T, kind="sim3").scale * (1 - 1e-12)


def test_steps_of_the_truth_that_stand_do_not_count():
    T = random_path(np.random.default_rng(1))
    T[10:20] = T[10]
    trembling = T.copy()
    trembling[11:20, 0, 3] += 0.5
    assert motion_scale(T[:20], trembling[:20]) == pytest.approx(1.0)
