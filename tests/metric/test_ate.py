"""Errors between poses, and the absolute and relative errors built on them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.ate import absolute_errors, angle_rad, motion_errors, motions

SEEDS = st.integers(0, 2**32 - 1)


def random_poses(rng, n=12):
    q = rng.normal(size=(n, 4))
    rotations = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    return se3.transform(rotations, rng.normal(size=(n, 3)))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi])
def test_an_angle_is_found_again_through_six_digits_of_skew(angle):
    assert angle_rad(se3.rotation_z(angle)) == pytest.approx(angle, abs=1e-15, rel=1e-15)
    skew = np.eye(3) + 2e-7 * np.array([[1.0, 0.5, 0.0], [0.5, -1.0, 0.3], [0.0, 0.3, 0.7]])
    polar = se3.nearest_rotation(se3.rotation_z(angle) @ skew)
    assert angle_rad(se3.rotation_z(angle) @ skew) == pytest.approx(se3.rotation_angle(polar), abs=1e-12)


@given(SEEDS)
def test_absolute_errors_do_not_depend_on_the_world_frame(seed):
    rng = np.random.default_rng(seed)
    T_gt, T_est, T_other_world = random_poses(rng), random_poses(rng), random_poses(rng, 1)
    here, there = absolute_errors(T_gt, T_est), absolute_errors(T_other_world @ T_gt, T_other_world @ T_est)
    np.testing.assert_allclose(here.trans_m, there.trans_m, atol=1e-13)
    np.testing.assert_allclose(here.rot_rad, there.rot_rad, atol=1e-13)


@given(SEEDS)
def test_motion_errors_are_symmetric_and_zero_only_between_equals(seed):
    rng = np.random.default_rng(seed)
    a, b = random_poses(rng), random_poses(rng)
    ab, ba, aa = motion_errors(a, b), motion_errors(b, a), motion_errors(a, a)
    np.testing.assert_allclose(ab.trans_m, ba.trans_m, atol=1e-13)
    np.testing.assert_allclose(ab.rot_rad, ba.rot_rad, atol=1e-13)
    assert max(aa.trans_m.max(), aa.rot_rad.max()) < 1e-14
    assert min(ab.trans_m.min(), ab.rot_rad.min()) > 0


@given(SEEDS)
def test_motions_do_not_depend_on_the_world_frame(seed):
    rng = np.random.default_rng(seed)
    T, T_other_world = random_poses(rng), random_poses(rng, 1)
    first, last = np.arange(11), np.arange(1, 12)
    np.testing.assert_allclose(motions(T, first, last), motions(T_other_world @ T, first, last), atol=1e-12)
    np.testing.assert_allclose(T[first] @ motions(T, first, last), T[last], atol=1e-13)


def test_errors_are_in_metres_and_radians():
    T_gt = se3.transform(np.eye(3), np.zeros((1, 3)))
    T_est = se3.transform(se3.rotation_z(0.25), [[3.0, 4.0, 0.0]])
    errors = absolute_errors(T_gt, T_est)
    assert (errors.trans_m.item(), errors.rot_rad.item()) == pytest.approx((5.0, 0.25))
