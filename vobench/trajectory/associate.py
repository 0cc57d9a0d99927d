"""Associates estimated poses with true poses by their stamps."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vobench.errors import AlignmentError
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

Index = NDArray[np.int64]
Method = Literal["nearest", "evo", "interpolate", "greedy", "in_order"]
MAX_DIFF_NS = 10_000_000  # the default, as in evo; it is less than half a frame at 30 Hz
MAX_CANDIDATES = 20_000_000  # the largest number of pairs that "greedy" compares, in 0.6 GB


@dataclass(frozen=True, slots=True)
class Pairs:
    """K pairs of poses: the indices `gt` (K,) in the ground truth, increasing, and the indices `est` (K,)."""

    gt: Index
    est: Index

    def __len__(self) -> int:
        return len(self.gt)


@dataclass(frozen=True, slots=True)
class Matched:
    """K pairs: their indices, their stamps (K,) on the clock of the truth, and their poses (K, 4, 4)."""

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
    """Pairs of poses whose stamps differ by at most `max_diff_ns`, after `offset_ns` is added to those of the estimate.

    Stamps must be sorted. The rules are:
    nearest: each pose of the shorter side (the estimate, if equal) requests the nearest pose of the longer side, or the
    earlier of two. If several request the same pose, the nearest of them gets it.
    evo, interpolate: as above, but all of them get it, and ties are decided in float64 seconds.
    greedy: the closest pairs first, each pose only once, with a difference strictly below the limit (TUM, rpg).
    in_order: each estimated pose gets the nearest pose that is left (ov_eval).
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
    """The poses of the pairs of `associate`.

    With "interpolate", the longer side is interpolated at the other stamps.
    """
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
    """The index (N,) of the nearest of the sorted instants `among` for each of t (N,); of two, the earlier one."""
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
    """The pairs of evo 1.38, in which the rounding of float64 seconds decides ties and limits."""
    gt_s = _seconds(gt_ns)
    est_s = _seconds(est_ns)
    if len(est_s) > len(gt_s):
        gt, est = _nearest_within(gt_s, est_s + offset_s, max_diff_s)
    else:
        est, gt = _nearest_within(est_s, gt_s - offset_s, max_diff_s)
    return Pairs(gt, est)


def _nearest_within(shorter_s: Array, longer_s: Array, max_diff_s: float) -> tuple[Index, Index]:
    """The indices (K,) of instants, and of the nearest instants of the longer list, which may occur several times."""
    nearest_longer = nearest(shorter_s, longer_s)
    diff_s = np.abs(longer_s[nearest_longer] - shorter_s)
    is_beyond = shorter_s > longer_s[-1]
    is_near = (diff_s <= max_diff_s) | is_beyond
    is_after_first = shorter_s >= longer_s[0] - max_diff_s
    is_before_last = shorter_s <= longer_s[-1] + max_diff_s
    paired = np.flatnonzero(is_near & is_after_first & is_before_last)
    return paired, nearest_longer[paired]


def _seconds(t_ns: Stamps) -> Array:
    """The stamps as the nearest float64 in seconds. They are not converted from float64 ns, which round above 2⁵³."""
    is_exact = np.abs(t_ns) < 2**53
    whole_s = t_ns // 10**9
    fraction_s = t_ns % 10**9 / 1e9
    return np.asarray(np.where(is_exact, t_ns / 1e9, whole_s + fraction_s))


def _once_each(shorter_ns: Stamps, longer_ns: Stamps, max_diff_ns: int) -> tuple[Index, Index]:
    """The indices (K,) of instants, and of the nearest instants of the longer list, each of which occurs only once."""
    nearest_longer = nearest(shorter_ns, longer_ns)
    diff_ns = np.abs(longer_ns[nearest_longer] - shorter_ns)
    requesting = np.flatnonzero(diff_ns <= max_diff_ns)
    requested = nearest_longer[requesting]
    # lexsort is stable. For each requested pose, the nearest one comes first, and of equal ones the earlier.
    order = np.lexsort((diff_ns[requesting], requested))
    is_first = np.diff(requested[order], prepend=-1) > 0
    chosen = order[is_first]
    return requesting[chosen], requested[chosen]


def _greedy(gt_ns: Stamps, est_ns: Stamps, max_diff_ns: int) -> Pairs:
    """The pairs of Sturm et al. (2012), in which ties are decided for the earlier stamps."""
    first_gt = np.searchsorted(gt_ns, est_ns - max_diff_ns, side="right")
    end_gt = np.searchsorted(gt_ns, est_ns + max_diff_ns, side="left")
    count = np.maximum(end_gt - first_gt, 0)  # the number of candidates for each estimated pose
    n_candidates = count.sum()
    if n_candidates > MAX_CANDIDATES:
        raise AlignmentError(
            f"max_diff_ns should leave few candidates a pose, but {max_diff_ns} leaves {n_candidates} pairs to compare"
        )

    # The candidates of each estimated pose follow those of the poses before it.
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

    # Two close pairs can cross, so only the true poses are in order.
    pairs = np.array(chosen, np.int64)
    pairs = pairs[np.argsort(gt[pairs])]
    return Pairs(gt[pairs], est[pairs])


def _in_order(gt_ns: Stamps, est_ns: Stamps, max_diff_ns: int) -> Pairs:
    """The pairs of OpenVINS (Geneva et al., 2020), which are in order of time on both sides."""
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
