"""Which poses a relative error compares: pairs so many frames, metres, seconds, degrees or radians apart."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import AlignmentError
from vobench.geometry.se3 import Array
from vobench.metric.pose_error import angle_rad
from vobench.metric.settings import Unit
from vobench.trajectory.associate import Index
from vobench.trajectory.trajectory import Stamps

TOLERANCE = 0.1  # of delta, that a pair may be off among all pairs; evo's
GAP_STEPS = 1.5  # a step so many times the usual one is a gap
MAX_PAIRS = 20_000_000  # all pairs by angle grow with the square of the poses; this many need 3 GB
MAX_POSES = 2000  # whose every pair is looked at: 4 million
CHUNK = 4_000_000  # relative angles looked at in one go: 32 MB

IndexPairs = tuple[Index, Index]


def select_pairs(
    T: Array, t_ns: Stamps, *, delta: float, unit: Unit, all_pairs: bool, spanning: bool = True
) -> IndexPairs:
    """Indices (first, last), each (P,), of matched poses T (K, 4, 4), stamped t_ns (K,), that are `delta` apart.

    Consecutive: from the first pose on, each pair begins where the one before ended, at the first pose
    `delta` or more further along. All pairs: every pose with the later one nearest to `delta` away, if it
    is within a tenth; with `spanning` a pose whose partner fell into a gap goes with the one after the gap,
    so that what went wrong meanwhile is counted. Frames count matched poses. Source: evo's rules; gaps ours.
    """
    if unit == "f":
        return _frame_pairs(len(T), int(delta), all_pairs=all_pairs)
    if unit in ("d", "r"):
        delta = float(np.deg2rad(delta)) if unit == "d" else delta
        return _all_by_angle(T[:, :3, :3], delta) if all_pairs else _chain(_turns(T), delta)
    if not all_pairs:
        return _chain(_moves(T) if unit == "m" else np.diff(t_ns), delta if unit == "m" else delta * 1e9)
    along = np.concatenate([[0.0], np.cumsum(_moves(T))]) if unit == "m" else (t_ns - t_ns[:1]) / 1e9
    return pairs_along(along[: len(T)], delta, tolerance=TOLERANCE * delta, gaps=_gaps(t_ns) if spanning else None)


def every_pair(n: int) -> IndexPairs:
    """All ordered pairs (first, last) of n poses, each with itself too: what TartanAir draws 10,000 at random of.

    Of more than MAX_POSES poses, as many pairs as these have are drawn, always the same.
    """
    if n <= MAX_POSES:
        return np.repeat(np.arange(n), n), np.tile(np.arange(n), n)
    first, last = np.random.default_rng(0).integers(n, size=(2, MAX_POSES**2))
    return first, last


def pairs_along(along: Array, delta: float, *, tolerance: float, gaps: NDArray[np.bool_] | None = None) -> IndexPairs:
    """Of every pose the later one whose way `along` (K,), not decreasing, is nearest to delta further on.

    Pairs that miss it by more than `tolerance` are dropped, unless the partner fell into one of the `gaps`
    (K-1,), the steps that have holes in them: then the pose after the gap is taken. O(K log K).
    """
    n = len(along)
    first = np.arange(max(n - 1, 0))
    beyond = np.clip(np.searchsorted(along, along[first] + delta, side="left"), first + 1, max(n - 1, 0))
    # Poses that stand still share a distance; the first of them is the one that arrives there.
    beyond, short = (
        np.maximum(np.searchsorted(along, along[last], side="left"), first + 1) for last in (beyond, beyond - 1)
    )
    miss_beyond, miss_short = (np.abs(along[last] - along[first] - delta) for last in (beyond, short))
    last = np.where(miss_short <= miss_beyond, short, beyond)
    near = np.minimum(miss_short, miss_beyond) <= tolerance
    spans = np.zeros(len(first), bool) if gaps is None else gaps[beyond - 1] & (along[beyond] - along[first] > delta)
    kept = near | spans
    return first[kept], np.where(near, last, beyond)[kept]


def _frame_pairs(n: int, delta: int, *, all_pairs: bool) -> IndexPairs:
    first = np.arange(0, max(n - delta, 0), 1 if all_pairs else delta)
    return first, first + delta


def _moves(T: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))


def _turns(T: Array) -> Array:
    R = T[:, :3, :3]
    return angle_rad(np.swapaxes(R[:-1], -1, -2) @ R[1:])


def _gaps(t_ns: Stamps) -> NDArray[np.bool_]:
    """Which steps (K-1,) between matched poses take longer than usual."""
    steps = np.diff(t_ns)
    return steps > GAP_STEPS * np.median(steps) if len(steps) else np.zeros(0, bool)


def _chain(steps: NDArray[Any], delta: float) -> IndexPairs:
    """Pairs end to end, each as soon as its steps sum up to delta: one sum after the other, as it rounds."""
    chosen, total = [0], 0.0
    for end, step in enumerate(steps.tolist(), 1):
        total += step
        if total >= delta:
            chosen.append(end)
            total = 0.0
    ends = np.array(chosen, np.int64)
    return ends[:-1], ends[1:]


def _all_by_angle(R: Array, delta_rad: float) -> IndexPairs:
    """Every two rotations (K, 3, 3) that are delta ± a tenth apart, whatever the way between them."""
    found: list[IndexPairs] = []
    total = 0
    for first, last in _candidates(R, delta_rad):
        angle = angle_rad(np.swapaxes(R[first], -1, -2) @ R[last])
        kept = np.abs(angle - delta_rad) <= TOLERANCE * delta_rad
        found.append((first[kept], last[kept]))
        total += int(np.count_nonzero(kept))
        if total > MAX_PAIRS:
            raise AlignmentError(
                f"all pairs {np.rad2deg(delta_rad):g} degrees apart should be {MAX_PAIRS} or fewer, but {len(R)} poses "
                f"have more; take consecutive pairs"
            )
    firsts, lasts = zip(*found, strict=True) if found else ((np.zeros(0, np.int64),), (np.zeros(0, np.int64),))
    return np.concatenate(firsts), np.concatenate(lasts)


def _candidates(R: Array, delta_rad: float) -> Iterator[IndexPairs]:
    """Pairs whose trace says that they may fit, chunk after chunk; the margin is more than six digits lose."""
    flat = R.reshape(-1, 9)
    margin = 1e-4
    low = 1 + 2 * np.cos(min((1 + TOLERANCE) * delta_rad, np.pi)) - margin
    high = 1 + 2 * np.cos(max((1 - TOLERANCE) * delta_rad, 0.0)) + margin
    rows = max(1, CHUNK // max(len(R), 1))
    for begin in range(0, len(R) - 1, rows):
        traces = flat[begin : begin + rows] @ flat[begin + 1 :].T
        first, last = np.nonzero((traces >= low) & (traces <= high))
        later = last >= first
        yield first[later] + begin, last[later] + begin + 1
