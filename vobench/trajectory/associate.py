"""Which pose of the estimate belongs to which pose of the ground truth, by their stamps."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vobench.errors import AlignmentError
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

Index = NDArray[np.int64]
Method = Literal["nearest", "evo", "interpolate", "greedy", "in_order"]
MAX_DIFF_NS = 10_000_000  # evo's and this project's default: less than half a frame at 30 Hz
MAX_CANDIDATES = 20_000_000  # pairs within the window that "greedy" may weigh: 0.6 GB


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pose gt[k] of the ground truth belongs to pose est[k] of the estimate, (K,) int64 in order of the truth."""

    gt: Index
    est: Index

    def __len__(self) -> int:
        return len(self.gt)


@dataclass(frozen=True, slots=True)
class Matched:
    """K pairs: which poses they are, when (K,) on the truth's clock, and the poses (K, 4, 4) to compare."""

    pairs: Pairs
    t_ns: Stamps
    T_gt: Array
    T_est: Array

    def __len__(self) -> int:
        return len(self.pairs)


def associate(
    gt_t_ns: Stamps, est_t_ns: Stamps, *, max_diff_ns: int = MAX_DIFF_NS, offset_ns: int = 0, method: Method = "nearest"
) -> Pairs:
    """Pairs of poses whose stamps, the estimate's moved by offset_ns, are at most max_diff_ns apart; stamps sorted.

    nearest: each pose of the shorter (the estimate, if equal) asks for the nearest of the longer, the earlier
    of two; of several who ask for one the nearest gets it. evo, interpolate: they share it, and ties are decided
    in seconds as float64. greedy: of all pairs the closest first, each pose once, strictly within (TUM, rpg).
    in_order: each estimated pose takes the nearest that is left (ov_eval).
    """
    if not len(gt_t_ns) or not len(est_t_ns):
        return Pairs(np.zeros(0, np.int64), np.zeros(0, np.int64))
    if method in ("evo", "interpolate"):
        return _as_evo(gt_t_ns, est_t_ns, max_diff_ns / 1e9, offset_ns / 1e9)
    est_t_ns = est_t_ns + np.int64(offset_ns)
    if method == "greedy":
        return _greedy(gt_t_ns, est_t_ns, max_diff_ns)
    if method == "in_order":
        return _in_order(gt_t_ns, est_t_ns, max_diff_ns)
    if len(est_t_ns) > len(gt_t_ns):
        gt, est = _once_each(gt_t_ns, est_t_ns, max_diff_ns)
    else:
        est, gt = _once_each(est_t_ns, gt_t_ns, max_diff_ns)
    return Pairs(gt, est)


def match(
    gt: Trajectory, est: Trajectory, *, method: Method = "nearest", max_diff_ns: int = MAX_DIFF_NS, offset_ns: int = 0
) -> Matched:
    """The poses that `associate` pairs; with "interpolate" the longer side is read at the shorter side's stamps."""
    pairs = associate(gt.t_ns, est.t_ns, max_diff_ns=max_diff_ns, offset_ns=offset_ns, method=method)
    T_gt = gt.T_world_frame[pairs.gt]
    T_est = est.T_world_frame[pairs.est]
    t_ns = gt.t_ns[pairs.gt]
    if method == "interpolate" and len(est) > len(gt):
        T_est = poses_at(est, t_ns - offset_ns)
    elif method == "interpolate":
        t_ns = est.t_ns[pairs.est] + offset_ns
        T_gt = poses_at(gt, t_ns)
    return Matched(pairs, t_ns, T_gt, T_est)


def nearest(t: Stamps | Array, among: Stamps | Array) -> Index:
    """Of each instant (N,) the nearest of sorted ones, one or more; the earlier of two equally near."""
    before = np.maximum(np.searchsorted(among, t, side="right") - 1, 0)
    after = np.minimum(before + 1, len(among) - 1)
    return np.where(np.abs(among[after] - t) < np.abs(t - among[before]), after, before)


