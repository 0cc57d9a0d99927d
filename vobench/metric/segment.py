"""Drift per metre over segments of fixed path length, after the KITTI odometry benchmark."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.pose_error import motion_errors, motions
from vobench.trajectory.associate import Index

INDOOR_LENGTHS_M = (0.5, 1.0, 1.5, 2.0)
KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)


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
    distances_m: Array,
    *,
    lengths_m: Sequence[float] = INDOOR_LENGTHS_M,
    step_frames: int = 1,
) -> SegmentErrors:
    """Errors of every segment that begins at a multiple of `step_frames`, length after length.

    T_gt and T_est (K, 4, 4) are matched poses, `frames` (K,) their ground-truth frames, distances_m (N,)
    the path from the start to every ground-truth frame. A length that the path doesn't hold gives no segment.
    Source: Geiger et al. (2012), with the path in float64 where the devkit sums in float32.
    """
    parts = []
    for length_m in lengths_m:
        first, last, over_m = segment_pairs(frames, distances_m, length_m, step_frames=step_frames)
        errors = motion_errors(motions(T_gt, first, last), motions(T_est, first, last))
        drift = errors.trans_m / over_m, errors.rot_rad / over_m
        parts.append((frames[first], frames[last], np.full(len(first), length_m), *drift))
    return SegmentErrors(*map(np.concatenate, zip(*parts, strict=True)))


def segment_pairs(
    frames: Index, distances_m: Array, length_m: float, *, step_frames: int = 1
) -> tuple[Index, Index, Array]:
    """Matched poses (first, last) of each segment, each (N,), and the path (N,) in m to divide by.

    A segment ends at the first frame strictly beyond `length_m`, and `length_m` divides its error:
    the devkit's rule. Where that frame has no estimate the next one that has ends the
    segment, and the path really travelled divides.
    """
    first = np.flatnonzero(frames % step_frames == 0)
    end = np.searchsorted(distances_m, distances_m[frames[first]] + length_m, side="right")
    last = np.searchsorted(frames, end, side="left")
    held = last < len(frames)
    first, last, end = first[held], last[held], end[held]
    travelled_m = distances_m[frames[last]] - distances_m[frames[first]]
    return first, last, np.where(frames[last] == end, length_m, travelled_m)
