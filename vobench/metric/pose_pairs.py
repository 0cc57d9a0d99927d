"""The pairs of matched poses whose motions a relative pose error compares."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.motion_error import angle_rad
from vobench.metric.settings import Unit
from vobench.trajectory.associate import Index
from vobench.trajectory.trajectory import Stamps, path_lengths_m, step_lengths_m

TOLERANCE = 0.1  # with all pairs, the largest deviation of a pair from delta, relative to delta; as in evo
GAP_STEPS = 1.5  # a longer step, relative to the usual step, is a gap
MAX_PAIRS = 20_000_000  # the number of pairs by angle grows with the square of the poses; these need 3 GB
MAX_POSES = 2000  # the largest number of poses for which all pairs are compared, which are 4 million
CHUNK = 4_000_000  # the number of relative angles that are computed at once, in 32 MB
TRACE_MARGIN = 1e-4  # larger than the rounding errors of matrices with six digits

IndexPairs = tuple[Index, Index]
Mask = NDArray[np.bool_]
NO_POSES = np.zeros(0, np.int64)


def select_pairs(
    T: Array,
    t_ns: Stamps,
    *,
    delta: float,
    unit: Unit,
    all_pairs: bool,
    spanning: bool = True,
) -> IndexPairs:
    """Indices (first, last), each (P,), of matched poses T (K, 4, 4), stamped t_ns (K,), that are `delta` apart.

    Consecutive: from the first pose on, each pair begins where the one before ended, at the first pose
    `delta` or more further along. All pairs: every pose with the later one nearest to `delta` away, if it
    is within a tenth; with `spanning` a pose whose partner fell into a gap is paired with the one after the
    gap, so that errors made in the gap are counted. Frames count matched poses. Source: evo's rules; gaps ours.
    """
    if unit == "f":
        return _pairs_by_frames(len(T), int(delta), all_pairs=all_pairs)
    if unit in ("d", "r"):
        delta_rad = float(np.deg2rad(delta)) if unit == "d" else delta
        return _pairs_by_angle(T[:, :3, :3], delta_rad, all_pairs=all_pairs)
    if all_pairs:
        along = path_lengths_m(T[:, :3, 3]) if unit == "m" else (t_ns - t_ns[:1]) / 1e9
        gaps = _gaps(t_ns) if spanning else None
        return pairs_along(along, delta, tolerance=TOLERANCE * delta, gaps=gaps)
    if unit == "m":
        return _chain(step_lengths_m(T[:, :3, 3]), delta)
    return _chain(np.diff(t_ns), delta * 1e9)


def _pairs_by_frames(n: int, delta: int, *, all_pairs: bool) -> IndexPairs:
    """Pairs of n poses that are `delta` frames apart."""
    step = 1 if all_pairs else delta
    first = np.arange(0, max(n - delta, 0), step)
    return first, first + delta


def _pairs_by_angle(R: Array, delta_rad: float, *, all_pairs: bool) -> IndexPairs:
    """Pairs of rotations (K, 3, 3) that differ by an angle."""
    if all_pairs:
        return _all_by_angle(R, delta_rad)
    R_steps = se3.transposed(R[:-1]) @ R[1:]
    return _chain(angle_rad(R_steps), delta_rad)


def every_pair(n: int) -> IndexPairs:
    """All ordered pairs (first, last) of n poses, including pairs of equal poses. TartanAir draws 10,000 of them.

    For more than MAX_POSES poses, MAX_POSES² pairs are drawn, which are always the same.
    """
    if n <= MAX_POSES:
        poses = np.arange(n)
        return np.repeat(poses, n), np.tile(poses, n)
    first, last = np.random.default_rng(0).integers(n, size=(2, MAX_POSES**2))
    return first, last


def pairs_along(
    along: Array,
    delta: float,
    *,
    tolerance: float,
    gaps: Mask | None = None,
) -> IndexPairs:
    """Each pose, paired with the later pose whose distance from it is nearest to delta.

    `along` (K,) are distances from the start, which do not decrease. A pair whose distance differs from delta by more
    than `tolerance` is dropped, unless the later pose would be in one of the `gaps` (K - 1,), which are steps with
    missing poses. The pose after the gap is used then. O(K log K).
    """
    n = len(along)
    first = np.arange(max(n - 1, 0))
    goal = along[first] + delta
    beyond = np.searchsorted(along, goal, side="left")
    beyond = np.clip(beyond, first + 1, max(n - 1, 0))

    # While the body is stationary, all poses have the same distance. The first of them is used.
    short = _first_of_equal(along, beyond - 1, first)
    beyond = _first_of_equal(along, beyond, first)
    distance_beyond = along[beyond] - along[first]
    distance_short = along[short] - along[first]
    miss_beyond = np.abs(distance_beyond - delta)
    miss_short = np.abs(distance_short - delta)
    nearest_pose = np.where(miss_short <= miss_beyond, short, beyond)
    is_near = np.minimum(miss_short, miss_beyond) <= tolerance

    spans_gap = np.zeros(len(first), bool)
    if gaps is not None:
        spans_gap = gaps[beyond - 1] & (distance_beyond > delta)
    is_pair = is_near | spans_gap
    last = np.where(is_near, nearest_pose, beyond)
    return first[is_pair], last[is_pair]


def _first_of_equal(along: Array, poses: Index, first: Index) -> Index:
    """The first of all poses with the same distance as `poses` that come after `first`, all (N,)."""
    arrivals = np.searchsorted(along, along[poses], side="left")
    return np.asarray(np.maximum(arrivals, first + 1))


def _gaps(t_ns: Stamps) -> Mask:
    """Whether each step (K - 1,) between matched poses is longer than usual."""
    steps_ns = np.diff(t_ns)
    if not len(steps_ns):
        return np.zeros(0, bool)
    return np.asarray(steps_ns > GAP_STEPS * np.median(steps_ns))


def _chain(steps: NDArray[Any], delta: float) -> IndexPairs:
    """Consecutive pairs, each of which ends when the sum of its steps reaches delta. Steps are added as in evo."""
    ends = [0]
    total = 0.0
    for end, step in enumerate(steps.tolist(), 1):
        total += step
        if total >= delta:
            ends.append(end)
            total = 0.0
    chain = np.array(ends, np.int64)
    return chain[:-1], chain[1:]


def _all_by_angle(R: Array, delta_rad: float) -> IndexPairs:
    """All pairs of rotations (K, 3, 3) that differ by delta ± a tenth, regardless of the rotations between them."""
    firsts = [NO_POSES]
    lasts = [NO_POSES]
    total = 0
    for first, last in _candidates(R, delta_rad):
        angle = angle_rad(se3.transposed(R[first]) @ R[last])
        is_pair = np.abs(angle - delta_rad) <= TOLERANCE * delta_rad
        firsts.append(first[is_pair])
        lasts.append(last[is_pair])
        total += int(np.count_nonzero(is_pair))
        if total > MAX_PAIRS:
            raise AlignmentError(
                f"all pairs {np.rad2deg(delta_rad):g} degrees apart should be {MAX_PAIRS} or fewer, but {len(R)} poses "
                f"have more; take consecutive pairs"
            )
    return np.concatenate(firsts), np.concatenate(lasts)


def _candidates(R: Array, delta_rad: float) -> Iterator[IndexPairs]:
    """The pairs whose trace is close to that of the angle, in chunks."""
    flat = R.reshape(-1, 9)
    largest_rad = min((1 + TOLERANCE) * delta_rad, np.pi)
    smallest_rad = max((1 - TOLERANCE) * delta_rad, 0.0)
    lowest_trace = 1 + 2 * np.cos(largest_rad) - TRACE_MARGIN
    highest_trace = 1 + 2 * np.cos(smallest_rad) + TRACE_MARGIN
    rows = max(1, CHUNK // max(len(R), 1))
    for begin in range(0, len(R) - 1, rows):
        chunk = flat[begin : begin + rows]
        traces = chunk @ flat[begin + 1 :].T
        is_candidate = (traces >= lowest_trace) & (traces <= highest_trace)
        first, last = np.nonzero(is_candidate)
        is_later = last >= first
        yield first[is_later] + begin, last[is_later] + begin + 1
