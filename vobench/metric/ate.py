"""Absolute trajectory error: how far each aligned pose is from the truth."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.pose_error import (
    MatrixErrors,
    PoseErrors,
    Rows,
    angle_rad,
    in_blocks,
    matrix_norms,
    roll_pitch_yaw_rad,
)


@dataclass(frozen=True, slots=True)
class AxisErrors:
    """Signed errors along and about the world's axes: x, y, z (K, 3) in m; roll, pitch, yaw (K, 3) in rad."""

    xyz_m: Array
    rpy_rad: Array


def absolute_errors(T_gt: Array, T_est: Array) -> PoseErrors:
    """Distances and angles between matched poses (K, 4, 4), the estimate already aligned.

    Source: Sturm et al. (2012), section V-B; the rotation is the angle of R_est⁻¹ R_gt.
    """

    def block(part: slice) -> Rows:
        gt, est = T_gt[part], T_est[part]
        trans_m = np.linalg.norm(est[:, :3, 3] - gt[:, :3, 3], axis=1)
        return trans_m, angle_rad(np.swapaxes(est[:, :3, :3], -1, -2) @ gt[:, :3, :3])

    return PoseErrors(*in_blocks(len(T_gt), block))


def absolute_matrix_errors(T_gt: Array, T_est: Array) -> MatrixErrors:
    """The same errors as norms of T_est⁻¹ T_gt less the identity: evo's rot_part and full."""
    norms = in_blocks(len(T_gt), lambda part: matrix_norms(se3.inverse(T_est[part]) @ T_gt[part]))
    return MatrixErrors(*norms)


def axis_errors(T_gt: Array, T_est: Array) -> AxisErrors:
    """Where matched poses (K, 4, 4) are off, axis by axis of the truth's world.

    Source: Zhang and Scaramuzza (2018), section IV: R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll).
    """
    R = T_est[:, :3, :3] @ np.swapaxes(T_gt[:, :3, :3], -1, -2)
    return AxisErrors(T_est[:, :3, 3] - T_gt[:, :3, 3], roll_pitch_yaw_rad(R))
