"""Copies of the truth are recognised in any frame, scale and rounding; estimates from measurements are not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.metric.truth_copy import FLOOR_M, FLOOR_RAD, is_truth_copy
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum

FRAMES = 60
T_NS = np.arange(FRAMES, dtype=np.int64) * 50_000_000


def trajectory(positions_m, angles_rad):
    """A trajectory through positions (N, 3), turned about z by angles (N,)."""
    R = Rotation.from_rotvec(np.outer(angles_rad, [0, 0, 1])).as_matrix()
    return Trajectory(T_NS[: len(R)], se3.transform(R, positions_m))


def bend():
    """A path of 6 m in a bend, at constant speed."""
    angle_rad = np.linspace(0, 2, FRAMES)
    return trajectory(3 * np.stack([np.sin(angle_rad), 1 - np.cos(angle_rad), 0 * angle_rad], -1), angle_rad)


def with_noise(gt, sigma_m, sigma_rad, seed=0):
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(rng.normal(0, sigma_rad, (len(gt), 3))).as_matrix()
    return Trajectory(gt.t_ns, gt.T_world_frame @ se3.transform(R, rng.normal(0, sigma_m, (len(gt), 3))))


def test_the_truth_is_a_copy_of_itself_in_any_frame():
    gt = bend()
    R = Rotation.from_euler("xyz", [40, -20, 100], degrees=True).as_matrix()
    moved = Trajectory(gt.t_ns, se3.transform(R, [3.0, -8.0, 1.0]) @ gt.T_world_frame)
    assert is_truth_copy(gt, gt)
    assert is_truth_copy(gt, moved)


def test_a_copy_in_single_precision_or_with_six_decimals_is_one():
    gt = bend()
    single = Trajectory(gt.t_ns, gt.T_world_frame.astype(np.float32).astype(float))
    lines = []
    for line in format_tum(gt).splitlines():
        stamp, *values = line.split()
        lines.append(" ".join([stamp, *(f"{float(value):.6f}" for value in values)]))
    assert is_truth_copy(gt, single)
    assert is_truth_copy(gt, parse_tum("\n".join(lines), name="rounded"))


@pytest.mark.parametrize(("floors", "is_copy"), [(0.1, True), (3.0, False), (100.0, False)])
def test_noise_above_the_floor_makes_it_an_estimate(floors, is_copy):
    gt = bend()
    assert is_truth_copy(gt, with_noise(gt, floors * FLOOR_M, floors * FLOOR_RAD)) == is_copy


@pytest.mark.parametrize(("position_floors", "rotation_floors"), [(100.0, 0.0), (0.0, 100.0)])
def test_an_estimate_that_is_exact_in_translation_or_rotation_alone_is_no_copy(position_floors, rotation_floors):
    gt = bend()
    assert not is_truth_copy(gt, with_noise(gt, position_floors * FLOOR_M, rotation_floors * FLOOR_RAD))


def test_some_wrong_or_missing_poses_do_not_hide_a_copy():
    gt = bend()
    T = gt.T_world_frame.copy()
    T[::5, 0, 3] += 0.3
    kept = np.arange(FRAMES) % 7 != 3
    assert is_truth_copy(gt, Trajectory(gt.t_ns[kept], T[kept]))


def test_a_scaled_copy_is_one_only_of_an_estimator_without_scale():
    gt = bend()
    T = gt.T_world_frame.copy()
    T[:, :3, 3] *= 0.2
    scaled = Trajectory(gt.t_ns, T)
    assert is_truth_copy(gt, scaled, has_scale=False)
    assert not is_truth_copy(gt, scaled)


def test_who_notices_that_the_camera_is_stationary_is_no_copy():
    still = trajectory(np.zeros((FRAMES, 3)), np.zeros(FRAMES))
    assert not is_truth_copy(still, still)

    # It stands for two thirds of the time, and the estimate is 1 % too long.
    x_m = np.concatenate([np.zeros(40), np.linspace(0.01, 0.2, 20)])
    positions_m = np.outer(x_m, [1.0, 0, 0])
    gt = trajectory(positions_m, np.zeros(FRAMES))
    assert not is_truth_copy(gt, trajectory(1.01 * positions_m, np.zeros(FRAMES)))
    assert is_truth_copy(gt, gt)


def test_one_pose_or_none_is_no_copy():
    gt = bend()
    assert not is_truth_copy(gt, Trajectory(gt.t_ns[:1], gt.T_world_frame[:1]))
    assert not is_truth_copy(gt, Trajectory(gt.t_ns[:0], gt.T_world_frame[:0]))
    assert not is_truth_copy(gt, Trajectory(gt.t_ns + 1, gt.T_world_frame))
