"""Relative errors over parts of the path, and the split of an angle into yaw and tilt."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.pose_error import roll_pitch_yaw_rad
from vobench.metric.relative import part_errors, relative_lengths

SEEDS = st.integers(0, 2**32 - 1)
N = 400


def rotation_x(angle):
    return se3.rotation_z(angle)[..., [2, 0, 1], :][..., [2, 0, 1]]


def circle(n=N, radius_m=5.0):
    angle = np.linspace(0, 2 * np.pi, n)
    level = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    return se3.transform(se3.rotation_z(angle + np.pi / 2), radius_m * level)


@given(SEEDS)
def test_roll_pitch_and_yaw_make_the_rotation_again(seed):
    q = np.random.default_rng(seed).normal(size=(20, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    roll, pitch, yaw = roll_pitch_yaw_rad(R).T
    Ry = rotation_x(pitch)[..., [2, 0, 1], :][..., [2, 0, 1]]
    np.testing.assert_allclose(se3.rotation_z(yaw) @ Ry @ rotation_x(roll), R, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_where_roll_and_yaw_are_one_yaw_has_it_all(pitch):
    Ry = rotation_x(pitch)[[2, 0, 1], :][:, [2, 0, 1]]
    roll, found, yaw = roll_pitch_yaw_rad(se3.rotation_z(0.3) @ Ry)
    assert (roll, found, yaw) == pytest.approx((0.0, pitch, 0.3))


def test_lengths_are_tenths_of_the_path_cut_to_centimetres_or_ov_evals():
    assert relative_lengths(12.349, "rpg") == (1.23, 2.46, 3.7, 4.93, 6.17)
    assert relative_lengths(0.02, "rpg") == (0.01,)
    assert relative_lengths(0.0, "rpg") == ()
    assert relative_lengths(12.0, "openvins") == (8.0, 16.0, 24.0, 32.0, 40.0, 48.0)


@pytest.mark.parametrize("rule", ["rpg", "openvins"])
def test_the_truth_has_no_error(rule):
    errors = part_errors(circle(), circle(), relative_lengths(31.4, rule), rule=rule)
    assert set(errors.length_m) >= {8.0, 16.0} or rule == "rpg"
    assert max(errors.trans_m.max(), errors.rot_rad.max(), errors.yaw_rad.max()) < 1e-7


def test_a_drift_in_yaw_is_yaw_and_not_tilt():
    T_gt = circle()
    drift = se3.transform(se3.rotation_z(np.linspace(0, 0.2, N)), np.zeros((N, 3)))
    errors = part_errors(T_gt, drift @ T_gt, (3.0, 6.0), rule="rpg")
    np.testing.assert_allclose(errors.yaw_rad, errors.rot_rad, atol=1e-9)
    assert errors.gravity_rad.max() < 1e-9
    of_length = [errors.yaw_rad[errors.length_m == length].mean() for length in (3.0, 6.0)]
    assert of_length[1] / of_length[0] == pytest.approx(2.0, rel=0.02)


def test_a_drift_in_roll_of_the_world_is_tilt_and_not_yaw():
    T_gt = circle()
    drift = se3.transform(rotation_x(np.linspace(0, 0.01, N)), np.zeros((N, 3)))
    errors = part_errors(T_gt, drift @ T_gt, (3.0,), rule="rpg")
    np.testing.assert_allclose(errors.gravity_rad, errors.rot_rad, rtol=1e-3)
    assert errors.yaw_rad.max() < 1e-3 * errors.gravity_rad.max()


def test_a_length_with_fewer_than_two_parts_is_left_out():
    assert len(part_errors(circle(), circle(), (31.4, 100.0), rule="rpg")) >= 2
    assert len(part_errors(circle(), circle(), (500.0,), rule="rpg")) == 0
    assert len(part_errors(circle(1), circle(1), (1.0,), rule="rpg")) == 0


def test_a_part_ends_within_half_a_metre_or_a_fifth_of_its_length():
    T = se3.transform(np.eye(3), np.arange(20)[:, None] * [3.0, 0.0, 0.0])
    assert len(part_errors(T, T, (8.0,), rule="openvins")) == 0
    assert len(part_errors(T, T, (8.0,), rule="rpg")) == 17
