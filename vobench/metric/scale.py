"""Scale: by what factor an estimate's distances are wrong, how that drifts, and TartanAir's two factors for it."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.trajectory.align import align_positions
from vobench.trajectory.associate import Index

LEAST_SHARE = 0.1  # of the median true distance; a segment that ends nearer to its begin shows no scale
STILL_M = 1e-4  # their least step that has a speed


@dataclass(frozen=True, slots=True)
class ScaleErrors:
    """Signed errors (N,) of the scale as ratio less one, where along the path (N,) in m, and their trend per metre."""

    error: Array
    along_m: Array
    drift_per_m: float

    def __len__(self) -> int:
        return len(self.error)


def scale_errors(T_gt: Array, T_est: Array, along_m: Array, first: Index, last: Index) -> ScaleErrors:
    """Ratios of the distances between matched poses (K, 4, 4) `first` and `last` (N,), estimate over truth.

    along_m (K,) is the true path to each pose. The drift is the slope of the logarithm of the ratio over
    the path by least squares, 0 with fewer than two places. Source: Strasdat et al. (2010), section II.
    """
    gt_m, est_m = (np.linalg.norm(T[last, :3, 3] - T[first, :3, 3], axis=1) for T in (T_gt, T_est))
    shown = (gt_m > LEAST_SHARE * np.median(gt_m)) & (gt_m > 0) if len(gt_m) else np.zeros(0, bool)
    ratio, middle_m = est_m[shown] / gt_m[shown], 0.5 * (along_m[first] + along_m[last])[shown]
    return ScaleErrors(ratio - 1.0, middle_m, _slope(middle_m[ratio > 0], np.log(ratio[ratio > 0])))


def ate_scale(T_gt: Array, T_est: Array) -> float:
    """TartanAir's factor on the estimate (K, 4, 4) before an SE(3) alignment: Σ‖gt‖² / Σ gt·est about the means.

    Umeyama's is Σ gt·est / Σ‖est‖², and never larger; 1 where either side stands still.
    Source: Wang et al. (2020), the evaluation script.
    """
    gt_m, est_m = T_gt[:, :3, 3], T_est[:, :3, 3]
    fit = align_positions(gt_m, est_m, kind="se3")
    x, y = (gt_m - gt_m.mean(axis=0)) @ fit.rotation.T, est_m - est_m.mean(axis=0)
    return 1.0 if "rotation" in fit.unobservable else float(np.sum(x * x) / np.sum(x * y))


def motion_scale(T_gt: Array, T_est: Array) -> float:
    """TartanAir's factor on the estimate (K, 4, 4) before relative and segment errors.

    It is 1 / mean of the estimate's steps over the truth's, 1 where either side stands still.
    Source: Wang et al. (2020), the evaluation script.
    """
    gt_m, est_m = (np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) for T in (T_gt, T_est))
    moving = gt_m > STILL_M
    ratio = float(np.mean(est_m[moving] / gt_m[moving])) if moving.any() else 0.0
    return 1.0 / ratio if ratio > 0 else 1.0


def _slope(x: Array, y: Array) -> float:
    centred = x - x.mean() if len(x) else x
    power = float(centred @ centred)
    return float(centred @ (y - y.mean())) / power if power > 0 else 0.0
