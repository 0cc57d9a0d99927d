"""Errors between poses and between motions: metres and radians, one of each per sample."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.associate import Index


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Translation errors (N,) in metres and rotation errors (N,) in radians, both non-negative."""

    trans_m: Array
    rot_rad: Array

    def __len__(self) -> int:
        return len(self.trans_m)


def angle_rad(R: Array) -> Array:
    """Angles (...) of rotations (..., 3, 3) that text with few digits has left slightly skew.

    One Newton step towards the nearest rotation first: KITTI's six digits leave R 2e-7 off
    orthonormal, which alone would shift an angle by 3e-7 rad. Source: Higham (1986), eq. 3.6.
    """
    steps = 1.5 * np.eye(3) - 0.5 * np.swapaxes(R, -1, -2) @ R
    return se3.rotation_angle(R @ steps)


def motion_errors(T_gt_first_last: Array, T_est_first_last: Array) -> PoseErrors:
    """What is left of true motions (N, 4, 4) after the estimated ones are undone."""
    E = se3.inverse(T_gt_first_last) @ T_est_first_last
    return PoseErrors(np.linalg.norm(E[:, :3, 3], axis=1), angle_rad(E[:, :3, :3]))


def motions(T_world_frame: Array, first: Index, last: Index) -> Array:
    """Pose of frame `last` seen from frame `first`, (N, 4, 4), for index arrays (N,)."""
    T_first_last: Array = se3.inverse(T_world_frame[first]) @ T_world_frame[last]
    return T_first_last
