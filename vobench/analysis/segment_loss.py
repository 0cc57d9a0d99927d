"""The error of a trial in segments of its path: position and rotation errors relative to the path length."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps, Trajectory

SEGMENTS = 24
MIN_STEPS = 2  # frames per segment
MIN_LENGTH_M = 1e-3  # the smallest length of a segment; the body is stationary on a shorter one


@dataclass(frozen=True, slots=True)
class Outcome:
    """The status of a trial, and its error (S,) in each of its segments."""

    status: str
    survived: bool
    loss: Array


def segment_loss(gt: Trajectory, est: Trajectory, *, scale: float = 1.0) -> Array:
    """The error (S,) of up to SEGMENTS parts of equal duration, as `loss_between` defines it."""
    count = max(1, min(SEGMENTS, (len(gt) - 1) // MIN_STEPS))
    borders_ns = np.linspace(gt.t_ns[0], gt.t_ns[-1], count + 1)
    after = np.searchsorted(gt.t_ns, borders_ns).clip(1, len(gt) - 1)
    since_before_ns = borders_ns - gt.t_ns[after - 1]
    until_after_ns = gt.t_ns[after] - borders_ns
    nearest = np.where(since_before_ns < until_after_ns, after - 1, after)
    return loss_between(gt, est, nearest, scale=scale)


def loss_between(
    gt: Trajectory,
    est: Trajectory,
    frames: NDArray[np.intp],
    *,
    scale: float = 1.0,
) -> Array:
    """The error (S,) from each of the `frames` (S + 1,) to the next, as `loss_of_motions` defines it."""
    return loss_of_motions(gt, est, frames[:-1], frames[1:], scale=scale)


def loss_of_motions(
    gt: Trajectory,
    est: Trajectory,
    first: NDArray[np.intp],
    last: NDArray[np.intp],
    *,
    scale: float = 1.0,
) -> Array:
    """The error (S,) of the motions from frames `first` (S,) to `last` (S,), relative to the path length, 0 to 1.

    It is the position error at the end of the motion relative to its length, plus the rotation error in rad, which
    is what the rotation costs per metre of the path that follows. The error is 1 without a pose at both ends. `scale`
    multiplies the positions of the estimate.
    """
    distances_m = gt.distances_m()
    lengths_m = distances_m[last] - distances_m[first]
    lengths_m = np.maximum(lengths_m, max(float(lengths_m.mean()), MIN_LENGTH_M))
    loss = np.ones(len(first))
    if not len(est):
        return loss

    begin_row, has_begin = _rows_at(est, gt.t_ns[first])
    end_row, has_end = _rows_at(est, gt.t_ns[last])
    has_both_poses = np.flatnonzero(has_begin & has_end)
    estimated_motion = _motions(est.T_world_frame[begin_row], est.T_world_frame[end_row])[has_both_poses]
    estimated_motion[:, :3, 3] *= scale
    true_motion = _motions(gt.T_world_frame[first], gt.T_world_frame[last])[has_both_poses]

    error = se3.inverse(estimated_motion) @ true_motion
    position_error_m = np.linalg.norm(error[:, :3, 3], axis=1)
    rotation_error_rad = se3.rotation_angle(error[:, :3, :3])
    total_error = position_error_m / lengths_m[has_both_poses] + rotation_error_rad
    loss[has_both_poses] = np.minimum(total_error, 1.0)
    return loss


def _rows_at(trajectory: Trajectory, t_ns: Stamps) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The rows (S,) of a trajectory at stamps (S,), and whether there is a pose at each."""
    rows = np.searchsorted(trajectory.t_ns, t_ns).clip(max=len(trajectory) - 1)
    return rows, trajectory.t_ns[rows] == t_ns


def _motions(T_world_first: Array, T_world_last: Array) -> Array:
    """The motions (S, 4, 4) between poses (S, 4, 4)."""
    motions: Array = se3.inverse(T_world_first) @ T_world_last
    return motions
