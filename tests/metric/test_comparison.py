"""Comparisons: matching, alignment, TartanAir's factors of scale, projection to a plane, and results computed once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.metric.comparison import OURS, MetricDefinition, ate_scale, compare, in_plane, motion_scale
from vobench.metric.settings import LIKE, ScoreSettings
from vobench.trajectory.align import align
from vobench.trajectory.trajectory import Trajectory

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


def curved(n=40, *, scale=1.0, t0_ns=0):
    """A spatial path with rotations, scaled about the origin."""
    angle = np.arange(n) * 0.1
    positions_m = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.sin(3 * angle)], -1)
    R = Rotation.from_euler("ZYX", np.stack([angle, 0.1 * np.cos(angle), 0.2 * angle], -1)).as_matrix()
    return Trajectory(t0_ns + np.arange(n) * 10**8, se3.transform(R, scale * positions_m))


def test_a_stationary_side_has_no_factor_of_scale():
    moving = curved().T_world_frame
    still = np.tile(moving[:1], (len(moving), 1, 1))

    assert (ate_scale(moving, still), ate_scale(still, moving)) == (1.0, 1.0)
    assert (motion_scale(moving, still), motion_scale(still, moving)) == (1.0, 1.0)


def test_the_scale_of_motions_is_the_mean_of_the_ratios_of_steps():
    gt = se3.transform(np.eye(3), np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0.0]]))
    est = se3.transform(np.eye(3), np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0.0]]))

    assert motion_scale(gt, est) == pytest.approx(1 / np.mean([2 / 1, 2 / 2]))


@pytest.mark.parametrize(("step_m", "counts"), [(0.9e-4, False), (1.1e-4, True)])
def test_a_step_of_a_tenth_of_a_millimetre_counts_as_motion(step_m, counts):
    gt = se3.transform(np.eye(3), np.arange(3)[:, None] * [step_m, 0.0, 0.0])
    est = se3.transform(np.eye(3), np.arange(3)[:, None] * [3 * step_m, 0.0, 0.0])

    assert motion_scale(gt, est) == pytest.approx(1 / 3 if counts else 1.0)


@pytest.mark.parametrize(("plane", "normal"), [("yz", 0), ("xz", 1), ("xy", 2)])
def test_a_projected_pose_lies_in_its_plane_and_turns_about_its_normal(plane, normal):
    T = curved().T_world_frame
    projected = in_plane(T, plane)
    kept = [axis for axis in range(3) if axis != normal]

    assert (projected[:, normal, 3] == 0).all()
    np.testing.assert_array_equal(projected[:, kept, 3], T[:, kept, 3])
    vectors = Rotation.from_matrix(projected[:, :3, :3]).as_rotvec()
    np.testing.assert_allclose(vectors[:, kept], 0, atol=1e-12)
    expected = se3.roll_pitch_yaw_rad(T[:, :3, :3])[:, normal]
    np.testing.assert_allclose(np.angle(np.exp(1j * (vectors[:, normal] - expected))), 0, atol=1e-12)


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_projecting_twice_is_projecting_once(plane):
    T = curved(15).T_world_frame
    once = in_plane(T, plane)

    np.testing.assert_allclose(in_plane(once, plane), once, atol=1e-12)


def test_a_comparison_in_a_plane_projects_the_truth_the_pairs_and_the_estimate():
    settings = ScoreSettings(project="xz", alignment="none")
    comparison = compare(curved(), curved(scale=1.5), settings)

    for T in (comparison.gt.T_world_frame, comparison.matched.T_gt, comparison.T_aligned, comparison.T_moving):
        assert (T[:, 1, 3] == 0).all()
        assert np.ptp(T[:, 0, 3]) > 1
    assert comparison.distances_m[-1] == pytest.approx(comparison.gt.distances_m()[-1])
    assert comparison.distances_m[-1] < curved().distances_m()[-1]


def test_tartanairs_scale_applies_to_positions_and_another_one_to_motions():
    gt = curved()
    T = curved(scale=0.5).T_world_frame.copy()
    T[20:, :3, 3] += 0.1  # one long step, by which the two factors differ
    comparison = compare(gt, Trajectory(gt.t_ns, T), LIKE["tartanair_mono"])
    aligned_steps = np.linalg.norm(np.diff(comparison.T_aligned[:, :3, 3], axis=0), axis=1)
    moving_steps = np.linalg.norm(np.diff(comparison.T_moving[:, :3, 3], axis=0), axis=1)
    est_steps = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)

    np.testing.assert_allclose(aligned_steps / est_steps, ate_scale(gt.T_world_frame, T))
    np.testing.assert_allclose(moving_steps / est_steps, motion_scale(gt.T_world_frame, T))
    assert comparison.alignment.scale == ate_scale(gt.T_world_frame, T)
    assert abs(motion_scale(gt.T_world_frame, T) - ate_scale(gt.T_world_frame, T)) > 0.01


def test_with_one_scale_the_aligned_poses_are_those_whose_motions_count():
    comparison = compare(curved(), curved(scale=2.0), ScoreSettings(alignment="sim3"))

    assert comparison.T_moving is comparison.T_aligned
    np.testing.assert_allclose(comparison.T_aligned, comparison.matched.T_gt, atol=1e-12)


def test_an_alignment_may_use_the_first_poses_alone():
    gt = curved()
    T = gt.T_world_frame.copy()
    T[20:, :3, 3] += [5.0, 0.0, 0.0]
    comparison = compare(gt, Trajectory(gt.t_ns, T), ScoreSettings(align_n=20))

    np.testing.assert_allclose(comparison.T_aligned[:20], gt.T_world_frame[:20], atol=1e-12)


def test_a_result_is_computed_once_and_belongs_to_its_comparison():
    calls = []

    def work(comparison):
        calls.append(comparison)
        return len(calls)

    first = compare(curved(), curved())
    second = compare(curved(), curved())

    assert [first.once(work), first.once(work), second.once(work), first.once(work)] == [1, 1, 2, 1]
    assert calls == [first, second]


def test_a_comparison_that_matches_nothing_names_both_sides_the_window_and_the_offset():
    settings = ScoreSettings(max_diff_ns=2_000_000, offset_ns=3 * 10**9)
    with pytest.raises(AlignmentError) as error:
        compare(curved(5), curved(3, t0_ns=10**12), settings)

    assert str(error.value) == (
        "no pose of the estimate shifted by 3 s is within 2 ms of a ground-truth pose: the truth has 5 poses from "
        "0.000000000 s to 0.400000000 s, the estimate 3 poses from 1000.000000000 s to 1000.200000000 s"
    )


def test_covariances_of_another_number_of_poses_are_refused():
    with pytest.raises(AlignmentError, match=r"covariance should be \(40, 6, 6\), one a pose, but is \(39, 6, 6\)"):
        compare(curved(), curved(), covariance=np.tile(np.eye(6), (39, 1, 1)))


def test_a_comparison_and_a_definition_describe_themselves():
    comparison = compare(curved(), curved(30), ScoreSettings(alignment="origin"))
    metric = MetricDefinition("my_new_metric", "title", "m", "formula", OURS, ("alignment",), "nothing")

    assert repr(comparison) == "Comparison(30 pairs of 40 true and 30 estimated poses, alignment origin)"
    assert metric.identity == "my.new_metric"
    assert metric.as_dict() == {
        "id": "my_new_metric",
        "title": "title",
        "unit": "m",
        "formula": "formula",
        "source": "this project",
        "settings": ("alignment",),
        "blind": "nothing",
        "headline": "rmse",
        "full": True,
    }
    assert "measure" not in replace(metric, measure=len).as_dict()


def test_a_changed_comparison_has_no_results_of_the_one_it_was_made_of():
    first = compare(curved(), curved())
    second = compare(curved(), curved(scale=2.0))
    assert first.once(lambda comparison: comparison.distances_m[-1]) > 0

    def last_x(comparison):
        return comparison.T_moving[-1, 0, 3]

    before = first.once(last_x)
    changed = replace(first, T_moving=3 * second.T_moving)
    assert changed.once(last_x) == 3 * second.T_moving[-1, 0, 3] != before


@given(SEEDS, st.sampled_from(["xy", "xz", "yz"]))
def test_in_a_plane_a_pose_keeps_its_euler_angle_about_the_normal_and_its_place_along_the_plane(seed, plane):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(20, 4))
    T = se3.transform(se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)), rng.normal(size=(20, 3)))
    (normal,) = {0, 1, 2} - {"xyz".index(axis) for axis in plane}
    flat = in_plane(T, plane)
    angles = Rotation.from_matrix(T[:, :3, :3]).as_euler("xyz")
    expected = Rotation.from_rotvec(angles * np.eye(3)[normal]).as_matrix()
    np.testing.assert_allclose(flat[:, :3, :3], expected, atol=1e-12)
    np.testing.assert_array_equal(flat[:, :3, 3], T[:, :3, 3] * (1 - np.eye(3)[normal]))
    np.testing.assert_allclose(in_plane(flat, plane), flat, atol=1e-12)
