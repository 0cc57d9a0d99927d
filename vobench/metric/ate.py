"""Absolute trajectory error, and the pose errors that all metrics are based on."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.comparison import HARTLEY, OURS, POSES, STURM_ATE, ZHANG, Comparison, MetricDefinition
from vobench.trajectory.associate import Index

Rows = tuple[Array, ...]
BLOCK = 1 << 14  # poses per block; the matrices of a block fit into the processor's cache


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Translation errors (N,) in metres and rotation errors (N,) in radians, both non-negative."""

    trans_m: Array
    rot_rad: Array

    def __len__(self) -> int:
        return len(self.trans_m)


def angle_rad(R: Array) -> Array:
    """Angles (...) in radians of rotation matrices (..., 3, 3) that may be slightly non-orthonormal.

    One Newton step towards the nearest rotation removes the rounding errors of text files. KITTI prints six digits,
    so R is up to 2e-7 from orthonormal, which would change the angle by 3e-7 rad. Source: Higham (1986), eq. 3.6.
    """
    R_transposed = se3.transposed(R)
    correction = 1.5 * np.eye(3) - 0.5 * R_transposed @ R
    return se3.rotation_angle(R @ correction)


def matrix_norms(E: Array) -> Rows:
    """Frobenius norms (N,) of E - I for error poses E (N, 4, 4): of the rotation part, and of the whole matrix.

    evo calls these errors rot_part and full.
    """
    squares = np.square(E - np.eye(4))
    rotation_norm = np.sqrt(squares[:, :3, :3].sum((1, 2)))
    full_norm = np.sqrt(squares.sum((1, 2)))
    return rotation_norm, full_norm


def motion_errors(T_gt_first_last: Array, T_est_first_last: Array) -> PoseErrors:
    """Errors of estimated motions (N, 4, 4) relative to the true ones."""
    gt = _pose_columns(T_gt_first_last)
    est = _pose_columns(T_est_first_last)
    return PoseErrors(*_relative_errors(gt, est))


def errors_between(
    T_gt: Array,
    T_est: Array,
    first: Index,
    last: Index,
) -> PoseErrors:
    """Errors of the estimated motions between pairs of poses of two trajectories (K, 4, 4).

    `first` and `last` (N,) are the indices of the two poses of each pair.
    Source: Sturm et al. (2012), section V-A: (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j).
    """
    gt = _pose_columns(T_gt)
    est = _pose_columns(T_est)

    def motion(poses: Array, block: slice) -> Array:
        first_poses = poses.take(first[block], axis=-1)
        last_poses = poses.take(last[block], axis=-1)
        return _relative_poses(first_poses, last_poses)

    def errors(block: slice) -> Rows:
        return _relative_errors(motion(gt, block), motion(est, block))

    return PoseErrors(*in_blocks(len(first), errors))


# The functions below store N poses as an array (3, 4, N), which is processed faster than N small matrices.


def _pose_columns(T: Array) -> Array:
    """Poses (N, 4, 4) as an array (3, 4, N)."""
    upper_rows = T[:, :3]
    return np.ascontiguousarray(np.moveaxis(upper_rows, 0, -1))


def _relative_poses(first: Array, last: Array) -> Array:
    """Poses `last` in the frames of `first`, all (3, 4, N)."""
    R_first = first[:, :3]
    R_last = last[:, :3]
    offset = last[:, 3] - first[:, 3]
    R = np.einsum("kin,kjn->ijn", R_first, R_last)
    t = np.einsum("kin,kn->in", R_first, offset)
    return np.concatenate([R, t[:, None]], axis=1)


def _relative_errors(gt: Array, est: Array) -> Rows:
    """Translation errors (N,) in m and rotation errors (N,) in rad of poses `est` relative to `gt`, both (3, 4, N).

    The rotations are orthonormalised as in `angle_rad`.
    """
    E = _relative_poses(gt, est)
    R = E[:, :3]
    t = E[:, 3]
    correction = -0.5 * np.einsum("kin,kjn->ijn", R, R)
    correction[range(3), range(3)] += 1.5
    R = np.einsum("ikn,kjn->ijn", R, correction)

    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    scaled_axis = np.stack([zy - yz, xz - zx, yx - xy])  # (3, N), the axis of rotation times twice the sine
    twice_sine = np.sqrt(np.einsum("in,in->n", scaled_axis, scaled_axis))
    twice_cosine = xx + yy + zz - 1.0
    length = np.sqrt(np.einsum("in,in->n", t, t))
    angle = np.arctan2(twice_sine, twice_cosine)
    return length, angle


