"""Absolute errors do not depend on the world frame, and are in metres and radians."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.ate import absolute_errors

SEEDS = st.integers(0, 2**32 - 1)


def random_poses(rng, n=12):
    q = rng.normal(size=(n, 4))
    rotations = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    return se3.transform(rotations, rng.normal(size=(n, 3)))


@given(SEEDS)
def test_absolute_errors_do_not_depend_on_the_world_frame(seed):
    rng = np.random.default_rng(seed)
    T_gt, T_est, T_other_world = random_poses(rng), random_poses(rng), random_poses(rng, 1)
    here, there = absolute_errors(T_gt, T_est), absolute_errors(T_other_world @ T_gt, T_other_world @ T_est)
    np.testing.assert_allclose(here.trans_m, there.trans_m, atol=1e-13)
    np.testing.assert_allclose(here.rot_rad, there.rot_rad, atol=1e-13)


def test_errors_are_in_metres_and_radians():
    T_gt = se3.transform(np.eye(3), np.zeros((1, 3)))
    T_est = se3.transform(se3.rotation_z(0.25), [[3.0, 4.0, 0.0]])
    errors = absolute_errors(T_gt, T_est)
    assert (errors.trans_m.item(), errors.rot_rad.item()) == pytest.approx((5.0, 0.25))
