"""Association: pairs of estimated and ground-truth poses by their stamps."""

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
MAX_CANDIDATES = 20_000_000  # pairs within the window that "greedy" may compare: 0.6 GB


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pose gt[k] of the ground truth belongs to pose est[k] of the estimate, (K,) int64 in order of the truth."""

    gt: Index
    est: Index

    def __len__(self) -> int:
        return len(self.gt)


@dataclass(frozen=True, slots=True)
class Matched:
    """K pairs: their indices, their stamps (K,) on the truth's clock, and their poses (K, 4, 4)."""

    pairs: Pairs
    t_ns: Stamps
    T_gt: Array
    T_est: Array

    def __len__(self) -> int:
        return len(self.pairs)


def associate(
    gt_t_ns: Stamps,
    est_t_ns: Stamps,
    *,
    max_diff_ns: int = MAX_DIFF_NS,
    offset_ns: int = 0,
    method: Method = "nearest",
) -> Pairs:
    """Pairs of poses whose stamps, the estimate's shifted by offset_ns, are at most max_diff_ns apart; stamps sorted.

    nearest: each pose of the shorter side (the estimate, if equal) requests the nearest of the longer, the earlier
    of two; of several that request one the nearest gets it. evo, interpolate: they share it, and ties are decided
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
    gt: Trajectory,
    est: Trajectory,
    *,
    method: Method = "nearest",
    max_diff_ns: int = MAX_DIFF_NS,
    offset_ns: int = 0,
) -> Matched:
    """The poses that `associate` pairs; "interpolate" interpolates the longer side at the shorter side's stamps."""
    pairs = associate(
        gt.t_ns,
        est.t_ns,
        max_diff_ns=max_diff_ns,
        offset_ns=offset_ns,
        method=method,
    )
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
    """The index (N,) of the sorted instants `among` nearest to each of t (N,); the earlier of two equally near."""
    before = np.searchsorted(among, t, side="right") - 1
    before = np.maximum(before, 0)
    after = np.minimum(before + 1, len(among) - 1)
    is_after_nearer = np.abs(among[after] - t) < np.abs(t - among[before])
    return np.where(is_after_nearer, after, before)


def _as_evo(
    gt_ns: Stamps,
    est_ns: Stamps,
    max_diff_s: float,
    offset_s: float,
) -> Pairs:
    """The pairs of evo 1.38, whose float64 seconds decide ties and limits by their rounding."""
    gt_s = _seconds(gt_ns)
    est_s = _seconds(est_ns)
    if len(est_s) > len(gt_s):
        gt, est = _nearest_within(gt_s, est_s + offset_s, max_diff_s)
    else:
        est, gt = _nearest_within(est_s, gt_s - offset_s, max_diff_s)
    return Pairs(gt, est)


def _nearest_within(shorter_s: Array, longer_s: Array, max_diff_s: float) -> tuple[Index, Index]:
    """Indices (K,) of instants and of the nearest of the longer list, which several may share, within a difference."""
    nearest_longer = nearest(shorter_s, longer_s)
    diff_s = np.abs(longer_s[nearest_longer] - shorter_s)
    is_beyond = shorter_s > longer_s[-1]
    is_near = (diff_s <= max_diff_s) | is_beyond
    is_after_first = shorter_s >= longer_s[0] - max_diff_s
    is_before_last = shorter_s <= longer_s[-1] + max_diff_s
    paired = np.flatnonzero(is_near & is_after_first & is_before_last)
    return paired, nearest_longer[paired]


def _seconds(t_ns: Stamps) -> Array:
    """The float64 nearest to the decimal digits of each stamp; above 2⁵³ ns the integer itself would round first."""
    is_exact = np.abs(t_ns) < 2**53
    whole_s = t_ns // 10**9
    fraction_s = t_ns % 10**9 / 1e9
    return np.asarray(np.where(is_exact, t_ns / 1e9, whole_s + fraction_s))


def _once_each(shorter_ns: Stamps, longer_ns: Stamps, max_diff_ns: int) -> tuple[Index, Index]:
    """Indices (K,) of instants and of the nearest of the longer list, each of which goes to the nearest instant."""
    nearest_longer = nearest(shorter_ns, longer_ns)
    diff_ns = np.abs(longer_ns[nearest_longer] - shorter_ns)
    requesting = np.flatnonzero(diff_ns <= max_diff_ns)
    requested = nearest_longer[requesting]
    # lexsort is stable: for each requested pose the nearest comes first, the earlier before its equal.
    order = np.lexsort((diff_ns[requesting], requested))
    is_first = np.diff(requested[order], prepend=-1) > 0
    chosen = order[is_first]
    return requesting[chosen], requested[chosen]


def _greedy(gt_ns: Stamps, est_ns: Stamps, max_diff_ns: int) -> Pairs:
    """Source: the association of Sturm et al. (2012), whose ties go to the earlier stamps."""
    first_gt = np.searchsorted(gt_ns, est_ns - max_diff_ns, side="right")
    end_gt = np.searchsorted(gt_ns, est_ns + max_diff_ns, side="left")
    count = np.maximum(end_gt - first_gt, 0)  # of candidates for each estimated pose
    n_candidates = count.sum()
    if n_candidates > MAX_CANDIDATES:
        raise AlignmentError(
            f"max_diff_ns should leave few candidates a pose, but {max_diff_ns} leaves {n_candidates} pairs to compare"
        )

    # All candidates: the first of each estimated pose begins after those of the poses before it.
    first_candidate = np.cumsum(count) - count
    est = np.repeat(np.arange(len(est_ns)), count)
    gt = np.arange(n_candidates) - np.repeat(first_candidate - first_gt, count)
    diff_ns = np.abs(gt_ns[gt] - est_ns[est])
    order = np.lexsort((est, gt, diff_ns))

    is_gt_free = bytearray(b"1" * len(gt_ns))
    is_est_free = bytearray(b"1" * len(est_ns))
    chosen = []
    for candidate, i, j in zip(order.tolist(), gt[order].tolist(), est[order].tolist(), strict=True):
        if is_gt_free[i] and is_est_free[j]:
            is_gt_free[i] = 0
            is_est_free[j] = 0
            chosen.append(candidate)

    # Two close pairs may cross: then only the truth's poses are in order.
    pairs = np.array(chosen, np.int64)
    pairs = pairs[np.argsort(gt[pairs])]
    return Pairs(gt[pairs], est[pairs])


def _in_order(gt_ns: Stamps, est_ns: Stamps, max_diff_ns: int) -> Pairs:
    """Source: the association of OpenVINS (Geneva et al., 2020), in which no pair goes back in time."""
    gt_stamps = gt_ns.tolist()
    est_stamps = est_ns.tolist()
    nearest_gt = nearest(est_ns, gt_ns).tolist()
    first_free = 0
    gt = []
    est = []
    for j, (t_ns, nearest_i) in enumerate(zip(est_stamps, nearest_gt, strict=True)):
        i = max(nearest_i, first_free)
        if i < len(gt_stamps) and abs(gt_stamps[i] - t_ns) <= max_diff_ns:
            gt.append(i)
            est.append(j)
            first_free = i + 1
    return Pairs(np.array(gt, np.int64), np.array(est, np.int64))
