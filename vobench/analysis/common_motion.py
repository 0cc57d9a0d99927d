"""Whether two trajectories are of one motion, by whether their short motions agree better now than at other times."""

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.align import align

WINDOWS = 50  # short motions that a recording is divided into
MIN_WINDOWS = 20
SHIFTS = 15  # by which motions are shifted in time, evenly over the recording
TINY = 1e-300


def motion_disagreement(T_gt: Array, T_est: Array) -> float | None:
    """How much matched poses (K, 4, 4) disagree in their short motions, relative to motions shifted in time.

    0 for the same motion up to scale and world, about 1 for motions that have nothing to do with each other; None if
    there are too few poses. It is the smaller one of the disagreements in rotation and in length: on a straight road,
    or at a constant speed, only one of them tells anything.
    """
    step = max(1, len(T_gt) // WINDOWS)
    motions_gt = _motions(T_gt, step)
    motions_est = _motions(T_est, step)
    if len(motions_gt) < MIN_WINDOWS:
        return None

    scale = max(align(T_est, T_gt, kind="sim3").scale, 0.0)
    lengths_gt = np.linalg.norm(motions_gt[:, :3, 3], axis=1)
    lengths_est = scale * np.linalg.norm(motions_est[:, :3, 3], axis=1)
    now = _squared_differences(motions_gt, motions_est, lengths_gt, lengths_est)
    shifts = np.linspace(0, len(motions_gt), SHIFTS + 2)[1:-1].astype(int)
    shifted = []
    for shift in shifts:
        rolled = np.roll(np.arange(len(motions_gt)), shift)
        shifted.append(_squared_differences(motions_gt, motions_est[rolled], lengths_gt, lengths_est[rolled]))
    at_other_times = np.median(shifted, axis=0)
    return float(np.min(now / np.maximum(at_other_times, TINY)))


def _motions(T: Array, step: int) -> Array:
    """The consecutive motions (W, 4, 4), each over a number of poses."""
    poses = T[::step]
    motions: Array = se3.inverse(poses[:-1]) @ poses[1:]
    return motions


def _squared_differences(motions_gt: Array, motions_est: Array, lengths_gt: Array, lengths_est: Array) -> Array:
    """The mean squared differences (2,) of rotations in rad and of lengths in m."""
    R_gt_est = np.swapaxes(motions_gt[:, :3, :3], 1, 2) @ motions_est[:, :3, :3]
    angles_rad = se3.rotation_angle(R_gt_est)
    length_differences_m = lengths_est - lengths_gt
    return np.array([np.mean(angles_rad**2), np.mean(length_differences_m**2)])
