"""Which pose of the estimate belongs to which pose of the ground truth: the nearest in time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.trajectory.trajectory import Stamps

Index = NDArray[np.int64]
MAX_DIFF_NS = 10_000_000  # evo's and this project's default: less than half a frame at 30 Hz


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pose gt[k] of the ground truth belongs to pose est[k] of the estimate; both (K,) int64, increasing."""

    gt: Index
    est: Index

    def __len__(self) -> int:
        return len(self.gt)


def associate(gt_t_ns: Stamps, est_t_ns: Stamps, *, max_diff_ns: int = MAX_DIFF_NS) -> Pairs:
    """Pairs of poses at most `max_diff_ns` apart, each pose in one pair at most; stamps are sorted.

    Each pose of the shorter trajectory (the estimate, if equal) asks for the nearest of the longer,
    the earlier of two equally near. Where several ask for one, the nearest gets it, again the
    earlier of equals, and the others go without. Source: evo's rule, made one-to-one.
    """
    if len(est_t_ns) > len(gt_t_ns):
        gt, est = _match(gt_t_ns, est_t_ns, max_diff_ns)
    else:
        est, gt = _match(est_t_ns, gt_t_ns, max_diff_ns)
    return Pairs(gt, est)


def _match(asking_ns: Stamps, asked_ns: Stamps, max_diff_ns: int) -> tuple[Index, Index]:
    if not len(asking_ns):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    nearest = _nearest(asking_ns, asked_ns)
    diff_ns = np.abs(asked_ns[nearest] - asking_ns)
    asking = np.flatnonzero(diff_ns <= max_diff_ns)
    # lexsort is stable: for each asked pose the nearest comes first, the earlier before its equal.
    asking = asking[np.lexsort((diff_ns[asking], nearest[asking]))]
    first = np.diff(nearest[asking], prepend=-1) > 0
    return asking[first], nearest[asking[first]]


def _nearest(t_ns: Stamps, among_ns: Stamps) -> Index:
    before = np.maximum(np.searchsorted(among_ns, t_ns, side="right") - 1, 0)
    after = np.minimum(before + 1, len(among_ns) - 1)
    return np.where(np.abs(among_ns[after] - t_ns) < np.abs(t_ns - among_ns[before]), after, before)
