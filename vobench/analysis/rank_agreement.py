"""Measures the agreement of two recordings on the order of estimators."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.align import align
from vobench.trajectory.trajectory import Trajectory

# --- Errors of segments ---

PATH_SHARES = np.arange(1, 9) / 12  # lengths of segments
LOST_PERCENT = 100.0  # error of a segment for which the estimate has no pose
MIN_POSES_FOR_SCALE = 3


def segment_errors(gt: Trajectory, est: Trajectory, *, scaled: bool = False) -> Array:
    """The errors (8, N) in percent of segments with 1/12 to 8/12 of the path, by the pose at which they start.

    NaN means that there is no segment, and LOST_PERCENT that the estimate has no pose at both ends. With `scaled`, an
    estimate without a unit of length gets the scale of the ground truth.
    """
    has_pose = np.isin(gt.t_ns, est.t_ns)
    T_est = np.full((len(gt), 4, 4), np.nan)
    T_est[has_pose] = est.T_world_frame[np.searchsorted(est.t_ns, gt.t_ns[has_pose])]
    if scaled and has_pose.sum() >= MIN_POSES_FOR_SCALE:
        alignment = align(T_est[has_pose], gt.T_world_frame[has_pose], kind="sim3")
        T_est[:, :3, 3] *= alignment.scale

    distances_m = gt.distances_m()
    errors = np.full((len(PATH_SHARES), len(gt)), np.nan)
    for row, length_m in enumerate(PATH_SHARES * distances_m[-1]):
        ends = np.searchsorted(distances_m, distances_m + length_m)
        starts = np.flatnonzero(ends < len(gt))
        ends = ends[starts]
        errors[row, starts] = LOST_PERCENT

        has_both_poses = has_pose[starts] & has_pose[ends]
        starts = starts[has_both_poses]
        ends = ends[has_both_poses]
        true_motion = se3.inverse(gt.T_world_frame[starts]) @ gt.T_world_frame[ends]
        error = se3.inverse(true_motion) @ se3.inverse(T_est[starts]) @ T_est[ends]
        lengths_m = np.maximum(distances_m[ends] - distances_m[starts], 1e-9)
        error_m = np.linalg.norm(error[:, :3, 3], axis=1)
        errors[row, starts] = 100 * error_m / lengths_m
    return errors


# --- Agreement of orders ---

MIN_ESTIMATORS = 3
BLOCKS = 10  # the number of parts of a recording that are resampled
RESAMPLES = 1000
INTERVAL = (0.025, 0.975)


@dataclass(frozen=True, slots=True)
class Agreement:
    """Kendall's tau between two orders of the same estimators with its 95 % interval, and mean errors by estimator."""

    tau: float
    low: float
    high: float
    errors: Mapping[str, tuple[float, float]]


def agreement(
    first: Mapping[str, Array],
    second: Mapping[str, Array],
    *,
    seed: int = 0,
) -> Agreement:
    """The agreement of two recordings on the order of estimators by the errors (8, N) of segments.

    The bootstrap interval accounts for the choice of parts of the recordings.
    """
    names = [name for name in first if name in second]
    if len(names) < MIN_ESTIMATORS:
        raise InputError(
            f"an order needs {MIN_ESTIMATORS} estimators or more that ran on both, and there are {len(names)}"
        )
    first_blocks = np.stack([_block_sums(first[name]) for name in names])  # (estimators, BLOCKS, 2)
    second_blocks = np.stack([_block_sums(second[name]) for name in names])
    all_blocks = np.arange(BLOCKS)
    first_means = _means(first_blocks, all_blocks)
    second_means = _means(second_blocks, all_blocks)

    rng = np.random.default_rng(seed)
    taus = []
    for _ in range(RESAMPLES):
        first_sample = _means(first_blocks, rng.integers(0, BLOCKS, BLOCKS))
        second_sample = _means(second_blocks, rng.integers(0, BLOCKS, BLOCKS))
        taus.append(_tau(first_sample, second_sample))
    low, high = np.quantile(taus, INTERVAL).tolist()

    errors = {name: (float(first_means[row]), float(second_means[row])) for row, name in enumerate(names)}
    return Agreement(_tau(first_means, second_means), low, high, errors)


def _block_sums(errors: Array) -> Array:
    """Sums and counts (BLOCKS, 2) of known errors (8, N), by the stretch in which their segments start."""
    blocks = np.array_split(errors, BLOCKS, axis=1)
    return np.array([[np.nansum(block), np.isfinite(block).sum()] for block in blocks])


def _means(block_sums: Array, blocks: NDArray[np.int64]) -> Array:
    """The mean error (estimators,) over some blocks of each estimator's sums and counts (estimators, BLOCKS, 2)."""
    sums = block_sums[:, blocks].sum(1)
    means: Array = sums[:, 0] / np.maximum(sums[:, 1], 1)
    return means


def _tau(first: Array, second: Array) -> float:
    """Kendall's tau; 0 if it is undefined because all values of one side are equal."""
    tau = float(scipy.stats.kendalltau(first, second).statistic)
    return tau if np.isfinite(tau) else 0.0
