"""Absolute trajectory error: how far each aligned pose is from the truth."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.pose_error import PoseErrors, angle_rad


def absolute_errors(T_gt: Array, T_est: Array) -> PoseErrors:
    """Distances and angles between matched poses (K, 4, 4), the estimate already aligned.

    Source: Sturm et al. (2012), section V-B; the rotation is the angle of R_est⁻¹ R_gt.
    """
    trans_m = np.linalg.norm(T_est[:, :3, 3] - T_gt[:, :3, 3], axis=1)
    return PoseErrors(trans_m, angle_rad(np.swapaxes(T_est[:, :3, :3], -1, -2) @ T_gt[:, :3, :3]))
