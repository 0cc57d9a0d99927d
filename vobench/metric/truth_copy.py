"""Whether an estimate is a copy of the ground truth: it agrees better than anything that is measured from images."""

from typing import Final

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Trajectory

# Features are located to about 1/20 px, and a step is estimated from about a hundred of them. At a focal length of 400
# px that is 0.05 / 400 / sqrt(100) = 1e-5 rad, and 1e-5 m at a distance of 1 m. The best median of vobench's estimators
# on noise-free scenes is 7e-5 m. Copies in single precision, or rounded to six decimals, are within 1e-6.
FLOOR_M: Final = 1e-6
FLOOR_RAD: Final = 1e-6
# Shorter steps are not compared: an estimator that notices that its camera is stationary reports them exactly.
SHORTEST_STEP_M: Final = 100 * FLOOR_M
SHORTEST_STEP_RAD: Final = 100 * FLOOR_RAD


def is_truth_copy(gt: Trajectory, est: Trajectory, *, has_scale: bool = True) -> bool:
    """Whether at least half of the steps in which the camera moves equal the true ones to rounding.

    A step is the motion between consecutive frames that have both poses. It is equal if its translation is within
    FLOOR_M and its rotation within FLOOR_RAD. An estimate without a scale is compared at the median ratio of lengths.
    False if the camera does not move.
    """
    _, gt_rows, est_rows = np.intersect1d(gt.t_ns, est.t_ns, assume_unique=True, return_indices=True)
    all_true_steps = _steps(gt.T_world_frame[gt_rows])
    all_steps = _steps(est.T_world_frame[est_rows])
    lengths_m = np.linalg.norm(all_true_steps[:, :3, 3], axis=1)
    angles_rad = se3.rotation_angle(all_true_steps[:, :3, :3])
    is_moving = (lengths_m > SHORTEST_STEP_M) | (angles_rad > SHORTEST_STEP_RAD)
    if not is_moving.any():
        return False

    true_steps = all_true_steps[is_moving]
    steps = all_steps[is_moving]
    scale = 1.0 if has_scale else _median_scale(true_steps, steps)
    translation_errors_m = np.linalg.norm(scale * steps[:, :3, 3] - true_steps[:, :3, 3], axis=1)
    R_errors = np.swapaxes(true_steps[:, :3, :3], 1, 2) @ steps[:, :3, :3]
    rotation_errors_rad = se3.rotation_angle(R_errors)
    is_equal = (translation_errors_m <= FLOOR_M) & (rotation_errors_rad <= FLOOR_RAD)
    return bool(2 * np.count_nonzero(is_equal) >= len(is_equal))


def _steps(T: Array) -> Array:
    """The motions (K - 1, 4, 4) between consecutive poses (K, 4, 4)."""
    return se3.inverse(T[:-1]) @ T[1:]


def _median_scale(true_steps: Array, steps: Array) -> float:
    """The median ratio of the true and the estimated lengths of steps. It is 1 if no step has a length."""
    true_lengths_m = np.linalg.norm(true_steps[:, :3, 3], axis=1)
    lengths = np.linalg.norm(steps[:, :3, 3], axis=1)
    has_length = (true_lengths_m > 0) & (lengths > 0)
    if not has_length.any():
        return 1.0
    return float(np.median(true_lengths_m[has_length] / lengths[has_length]))
