"""Alignment: what a similarity hides is found again, and what can't be found is said."""

import json
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.trajectory.align import Alignment, AlignmentKind, align, align_positions, rotation_between

SEEDS = st.integers(0, 2**32 - 1)


def random_rotation(rng):
    q = rng.normal(size=4)
    return se3.from_quaternion(q / np.linalg.norm(q))


def random_poses(rng, n=20):
    return se3.transform(np.stack([random_rotation(rng) for _ in range(n)]), rng.normal(size=(n, 3)))


def moved(T, R, t, scale=1.0):
    return se3.transform(R @ T[:, :3, :3], scale * T[:, :3, 3] @ R.T + t)


def line(n=50, direction=(1.0, 0.0, 0.0)):
    """Poses on a straight line with constant orientation."""
    return se3.transform(np.eye(3), np.linspace(0, 5, n)[:, None] * np.asarray(direction))


@given(SEEDS, st.floats(1e-3, 1e3))
def test_sim3_undoes_any_similarity(seed, scale):
    rng = np.random.default_rng(seed)
    T_gt, R, t = random_poses(rng), random_rotation(rng), rng.normal(size=3)
    fit = align(moved(T_gt, R, t, scale), T_gt, kind="sim3")
    assert fit.unobservable == ()
    np.testing.assert_allclose(fit.scale, 1 / scale, rtol=1e-12)
    np.testing.assert_allclose(fit.rotation, R.T, atol=1e-12)
    np.testing.assert_allclose(fit.apply(moved(T_gt, R, t, scale)), T_gt, atol=1e-10)


@given(SEEDS)
def test_se3_is_the_least_squares_answer(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(2, 20, 3))
    fit = align_positions(x, y, kind="se3")
    best = np.sum((x @ fit.rotation.T + fit.translation - y) ** 2)
    for _ in range(5):
        R = rotation_between([0, 0, 1], [0, 0, 1] + 1e-3 * rng.normal(size=3)) @ fit.rotation
        t = fit.translation + 1e-3 * rng.normal(size=3)
        assert np.sum((x @ R.T + t - y) ** 2) >= best
    assert fit.scale == 1.0


def test_a_mirrored_estimate_still_gets_a_proper_rotation():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(20, 3))
    assert se3.is_rotation(align_positions(x * [1, 1, -1], x, kind="sim3").rotation, tolerance=1e-12)


@pytest.mark.parametrize("size_m", [1e-9, 1e-3, 1e9])
def test_what_is_observable_does_not_depend_on_the_size(size_m):
    rng = np.random.default_rng(4)
    T, R = random_poses(rng), random_rotation(rng)
    T[:, :3, 3] *= size_m
    fit = align(moved(T, R, np.zeros(3)), T, kind="se3")
    assert fit.unobservable == ()
    np.testing.assert_allclose(fit.rotation, R.T, atol=1e-10)


def test_origin_lays_the_first_pose_on_the_first_pose():
    rng = np.random.default_rng(5)
    T_est, T_gt = random_poses(rng), random_poses(rng)
    np.testing.assert_allclose(align(T_est, T_gt, kind="origin").apply(T_est)[0], T_gt[0], atol=1e-12)


def test_none_leaves_every_pose_as_it_is():
    T = random_poses(np.random.default_rng(6))
    np.testing.assert_array_equal(align(T, T, kind="none").apply(T), T)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0.6, 0.8, 0), (0.36, 0.48, 0.8), (-1, 0, 0)])
@pytest.mark.parametrize("noise_m", [0.0, 1e-9])
def test_on_a_line_orientations_decide_the_roll(direction, noise_m):
    rng = np.random.default_rng(7)
    T_gt, R = line(direction=direction), random_rotation(rng)
    T_est = moved(T_gt, R, [1.0, 2.0, 3.0])
    T_est[:, :3, 3] += noise_m * rng.normal(size=(len(T_est), 3))
    fit = align(T_est, T_gt, kind="se3")
    assert fit.unobservable == ("roll about the path",)
    np.testing.assert_allclose(fit.apply(T_est), T_gt, atol=1e-8)


