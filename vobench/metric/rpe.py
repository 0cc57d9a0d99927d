"""Relative pose error: how wrong the motion between two poses is."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.pairs import IndexPairs
from vobench.metric.pose_error import (
    MatrixErrors,
    PoseErrors,
    Rows,
    errors_between,
    in_blocks,
    matrix_norms,
    motion_errors,
    motions,
)
from vobench.trajectory.associate import nearest
from vobench.trajectory.trajectory import Trajectory

MAX_TRUTH_STEPS = 2.0  # TUM's: a truth further off than this many of its usual steps is none
STILL_M = 1e-100  # a motion of the truth below it has no percentage that could be squared


@dataclass(frozen=True, slots=True)
class DistanceErrors:
    """By how much distances moved are wrong: (P,) in m, and (Q,) in percent of the true ones above zero."""

    point_m: Array
    percent: Array


def relative_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> PoseErrors:
    """Errors of the motions between matched poses (K, 4, 4) from first to last, each (P,).

    Source: Sturm et al. (2012), section V-A: (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j).
    """
    return errors_between(T_gt, T_est, *pairs)


def relative_matrix_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> MatrixErrors:
    """The same errors as norms of the matrix less the identity: evo's rot_part and full."""
    first, last = pairs

    def block(part: slice) -> Rows:
        gt, est = (motions(T, first[part], last[part]) for T in (T_gt, T_est))
        return matrix_norms(se3.inverse(gt) @ est)

    return MatrixErrors(*in_blocks(len(first), block))


def distance_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> DistanceErrors:
    """| ‖q_j - q_i‖ - ‖p_j - p_i‖ | of matched poses (K, 4, 4), q true and p estimated.

    Pairs between which the truth didn't move have no percentage. Source: evo's point_distance and its ratio.
    """
    first, last = pairs
    gt_m, est_m = (np.linalg.norm(T[last, :3, 3] - T[first, :3, 3], axis=1) for T in (T_gt, T_est))
    point_m, moved = np.abs(gt_m - est_m), gt_m > STILL_M
    return DistanceErrors(point_m, point_m[moved] / gt_m[moved] * 100)


def tum_errors(
    gt: Trajectory, est: Trajectory, *, delta_s: float, offset_ns: int = 0, scale: float = 1.0
) -> PoseErrors:
    """Errors of the estimate's motions over delta_s seconds, from every pose on; est's positions times scale.

    Source: Sturm et al. (2012), section V-A, by their script with --fixed_delta.
    """
    first, last, gt_first, gt_last = _tum_pairs(gt, est, delta_s, offset_ns)
    T_est = motions(est.T_world_frame, last, first)
    T_est[:, :3, 3] *= scale
    return motion_errors(motions(gt.T_world_frame, gt_last, gt_first), T_est)


def _tum_pairs(gt: Trajectory, est: Trajectory, delta_s: float, offset_ns: int) -> tuple[*IndexPairs, *IndexPairs]:
    """Poses (first, last) of the estimate, and the truth's that are nearest in time to them."""
    t_ns = est.t_ns + np.int64(offset_ns)
    first = np.arange(len(t_ns))
    last = nearest(t_ns + round(delta_s * 1e9), t_ns)
    inside = last < len(t_ns) - 1  # the last pose may stand for any later instant, so it ends no pair
    first, last = first[inside], last[inside]
    gt_first, gt_last = nearest(t_ns[first], gt.t_ns), nearest(t_ns[last], gt.t_ns)
    longest_ns = MAX_TRUTH_STEPS * np.median(np.diff(gt.t_ns)) if len(gt) > 1 else 0.0
    off_ns = np.maximum(np.abs(gt.t_ns[gt_first] - t_ns[first]), np.abs(gt.t_ns[gt_last] - t_ns[last]))
    near = off_ns <= longest_ns
    return first[near], last[near], gt_first[near], gt_last[near]
