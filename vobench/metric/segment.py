"""Errors over segments of fixed path length: drift per metre, after the KITTI odometry benchmark, and scale."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.metric.ate import PoseErrors, Rows, errors_between, in_blocks
from vobench.metric.comparison import POSES, Comparison, MetricDefinition, OverLengths
from vobench.metric.settings import INDOOR_LENGTHS_M, Mean, Precision
from vobench.trajectory.associate import Index

Float32 = NDArray[np.float32]
Distances = Float32 | Array
LEAST_SHARE = 0.1  # of the median true distance; a segment that ends nearer to its begin shows no scale


@dataclass(frozen=True, slots=True)
class SegmentErrors:
    """Errors of N segments: ground-truth frames first and last (N,), nominal length (N,), drift a metre (N,)."""

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
    """Errors of every segment that begins at a multiple of `step_frames`, start after start.

    T_gt and T_est (K, 4, 4) are matched poses, `frames` (K,) their ground-truth frames, distances_m (N,)
    the path from the start to every ground-truth frame (of `devkit_distances` for "devkit", which rounds
    where the devkit rounds). A length that the path doesn't hold gives no segment. Source: Geiger et al. (2012).
    """
    found = [segment_pairs(frames, distances_m, length, step_frames=step_frames) for length in lengths_m]
    first, last, over_m = (np.concatenate(parts) for parts in zip(*found, strict=True))
    length_m = np.repeat(np.asarray(lengths_m, float), [len(part[0]) for part in found])
    order = np.lexsort((length_m, first))
    first = first[order]
    last = last[order]
    over_m = over_m[order]
    length_m = length_m[order]
    if precision == "devkit":
        over_m = over_m.astype(np.float32)
        rounded = in_blocks(len(first), lambda part: _devkit_errors(T_gt, T_est, first[part], last[part]))
        errors = PoseErrors(*rounded)
    else:
        errors = errors_between(T_gt, T_est, first, last)
    return SegmentErrors(frames[first], frames[last], length_m, errors.trans_m / over_m, errors.rot_rad / over_m)


def segment_pairs(
    frames: Index, distances_m: Distances, length_m: float, *, step_frames: int = 1
) -> tuple[Index, Index, Array]:
    """Matched poses (first, last) of each segment, each (N,), and the path (N,) in m to divide by.

    A segment ends at the first frame strictly beyond `length_m`, and `length_m` divides its error:
    the devkit's rule. Where that frame has no estimate the next one that has ends the
    segment, and the path really travelled divides.
    """
    first = np.flatnonzero(frames % step_frames == 0)
    # A sum of float32 stays float32, as in the devkit.
    end = np.searchsorted(distances_m, distances_m[frames[first]] + distances_m.dtype.type(length_m), side="right")
    last = np.searchsorted(frames, end, side="left")
    held = last < len(frames)
    first = first[held]
    last = last[held]
    end = end[held]
    travelled_m = distances_m[frames[last]] - distances_m[frames[first]]
    return first, last, np.where(frames[last] == end, length_m, travelled_m)


def devkit_distances(positions_m: Array) -> Float32:
    """Path (N,) to each position (N, 3), summed up in float32 one after the other like the devkit's."""
    steps = np.diff(positions_m, axis=0).astype(np.float32)
    x, y, z = steps.T
    lengths = np.sqrt(x * x + y * y + z * z)
    sums: Float32 = np.cumsum(np.concatenate([np.zeros(1, np.float32), lengths]), dtype=np.float32)
    return sums[: len(positions_m)]


def mean_drift(errors: Distances, length_m: Array, *, mean: Mean = "micro") -> float:
    """One number for segments' errors (N,): the mean of all, or "macro", the mean over lengths of their means.

    In float32, as the devkit's errors are, it sums one after the other as the devkit does.
    """
    if mean == "macro":
        return float(np.mean([errors[length_m == length].mean() for length in np.unique(length_m)]))
    if errors.dtype == np.float32:
        return float(np.cumsum(errors, dtype=np.float32)[-1] / np.float32(len(errors)))
    return float(errors.mean())


def _devkit_errors(T_gt: Array, T_est: Array, first: Index, last: Index) -> Rows:
    """Errors as the devkit rounds them: full inverses in float64, then float32, and the angle by its cosine."""
    gt, est = (np.linalg.inv(T[first]) @ T[last] for T in (T_gt, T_est))
    E = np.linalg.inv(est) @ gt
    a, b, c = (E[:, k, k].astype(np.float32) for k in range(3))
    cosine = (0.5 * ((a + b + c).astype(np.float64) - 1.0)).astype(np.float32)
    x, y, z = (E[:, k, 3].astype(np.float32) for k in range(3))
    return np.sqrt(x * x + y * y + z * z), np.arccos(np.clip(cosine, np.float32(-1), np.float32(1)))


def segments(of: Comparison) -> SegmentErrors:
    """`segment_errors` of a comparison."""
    s = of.settings
    return segment_errors(
        of.matched.T_gt,
        of.T_moving,
        of.matched.pairs.gt,
        devkit_distances(of.gt.positions_m) if s.segment_precision == "devkit" else of.distances_m,
        lengths_m=s.segment_lengths_m or (),
        step_frames=s.segment_step_frames or 1,
        precision=s.segment_precision,
    )


def _drift(of: Comparison, drift: Distances, *, in_degrees: bool = False) -> OverLengths:
    errors: Array = np.rad2deg(drift, dtype=float) if in_degrees else drift  # type: ignore[assignment]
    return OverLengths(errors, of.once(segments).length_m, drift)


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
    ratio = est_m[shown] / gt_m[shown]
    middle_m = 0.5 * (along_m[first] + along_m[last])[shown]
    return ScaleErrors(ratio - 1.0, _slope(middle_m[ratio > 0], np.log(ratio[ratio > 0])))


def _slope(x: Array, y: Array) -> float:
    centred = x - x.mean() if len(x) else x
    power = float(centred @ centred)
    return float(centred @ (y - y.mean())) / power if power > 0 else 0.0


def _scale(of: Comparison) -> ScaleErrors:
    frames = of.matched.pairs.gt
    found = of.once(segments)
    first, last = (np.searchsorted(frames, ends) for ends in (found.first, found.last))
    return scale_errors(of.matched.T_gt, of.T_moving, of.distances_m[frames], first, last)


SEGMENTS = ("segment_lengths_m", "segment_step_frames", "segment_precision", "segment_mean", *POSES)
GEIGER = "Geiger et al. (2012), section 3.2, and its development kit"
STRASDAT = "Strasdat et al. (2010), section II, as a ratio of distances"
_drift_metric = partial(MetricDefinition, source=GEIGER, settings=SEGMENTS, headline="mean", full=False)
_scale_metric = partial(MetricDefinition, source=STRASDAT, settings=SEGMENTS, headline="mean")
METRICS = (
    _drift_metric(
        "kitti_t_rel",
        "translation drift per metre of path",
        "1",
        "‖t‖ of (T_est,ij)⁻¹ T_gt,ij / length, j the first frame further than the length along the true path",
        blind="jitter: it is small against segments of a hundred metres",
        measure=lambda of: _drift(of, of.once(segments).trans_ratio),
    ),
    _drift_metric(
        "kitti_r_rel",
        "rotation drift per metre of path",
        "deg/m",
        "angle of (T_est,ij)⁻¹ T_gt,ij / length, segments as of kitti_t_rel",
        blind="jitter, and errors that turn back within a segment",
        measure=lambda of: _drift(of, of.once(segments).rot_radpm, in_degrees=True),
    ),
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
