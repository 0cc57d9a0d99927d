"""The error of a trial in segments of its path."""

import numpy as np
import pytest

from vobench.analysis.segment_loss import loss_between, segment_loss
from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory


def straight(count: int = 31) -> Trajectory:
    along = np.linspace(0, 3, count)
    R = np.eye(3)
    return Trajectory(
        (np.arange(count) * 10**8).astype(np.int64), se3.transform(R, np.stack([along, 0 * along, 0 * along], 1))
    )


def test_the_truth_has_no_error_and_no_poses_have_all_of_it() -> None:
    gt = straight()
    assert segment_loss(gt, gt) == pytest.approx(0, abs=1e-9)
    assert (segment_loss(gt, Trajectory(gt.t_ns[:0], gt.T_world_frame[:0])) == 1).all()


def test_the_error_is_a_share_of_the_way_wherever_the_estimate_starts() -> None:
    gt = straight()
    T = gt.T_world_frame.copy()
    T[:, :3, 3] *= 1.1
    start = se3.transform(se3.rotation_z(0.9), np.array([3.0, 2.0, 1.0]))
    est = Trajectory(gt.t_ns, start @ T)
    assert segment_loss(gt, est) == pytest.approx(0.1)
    assert segment_loss(gt, est, scale=1 / 1.1) == pytest.approx(0, abs=1e-9)


def test_a_wrong_turn_costs_its_radians_and_a_gap_its_two_steps() -> None:
    gt, at = straight(), np.arange(31)
    T, here = gt.T_world_frame.copy(), gt.T_world_frame[11]
    T[11:] = here @ se3.transform(se3.rotation_z(0.2), np.zeros(3)) @ se3.inverse(here) @ T[11:]
    assert loss_between(gt, Trajectory(gt.t_ns, T), at) == pytest.approx(np.where(at[:-1] == 10, 0.2, 0.0), abs=1e-6)
    kept = np.arange(31) != 10
    loss = loss_between(gt, Trajectory(gt.t_ns[kept], gt.T_world_frame[kept]), at)
    assert np.flatnonzero(loss).tolist() == [9, 10]


@pytest.mark.parametrize(("frames", "segments"), [(2, 1), (3, 1), (5, 2), (31, 15), (49, 24), (500, 24)])
def test_a_trial_has_24_segments_or_as_many_as_have_two_steps(frames: int, segments: int) -> None:
    assert len(segment_loss(straight(frames), straight(frames))) == segments


def test_segments_end_at_the_frames_that_are_nearest_to_equal_parts_of_the_time() -> None:
    t_ns = np.array([0, 10, 30, 38, 52, 60, 100]) * 10**7
    gt = Trajectory(t_ns, straight(7).T_world_frame)
    assert len(segment_loss(gt, gt)) == 3  # with borders at 33.3 and 66.7, so at the frames 2 and 5
    for lost, expected in ((2, [1, 1, 0]), (5, [0, 1, 1]), (3, [0, 0, 0]), (0, [1, 0, 0]), (6, [0, 0, 1])):
        kept = np.arange(7) != lost
        est = Trajectory(t_ns[kept], gt.T_world_frame[kept])
        assert segment_loss(gt, est).round(6).tolist() == expected, lost


def test_where_the_body_stands_still_errors_count_relative_to_the_mean_length() -> None:
    positions_m = np.zeros((5, 3))
    positions_m[:, 0] = [0, 0, 0, 1, 2]
    gt = Trajectory(np.arange(5) * 10**8, se3.transform(np.eye(3), positions_m))
    T = gt.T_world_frame.copy()
    T[1:, 1, 3] += 0.1
    found = loss_between(gt, Trajectory(gt.t_ns, T), np.array([0, 1, 2, 3, 4]))
    assert found == pytest.approx([0.1 / 0.5, 0, 0, 0])
    still = Trajectory(gt.t_ns, np.repeat(gt.T_world_frame[:1], 5, axis=0))
    T = still.T_world_frame.copy()
    T[1:, 1, 3] += 2e-4
    assert loss_between(still, Trajectory(gt.t_ns, T), np.arange(5)) == pytest.approx([0.2, 0, 0, 0])


def test_no_error_is_larger_than_that_of_a_lost_segment() -> None:
    gt = straight()
    T = gt.T_world_frame.copy()
    T[16:, 1, 3] += 50
    loss = loss_between(gt, Trajectory(gt.t_ns, T), np.arange(31))
    assert loss.max() == 1
    assert loss.sum() == pytest.approx(1)
