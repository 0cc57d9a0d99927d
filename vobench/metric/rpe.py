"""Relative pose error over frames, metres, seconds and angles, and over parts of the path."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.ate import (
    PoseErrors,
    Rows,
    angle_rad,
    errors_between,
    in_blocks,
    matrix_norms,
    motion_errors,
    motions,
)
from vobench.metric.comparison import HARTLEY, POSES, STURM_RPE, ZHANG, Comparison, MetricDefinition, OverLengths
from vobench.metric.settings import RelativeRule, Unit
from vobench.trajectory.associate import Index, nearest
from vobench.trajectory.trajectory import Stamps, Trajectory

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
        first = np.arange(0, max(len(T) - int(delta), 0), 1 if all_pairs else int(delta))
        return first, first + int(delta)
    if unit in ("d", "r"):
        delta = float(np.deg2rad(delta)) if unit == "d" else delta
        R = T[:, :3, :3]
        return _all_by_angle(R, delta) if all_pairs else _chain(angle_rad(np.swapaxes(R[:-1], -1, -2) @ R[1:]), delta)
    if not all_pairs:
        return _chain(_moves(T) if unit == "m" else np.diff(t_ns), delta if unit == "m" else delta * 1e9)
    along = _along(T) if unit == "m" else (t_ns - t_ns[:1]) / 1e9
    return pairs_along(along, delta, tolerance=TOLERANCE * delta, gaps=_gaps(t_ns) if spanning else None)


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


def _moves(T: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))


def _along(T: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(_moves(T))])[: len(T)]


def _gaps(t_ns: Stamps) -> NDArray[np.bool_]:
    """Which steps (K-1,) between matched poses take longer than usual."""
    steps = np.diff(t_ns)
    return steps > GAP_STEPS * np.median(steps) if len(steps) else np.zeros(0, bool)


def _chain(steps: NDArray[Any], delta: float) -> IndexPairs:
    """Pairs end to end, each as soon as its steps sum up to delta: one sum after the other, as it rounds."""
    chosen = [0]
    total = 0.0
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


MAX_TRUTH_STEPS = 2.0  # TUM's: a truth further off than this many of its usual steps is none
STILL_M = 1e-100  # a motion of the truth below it has no percentage that could be squared


def relative_matrix_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> Rows:
    """`matrix_norms` (P,) of the errors of the motions between matched poses (K, 4, 4) from first to last."""
    first, last = pairs

    def block(part: slice) -> Rows:
        gt, est = (motions(T, first[part], last[part]) for T in (T_gt, T_est))
        return matrix_norms(se3.inverse(gt) @ est)

    return in_blocks(len(first), block)


def distance_errors(T_gt: Array, T_est: Array, pairs: IndexPairs) -> Rows:
    """| ‖q_j - q_i‖ - ‖p_j - p_i‖ | of matched poses (K, 4, 4), q true and p estimated: in m, and in % of the true one.

    Pairs between which the truth didn't move have no percentage. Source: evo's point_distance and its ratio.
    """
    first, last = pairs
    gt_m, est_m = (np.linalg.norm(T[last, :3, 3] - T[first, :3, 3], axis=1) for T in (T_gt, T_est))
    point_m = np.abs(gt_m - est_m)
    moved = gt_m > STILL_M
    return point_m, point_m[moved] / gt_m[moved] * 100


def tum_errors(
    gt: Trajectory, est: Trajectory, *, delta_s: float, offset_ns: int = 0, scale: float = 1.0
) -> PoseErrors:
    """Errors of the estimate's motions over delta_s seconds, from every pose on; est's positions times scale.

    Source: Sturm et al. (2012), section V-A, by their script with --fixed_delta.
    """
    t_ns = est.t_ns + np.int64(offset_ns)
    last = nearest(t_ns + round(delta_s * 1e9), t_ns)
    first = np.flatnonzero(last < len(t_ns) - 1)  # the last pose may stand for any later instant, so it ends no pair
    last = last[first]
    gt_first = nearest(t_ns[first], gt.t_ns)
    gt_last = nearest(t_ns[last], gt.t_ns)
    longest_ns = MAX_TRUTH_STEPS * np.median(np.diff(gt.t_ns)) if len(gt) > 1 else 0.0
    off_ns = np.maximum(np.abs(gt.t_ns[gt_first] - t_ns[first]), np.abs(gt.t_ns[gt_last] - t_ns[last]))
    near = off_ns <= longest_ns
    T_est = motions(est.T_world_frame, last[near], first[near])
    T_est[:, :3, 3] *= scale
    return motion_errors(motions(gt.T_world_frame, gt_last[near], gt_first[near]), T_est)


OPENVINS_LENGTHS_M = (8.0, 16.0, 24.0, 32.0, 40.0, 48.0)
OPENVINS_TOLERANCE_M = 0.5
RPG_SHARES = (0.1, 0.2, 0.3, 0.4, 0.5)
RPG_TOLERANCE = 0.2  # of the length
MIN_SAMPLES = 2  # a length with fewer is left out


@dataclass(frozen=True, slots=True)
class RelativeErrors:
    """Errors of N parts: nominal length, translation in m, angle, its yaw and its tilt in rad, each (N,)."""

    length_m: Array
    trans_m: Array
    rot_rad: Array
    yaw_rad: Array
    gravity_rad: Array

    def __len__(self) -> int:
        return len(self.length_m)


def relative_lengths(path_m: float, rule: RelativeRule) -> tuple[float, ...]:
    """The rule's lengths: 8 to 48 m, or 10 to 50 % of the path with two decimals cut off."""
    if rule == "openvins":
        return OPENVINS_LENGTHS_M
    shares = (float(np.trunc(share * path_m * 100) / 100) for share in RPG_SHARES)
    return tuple(length for length in shares if length > 0)


