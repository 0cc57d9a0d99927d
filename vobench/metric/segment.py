"""Errors over segments of fixed path length: drift per metre, after the KITTI odometry benchmark, and scale."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.metric.blockwise import in_blocks
from vobench.metric.comparison import POSES, Comparison, MetricDefinition, OverLengths
from vobench.metric.motion_error import PoseErrors, distances_between, errors_between
from vobench.metric.settings import INDOOR_LENGTHS_M, Mean, Precision
from vobench.trajectory.associate import Index

Float32 = NDArray[np.float32]
Distances = Float32 | Array
LEAST_SHARE = 0.1  # segments with a shorter true distance, relative to the median, do not determine the scale


@dataclass(frozen=True, slots=True)
class SegmentErrors:
    """The errors per metre of N segments, with their first and last true frames and nominal lengths, each (N,)."""

    first: Index
    last: Index
    length_m: Array
    trans_ratio: Array
    rot_radpm: Array

    def __len__(self) -> int:
        return len(self.first)


def segment_errors(
    T_gt: Array,
    T_est: Array,
    frames: Index,
    distances_m: Distances,
    *,
    lengths_m: Sequence[float] = INDOOR_LENGTHS_M,
    step_frames: int = 1,
    precision: Precision = "float64",
) -> SegmentErrors:
    """The errors of all segments that begin at a multiple of `step_frames`, in the order of their starts.

    T_gt and T_est (K, 4, 4) are matched poses, `frames` (K,) their ground-truth frames, distances_m (N,)
    the path from the start to every ground-truth frame (of `devkit_distances` for "devkit", which rounds
    where the devkit rounds). A length above that of the path gives no segment. Source: Geiger et al. (2012).
    """
    pairs = [segment_pairs(frames, distances_m, length, step_frames=step_frames) for length in lengths_m]
    firsts, lasts, divisors_m = zip(*pairs, strict=True)
    segments_per_length = [len(first) for first in firsts]
    first = np.concatenate(firsts)
    last = np.concatenate(lasts)
    divisor_m = np.concatenate(divisors_m)
    length_m = np.repeat(np.asarray(lengths_m, float), segments_per_length)

    order = np.lexsort((length_m, first))
    first = first[order]
    last = last[order]
    divisor_m = divisor_m[order]
    length_m = length_m[order]

    if precision == "devkit":
        divisor_m = divisor_m.astype(np.float32)
        errors = in_blocks(len(first), partial(_devkit_errors, T_gt, T_est, first, last))
    else:
        errors = errors_between(T_gt, T_est, first, last)
    return SegmentErrors(
        first=frames[first],
        last=frames[last],
        length_m=length_m,
        trans_ratio=errors.trans_m / divisor_m,
        rot_radpm=errors.rot_rad / divisor_m,
    )


def segment_pairs(
    frames: Index,
    distances_m: Distances,
    length_m: float,
    *,
    step_frames: int = 1,
) -> tuple[Index, Index, Array]:
    """The first and last matched pose (N,) of each segment, and the path length (N,) in m that divides its error.

    As in the devkit, a segment ends at the first frame whose path exceeds `length_m`, and its error is divided by
    `length_m`. If that frame has no estimated pose, the segment ends at the next frame that has one, and its error is
    divided by the actual path length.
    """
    first = np.flatnonzero(frames % step_frames == 0)
    # A sum of float32 stays float32, as in the devkit.
    target_m = distances_m[frames[first]] + distances_m.dtype.type(length_m)
    end_frame = np.searchsorted(distances_m, target_m, side="right")
    last = np.searchsorted(frames, end_frame, side="left")

    is_complete = last < len(frames)
    first = first[is_complete]
    last = last[is_complete]
    end_frame = end_frame[is_complete]
    has_end_frame = frames[last] == end_frame
    travelled_m = distances_m[frames[last]] - distances_m[frames[first]]
    divisor_m = np.where(has_end_frame, length_m, travelled_m)
    return first, last, divisor_m


def devkit_distances(positions_m: Array) -> Float32:
    """The path length (N,) to each position (N, 3), added sequentially in float32 as in the devkit."""
    steps_m = np.diff(positions_m, axis=0).astype(np.float32)
    x, y, z = steps_m.T
    lengths_m = np.sqrt(x * x + y * y + z * z)
    start_m = np.zeros(1, np.float32)
    sums: Float32 = np.cumsum(np.concatenate([start_m, lengths_m]), dtype=np.float32)
    return sums[: len(positions_m)]


def mean_drift(errors: Distances, length_m: Array, *, mean: Mean = "micro") -> float:
    """The mean of the errors (N,) of segments. With "macro", the mean over lengths of the mean errors of each length.

    Errors in float32 are added sequentially, as in the devkit.
    """
    if mean == "macro":
        means = [errors[length_m == length].mean() for length in np.unique(length_m)]
        return float(np.mean(means))
    if errors.dtype == np.float32:
        total = np.cumsum(errors, dtype=np.float32)[-1]
        return float(total / np.float32(len(errors)))
    return float(errors.mean())


def _devkit_errors(
    T_gt: Array,
    T_est: Array,
    first: Index,
    last: Index,
    block: slice,
) -> PoseErrors:
    """The errors of a block of segments with the devkit's rounding.

    Inverses are computed in float64, then everything in float32, and angles from their cosine.
    """
    first = first[block]
    last = last[block]
    gt = np.linalg.inv(T_gt[first]) @ T_gt[last]
    est = np.linalg.inv(T_est[first]) @ T_est[last]
    E = np.linalg.inv(est) @ gt
    xx, yy, zz = (E[:, axis, axis].astype(np.float32) for axis in range(3))
    x, y, z = (E[:, axis, 3].astype(np.float32) for axis in range(3))
    length = np.sqrt(x * x + y * y + z * z)

    trace = (xx + yy + zz).astype(np.float64)
    cosine = (0.5 * (trace - 1.0)).astype(np.float32)
    clipped = np.clip(cosine, np.float32(-1), np.float32(1))
    return PoseErrors(length, np.arccos(clipped))


def segments(comparison: Comparison) -> SegmentErrors:
    """The `segment_errors` of a comparison."""
    settings = comparison.settings
    distances_m: Distances = comparison.distances_m
    if settings.segment_precision == "devkit":
        distances_m = devkit_distances(comparison.gt.positions_m)
    return segment_errors(
        comparison.matched.T_gt,
        comparison.T_moving,
        comparison.matched.pairs.gt,
        distances_m,
        lengths_m=settings.segment_lengths_m or (),
        step_frames=settings.segment_step_frames or 1,
        precision=settings.segment_precision,
    )


def _drift(comparison: Comparison, errors: Array, drift: Distances) -> OverLengths:
    """The errors of segments with the nominal lengths of the segments."""
    length_m = comparison.once(segments).length_m
    return OverLengths(errors, length_m, drift)


def _translation_drift(comparison: Comparison) -> OverLengths:
    trans_ratio = comparison.once(segments).trans_ratio
    return _drift(comparison, trans_ratio, trans_ratio)


def _rotation_drift(comparison: Comparison) -> OverLengths:
    rot_radpm = comparison.once(segments).rot_radpm
    rot_degpm = np.rad2deg(rot_radpm, dtype=float)
    return _drift(comparison, rot_degpm, rot_radpm)


@dataclass(frozen=True, slots=True)
class ScaleErrors:
    """The signed errors (N,) of the scale, which are the ratio minus 1, and the drift of the scale per metre."""

    error: Array
    drift_per_m: float


def scale_errors(
    T_gt: Array,
    T_est: Array,
    along_m: Array,
    first: Index,
    last: Index,
) -> ScaleErrors:
    """The scale errors from the estimated and true distances between matched poses `first` and `last` (N,).

    `along_m` (K,) is the true path length to each pose. The drift is the least-squares slope of the logarithm of the
    ratio over the path, 0 for fewer than two segments. Source: Strasdat et al. (2010), section II.
    """
    gt_m = distances_between(T_gt, first, last)
    est_m = distances_between(T_est, first, last)
    smallest_m = LEAST_SHARE * np.median(gt_m) if len(gt_m) else 0.0
    has_scale = (gt_m > smallest_m) & (gt_m > 0)
    ratio = est_m[has_scale] / gt_m[has_scale]
    middle_m = 0.5 * (along_m[first] + along_m[last])[has_scale]

    is_positive = ratio > 0
    drift_per_m = _slope(middle_m[is_positive], np.log(ratio[is_positive]))
    return ScaleErrors(ratio - 1.0, drift_per_m)


def _slope(x: Array, y: Array) -> float:
    """The least-squares slope of y over x, each (N,); 0 if x does not vary."""
    if not len(x):
        return 0.0
    centred = x - x.mean()
    power = float(centred @ centred)
    return float(centred @ (y - y.mean())) / power if power > 0 else 0.0


def _scale(comparison: Comparison) -> ScaleErrors:
    """The `scale_errors` of the segments of a comparison."""
    matched = comparison.matched
    frames = matched.pairs.gt
    errors = comparison.once(segments)
    first = np.searchsorted(frames, errors.first)
    last = np.searchsorted(frames, errors.last)
    along_m = comparison.distances_m[frames]
    return scale_errors(matched.T_gt, comparison.T_moving, along_m, first, last)


def _scale_error(comparison: Comparison) -> Array:
    return comparison.once(_scale).error


def _scale_drift(comparison: Comparison) -> Array:
    """The drift of the scale as one number (1,); empty (0,) without segments."""
    scale = comparison.once(_scale)
    n = min(len(scale.error), 1)
    return np.full(n, scale.drift_per_m)


SEGMENTS = ("segment_lengths_m", "segment_step_frames", "segment_precision", "segment_mean", *POSES)
GEIGER = "Geiger et al. (2012), section 3.2, and its development kit"
STRASDAT = "Strasdat et al. (2010), section II, as a ratio of distances"
_drift_metric = partial(MetricDefinition, source=GEIGER, settings=SEGMENTS, headline="mean", full=False)
_scale_metric = partial(MetricDefinition, source=STRASDAT, settings=SEGMENTS, headline="mean")
METRICS = (
    _drift_metric(
        id="kitti_t_rel",
        title="translation drift per metre of path",
        unit="1",
        formula="‖t‖ of (T_est,ij)⁻¹ T_gt,ij / length, j the first frame further than the length along the true path",
        blind="jitter: it is small against segments of a hundred metres",
        measure=_translation_drift,
    ),
    _drift_metric(
        id="kitti_r_rel",
        title="rotation drift per metre of path",
        unit="deg/m",
        formula="angle of (T_est,ij)⁻¹ T_gt,ij / length, segments as of kitti_t_rel",
        blind="jitter, and errors that turn back within a segment",
        measure=_rotation_drift,
    ),
    _scale_metric(
        id="scale_error",
        title="scale error of the segments",
        unit="1",
        formula="‖p_j − p_i‖ / ‖q_j − q_i‖ − 1 of the segments of kitti_t_rel, with its sign",
        blind="scale where a segment ends near where it began; an alignment with scale has taken the mean out",
        measure=_scale_error,
    ),
    _scale_metric(
        id="scale_drift",
        title="drift of the scale per metre of path",
        unit="1/m",
        formula="slope by least squares of log(1 + scale_error) over the true path, one number",
        blind="a scale that goes up and comes down again",
        measure=_scale_drift,
    ),
)
