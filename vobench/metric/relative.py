"""Relative errors over parts of the path, split into yaw and tilt, after rpg_trajectory_evaluation and ov_eval."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.pairs import IndexPairs, pairs_along
from vobench.metric.pose_error import Rows, angle_rad, in_blocks, motions, roll_pitch_yaw_rad
from vobench.metric.settings import RelativeRule
from vobench.trajectory.associate import Index

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
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(T_gt[:, :3, 3], axis=0), axis=1))])[: len(T_gt)]
    found = [(length, *_parts(along, length, rule)) for length in lengths_m]
    kept = [part for part in found if len(part[1]) >= MIN_SAMPLES]
    first, last = (np.concatenate([np.zeros(0, np.int64), *(part[side] for part in kept)]) for side in (1, 2))
    lengths = np.repeat([part[0] for part in kept], [len(part[1]) for part in kept])
    errors = in_blocks(len(first), lambda part: _errors(T_gt, T_est, first[part], last[part]))
    return RelativeErrors(lengths, *errors)


def _errors(T_gt: Array, T_est: Array, first: Index, last: Index) -> Rows:
    """Translation, angle, yaw and tilt (N,) of what is left between motions."""
    E = se3.inverse(motions(T_gt, first, last)) @ motions(T_est, first, last)
    R_est = T_est[last, :3, :3]
    roll, pitch, yaw = roll_pitch_yaw_rad(R_est @ E[:, :3, :3] @ np.swapaxes(R_est, -1, -2)).T
    return np.linalg.norm(E[:, :3, 3], axis=1), angle_rad(E[:, :3, :3]), np.abs(yaw), np.hypot(pitch, roll)


def _parts(along: Array, length_m: float, rule: RelativeRule) -> IndexPairs:
    if rule == "openvins":
        return pairs_along(along, length_m, tolerance=OPENVINS_TOLERANCE_M)
    return pairs_along(along, length_m, tolerance=float(np.nextafter(RPG_TOLERANCE * length_m, 0.0)))  # strictly less
