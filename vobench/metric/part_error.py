"""Relative errors over parts of the path, of nominal lengths in metres or as shares of the whole path."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.blockwise import in_blocks
from vobench.metric.comparison import POSES, ZHANG, Comparison, MetricDefinition, OverLengths
from vobench.metric.motion_error import angle_rad, motions
from vobench.metric.pose_pairs import NO_POSES, pairs_along
from vobench.metric.settings import RelativeRule
from vobench.trajectory.associate import Index
from vobench.trajectory.trajectory import path_lengths_m

OPENVINS_LENGTHS_M = (8.0, 16.0, 24.0, 32.0, 40.0, 48.0)
OPENVINS_TOLERANCE_M = 0.5
RPG_SHARES = (0.1, 0.2, 0.3, 0.4, 0.5)
RPG_TOLERANCE = 0.2  # the tolerance of rpg, relative to the length
MIN_SAMPLES = 2  # a length with fewer parts is omitted


@dataclass(frozen=True, slots=True)
class PartErrors:
    """The errors of N parts of a path: translation in m, and angle, yaw and tilt in rad, with the nominal lengths."""

    length_m: Array
    trans_m: Array
    rot_rad: Array
    yaw_rad: Array
    gravity_rad: Array

    def __len__(self) -> int:
        return len(self.length_m)


def nominal_lengths_m(path_m: float, rule: RelativeRule) -> tuple[float, ...]:
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
) -> PartErrors:
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

    errors = in_blocks(len(first), partial(_errors_of_block, T_gt, T_est, first, last))
    return PartErrors(
        length_m=np.concatenate(part_lengths_m),
        trans_m=errors.trans_m,
        rot_rad=errors.rot_rad,
        yaw_rad=errors.yaw_rad,
        gravity_rad=errors.gravity_rad,
    )


def _part_tolerance_m(length_m: float, rule: RelativeRule) -> float:
    """The largest difference between the path of a part and its nominal length."""
    if rule == "openvins":
        return OPENVINS_TOLERANCE_M
    limit_m = RPG_TOLERANCE * length_m
    return float(np.nextafter(limit_m, 0.0))  # rpg requires a difference strictly below the limit


@dataclass(frozen=True, slots=True)
class _BlockErrors:
    """The errors of a block of parts, without their lengths."""

    trans_m: Array
    rot_rad: Array
    yaw_rad: Array
    gravity_rad: Array


def _errors_of_block(
    T_gt: Array,
    T_est: Array,
    first: Index,
    last: Index,
    block: slice,
) -> _BlockErrors:
    """The errors of the motions between a block of pairs of poses."""
    first = first[block]
    last = last[block]
    E = se3.inverse(motions(T_gt, first, last)) @ motions(T_est, first, last)
    R_error = E[:, :3, :3]
    R_est = T_est[last, :3, :3]
    R_world = R_est @ R_error @ se3.transposed(R_est)
    roll, pitch, yaw = se3.roll_pitch_yaw_rad(R_world).T
    return _BlockErrors(
        trans_m=np.linalg.norm(E[:, :3, 3], axis=1),
        rot_rad=angle_rad(R_error),
        yaw_rad=np.abs(yaw),
        gravity_rad=np.hypot(pitch, roll),
    )


def _parts(comparison: Comparison) -> PartErrors:
    """The `part_errors` of a comparison for the lengths of its rule."""
    matched = comparison.matched
    settings = comparison.settings
    T_est = comparison.T_moving
    if settings.relative_rule == "rpg" and not settings.project:  # rpg turns errors into the estimate's own world
        R_est = matched.T_est[:, :3, :3]
        positions_m = comparison.alignment.scale * matched.T_est[:, :3, 3]
        T_est = se3.transform(R_est, positions_m)
    path_m = float(comparison.distances_m[-1])
    lengths_m = nominal_lengths_m(path_m, settings.relative_rule)
    return part_errors(matched.T_gt, T_est, lengths_m, rule=settings.relative_rule)


def _over_parts(errors: Callable[[PartErrors], Array]) -> Callable[[Comparison], OverLengths]:
    """The measure of one kind of errors of parts."""

    def measure(comparison: Comparison) -> OverLengths:
        parts = comparison.once(_parts)
        return OverLengths(errors(parts), parts.length_m)

    return measure


_part_metric = partial(MetricDefinition, source=ZHANG, settings=("relative_rule", *POSES))
METRICS = (
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
