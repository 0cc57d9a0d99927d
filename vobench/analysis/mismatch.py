"""Wrong axes, wrong quaternions, inverses or another frame of the body: which of them one mend takes away."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product
from typing import Literal

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.settings import Side
from vobench.trajectory.align import align
from vobench.trajectory.formats import Order
from vobench.trajectory.trajectory import Kind as MoveKind
from vobench.trajectory.trajectory import Move

Kind = Literal[
    "quaternion_order", "axis_swap", "mirrored_axes", "body_frame_offset", "inverse_poses", "inverse_rotations"
]

# Real pairs without such a fault (KITTI, TUM, TartanAir) keep 0.73 of their misfit and more, or lose 0.045 at most.
MENDED = 0.6  # a mend leaves at most this share of the misfit
MENDED_BY = 0.03  # and takes away this much: rad, or share of the extent
LEVER_MENDED_BY = 0.002  # a lever of 1 m on KITTI 00 takes 0.003
BELIEVED = 0.5  # rad and share of the extent; an estimate that is worse than this has no frame to speak of
AS_GOOD = 1.6  # a mend in one word is preferred to a fitted one up to this ratio of misfits

INVERSE: dict[MoveKind, Kind] = {"inverse": "inverse_poses", "rotations": "inverse_rotations"}
IDENTITY = np.eye(3)
SIGNED_AXES = [
    np.diag(signs) @ IDENTITY[list(order)]
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if (order, signs) != ((0, 1, 2), (1.0, 1.0, 1.0))
]
MOUNT_ROUNDS = 15
STEADY = 0.97  # a ratio of steps nearer to 1 leads too far away to be believed
WINDOWS = (30, 60, 120, 240)  # motions a path is cut into, to see a lever: it shows in turns, drift shows with length
EXPLAINED = 0.75  # share of the motions' misfit that real pairs without a lever keep is 0.78 and more
SIGNIFICANT = 5.0  # standard errors
ROUNDING = 1e-6  # of how well turning determines a lever; below it there is no turning
TINY = 1e-300  # keeps 0/0 from being a nan


@dataclass(frozen=True, slots=True)
class Misfit:
    """What is left after the best similarity: positions as share of the truth's extent, rotations in rad (rms).

    `turned_rad` is how far that similarity turned the estimate.
    """

    trans: float
    rot_rad: float
    turned_rad: float

    @property
    def total(self) -> float:
        """One number of both."""
        return float(np.hypot(self.trans, self.rot_rad))


@dataclass(frozen=True, slots=True)
class Suspect:
    """One thing that may be wrong on one side, and the misfit once it is mended: a move, or the quaternions' order."""

    side: Side
    move: Move | None
    misfit: Misfit
    T_gt: Array
    T_est: Array


@dataclass(frozen=True, slots=True)
class Lever:
    """A lever (3,) in m, and the motions' misfit (rms) without and with it.

    Its part along an axis that the path hardly turns about can't be known and is 0.
    """

    m: Array
    before_m: float
    after_m: float

    @property
    def ratio(self) -> float:
        """What the lever leaves of the misfit, 0..1."""
        return self.after_m / (self.before_m + TINY)

    @property
    def is_plain(self) -> bool:
        """Whether the lever is more than what noise makes of none."""
        return self.ratio <= EXPLAINED and bool(np.any(self.m))


@dataclass(frozen=True, slots=True)
class Mismatch:
    """A fault of frames, the misfit before and after its mend, and the poses (K, 4, 4) once mended."""

    kind: Kind
    suspect: Suspect
    before: Misfit
    lever: Lever | None


