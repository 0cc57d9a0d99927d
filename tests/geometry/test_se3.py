"""SE(3) obeys the group's laws, and rotations survive the way through quaternions, even near pi."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.geometry.se3 import Array

EDGE_ANGLES_RAD = (0.0, 1e-12, 1e-8, 1e-4, 0.5, np.pi / 2, 3.0, np.pi - 1e-4, np.pi - 1e-8, np.pi - 1e-12, np.pi)


def random_transforms(count: int, *, seed: int = 5) -> Array:
    rng = np.random.default_rng(seed)
    return se3.transform(Rotation.random(count, rng).as_matrix(), 10 * rng.standard_normal((count, 3)))


def turns(angle_rad: float, *, count: int = 60) -> Array:
    """Rotations (count + 9, 3, 3) by one angle, about random axes and about those where forms change."""
    axes = np.random.default_rng(7).standard_normal((count, 3))
    special = np.array(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1], [-1, 1, 1], [0, 0, -1]]
    )
    axes = np.concatenate([axes, special])
    return Rotation.from_rotvec(angle_rad * axes / np.linalg.norm(axes, axis=1, keepdims=True)).as_matrix()


def test_a_transform_and_its_inverse_cancel_from_either_side() -> None:
    T = random_transforms(200)
    for product in (T @ se3.inverse(T), se3.inverse(T) @ T):
        np.testing.assert_allclose(product, np.broadcast_to(np.eye(4), T.shape), atol=1e-13)


def test_the_inverse_of_a_product_is_the_product_of_inverses_backwards() -> None:
    A, B = random_transforms(100), random_transforms(100, seed=6)
    np.testing.assert_allclose(se3.inverse(A @ B), se3.inverse(B) @ se3.inverse(A), atol=1e-13)


def test_applying_a_product_is_applying_one_after_the_other() -> None:
    T_a_b, T_b_c = random_transforms(20), random_transforms(20, seed=6)
    points_c = np.random.default_rng(1).standard_normal((20, 7, 3))
    np.testing.assert_allclose(
        se3.apply(T_a_b @ T_b_c, points_c), se3.apply(T_a_b, se3.apply(T_b_c, points_c)), atol=1e-12
    )


def test_one_transform_moves_many_points_and_many_transforms_the_same_points() -> None:
    T, points = random_transforms(4), np.random.default_rng(2).standard_normal((6, 3))
    moved = se3.apply(T, points)
    assert moved.shape == (4, 6, 3)
    np.testing.assert_allclose(moved[2], points @ T[2, :3, :3].T + T[2, :3, 3], atol=1e-14)


@pytest.mark.parametrize("angle_rad", EDGE_ANGLES_RAD)
def test_a_rotation_comes_back_from_its_quaternion(angle_rad: float) -> None:
    R = turns(angle_rad)
    q_xyzw = se3.to_quaternion(R)
    np.testing.assert_allclose(se3.from_quaternion(q_xyzw), R, atol=3e-15)
    np.testing.assert_allclose(np.linalg.norm(q_xyzw, axis=-1), 1, atol=1e-15)
    assert (q_xyzw[..., 3] >= 0).all()


def test_quaternions_are_those_of_scipy() -> None:
    R = random_transforms(500)[:, :3, :3]
    np.testing.assert_allclose(se3.to_quaternion(R), Rotation.from_matrix(R).as_quat(canonical=True), atol=1e-14)


@pytest.mark.parametrize("angle_rad", EDGE_ANGLES_RAD)
def test_the_angle_of_a_turn_is_the_angle_it_was_made_with(angle_rad: float) -> None:
    # Relative near 0, where the arc cosine of the trace would return 0 below 1e-8.
    np.testing.assert_allclose(se3.rotation_angle(turns(angle_rad)), angle_rad, rtol=1e-7, atol=1e-15)


def test_the_angle_does_not_depend_on_the_frame_it_is_seen_from() -> None:
    R, Q = random_transforms(50)[:, :3, :3], random_transforms(50, seed=9)[:, :3, :3]
    np.testing.assert_allclose(se3.rotation_angle(Q @ R @ np.swapaxes(Q, -1, -2)), se3.rotation_angle(R), atol=1e-12)


def test_turns_about_z_add_up() -> None:
    a, b = np.random.default_rng(3).uniform(-4, 4, (2, 50))
    np.testing.assert_allclose(se3.rotation_z(a) @ se3.rotation_z(b), se3.rotation_z(a + b), atol=1e-14)
    np.testing.assert_allclose(se3.rotation_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_the_nearest_rotation_is_a_rotation_and_none_around_it_is_nearer() -> None:
    M = random_transforms(80)[:, :3, :3] + 0.2 * np.random.default_rng(4).standard_normal((80, 3, 3))
    R = se3.nearest_rotation(M)
    assert se3.is_rotation(R)
    distance = np.linalg.norm(M - R, axis=(1, 2))
    for step in turns(1e-3):
        assert (np.linalg.norm(M - R @ step, axis=(1, 2)) >= distance).all()


def test_the_nearest_rotation_to_a_rotation_is_itself_and_to_a_mirror_none_the_less_a_rotation() -> None:
    R = random_transforms(50)[:, :3, :3]
    np.testing.assert_allclose(se3.nearest_rotation(R), R, atol=1e-14)
    assert se3.is_rotation(se3.nearest_rotation(R @ np.diag([1.0, 1.0, -0.5])))


@pytest.mark.parametrize(
    "matrix", [np.diag([1.0, 1.0, -1.0]), 1.001 * np.eye(3), np.full((3, 3), np.nan), np.zeros((3, 3))]
)
def test_a_mirror_a_stretch_and_nonsense_are_no_rotations(matrix: Array) -> None:
    assert se3.is_rotation(np.eye(3))
    assert not se3.is_rotation(matrix)
    assert not se3.is_rotation(np.stack([np.eye(3), matrix]))


def test_roll_pitch_and_yaw_multiply_to_the_rotation() -> None:
    R = random_transforms(100)[:, :3, :3]
    roll, pitch, yaw = se3.roll_pitch_yaw_rad(R).T
    expected = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], -1)).as_matrix()
    np.testing.assert_allclose(expected, R, atol=1e-14)
    assert (np.abs(pitch) <= np.pi / 2).all()


@pytest.mark.parametrize("pitch_rad", [np.pi / 2, -np.pi / 2])
@pytest.mark.parametrize(("yaw_rad", "roll_rad"), [(0.3, 0.0), (0.3, 0.5), (-2.0, 0.1)])
def test_at_90_degrees_of_pitch_the_whole_turn_is_yaw(pitch_rad: float, yaw_rad: float, roll_rad: float) -> None:
    yaw, pitch, roll = (se3.rotation_z(yaw_rad), turn_y(pitch_rad), turn_x(roll_rad))
    R = yaw @ pitch @ roll
    R[2, 1:] = 0.0  # exactly at the pole
    R[:2, 0] = 0.0
    angles = se3.roll_pitch_yaw_rad(R)
    assert angles[0] == 0.0
    np.testing.assert_allclose(angles[1], pitch_rad)
    np.testing.assert_allclose(se3.rotation_z(angles[2]) @ turn_y(pitch_rad), R, atol=1e-12)


def turn_y(angle_rad: float) -> Array:
    return Rotation.from_euler("y", angle_rad).as_matrix()


def turn_x(angle_rad: float) -> Array:
    return Rotation.from_euler("x", angle_rad).as_matrix()


@pytest.mark.parametrize(("cosine", "is_merged"), [(0.9e-12, True), (1.1e-12, False)])
def test_roll_and_yaw_merge_where_the_cosine_of_pitch_is_below_a_millionth_of_a_millionth(
    cosine: float, is_merged: bool
) -> None:
    R = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, cosine, 0.0]])
    assert (se3.roll_pitch_yaw_rad(R)[0] == 0.0) == is_merged


def test_a_transform_broadcasts_one_rotation_over_many_translations() -> None:
    t = np.arange(6.0).reshape(2, 3)
    T = se3.transform(np.eye(3), t)
    np.testing.assert_array_equal(T[:, :3, 3], t)
    np.testing.assert_array_equal(T[:, 3], [[0, 0, 0, 1]] * 2)
    assert se3.transform(se3.rotation_z([0.1, 0.2]), [0, 0, 0]).shape == (2, 4, 4)


@pytest.mark.parametrize(("tolerance", "is_one"), [(1.9e-3, False), (2.1e-3, True)])
def test_the_tolerance_of_a_rotation_is_that_of_its_product_with_its_transpose(tolerance: float, is_one: bool) -> None:
    assert se3.is_rotation(np.sqrt(1.002) * np.eye(3), tolerance=tolerance) == is_one


def test_a_transpose_is_the_inverse_of_a_rotation() -> None:
    R = random_transforms(20)[:, :3, :3]
    np.testing.assert_allclose(se3.transposed(R) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-14)


def rotation_x(angle_rad: Array) -> Array:
    return se3.rotation_z(angle_rad)[..., [2, 0, 1], :][..., [2, 0, 1]]


def test_roll_pitch_and_yaw_make_the_rotation_again() -> None:
    R = random_transforms(200)[:, :3, :3]
    roll, pitch, yaw = se3.roll_pitch_yaw_rad(R).T
    Ry = rotation_x(pitch)[..., [2, 0, 1], :][..., [2, 0, 1]]
    np.testing.assert_allclose(se3.rotation_z(yaw) @ Ry @ rotation_x(roll), R, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_where_roll_and_yaw_are_one_yaw_has_it_all(pitch: float) -> None:
    Ry = rotation_x(pitch)[[2, 0, 1], :][:, [2, 0, 1]]
    roll, found, yaw = se3.roll_pitch_yaw_rad(se3.rotation_z(0.3) @ Ry)
    assert (roll, found, yaw) == pytest.approx((0.0, pitch, 0.3))
