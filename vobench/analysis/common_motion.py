"""Whether two trajectories describe the same motion: their short motions agree better than those at other times."""

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.align import align

WINDOWS = 50  # the number of short motions into which a recording is divided
MIN_WINDOWS = 20
SHIFTS = 15  # the number of shifts in time, which are distributed evenly over the recording
TINY = 1e-300  # avoids a division by zero


def motion_disagreement(T_gt: Array, T_est: Array) -> float | None:
    """The disagreement of the short motions of matched poses (K, 4, 4), relative to that of motions shifted in time.

    It is 0 for the same motion, except for its scale and world frame, and about 1 for unrelated motions. None if there
    are too few poses. It is the smaller one of the disagreements in rotation and in length, because on a straight road,
    or at a constant speed, only one of them is informative.
    """
    step = max(1, len(T_gt) // WINDOWS)
    motions_gt = _motions(T_gt, step)
    motions_est = _motions(T_est, step)
    if len(motions_gt) < MIN_WINDOWS:
        return None

    scale = max(align(T_est, T_gt, kind="sim3").scale, 0.0)
    lengths_gt = np.linalg.norm(motions_gt[:, :3, 3], axis=1)
    lengths_est = scale * np.linalg.norm(motions_est[:, :3, 3], axis=1)
    unshifted = _squared_differences(motions_gt, motions_est, lengths_gt, lengths_est)

    shifted = []
    shifts = np.linspace(0, len(motions_gt), SHIFTS + 2)[1:-1].astype(int)
    for shift in shifts:
        rows = np.roll(np.arange(len(motions_gt)), shift)
        shifted.append(_squared_differences(motions_gt, motions_est[rows], lengths_gt, lengths_est[rows]))
    typical = np.median(shifted, axis=0)
    return float(np.min(unshifted / np.maximum(typical, TINY)))


def _motions(T: Array, step: int) -> Array:
    """The consecutive motions (W, 4, 4), each over `step` of the poses (K, 4, 4)."""
    poses = T[::step]
    motions: Array = se3.inverse(poses[:-1]) @ poses[1:]
    return motions


def _squared_differences(motions_gt: Array, motions_est: Array, lengths_gt: Array, lengths_est: Array) -> Array:
    """The mean squared differences (2,) of rotations in rad and of lengths in m."""
    R_gt_est = np.swapaxes(motions_gt[:, :3, :3], 1, 2) @ motions_est[:, :3, :3]
    angles_rad = se3.rotation_angle(R_gt_est)
    length_differences_m = lengths_est - lengths_gt
    return np.array([np.mean(angles_rad**2), np.mean(length_differences_m**2)])
