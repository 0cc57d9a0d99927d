"""Absolute trajectory error."""

from collections.abc import Callable
from functools import partial

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.blockwise import in_blocks
from vobench.metric.comparison import HARTLEY, OURS, POSES, STURM_ATE, ZHANG, Comparison, MetricDefinition
from vobench.metric.motion_error import MatrixErrors, PoseErrors, angle_rad, matrix_errors


def absolute_errors(T_gt: Array, T_est: Array) -> PoseErrors:
    """Errors of the poses of an aligned estimate relative to the matched true poses, both (K, 4, 4).

    The rotation error is the angle of R_est⁻¹ R_gt. Source: Sturm et al. (2012), section V-B.
    """
    return in_blocks(len(T_gt), partial(_errors_of_block, T_gt, T_est))


def _errors_of_block(T_gt: Array, T_est: Array, block: slice) -> PoseErrors:
    """The errors of a block of poses (K, 4, 4)."""
    gt = T_gt[block]
    est = T_est[block]
    offset_m = est[:, :3, 3] - gt[:, :3, 3]
    R_est_gt = se3.transposed(est[:, :3, :3]) @ gt[:, :3, :3]
    return PoseErrors(np.linalg.norm(offset_m, axis=1), angle_rad(R_est_gt))


def errors_of_comparison(comparison: Comparison) -> PoseErrors:
    """The absolute errors of the matched poses of a comparison."""
    return absolute_errors(comparison.matched.T_gt, comparison.T_aligned)


def _matrix_errors(comparison: Comparison) -> MatrixErrors:
    """The matrix errors of the error poses T_est⁻¹ T_gt of a comparison."""
    T_gt = comparison.matched.T_gt
    T_est = comparison.T_aligned
    return in_blocks(len(T_gt), partial(_matrix_errors_of_block, T_gt, T_est))


def _matrix_errors_of_block(T_gt: Array, T_est: Array, block: slice) -> MatrixErrors:
    """The matrix errors of a block of poses (K, 4, 4)."""
    T_error = se3.inverse(T_est[block]) @ T_gt[block]
    return matrix_errors(T_error)


def _axis_errors(comparison: Comparison) -> dict[str, Array]:
    """Signed errors (K,) by axis of the world: position in m, and angles in degrees.

    The angles are defined by R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll).
    """
    T_gt = comparison.matched.T_gt
    T_est = comparison.T_aligned
    x, y, z = (T_est[:, :3, 3] - T_gt[:, :3, 3]).T
    R_error = T_est[:, :3, :3] @ se3.transposed(T_gt[:, :3, :3])
    angles_deg = np.rad2deg(se3.roll_pitch_yaw_rad(R_error))
    roll, pitch, yaw = angles_deg.T
    return {"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw}


def _axis_measure(axis: str) -> Callable[[Comparison], Array]:
    """The function that returns the signed errors (K,) of a comparison along or about one axis."""
    return lambda comparison: comparison.once(_axis_errors)[axis]


PLACE_OF_ERROR = "where along the path an error arose: one early rotation error displaces all later poses"
UNTRACKED_FRAMES = "frames without a pose: see coverage"
_pose_metric = partial(MetricDefinition, settings=POSES)


def _position_metric(axis: str) -> MetricDefinition:
    """The metric of the signed position errors along an axis of the world."""
    return _pose_metric(
        id=f"ate_{axis}",
        title=f"absolute trajectory error along the truth's {axis}",
        unit="m",
        formula=f"{axis} of p_est − p_gt, with its sign",
        source=OURS,
        blind=f"errors along the other axes; {UNTRACKED_FRAMES}",
        measure=_axis_measure(axis),
    )


def _angle_metric(axis: str) -> MetricDefinition:
    """The metric of the signed errors of one of the angles roll, pitch and yaw."""
    return _pose_metric(
        id=f"ate_{axis}",
        title=f"absolute trajectory error in {axis}",
        unit="deg",
        formula=f"{axis} of R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll), with its sign",
        source=ZHANG,
        blind=f"roll and yaw separately at a pitch near 90°, where their axes coincide; {UNTRACKED_FRAMES}",
        measure=_axis_measure(axis),
    )


# Of these metrics, `full=False` marks those that are also measured if not all metrics are requested.
METRICS = (
    _pose_metric(
        id="ate_trans",
        title="absolute trajectory error, position",
        unit="m",
        formula="‖p_est − p_gt‖ of each aligned pose",
        source=STURM_ATE,
        blind=f"{PLACE_OF_ERROR}; {UNTRACKED_FRAMES}",
        full=False,
        measure=lambda comparison: comparison.once(errors_of_comparison).trans_m,
    ),
    _pose_metric(
        id="ate_rot",
        title="absolute trajectory error, angle",
        unit="deg",
        formula="angle of R_est⁻¹ R_gt of each aligned pose",
        source=STURM_ATE,
        blind=f"a rotation that the alignment cannot observe: see alignment.unobservable; {UNTRACKED_FRAMES}",
        full=False,
        measure=lambda comparison: np.rad2deg(comparison.once(errors_of_comparison).rot_rad),
    ),
    _pose_metric(
        id="ate_rot_chordal",
        title="absolute trajectory error, rotation as a matrix",
        unit="1",
        formula="‖R_est⁻¹ R_gt − I‖_F = 2√2 sin(angle / 2)",
        source=HARTLEY,
        blind=f"the same as ate_rot, of which it is a monotonic function; {UNTRACKED_FRAMES}",
        measure=lambda comparison: comparison.once(_matrix_errors).rotation,
    ),
    _pose_metric(
        id="ate_full",
        title="absolute trajectory error, whole pose",
        unit="1",
        formula="‖T_est⁻¹ T_gt − I‖_F",
        source="evo's full",
        blind="the difference between translation and rotation: their sum depends on the unit of length; "
        f"{UNTRACKED_FRAMES}",
        measure=lambda comparison: comparison.once(_matrix_errors).full,
    ),
    _position_metric("x"),
    _position_metric("y"),
    _position_metric("z"),
    _angle_metric("roll"),
    _angle_metric("pitch"),
    _angle_metric("yaw"),
)