def _as_evo(gt_ns: Stamps, est_ns: Stamps, max_diff_s: float, offset_s: float) -> Pairs:
    """Source: evo 1.38's association, whose float64 seconds leave ties and limits to their rounding."""
    gt_s = _seconds(gt_ns)
    est_s = _seconds(est_ns)
    is_est_longer = len(est_s) > len(gt_s)
    asking_s, asked_s = (gt_s, est_s + offset_s) if is_est_longer else (est_s, gt_s - offset_s)
    asked = nearest(asking_s, asked_s)
    near = (np.abs(asked_s[asked] - asking_s) <= max_diff_s) | (asking_s > asked_s[-1])
    asking = np.flatnonzero(near & (asking_s >= asked_s[0] - max_diff_s) & (asking_s <= asked_s[-1] + max_diff_s))
    asked = asked[asking]
    return Pairs(asking, asked) if is_est_longer else Pairs(asked, asking)


def _seconds(t_ns: Stamps) -> Array:
    """What reading the digits of a stamp as float64 gives; above 2⁵³ ns the integer itself would round first."""
    seconds: Array = np.where(np.abs(t_ns) < 2**53, t_ns / 1e9, t_ns // 10**9 + t_ns % 10**9 / 1e9)
    return seconds


def _once_each(asking_ns: Stamps, asked_ns: Stamps, max_diff_ns: int) -> tuple[Index, Index]:
    asked = nearest(asking_ns, asked_ns)
    asking = np.flatnonzero(np.abs(asked_ns[asked] - asking_ns) <= max_diff_ns)
    asked = asked[asking]
    diff_ns = np.abs(asked_ns[asked] - asking_ns[asking])
    # lexsort is stable: for each asked pose the nearest comes first, the earlier before its equal.
    order = np.lexsort((diff_ns, asked))
    first = order[np.diff(asked[order], prepend=-1) > 0]
    return asking[first], asked[first]


def _greedy(gt_ns: Stamps, est_ns: Stamps, max_diff_ns: int) -> Pairs:
    """Source: the association of Sturm et al. (2012), whose ties go to the earlier stamps."""
    begin = np.searchsorted(gt_ns, est_ns - max_diff_ns, side="right")
    count = np.maximum(np.searchsorted(gt_ns, est_ns + max_diff_ns, side="left") - begin, 0)
    if count.sum() > MAX_CANDIDATES:
        raise AlignmentError(
            f"max_diff_ns should leave few candidates a pose, but {max_diff_ns} leaves {count.sum()} pairs to weigh"
        )
    est = np.repeat(np.arange(len(est_ns)), count)
    gt = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - begin, count)
    order = np.lexsort((est, gt, np.abs(gt_ns[gt] - est_ns[est])))
    free_gt = bytearray(b"1" * len(gt_ns))
    free_est = bytearray(b"1" * len(est_ns))
    kept = []
    for k, i, j in zip(order.tolist(), gt[order].tolist(), est[order].tolist(), strict=True):
        if free_gt[i] and free_est[j]:
            free_gt[i] = free_est[j] = 0
            kept.append(k)
    chosen = np.array(kept, np.int64)
    chosen = chosen[np.argsort(gt[chosen])]  # two close pairs may cross: then only the truth's are in order
    return Pairs(gt[chosen], est[chosen])


def _in_order(gt_ns: Stamps, est_ns: Stamps, max_diff_ns: int) -> Pairs:
    nearest_gt = nearest(est_ns, gt_ns).tolist()
    stamps = gt_ns.tolist()
    left = 0
    pairs = []
    for j, (t_ns, i) in enumerate(zip(est_ns.tolist(), nearest_gt, strict=True)):
        best = max(i, left)
        if best < len(stamps) and abs(stamps[best] - t_ns) <= max_diff_ns:
            pairs.append((best, j))
            left = best + 1
    gt, est = np.array(pairs, np.int64).reshape(-1, 2).T
    return Pairs(gt, est)
