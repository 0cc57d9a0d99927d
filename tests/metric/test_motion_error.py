"""Motions and their errors do not depend on the world frame, and are zero only between equal ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.motion_error import angle_rad, errors_between, matrix_errors, motion_errors, motions

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


@given(SEEDS)
def test_errors_of_columns_are_those_of_matrices(seed):
    rng = np.random.default_rng(seed)
    T_gt, T_est = random_poses(rng), random_poses(rng)
    T_est[:, :3, :3] += 1e-7 * rng.normal(size=(12, 3, 3))  # as after rounding in a text file
    first, last = np.arange(11), np.arange(1, 12)
    E = se3.inverse(motions(T_gt, first, last)) @ motions(T_est, first, last)
    errors = errors_between(T_gt, T_est, first, last)
    np.testing.assert_allclose(errors.trans_m, np.linalg.norm(E[:, :3, 3], axis=1), atol=1e-13)
    np.testing.assert_allclose(errors.rot_rad, angle_rad(E[:, :3, :3]), atol=1e-12)


def test_matrix_errors_are_the_norms_of_the_rotation_and_of_the_whole():
    E = se3.transform(se3.rotation_z(np.pi), [[3.0, 4.0, 0.0]])
    errors = matrix_errors(E)
    assert errors.rotation == pytest.approx([np.sqrt(8.0)])
    assert errors.full == pytest.approx([np.sqrt(8.0 + 25.0)])
