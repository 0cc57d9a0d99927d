"""Relative pose error: pairs span gaps."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.rpe import relative_errors, spanning_pairs

FRAMES = st.lists(st.integers(0, 60), max_size=30, unique=True).map(lambda f: np.array(sorted(f), np.int64))


def straight(n, step_m=0.1):
    return se3.transform(np.eye(3), np.arange(n)[:, None] * [step_m, 0.0, 0.0])


@given(FRAMES, st.integers(1, 10))
def test_each_pose_goes_with_the_first_one_delta_or_more_frames_later(frames, delta):
    first, last = spanning_pairs(frames, delta=delta)
    expected = [
        (i, next(j for j, later in enumerate(frames) if later >= frame + delta))
        for i, frame in enumerate(frames)
        if frames[-1] >= frame + delta
    ]
    assert list(zip(first.tolist(), last.tolist(), strict=True)) == expected


@given(FRAMES)
def test_by_default_every_matched_pose_goes_with_the_next(frames):
    first, last = spanning_pairs(frames, delta=1)
    assert (last - first == 1).all()
    assert len(first) == max(len(frames) - 1, 0)


def test_an_error_made_while_lost_is_counted():
    T_gt = straight(20)
    frames = np.r_[0:5, 15:20]
    T_est = T_gt[frames].copy()
    T_est[5:, 0, 3] -= 1.0  # stood still for the ten lost frames
    errors = relative_errors(T_gt[frames], T_est, frames)
    np.testing.assert_allclose(errors.trans_m, [0, 0, 0, 0, 1.0, 0, 0, 0, 0], atol=1e-12)


def test_a_drift_of_one_percent_is_one_percent_of_each_step():
    T_gt = straight(20)
    T_est = straight(20, step_m=0.101)
    for delta in (1, 5):
        errors = relative_errors(T_gt, T_est, np.arange(20), delta=delta)
        np.testing.assert_allclose(errors.trans_m, np.full(20 - delta, 0.001 * delta), atol=1e-12)


def test_one_pose_has_no_relative_error():
    assert len(relative_errors(straight(1), straight(1), np.arange(1))) == 0