def part_errors(T_gt: Array, T_est: Array, lengths_m: Sequence[float], *, rule: RelativeRule) -> RelativeErrors:
    """Errors of the motions from each pose (K, 4, 4) to the one whose true path is nearest to each length.

    Gravity points along z of the world. Source: Zhang and Scaramuzza (2018), section IV.
    """
    along = _along(T_gt)
    kept: list[tuple[float, Index, Index]] = []
    for length in lengths_m:
        # rpg's tolerance is strictly less
        tolerance_m = OPENVINS_TOLERANCE_M if rule == "openvins" else float(np.nextafter(RPG_TOLERANCE * length, 0.0))
        first, last = pairs_along(along, length, tolerance=tolerance_m)
        kept += [(length, first, last)] if len(first) >= MIN_SAMPLES else []
    first, last = (np.concatenate([np.zeros(0, np.int64), *(part[side] for part in kept)]) for side in (1, 2))
    lengths = np.repeat([part[0] for part in kept], [len(part[1]) for part in kept])
    errors = in_blocks(len(first), lambda part: _errors(T_gt, T_est, first[part], last[part]))
    return RelativeErrors(lengths, *errors)


def _errors(T_gt: Array, T_est: Array, first: Index, last: Index) -> Rows:
    """Translation, angle, yaw and tilt (N,) of what is left between motions."""
    E = se3.inverse(motions(T_gt, first, last)) @ motions(T_est, first, last)
    R_est = T_est[last, :3, :3]
    roll, pitch, yaw = se3.roll_pitch_yaw_rad(R_est @ E[:, :3, :3] @ np.swapaxes(R_est, -1, -2)).T
    return np.linalg.norm(E[:, :3, 3], axis=1), angle_rad(E[:, :3, :3]), np.abs(yaw), np.hypot(pitch, roll)


def _pairs(of: Comparison) -> IndexPairs:
    s = of.settings
    if s.rpe_rule == "tartanair":
        return every_pair(len(of.matched))
    if s.rpe_rule == "tum":  # their script pairs other poses, and has no other forms of errors than theirs
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    return select_pairs(
        of.matched.T_gt if s.rpe_pairs_from == "gt" else of.T_moving,
        of.matched.t_ns,
        delta=s.rpe_delta,
        unit=s.rpe_unit,
        all_pairs=s.rpe_all_pairs,
        spanning=s.rpe_rule == "spanning",
    )


def _relative(of: Comparison) -> PoseErrors:
    s = of.settings
    if s.rpe_rule == "tum":
        return tum_errors(of.gt, of.est, delta_s=s.rpe_delta, offset_ns=s.offset_ns, scale=of.alignment.scale)
    return errors_between(of.matched.T_gt, of.T_moving, *of.once(_pairs))


def _matrices(of: Comparison) -> Rows:
    return relative_matrix_errors(of.matched.T_gt, of.T_moving, of.once(_pairs))


def _distances(of: Comparison) -> Rows:
    return distance_errors(of.matched.T_gt, of.T_moving, of.once(_pairs))


def _parts_of(of: Comparison) -> RelativeErrors:
    rule = of.settings.relative_rule
    T_est = of.T_moving
    if rule == "rpg" and not of.settings.project:  # rpg turns errors into the estimate's own world
        T_est = se3.transform(of.matched.T_est[:, :3, :3], of.alignment.scale * of.matched.T_est[:, :3, 3])
    lengths_m = relative_lengths(float(of.distances_m[-1]), rule)
    return part_errors(of.matched.T_gt, T_est, lengths_m, rule=rule)