def find_mismatch(T_gt: Array, T_est: Array, *, gt_order: Order | None, est_order: Order | None) -> Mismatch | None:
    """The fault of frames that explains most between matched poses (K, 4, 4), None where there is none.

    A change that is said in one word comes before a fitted one, unless that fits plainly better.
    """
    before = misfit(T_gt, T_est)
    tried = list(suspects(T_gt, T_est, gt_order=gt_order, est_order=est_order))
    # In one world the inverse of either side mends; truths are seldom given so.
    inverted = [s for s in tried if s.side == "est" and s.move and s.move.kind in INVERSE and _mends(before, s)]
    doubted = [s for s in tried if not (inverted and s.side == "gt" and s.move)]
    worded = min(doubted, key=lambda suspect: suspect.misfit.total)
    fitted = mounted(T_gt, T_est)
    if _mends(before, worded) and not _is_rather_mounted(worded, fitted):
        return Mismatch(_kind(worded), worded, before, None)
    lever = find_lever(T_gt, T_est, fitted.move.matrix[:3, :3]) if fitted.move else None
    if _mends(before, fitted) or (lever is not None and lever.is_plain and _matters(before, fitted)):
        return Mismatch("body_frame_offset", fitted, before, lever if lever and lever.is_plain else None)
    return None


def _mends(before: Misfit, suspect: Suspect) -> bool:
    after = suspect.misfit.total
    return after <= min(MENDED * before.total, BELIEVED) and before.total - after >= MENDED_BY


def _matters(before: Misfit, levered: Suspect) -> bool:
    """Whether a lever that motions show is worth a word: they show a millimetre that nobody would see."""
    after = levered.misfit.total
    return after <= BELIEVED and before.total - after >= LEVER_MENDED_BY


def _is_rather_mounted(worded: Suspect, fitted: Suspect) -> bool:
    """Turned axes look the same to motions as a turned body; then the one that leaves the world in place is meant."""
    if fitted.misfit.total * AS_GOOD < worded.misfit.total:
        return True
    is_turn = worded.move is not None and worded.move.kind == "axes" and np.linalg.det(worded.move.matrix) > 0
    as_good = fitted.misfit.total <= AS_GOOD * worded.misfit.total
    return is_turn and as_good and fitted.misfit.turned_rad < worded.misfit.turned_rad


def _kind(suspect: Suspect) -> Kind:
    if suspect.move is None:
        return "quaternion_order"
    if suspect.move.kind in INVERSE:
        return INVERSE[suspect.move.kind]
    return "mirrored_axes" if np.count_nonzero(np.diag(suspect.move.matrix)) == 3 else "axis_swap"


def misfit(T_gt: Array, T_est: Array) -> Misfit:
    """How badly matched poses (K, 4, 4) agree, whatever their worlds and scales are."""
    alignment = align(T_est, T_gt, kind="sim3")
    aligned = alignment.apply(T_est)
    trans_m = np.sqrt(np.sum((aligned - T_gt)[:, :3, 3] ** 2, axis=1).mean())
    angles = se3.rotation_angle(np.swapaxes(aligned[:, :3, :3], 1, 2) @ T_gt[:, :3, :3])
    extent_m = np.sqrt(T_gt[:, :3, 3].var(axis=0).sum())
    turned = float(se3.rotation_angle(alignment.rotation))
    return Misfit(float(trans_m / extent_m), float(np.sqrt(np.mean(angles**2))), turned)


def suspects(T_gt: Array, T_est: Array, *, gt_order: Order | None, est_order: Order | None) -> Iterator[Suspect]:
    """The other quaternion order and the inverses of either side, and all 47 other signed axes of the estimate.

    The orders are those that the files were read in, None where they hold matrices.
    """
    if est_order:
        yield _suspect("est", None, T_gt, _reordered(T_est, est_order))
    if gt_order:
        yield _suspect("gt", None, _reordered(T_gt, gt_order), T_est)
    for kind in INVERSE:
        yield _suspect("est", Move(kind), T_gt, Move(kind).apply(T_est))
        yield _suspect("gt", Move(kind), Move(kind).apply(T_gt), T_est)
    for axes in SIGNED_AXES:
        for move in (Move("positions", axes), Move("axes", axes)):
            yield _suspect("est", move, T_gt, move.apply(T_est))


