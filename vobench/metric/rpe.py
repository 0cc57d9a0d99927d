"""Relative pose error: the errors of motions over frames, metres, seconds and angles."""

from functools import partial
from typing import NamedTuple

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.blockwise import in_blocks
from vobench.metric.comparison import HARTLEY, POSES, STURM_RPE, Comparison, MetricDefinition
from vobench.metric.motion_error import (
    MatrixErrors,
    PoseErrors,
    distances_between,
    errors_between,
    matrix_errors,
    motion_errors,
    motions,
)
from vobench.metric.pose_pairs import NO_POSES, IndexPairs, every_pair, select_pairs
from vobench.trajectory.associate import Index, nearest
from vobench.trajectory.trajectory import Trajectory

# In TUM's script, a true pose counts as missing if it is farther away than this number of usual steps.
MAX_TRUTH_STEPS = 2.0
STILL_M = 1e-100  # the square of a percentage of a smaller true motion would overflow


def relative_matrix_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> MatrixErrors:
    """The matrix errors (P,) of the motions between the poses of pairs of matched poses (K, 4, 4)."""
    first, last = pairs
    return in_blocks(len(first), partial(_matrix_errors_of_block, T_gt, T_est, first, last))


def _matrix_errors_of_block(T_gt: Array, T_est: Array, first: Index, last: Index, block: slice) -> MatrixErrors:
    """The matrix errors of the motions between a block of pairs of poses."""
    gt = motions(T_gt, first[block], last[block])
    est = motions(T_est, first[block], last[block])
    return matrix_errors(se3.inverse(gt) @ est)


class DistanceErrors(NamedTuple):
    """The errors of the distances between P pairs of poses: in m, and in % of the true distance.

    A pair without true motion has no percentage, so there can be fewer percentages than pairs.
    """

    metres: Array
    percent: Array


def distance_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> DistanceErrors:
    """| ‖q_j - q_i‖ - ‖p_j - p_i‖ | of matched poses (K, 4, 4), q true and p estimated.

    Source: evo's point_distance and its ratio.
    """
    gt_m = distances_between(T_gt, *pairs)
    est_m = distances_between(T_est, *pairs)
    errors_m = np.abs(gt_m - est_m)
    is_moving = gt_m > STILL_M
    percent = errors_m[is_moving] / gt_m[is_moving] * 100
    return DistanceErrors(errors_m, percent)


def tum_errors(
    gt: Trajectory,
    est: Trajectory,
    *,
    delta_s: float,
    offset_ns: int = 0,
    scale: float = 1.0,
) -> PoseErrors:
    """The errors of the estimated motions over `delta_s` seconds from every pose. Positions are multiplied by `scale`.

    Source: Sturm et al. (2012), section V-A; their script with --fixed_delta.
    """
    t_ns = est.t_ns + np.int64(offset_ns)
    last = nearest(t_ns + round(delta_s * 1e9), t_ns)
    first = np.flatnonzero(last < len(t_ns) - 1)  # the last pose would be the nearest one to all later instants
    last = last[first]

    gt_first = nearest(t_ns[first], gt.t_ns)
    gt_last = nearest(t_ns[last], gt.t_ns)
    first_miss_ns = np.abs(gt.t_ns[gt_first] - t_ns[first])
    last_miss_ns = np.abs(gt.t_ns[gt_last] - t_ns[last])
    largest_miss_ns = 0.0
    if len(gt) > 1:
        largest_miss_ns = MAX_TRUTH_STEPS * np.median(np.diff(gt.t_ns))
    is_near = np.maximum(first_miss_ns, last_miss_ns) <= largest_miss_ns

    T_est = motions(est.T_world_frame, last[is_near], first[is_near])
    T_est[:, :3, 3] *= scale
    T_gt = motions(gt.T_world_frame, gt_last[is_near], gt_first[is_near])
    return motion_errors(T_gt, T_est)