def in_blocks(n: int, work: Callable[[slice], Rows]) -> Rows:
    """The arrays (n,) that `work` returns for n samples. `work` is called with one block of samples at a time."""
    results = []
    for begin in range(0, max(n, 1), BLOCK):  # one empty block if n is 0, so that the results are arrays
        end = min(begin + BLOCK, n)
        results.append(work(slice(begin, end)))
    return tuple(np.concatenate(blocks) for blocks in zip(*results, strict=True))


def motions(T_world_frame: Array, first: Index, last: Index) -> Array:
    """The motions (N, 4, 4) from poses `first` to poses `last`, given as indices (N,): T_first_last."""
    T_first_world = se3.inverse(T_world_frame[first])
    T_first_last: Array = T_first_world @ T_world_frame[last]
    return T_first_last


def distances_between(T: Array, first: Index, last: Index) -> Array:
    """Distances (N,) in m between poses `first` and poses `last`, given as indices (N,), of a trajectory (K, 4, 4)."""
    offset_m = T[last, :3, 3] - T[first, :3, 3]
    return np.asarray(np.linalg.norm(offset_m, axis=1))


def absolute_errors(T_gt: Array, T_est: Array) -> PoseErrors:
    """Errors of the poses of an aligned estimate relative to the matched true poses, both (K, 4, 4).

    The rotation error is the angle of R_est⁻¹ R_gt. Source: Sturm et al. (2012), section V-B.
    """

    def errors(block: slice) -> Rows:
        gt = T_gt[block]
        est = T_est[block]
        offset_m = est[:, :3, 3] - gt[:, :3, 3]
        R_est_gt = se3.transposed(est[:, :3, :3]) @ gt[:, :3, :3]
        return np.linalg.norm(offset_m, axis=1), angle_rad(R_est_gt)

    return PoseErrors(*in_blocks(len(T_gt), errors))


def absolute(comparison: Comparison) -> PoseErrors:
    """The absolute errors of the matched poses of a comparison."""
    return absolute_errors(comparison.matched.T_gt, comparison.T_aligned)


def _matrix_errors(comparison: Comparison) -> Rows:
    """The `matrix_norms` of the error poses T_est⁻¹ T_gt of a comparison."""
    T_gt = comparison.matched.T_gt
    T_est = comparison.T_aligned

    def norms(block: slice) -> Rows:
        T_error = se3.inverse(T_est[block]) @ T_gt[block]
        return matrix_norms(T_error)

    return in_blocks(len(T_gt), norms)


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


DRIFT = "where along the path an error arose: one early rotation error displaces all later poses"
LOST = "frames without a pose: see coverage"
_pose_metric = partial(MetricDefinition, settings=POSES)
METRICS = (
    _pose_metric(
        "ate_trans",
        "absolute trajectory error, position",
        "m",
        "‖p_est − p_gt‖ of each aligned pose",
        STURM_ATE,
        blind=f"{DRIFT}; {LOST}",
        full=False,
        measure=lambda comparison: comparison.once(absolute).trans_m,
    ),
    _pose_metric(
        "ate_rot",
        "absolute trajectory error, angle",
        "deg",
        "angle of R_est⁻¹ R_gt of each aligned pose",
        STURM_ATE,
        blind=f"a rotation that the alignment cannot observe: see alignment.unobservable; {LOST}",
        full=False,
        measure=lambda comparison: np.rad2deg(comparison.once(absolute).rot_rad),
    ),
    _pose_metric(
        "ate_rot_chordal",
        "absolute trajectory error, rotation as a matrix",
        "1",
        "‖R_est⁻¹ R_gt − I‖_F = 2√2 sin(angle / 2)",
        HARTLEY,
        blind=f"the same as ate_rot on another scale; {LOST}",
        measure=lambda comparison: comparison.once(_matrix_errors)[0],
    ),
    _pose_metric(
        "ate_full",
        "absolute trajectory error, whole pose",
        "1",
        "‖T_est⁻¹ T_gt − I‖_F",
        "evo's full",
        blind=f"the difference between translation and rotation: their sum depends on the unit of length; {LOST}",
        measure=lambda comparison: comparison.once(_matrix_errors)[1],
    ),
    *(
        _pose_metric(
            f"ate_{axis}",
            f"absolute trajectory error along the truth's {axis}",
            "m",
            f"{axis} of p_est − p_gt, with its sign",
            OURS,
            blind=f"errors along the other axes; {LOST}",
            measure=_axis_measure(axis),
        )
        for axis in ("x", "y", "z")
    ),
    *(
        _pose_metric(
            f"ate_{axis}",
            f"absolute trajectory error in {axis}",
            "deg",
            f"{axis} of R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll), with its sign",
            ZHANG,
            blind=f"roll and yaw separately at a pitch near 90°, where their axes coincide; {LOST}",
            measure=_axis_measure(axis),
        )
        for axis in ("roll", "pitch", "yaw")
    ),
)