@given(SEEDS)
def test_on_a_line_positions_alone_give_the_smallest_turn(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 3))
    s = np.linspace(-1, 1, 11)[:, None]
    fit = align_positions(s * a / np.linalg.norm(a), s * b / np.linalg.norm(b), kind="sim3")
    np.testing.assert_allclose(fit.rotation, rotation_between(a, b), atol=1e-7)
    np.testing.assert_allclose(fit.scale, 1.0, rtol=1e-12)


@pytest.mark.parametrize("kind", ["se3", "sim3"])
def test_a_standing_estimate_is_laid_on_the_mean_of_the_truth(kind):
    T_gt = random_poses(np.random.default_rng(8))
    T_est = np.broadcast_to(T_gt[3], T_gt.shape)
    fit = align(T_est, T_gt, kind=kind)
    assert "rotation" in fit.unobservable
    assert fit.scale == 1.0
    expected = np.broadcast_to(T_gt[:, :3, 3].mean(0), (20, 3))
    np.testing.assert_allclose(fit.apply(T_est)[:, :3, 3], expected, atol=1e-12)
    np.testing.assert_allclose(fit.apply(T_est)[0, :3, :3], T_gt[0, :3, :3], atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("far_m", [0.0, 5e6])
def test_few_poses_or_standing_far_from_the_origin_raise_nothing(n, far_m):
    rng = np.random.default_rng(9)
    T = random_poses(rng, n)
    still = se3.transform(np.broadcast_to(np.eye(3), (n, 3, 3)), np.full((n, 3), 0.1 + far_m))
    for est, gt in [(T, T), (still, T), (T, still), (still, still)]:
        fit = align(est, gt, kind="sim3")
        assert np.isfinite(fit.rotation).all()
        assert se3.is_rotation(fit.rotation, tolerance=1e-12)
        assert (est is not still and gt is not still) or "rotation" in fit.unobservable


@given(SEEDS)
def test_turn_takes_one_direction_onto_the_other_by_the_smallest_angle(seed):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=3)
    for b in (rng.normal(size=3), a, -a, a + 1e-13 * rng.normal(size=3), -a + 1e-9 * rng.normal(size=3)):
        R = rotation_between(a, b)
        assert se3.is_rotation(R, tolerance=1e-14)
        np.testing.assert_allclose(R @ a / np.linalg.norm(a), b / np.linalg.norm(b), atol=3e-12)
        between = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
        np.testing.assert_allclose(se3.rotation_angle(R), between, atol=1e-7)


def test_no_pairs_is_an_error_of_ours():
    with pytest.raises(AlignmentError, match="one or more matched poses"):
        align(np.zeros((0, 4, 4)), np.zeros((0, 4, 4)), kind="se3")


def test_positions_too_large_to_square_are_an_error_of_ours():
    T = random_poses(np.random.default_rng(10))
    T[:, :3, 3] *= 1e200
    with pytest.raises(AlignmentError, match="below 1e150 m"):
        align(T, T, kind="se3")


@pytest.mark.parametrize("kind", get_args(AlignmentKind))
def test_an_alignment_comes_back_from_json_as_it_was(kind):
    rng = np.random.default_rng(3)
    T_est, T_gt = (np.tile(np.eye(4), (9, 1, 1)) for _ in range(2))
    T_est[:, :3, 3], T_gt[:, :3, 3] = rng.standard_normal((2, 9, 3))
    made = align(T_est, T_gt, kind=kind)
    back = Alignment.from_dict(json.loads(json.dumps(made.as_dict())))
    assert back.as_dict() == made.as_dict()
    np.testing.assert_array_equal(back.apply(T_est), made.apply(T_est))


