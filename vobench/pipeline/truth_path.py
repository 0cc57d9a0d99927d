"""The path that estimates are compared with: the left camera's, at the pictures' own stamps."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.errors import SequenceError
from vobench.sequence import Sequence, read_truth
from vobench.trajectory.interpolate import poses_at
from vobench.trajectory.trajectory import Stamps, Trajectory

# Between two true poses further apart than this nobody knows where the camera was.
LONGEST_GAP_NS = 200_000_000


def left_truth(folder: Path) -> Trajectory:
    """The left camera's true poses at all pictures that have one; the truth is interpolated where it is not theirs.

    Pictures before, after or in a gap of the truth are left out, and so not scored.
    Raises SequenceError where that leaves none.
    """
    sequence, truth = Sequence.open(folder), read_truth(folder)
    if not len(truth):
        raise SequenceError(f"no ground truth, so nothing can be scored: {folder}")
    stamps = sequence.frame_stamps()
    if not np.array_equal(stamps, truth.t_ns):
        stamps = stamps[is_known(truth.t_ns, stamps)]
        if not len(stamps):
            raise SequenceError(f"the ground truth covers none of the pictures in time: {folder}")
        truth = Trajectory(stamps, poses_at(truth, stamps))
    return truth.of_mounted(sequence.rig.T_body_left)


def is_known(truth_ns: Stamps, stamps: Stamps) -> NDArray[np.bool_]:
    """Which stamps lie on a true pose, or between two that are near to each other in time."""
    after = np.searchsorted(truth_ns, stamps, side="left")
    before = np.searchsorted(truth_ns, stamps, side="right") - 1
    inside = (before >= 0) & (after < len(truth_ns))
    last = len(truth_ns) - 1
    gap_ns = truth_ns[np.minimum(after, last)] - truth_ns[np.maximum(before, 0)]
    return np.asarray(inside & (gap_ns <= LONGEST_GAP_NS))