def _pairs(comparison: Comparison) -> IndexPairs:
    """The pairs of matched poses whose motions are compared."""
    settings = comparison.settings
    if settings.rpe_rule == "tartanair":
        return every_pair(len(comparison.matched))
    if settings.rpe_rule == "tum":  # TUM's script uses other pairs, and has only some of the errors
        return NO_POSES, NO_POSES
    is_from_truth = settings.rpe_pairs_from == "gt"
    return select_pairs(
        comparison.matched.T_gt if is_from_truth else comparison.T_moving,
        comparison.matched.t_ns,
        delta=settings.rpe_delta,
        unit=settings.rpe_unit,
        all_pairs=settings.rpe_all_pairs,
        spanning=settings.rpe_rule == "spanning",
    )


def _relative(comparison: Comparison) -> PoseErrors:
    """The errors of the motions of a comparison."""
    settings = comparison.settings
    if settings.rpe_rule == "tum":
        return tum_errors(
            comparison.gt,
            comparison.est,
            delta_s=settings.rpe_delta,
            offset_ns=settings.offset_ns,
            scale=comparison.alignment.scale,
        )
    first, last = comparison.once(_pairs)
    return errors_between(comparison.matched.T_gt, comparison.T_moving, first, last)


def _matrix_errors(comparison: Comparison) -> MatrixErrors:
    """The matrix errors of the motions of a comparison."""
    pairs = comparison.once(_pairs)
    return relative_matrix_errors(comparison.matched.T_gt, comparison.T_moving, pairs)


def _distance_errors(comparison: Comparison) -> DistanceErrors:
    """The errors of the distances between the poses of the pairs of a comparison."""
    pairs = comparison.once(_pairs)
    return distance_errors(comparison.matched.T_gt, comparison.T_moving, pairs)


MOTIONS = ("rpe_delta", "rpe_unit", "rpe_all_pairs", "rpe_pairs_from", "rpe_rule", *POSES)
ALL_PAIRS = "; like tartanair over all ordered pairs i, j, of which its own script draws 10,000 at random"
GLOBAL = "a slow drift that stays below the size of a step"
_motion_metric = partial(MetricDefinition, settings=MOTIONS)
METRICS = (
    _motion_metric(
        id="rpe_trans",
        title="relative pose error, translation",
        unit="m",
        formula=f"‖t‖ of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        source=STURM_RPE,
        blind=GLOBAL,
        full=False,
        measure=lambda comparison: comparison.once(_relative).trans_m,
    ),
    _motion_metric(
        id="rpe_rot",
        title="relative pose error, angle",
        unit="deg",
        formula=f"angle of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        source=STURM_RPE,
        blind=GLOBAL,
        full=False,
        measure=lambda comparison: np.rad2deg(comparison.once(_relative).rot_rad),
    ),
    _motion_metric(
        id="rpe_rot_chordal",
        title="relative pose error, rotation as a matrix",
        unit="1",
        formula="‖R − I‖_F of the same E as rpe_rot",
        source=HARTLEY,
        blind=GLOBAL,
        measure=lambda comparison: comparison.once(_matrix_errors).rotation,
    ),
    _motion_metric(
        id="rpe_full",
        title="relative pose error, whole motion",
        unit="1",
        formula="‖E − I‖_F",
        source="evo's full",
        blind=f"the difference between translation and rotation: their sum depends on the unit of length; {GLOBAL}",
        measure=lambda comparison: comparison.once(_matrix_errors).full,
    ),
    _motion_metric(
        id="rpe_point",
        title="difference of the distances moved",
        unit="m",
        formula="| ‖q_j − q_i‖ − ‖p_j − p_i‖ |",
        source="evo's point_distance",
        blind="every direction: a motion of the right length to the wrong side has no error",
        measure=lambda comparison: comparison.once(_distance_errors).metres,
    ),
    _motion_metric(
        id="rpe_point_percent",
        title="difference of the distances moved, of the true one",
        unit="%",
        formula="100 | ‖q_j − q_i‖ − ‖p_j − p_i‖ | / ‖q_j − q_i‖, pairs where the truth stood still left out",
        source="evo's point_distance_error_ratio",
        blind="every direction, and drift while the truth is stationary",
        measure=lambda comparison: comparison.once(_distance_errors).percent,
    ),
)