def _over_parts(chosen: Callable[[RelativeErrors], Array]) -> Callable[[Comparison], OverLengths]:
    return lambda of: OverLengths(chosen(of.once(_parts_of)), of.once(_parts_of).length_m)


MOTIONS = ("rpe_delta", "rpe_unit", "rpe_all_pairs", "rpe_pairs_from", "rpe_rule", *POSES)
RELATIVE = ("relative_rule", *POSES)
ALL_PAIRS = "; like tartanair over all ordered pairs i, j, of which its own script draws 10,000 at random"
GLOBAL = "a slow drift that stays below the size of a step"
_motion_metric = partial(MetricDefinition, settings=MOTIONS)
_part_metric = partial(MetricDefinition, source=ZHANG, settings=RELATIVE)
METRICS = (
    _motion_metric(
        "rpe_trans",
        "relative pose error, translation",
        "m",
        f"‖t‖ of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        STURM_RPE,
        blind=GLOBAL,
        full=False,
        measure=lambda of: of.once(_relative).trans_m,
    ),
    _motion_metric(
        "rpe_rot",
        "relative pose error, angle",
        "deg",
        f"angle of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        STURM_RPE,
        blind=GLOBAL,
        full=False,
        measure=lambda of: np.rad2deg(of.once(_relative).rot_rad),
    ),
    _motion_metric(
        "rpe_rot_chordal",
        "relative pose error, rotation as a matrix",
        "1",
        "‖R − I‖_F of the same E as rpe_rot",
        HARTLEY,
        blind=GLOBAL,
        measure=lambda of: of.once(_matrices)[0],
    ),
    _motion_metric(
        "rpe_full",
        "relative pose error, whole motion",
        "1",
        "‖E − I‖_F",
        "evo's full",
        blind=f"metres and rotations are added: it changes with the unit of length; {GLOBAL}",
        measure=lambda of: of.once(_matrices)[1],
    ),
    _motion_metric(
        "rpe_point",
        "difference of the distances moved",
        "m",
        "| ‖q_j − q_i‖ − ‖p_j − p_i‖ |",
        "evo's point_distance",
        blind="every direction: a motion of the right length to the wrong side has no error",
        measure=lambda of: of.once(_distances)[0],
    ),
    _motion_metric(
        "rpe_point_percent",
        "difference of the distances moved, of the true one",
        "%",
        "100 | ‖q_j − q_i‖ − ‖p_j − p_i‖ | / ‖q_j − q_i‖, pairs where the truth stood still left out",
        "evo's point_distance_error_ratio",
        blind="every direction, and drift while the truth stands still",
        measure=lambda of: of.once(_distances)[1],
    ),
    _part_metric(
        "rel_trans",
        "translation error over parts of the path",
        "m",
        "‖t‖ of (T_gt,ij)⁻¹ T_est,ij, j nearest to the length along the true path",
        blind="lengths are mixed: the longest decide",
        measure=_over_parts(lambda parts: parts.trans_m),
    ),
    _part_metric(
        "rel_trans_percent",
        "translation error over parts of the path, of their length",
        "%",
        "100 ‖t‖ / length of the same parts",
        blind="jitter on long parts",
        headline="mean",
        measure=_over_parts(lambda parts: 100 * parts.trans_m / parts.length_m),
    ),
    _part_metric(
        "rel_rot",
        "angle error over parts of the path",
        "deg",
        "angle of (T_gt,ij)⁻¹ T_est,ij",
        blind="lengths are mixed: the longest decide",
        measure=_over_parts(lambda parts: np.rad2deg(parts.rot_rad)),
    ),
    _part_metric(
        "rel_rot_per_m",
        "angle error over parts of the path, per metre",
        "deg/m",
        "angle / length of the same parts",
        blind="jitter on long parts",
        headline="mean",
        measure=_over_parts(lambda parts: np.rad2deg(parts.rot_rad) / parts.length_m),
    ),
    _part_metric(
        "rel_yaw",
        "yaw error over parts of the path: the turn about gravity that inertia can't see",
        "deg",
        "|yaw| of the error turned into the world: R_est,j R_E R_est,j⁻¹ = Rz(yaw) Ry(pitch) Rx(roll); "
        "rpg's is the estimate's own world, openvins' the truth's",
        blind="gravity is the z of the world: another vertical mixes it with rel_gravity",
        measure=_over_parts(lambda parts: np.rad2deg(parts.yaw_rad)),
    ),
    _part_metric(
        "rel_gravity",
        "tilt error over parts of the path: the turn against gravity that inertia sees",
        "deg",
        "√(pitch² + roll²) of the same rotation as rel_yaw",
        blind="gravity is the z of the world: another vertical mixes it with rel_yaw",
        measure=_over_parts(lambda parts: np.rad2deg(parts.gravity_rad)),
    ),
)