@given(SEEDS, st.floats(-3.1, 3.1))
def test_yaw_undoes_any_turn_about_the_vertical_and_no_other(seed, angle):
    rng = np.random.default_rng(seed)
    T_gt, t = random_poses(rng), rng.normal(size=3)
    fit = align(moved(T_gt, se3.rotation_z(angle), t), T_gt, kind="yaw")
    assert (fit.unobservable, fit.scale) == ((), 1.0)
    np.testing.assert_allclose(fit.rotation, se3.rotation_z(-angle), atol=1e-12)
    np.testing.assert_allclose(fit.apply(moved(T_gt, se3.rotation_z(angle), t)), T_gt, atol=1e-12)
    tilted = align(moved(T_gt, random_rotation(rng), t), T_gt, kind="yaw")
    np.testing.assert_allclose(tilted.rotation[2], [0, 0, 1], atol=1e-15)


@given(SEEDS)
def test_yaw_is_the_least_squares_answer(seed):
    x, y = (random_poses(np.random.default_rng((seed, k))) for k in (0, 1))
    fit = align(x, y, kind="yaw")

    def residual(rotation):
        turned = x[:, :3, 3] @ rotation.T
        return np.sum((turned - turned.mean(0) - y[:, :3, 3] + y[:, :3, 3].mean(0)) ** 2)

    middle = (x[:, :3, 3] @ fit.rotation.T + fit.translation - y[:, :3, 3]).mean(0)
    np.testing.assert_allclose(middle, 0.0, atol=1e-12)
    for angle in (-1e-3, 1e-3, 1.0, 3.0):
        assert residual(se3.rotation_z(angle) @ fit.rotation) >= residual(fit.rotation) * (1 - 1e-12)


@pytest.mark.parametrize("positions", ["still", "vertical"])
def test_where_level_motion_leaves_the_yaw_open_orientation_decides(positions):
    T_gt = line(20, direction=(0.0, 0.0, float(positions == "vertical")))
    T_gt[:, :3, 3] += [5.0, -2.0, 0.0]
    fit = align(moved(T_gt, se3.rotation_z(0.4), np.ones(3)), T_gt, kind="yaw")
    assert fit.unobservable == ("yaw",)
    np.testing.assert_allclose(fit.rotation, se3.rotation_z(-0.4), atol=1e-12)


@given(SEEDS, st.floats(1e-2, 1e2))
def test_scale_takes_the_scale_of_sim3_and_moves_nothing(seed, scale):
    rng = np.random.default_rng(seed)
    T_gt = random_poses(rng)
    T_est = moved(T_gt, random_rotation(rng), rng.normal(size=3), scale)
    fit = align(T_est, T_gt, kind="scale")
    assert fit.scale == align(T_est, T_gt, kind="sim3").scale == pytest.approx(1 / scale)
    np.testing.assert_array_equal(fit.apply(T_est)[:, :3, :3], T_est[:, :3, :3])
    np.testing.assert_allclose(fit.apply(T_est)[:, :3, 3], T_est[:, :3, 3] * fit.scale)


@given(SEEDS)
def test_the_scale_alone_of_a_nearly_straight_path_is_the_least_squares_one(seed):
    rng = np.random.default_rng(seed)
    T_gt, T_est = line(20), line(20)
    for T in (T_gt, T_est):
        T[:, :3, 3] += 1e-3 * rng.normal(size=(20, 3))
    x, y = (T[:, :3, 3] - T[:, :3, 3].mean(axis=0) for T in (T_est, T_gt))
    U, d, Vt = np.linalg.svd(y.T @ x)
    d[2] *= np.sign(np.linalg.det(U @ Vt))  # Umeyama (1991), eq. 42
    fit = align(T_est, T_gt, kind="scale")
    assert (fit.scale, fit.unobservable) == (pytest.approx(d.sum() / np.sum(x * x), rel=1e-12), ())


@pytest.mark.parametrize("kind", ["se3", "sim3", "yaw", "scale"])
def test_the_first_poses_alone_may_decide(kind):
    rng = np.random.default_rng(11)
    T_est, T_gt = random_poses(rng), random_poses(rng)
    first, all_of_those = align(T_est, T_gt, kind=kind, first_n=7), align(T_est[:7], T_gt[:7], kind=kind)
    assert first.as_dict() == all_of_those.as_dict()
    assert first.as_dict() != align(T_est, T_gt, kind=kind).as_dict()


