"""Failing frames, the worst part of a recording, and the overlap of two trials."""

import numpy as np
import pytest

from vobench.analysis.frame_failure import failing_loss, frame_losses, overlap, worst_window
from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory


def straight(step_m: np.ndarray) -> Trajectory:
    """A straight path at 10 Hz with steps (N - 1,) in m."""
    along_m = np.concatenate([[0.0], np.cumsum(step_m)])
    positions_m = np.stack([along_m, 0 * along_m, 0 * along_m], 1)
    t_ns = (np.arange(len(along_m)) * 10**8).astype(np.int64)
    return Trajectory(t_ns, se3.transform(np.eye(3), positions_m))


def test_the_truth_has_no_error_wherever_it_starts() -> None:
    gt = straight(np.full(50, 0.1))
    moved = Trajectory(gt.t_ns, se3.transform(se3.rotation_z(0.7), np.array([1.0, 2.0, 3.0])) @ gt.T_world_frame)
    assert frame_losses(gt, moved) == pytest.approx(0, abs=1e-9)


def test_wrong_steps_are_errors_of_the_frames_around_them() -> None:
    gt = straight(np.full(50, 0.1))
    steps_m = np.full(50, 0.1)
    steps_m[20:30] = 0.15  # from frame 20 to frame 30
    loss = frame_losses(gt, straight(steps_m))
    assert loss[22:29] == pytest.approx(0.5)
    assert (loss[[19, 20, 21, 29, 30, 31]] > 0.1).all()
    assert loss[:19] == pytest.approx(0, abs=1e-9)
    assert loss[32:] == pytest.approx(0, abs=1e-9)


def test_frames_without_a_pose_and_their_neighbours_have_the_whole_error() -> None:
    gt = straight(np.full(50, 0.1))
    has_pose = np.ones(51, bool)
    has_pose[10:14] = False
    loss = frame_losses(gt, Trajectory(gt.t_ns[has_pose], gt.T_world_frame[has_pose]))
    assert np.flatnonzero(loss == 1).tolist() == list(range(8, 16))
    assert (frame_losses(gt, Trajectory(gt.t_ns[:0], gt.T_world_frame[:0])) == 1).all()


def test_the_scale_multiplies_the_estimate() -> None:
    gt = straight(np.full(50, 0.1))
    half = straight(np.full(50, 0.05))
    assert frame_losses(gt, half)[2:-2] == pytest.approx(0.5)
    assert frame_losses(gt, half, scale=2.0) == pytest.approx(0, abs=1e-9)


def test_the_worst_part_has_the_large_errors_in_its_middle() -> None:
    t_ns = (np.arange(200) * 10**8).astype(np.int64)
    loss = np.full(200, 0.01)
    loss[70:100] = 0.5
    window = worst_window(t_ns, loss, 5.0)
    assert len(window) == 51
    assert window.first < 70 - 5
    assert window.end > 100 + 5


def test_a_gap_in_the_frames_does_not_hide_the_errors_around_it() -> None:
    t_ns = (np.arange(200) * 10**8).astype(np.int64)
    loss = np.full(200, 0.05)
    loss[70:100] = 0.5
    is_kept = np.ones(200, bool)
    is_kept[70:100] = np.arange(30) % 6 == 0
    window = worst_window(t_ns[is_kept], loss[is_kept], 5.0)
    first_ns = t_ns[is_kept][window.first]
    last_ns = t_ns[is_kept][window.end - 1]
    assert first_ns <= 7.0e9
    assert last_ns >= 9.9e9


def test_a_short_recording_is_the_worst_part_itself() -> None:
    t_ns = (np.arange(20) * 10**8).astype(np.int64)
    window = worst_window(t_ns, np.full(20, 0.1), 5.0)
    assert (window.first, window.end) == (0, 20)


@pytest.mark.parametrize(("typical", "limit"), [(0.0, 0.02), (0.01, 0.03), (0.1, 0.3), (0.9, 0.5)])
def test_a_frame_fails_by_its_error_relative_to_a_typical_one(typical: float, limit: float) -> None:
    assert failing_loss(typical) == pytest.approx(limit)


def test_the_overlap_is_the_share_of_frames_in_both_of_those_in_either() -> None:
    frames = np.array([True, True, True, False])
    others = np.array([False, True, True, True])
    assert overlap(frames, others) == 0.5
    assert overlap(frames, frames) == 1
    assert overlap(frames, ~frames) == 0
    assert overlap(frames & False, others & False) == 0
