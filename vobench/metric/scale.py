"""Scale: by what factor an estimate's distances are wrong, and how that drifts."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.comparison import Comparison, MetricDefinition
from vobench.metric.segment import SEGMENTS, segments
from vobench.trajectory.associate import Index

LEAST_SHARE = 0.1  # of the median true distance; a segment that ends nearer to its begin shows no scale


@dataclass(frozen=True, slots=True)
class ScaleErrors:
    """Signed errors (N,) of the scale as ratio less one, and their trend per metre of path."""

    error: Array
    drift_per_m: float


def scale_errors(T_gt: Array, T_est: Array, along_m: Array, first: Index, last: Index) -> ScaleErrors:
    """Ratios of the distances between matched poses (K, 4, 4) `first` and `last` (N,), estimate over truth.

    along_m (K,) is the true path to each pose. The drift is the slope of the logarithm of the ratio over
    the path by least squares, 0 with fewer than two places. Source: Strasdat et al. (2010), section II.
    """
    gt_m, est_m = (np.linalg.norm(T[last, :3, 3] - T[first, :3, 3], axis=1) for T in (T_gt, T_est))
    shown = (gt_m > LEAST_SHARE * np.median(gt_m)) & (gt_m > 0) if len(gt_m) else np.zeros(0, bool)
    ratio, middle_m = est_m[shown] / gt_m[shown], 0.5 * (along_m[first] + along_m[last])[shown]
    return ScaleErrors(ratio - 1.0, _slope(middle_m[ratio > 0], np.log(ratio[ratio > 0])))


def _slope(x: Array, y: Array) -> float:
    centred = x - x.mean() if len(x) else x
    power = float(centred @ centred)
    return float(centred @ (y - y.mean())) / power if power > 0 else 0.0


def _scale(of: Comparison) -> ScaleErrors:
    frames, found = of.matched.pairs.gt, of.once(segments)
    first, last = (np.searchsorted(frames, ends) for ends in (found.first, found.last))
    return scale_errors(of.matched.T_gt, of.T_moving, of.distances_m[frames], first, last)


STRASDAT = "Strasdat et al. (2010), section II, as a ratio of distances"
_scale_metric = partial(MetricDefinition, source=STRASDAT, settings=SEGMENTS, headline="mean")
METRICS = (
    _scale_metric(
        "scale_error",
        "scale error of the segments",
        "1",
        "‖p_j − p_i‖ / ‖q_j − q_i‖ − 1 of the segments of kitti_t_rel, with its sign",
        blind="scale where a segment ends near where it began; an alignment with scale has taken the mean out",
        measure=lambda of: of.once(_scale).error,
    ),
    _scale_metric(
        "scale_drift",
        "drift of the scale per metre of path",
        "1/m",
        "slope by least squares of log(1 + scale_error) over the true path, one number",
        blind="a scale that goes up and comes down again",
        measure=lambda of: np.full(min(len(of.once(_scale).error), 1), of.once(_scale).drift_per_m),
    ),
)