@given(SEEDS)
def test_a_straight_drive_has_no_roll_that_noise_could_tell(seed):
    rng = np.random.default_rng(seed)
    T_gt, R = line(200), random_rotation(rng)
    T_gt[:, 1:3, 3] += 1e-3 * rng.normal(size=(200, 2))  # the robot trembles by a millimetre on five metres
    T_est = moved(T_gt, R, rng.normal(size=3))
    T_est[:, :3, 3] += 5e-3 * rng.normal(size=(200, 3))
    fit = align(T_est, T_gt, kind="se3")
    if fit.unobservable:
        assert fit.unobservable == ("roll about the path",)
    assert se3.rotation_angle(fit.rotation @ R) < 0.8


@given(SEEDS)
def test_a_slight_bend_that_both_sides_show_does_tell_the_roll(seed):
    rng = np.random.default_rng(seed)
    T_gt, R = line(200), random_rotation(rng)
    T_gt[:, 1, 3] += 0.02 * np.sin(np.linspace(0, 3, 200))  # two centimetres on five metres
    T_est = moved(T_gt, R, rng.normal(size=3))
    T_est[:, :3, 3] += 1e-3 * rng.normal(size=(200, 3))
    T_est[:, :3, :3] = random_rotation(rng)  # orientations say something else
    fit = align(T_est, T_gt, kind="se3")
    assert fit.unobservable == ()
    assert se3.rotation_angle(fit.rotation @ R) < 0.1


@pytest.mark.parametrize("is_est_straight", [True, False])
def test_a_roll_is_uncertain_if_either_side_is_nearly_straight_and_the_other_does_not_follow(is_est_straight):
    rng = np.random.default_rng(3)
    straight = line(100).copy()
    straight[:, 1:3, 3] = 0.005 * 5 * rng.normal(size=(100, 2)) / 4
    swaying = line(100).copy()
    swaying[:, 1:3, 3] = 0.05 * 5 * rng.normal(size=(100, 2))
    est, gt = (straight, swaying) if is_est_straight else (swaying, straight)

    assert align(est, gt, kind="se3").unobservable == ("roll about the path",)


def test_two_paths_that_sway_differently_by_more_than_a_hundredth_still_have_a_roll():
    rng = np.random.default_rng(3)
    est, gt = line(100).copy(), line(100).copy()
    for T in (est, gt):
        T[:, 1:3, 3] = 0.3 * rng.normal(size=(100, 2))

    assert align(est, gt, kind="se3").unobservable == ()


@pytest.mark.parametrize(("share", "is_stationary"), [(0.9e-6, True), (1.1e-6, False)])
@pytest.mark.parametrize("kind", ["se3", "yaw"])
def test_a_side_counts_as_stationary_below_a_millionth_of_the_others_extent(share, is_stationary, kind):
    T = random_poses(np.random.default_rng(4), 30)
    small = moved(T, np.eye(3), np.zeros(3), share)

    for est, gt in ((small, T), (T, small)):
        assert bool(align(est, gt, kind=kind).unobservable) == is_stationary


@pytest.mark.parametrize(("share", "is_line"), [(0.9e-6, True), (1.2e-6, False)])
def test_a_path_counts_as_a_line_below_a_millionth_of_its_extent(share, is_line):
    x = np.linspace(-1, 1, 41)
    y = share * np.cos(np.arange(41) * 2.0) * np.std(x) / np.std(np.cos(np.arange(41) * 2.0))
    T = se3.transform(np.eye(3), np.stack([x, y, 0 * x], -1))
    rotation = random_rotation(np.random.default_rng(5))
    est = se3.transform(np.eye(3), T[:, :3, 3] @ rotation.T)

    assert (align(est, T, kind="se3").unobservable != ()) == is_line
