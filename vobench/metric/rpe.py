"""Relative pose error over frames, metres, seconds and angles, and over parts of the path."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.blockwise import ErrorArrays, in_blocks
from vobench.metric.comparison import HARTLEY, POSES, STURM_RPE, ZHANG, Comparison, MetricDefinition, OverLengths
from vobench.metric.motion_error import (
    MatrixErrors,
    PoseErrors,
    angle_rad,
    distances_between,
    errors_between,
    matrix_errors,
    motion_errors,
    motions,
)
from vobench.metric.settings import RelativeRule, Unit
from vobench.trajectory.associate import Index, nearest
from vobench.trajectory.trajectory import Stamps, Trajectory, path_lengths_m, step_lengths_m

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


# In TUM's script, a true pose counts as missing if it is farther away than this number of usual steps.
MAX_TRUTH_STEPS = 2.0
STILL_M = 1e-100  # the square of a percentage of a smaller true motion would overflow


def relative_matrix_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> MatrixErrors:
    """The matrix errors (P,) of the motions between the poses of pairs of matched poses (K, 4, 4)."""
    first, last = pairs
    return MatrixErrors(*in_blocks(len(first), partial(_matrix_errors_of_pairs, T_gt, T_est, first, last)))


def _matrix_errors_of_pairs(T_gt: Array, T_est: Array, first: Index, last: Index, block: slice) -> MatrixErrors:
    """The matrix errors of the motions between a block of pairs of poses."""
    gt = motions(T_gt, first[block], last[block])
    est = motions(T_est, first[block], last[block])
    return matrix_errors(se3.inverse(gt) @ est)


class DistanceErrors(NamedTuple):
    """The errors of the distances between P pairs of poses: in m, and in % of the true distance.

    A pair without true motion has no percentage, so there can be fewer percentages than pairs.
    """

    metres: Array
    percent: Array


def distance_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> DistanceErrors:
    """| ‖q_j - q_i‖ - ‖p_j - p_i‖ | of matched poses (K, 4, 4), q true and p estimated.

    Source: evo's point_distance and its ratio.
    """
    gt_m = distances_between(T_gt, *pairs)
    est_m = distances_between(T_est, *pairs)
    errors_m = np.abs(gt_m - est_m)
    is_moving = gt_m > STILL_M
    percent = errors_m[is_moving] / gt_m[is_moving] * 100
    return DistanceErrors(errors_m, percent)


def tum_errors(
    gt: Trajectory,
    est: Trajectory,
    *,
    delta_s: float,
    offset_ns: int = 0,
    scale: float = 1.0,
) -> PoseErrors:
    """The errors of the estimated motions over `delta_s` seconds from every pose. Positions are multiplied by `scale`.

    Source: Sturm et al. (2012), section V-A; their script with --fixed_delta.
    """
    t_ns = est.t_ns + np.int64(offset_ns)
    last = nearest(t_ns + round(delta_s * 1e9), t_ns)
    first = np.flatnonzero(last < len(t_ns) - 1)  # the last pose would be the nearest one to all later instants
    last = last[first]

    gt_first = nearest(t_ns[first], gt.t_ns)
    gt_last = nearest(t_ns[last], gt.t_ns)
    first_miss_ns = np.abs(gt.t_ns[gt_first] - t_ns[first])
    last_miss_ns = np.abs(gt.t_ns[gt_last] - t_ns[last])
    largest_miss_ns = 0.0
    if len(gt) > 1:
        largest_miss_ns = MAX_TRUTH_STEPS * np.median(np.diff(gt.t_ns))
    is_near = np.maximum(first_miss_ns, last_miss_ns) <= largest_miss_ns

    T_est = motions(est.T_world_frame, last[is_near], first[is_near])
    T_est[:, :3, 3] *= scale
    T_gt = motions(gt.T_world_frame, gt_last[is_near], gt_first[is_near])
    return motion_errors(T_gt, T_est)


OPENVINS_LENGTHS_M = (8.0, 16.0, 24.0, 32.0, 40.0, 48.0)
OPENVINS_TOLERANCE_M = 0.5
RPG_SHARES = (0.1, 0.2, 0.3, 0.4, 0.5)
RPG_TOLERANCE = 0.2  # the tolerance of rpg, relative to the length
MIN_SAMPLES = 2  # a length with fewer parts is omitted


@dataclass(frozen=True, slots=True)
class RelativeErrors:
    """The errors of N parts of a path: translation in m, and angle, yaw and tilt in rad, with the nominal lengths."""

    length_m: Array
    trans_m: Array
    rot_rad: Array
    yaw_rad: Array
    gravity_rad: Array

    def __len__(self) -> int:
        return len(self.length_m)


def relative_lengths(path_m: float, rule: RelativeRule) -> tuple[float, ...]:
    """The lengths of a rule: 8 to 48 m, or 10 to 50 % of the path, truncated to two decimals."""
    if rule == "openvins":
        return OPENVINS_LENGTHS_M
    lengths_m = [float(np.trunc(share * path_m * 100) / 100) for share in RPG_SHARES]
    return tuple(length for length in lengths_m if length > 0)


def part_errors(
    T_gt: Array,
    T_est: Array,
    lengths_m: Sequence[float],
    *,
    rule: RelativeRule,
) -> RelativeErrors:
    """The errors of motions from each pose (K, 4, 4) to the pose at the path length nearest to each length.

    The vertical is the z axis of the world. Source: Zhang and Scaramuzza (2018), section IV.
    """
    along_m = path_lengths_m(T_gt[:, :3, 3])
    firsts = [NO_POSES]
    lasts = [NO_POSES]
    part_lengths_m = [np.zeros(0)]
    for length_m in lengths_m:
        first, last = pairs_along(along_m, length_m, tolerance=_part_tolerance_m(length_m, rule))
        if len(first) >= MIN_SAMPLES:
            firsts.append(first)
            lasts.append(last)
            part_lengths_m.append(np.full(len(first), length_m))
    first = np.concatenate(firsts)
    last = np.concatenate(lasts)

    errors = in_blocks(len(first), partial(_part_errors, T_gt, T_est, first, last))
    return RelativeErrors(np.concatenate(part_lengths_m), *errors)


def _part_tolerance_m(length_m: float, rule: RelativeRule) -> float:
    """The largest difference between the path of a part and its nominal length."""
    if rule == "openvins":
        return OPENVINS_TOLERANCE_M
    limit_m = RPG_TOLERANCE * length_m
    return float(np.nextafter(limit_m, 0.0))  # rpg requires a difference strictly below the limit


def _part_errors(
    T_gt: Array,
    T_est: Array,
    first: Index,
    last: Index,
    block: slice,
) -> ErrorArrays:
    """The translation, angle, yaw and tilt (N,) of the errors of the motions between a block of pairs of poses."""
    first = first[block]
    last = last[block]
    E = se3.inverse(motions(T_gt, first, last)) @ motions(T_est, first, last)
    R_error = E[:, :3, :3]
    R_est = T_est[last, :3, :3]
    R_world = R_est @ R_error @ se3.transposed(R_est)
    roll, pitch, yaw = se3.roll_pitch_yaw_rad(R_world).T
    length = np.linalg.norm(E[:, :3, 3], axis=1)
    tilt = np.hypot(pitch, roll)
    return length, angle_rad(R_error), np.abs(yaw), tilt


def _pairs(comparison: Comparison) -> IndexPairs:
    """The pairs of matched poses whose motions are compared."""
    settings = comparison.settings
    if settings.rpe_rule == "tartanair":
        return every_pair(len(comparison.matched))
    if settings.rpe_rule == "tum":  # TUM's script uses other pairs, and has only some of the errors
        return NO_POSES, NO_POSES
    is_from_truth = settings.rpe_pairs_from == "gt"
    return select_pairs(
        comparison.matched.T_gt if is_from_truth else comparison.T_moving,
        comparison.matched.t_ns,
        delta=settings.rpe_delta,
        unit=settings.rpe_unit,
        all_pairs=settings.rpe_all_pairs,
        spanning=settings.rpe_rule == "spanning",
    )


def _relative(comparison: Comparison) -> PoseErrors:
    settings = comparison.settings
    if settings.rpe_rule == "tum":
        return tum_errors(
            comparison.gt,
            comparison.est,
            delta_s=settings.rpe_delta,
            offset_ns=settings.offset_ns,
            scale=comparison.alignment.scale,
        )
    first, last = comparison.once(_pairs)
    return errors_between(comparison.matched.T_gt, comparison.T_moving, first, last)


def _matrix_errors(comparison: Comparison) -> MatrixErrors:
    pairs = comparison.once(_pairs)
    return relative_matrix_errors(comparison.matched.T_gt, comparison.T_moving, pairs)


def _distance_errors(comparison: Comparison) -> DistanceErrors:
    pairs = comparison.once(_pairs)
    return distance_errors(comparison.matched.T_gt, comparison.T_moving, pairs)


def _parts(comparison: Comparison) -> RelativeErrors:
    """The `part_errors` of a comparison for the lengths of its rule."""
    matched = comparison.matched
    settings = comparison.settings
    T_est = comparison.T_moving
    if settings.relative_rule == "rpg" and not settings.project:  # rpg turns errors into the estimate's own world
        R_est = matched.T_est[:, :3, :3]
        positions_m = comparison.alignment.scale * matched.T_est[:, :3, 3]
        T_est = se3.transform(R_est, positions_m)
    path_m = float(comparison.distances_m[-1])
    lengths_m = relative_lengths(path_m, settings.relative_rule)
    return part_errors(matched.T_gt, T_est, lengths_m, rule=settings.relative_rule)


def _over_parts(errors: Callable[[RelativeErrors], Array]) -> Callable[[Comparison], OverLengths]:
    """The measure of one kind of errors of parts."""

    def measure(comparison: Comparison) -> OverLengths:
        parts = comparison.once(_parts)
        return OverLengths(errors(parts), parts.length_m)

    return measure


MOTIONS = ("rpe_delta", "rpe_unit", "rpe_all_pairs", "rpe_pairs_from", "rpe_rule", *POSES)
RELATIVE = ("relative_rule", *POSES)
ALL_PAIRS = "; like tartanair over all ordered pairs i, j, of which its own script draws 10,000 at random"
GLOBAL = "a slow drift that stays below the size of a step"
_motion_metric = partial(MetricDefinition, settings=MOTIONS)
_part_metric = partial(MetricDefinition, source=ZHANG, settings=RELATIVE)
METRICS = (
    _motion_metric(
        id="rpe_trans",
        title="relative pose error, translation",
        unit="m",
        formula=f"‖t‖ of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        source=STURM_RPE,
        blind=GLOBAL,
        full=False,
        measure=lambda comparison: comparison.once(_relative).trans_m,
    ),
    _motion_metric(
        id="rpe_rot",
        title="relative pose error, angle",
        unit="deg",
        formula=f"angle of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        source=STURM_RPE,
        blind=GLOBAL,
        full=False,
        measure=lambda comparison: np.rad2deg(comparison.once(_relative).rot_rad),
    ),
    _motion_metric(
        id="rpe_rot_chordal",
        title="relative pose error, rotation as a matrix",
        unit="1",
        formula="‖R − I‖_F of the same E as rpe_rot",
        source=HARTLEY,
        blind=GLOBAL,
        measure=lambda comparison: comparison.once(_matrix_errors).rotation,
    ),
    _motion_metric(
        id="rpe_full",
        title="relative pose error, whole motion",
        unit="1",
        formula="‖E − I‖_F",
        source="evo's full",
        blind=f"the difference between translation and rotation: their sum depends on the unit of length; {GLOBAL}",
        measure=lambda comparison: comparison.once(_matrix_errors).full,
    ),
    _motion_metric(
        id="rpe_point",
        title="difference of the distances moved",
        unit="m",
        formula="| ‖q_j − q_i‖ − ‖p_j − p_i‖ |",
        source="evo's point_distance",
        blind="every direction: a motion of the right length to the wrong side has no error",
        measure=lambda comparison: comparison.once(_distance_errors).metres,
    ),
    _motion_metric(
        id="rpe_point_percent",
        title="difference of the distances moved, of the true one",
        unit="%",
        formula="100 | ‖q_j − q_i‖ − ‖p_j − p_i‖ | / ‖q_j − q_i‖, pairs where the truth stood still left out",
        source="evo's point_distance_error_ratio",
        blind="every direction, and drift while the truth is stationary",
        measure=lambda comparison: comparison.once(_distance_errors).percent,
    ),
    _part_metric(
        id="rel_trans",
        title="translation error over parts of the path",
        unit="m",
        formula="‖t‖ of (T_gt,ij)⁻¹ T_est,ij, j nearest to the length along the true path",
        blind="lengths are mixed: the longest decide",
        measure=_over_parts(lambda parts: parts.trans_m),
    ),
    _part_metric(
        id="rel_trans_percent",
        title="translation error over parts of the path, of their length",
        unit="%",
        formula="100 ‖t‖ / length of the same parts",
        blind="jitter on long parts",
        headline="mean",
        measure=_over_parts(lambda parts: 100 * parts.trans_m / parts.length_m),
    ),
    _part_metric(
        id="rel_rot",
        title="angle error over parts of the path",
        unit="deg",
        formula="angle of (T_gt,ij)⁻¹ T_est,ij",
        blind="lengths are mixed: the longest decide",
        measure=_over_parts(lambda parts: np.rad2deg(parts.rot_rad)),
    ),
    _part_metric(
        id="rel_rot_per_m",
        title="angle error over parts of the path, per metre",
        unit="deg/m",
        formula="angle / length of the same parts",
        blind="jitter on long parts",
        headline="mean",
        measure=_over_parts(lambda parts: np.rad2deg(parts.rot_rad) / parts.length_m),
    ),
    _part_metric(
        id="rel_yaw",
        title="yaw error over parts of the path: the turn about gravity that inertia can't see",
        unit="deg",
        formula="|yaw| of the error turned into the world: R_est,j R_E R_est,j⁻¹ = Rz(yaw) Ry(pitch) Rx(roll); "
        "rpg's is the estimate's own world, openvins' the truth's",
        blind="gravity is the z of the world: another vertical mixes it with rel_gravity",
        measure=_over_parts(lambda parts: np.rad2deg(parts.yaw_rad)),
    ),
    _part_metric(
        id="rel_gravity",
        title="tilt error over parts of the path: the turn against gravity that inertia sees",
        unit="deg",
        formula="√(pitch² + roll²) of the same rotation as rel_yaw",
        blind="gravity is the z of the world: another vertical mixes it with rel_yaw",
        measure=_over_parts(lambda parts: np.rad2deg(parts.gravity_rad)),
    ),
)