def mounted(T_gt: Array, T_est: Array) -> Suspect:
    """The estimate moved by the constant T_est_gt that fits best: rotation by the mean, lever by the motions.

    A lever that is no more than noise is left out.
    """
    lever_m = np.zeros(3)
    path = []
    for _ in range(MOUNT_ROUNDS):
        lever = find_lever(T_gt, T_est, _rotation_left(T_gt, T_est, lever_m))
        path.append(lever.m)
        lever_m = _limit(path[-3:]) if len(path) % 3 == 0 else lever.m
    lever_m = lever_m if lever.is_plain else np.zeros(3)
    move = Move("mount", se3.transform(_rotation_left(T_gt, T_est, lever_m), lever_m))
    return _suspect("est", move, T_gt, move.apply(T_est))


def _limit(steps: list[Array]) -> Array:
    """Where three steps (3,) that shorten by one ratio are going. Source: Aitken (1926)."""
    before = steps[1] - steps[0]
    after = steps[2] - steps[1]
    ratio = float(before @ after) / (float(before @ before) + TINY)
    return steps[2] + (ratio / (1 - ratio)) * after if 0 < ratio < STEADY else steps[2]


def _rotation_left(T_gt: Array, T_est: Array, lever_m: Array) -> Array:
    """The mean rotation (3, 3) from the estimate, moved by a lever and aligned, to the truth."""
    moved = T_est @ se3.transform(IDENTITY, lever_m)
    aligned = align(moved, T_gt, kind="sim3").apply(moved)
    return se3.nearest_rotation(np.mean(np.swapaxes(aligned[:, :3, :3], 1, 2) @ T_gt[:, :3, :3], axis=0))


def find_lever(T_gt: Array, T_est: Array, rotation: Array) -> Lever:
    """The lever that explains most of the motions, given the rotation (3, 3) between both bodies."""
    windows = sorted({max(1, len(T_gt) // parts) for parts in WINDOWS})
    return min((_lever(T_gt, T_est, rotation, window) for window in windows), key=lambda lever: lever.ratio)


def _lever(T_gt: Array, T_est: Array, rotation: Array, window: int) -> Lever:
    """Least squares of X t_gt = s t_est + (X R_gt Xᵀ − I) l over all motions of `window` poses.

    The truth's rotations, for the noise of the estimate's goes together with that of its translations.
    """
    motion_gt, motion_est = (se3.inverse(T[:-window]) @ T[window:] for T in (T_gt, T_est))
    moved = motion_est[:, :3, 3].reshape(-1)
    moved_sq = float(moved @ moved) + TINY
    seen = (motion_gt[:, :3, 3] @ rotation.T).reshape(-1)
    turning = (rotation @ motion_gt[:, :3, :3] @ rotation.T - IDENTITY).reshape(-1, 3)
    # The scale is taken out of either side first; what is left are three equations a motion for the lever.
    without = seen - moved * float(moved @ seen) / moved_sq
    free = turning - np.outer(moved, moved @ turning) / moved_sq
    strength, axes = np.linalg.eigh(free.T @ free)
    before = float(np.sqrt(3 * np.mean(without * without)))
    if not strength[2] > 0:
        return Lever(np.zeros(3), before, before)
    strength = np.maximum(strength, ROUNDING * strength[2])
    stated = (axes.T @ (free.T @ without)) / strength
    # Windows overlap, so that only every window-th motion is news.
    noise_m = np.sqrt(np.mean((without - free @ (axes @ stated)) ** 2) * window)
    certainty = np.abs(stated) * np.sqrt(strength) / (noise_m + TINY)
    solution = axes @ np.where(certainty >= SIGNIFICANT, stated, 0.0)
    after = float(np.sqrt(3 * np.mean((without - free @ solution) ** 2)))
    scale = float(moved @ (seen - turning @ solution)) / moved_sq
    return Lever(solution / scale if scale > 0 else np.zeros(3), before, after)


def _suspect(side: Side, move: Move | None, T_gt: Array, T_est: Array) -> Suspect:
    return Suspect(side, move, misfit(T_gt, T_est), T_gt, T_est)


def _reordered(T: Array, read_as: Order) -> Array:
    """Poses whose quaternions' four numbers were read in the wrong one of the two orders."""
    q = se3.to_quaternion(T[:, :3, :3])
    other = [1, 2, 3, 0] if read_as == "xyzw" else [3, 0, 1, 2]
    return se3.transform(se3.from_quaternion(q[:, other]), T[:, :3, 3])
