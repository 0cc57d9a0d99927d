"""Relative pose error: how wrong the motion between two nearby frames is, gaps included."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.pose_error import PoseErrors, motion_errors, motions
from vobench.trajectory.associate import Index


def spanning_pairs(frames: Index, *, delta: int) -> tuple[Index, Index]:
    """Matched poses (first, last), each (N,), whose frames are `delta` apart, or more across a gap.

    `frames` (K,) are the ground-truth frames of the matched poses, increasing. A pose is paired with the
    first matched one `delta` or more frames later; with delta 1 that is the next one. So the motion
    across lost frames is counted, and losing track at the hard spot doesn't lower the error.
    """
    last = np.searchsorted(frames, frames + delta, side="left")
    first = np.flatnonzero(last < len(frames))
    return first, last[first]


def relative_errors(T_gt: Array, T_est: Array, frames: Index, *, delta: int = 1) -> PoseErrors:
    """Errors of the motions between matched poses (K, 4, 4); see `spanning_pairs` for which.

    Source: Sturm et al. (2012), section V-A: (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j).
    """
    first, last = spanning_pairs(frames, delta=delta)
    return motion_errors(motions(T_gt, first, last), motions(T_est, first, last))
