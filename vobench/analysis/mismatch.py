"""Finds faults of frames between matched poses: wrong axes, quaternions, inverses, or another frame of the body."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product
from typing import Literal

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.settings import Side
from vobench.trajectory.align import Alignment, align
from vobench.trajectory.quaternion_columns import QuaternionOrder
from vobench.trajectory.trajectory import Kind as MoveKind
from vobench.trajectory.trajectory import PoseConvention

Kind = Literal[
    "quaternion_order", "axis_swap", "mirrored_axes", "body_frame_offset", "inverse_poses", "inverse_rotations"
]

# On real pairs without such a fault (KITTI, TUM, TartanAir) a correction leaves 73 % of the misfit or more, or
# reduces it by 0.045 at most.
MAX_SHARE_LEFT = 0.6  # of the misfit, after a correction that counts
MIN_REDUCTION = 0.03  # of the misfit: rad, or share of the extent
MIN_LEVER_REDUCTION = 0.002  # a lever of 1 m on KITTI 00 reduces the misfit by 0.003
MAX_MISFIT = 0.5  # rad and share of the extent; frames cannot be told from a worse estimate
# Errors of positions turn the alignment by about their share of the extent, in rad: then all rotations differ alike. A
# rotation of the body that is not this many times as large could be due to them.
MIN_ROTATION_OVER_MISFIT = 3.0
AS_GOOD = 1.6  # a discrete correction is preferred to a fitted one up to this ratio of misfits

INVERSE: dict[MoveKind, Kind] = {"inverse": "inverse_poses", "rotations": "inverse_rotations"}
IDENTITY = np.eye(3)
SIGNED_AXES = [
    np.diag(signs) @ IDENTITY[list(order)]
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if (order, signs) != ((0, 1, 2), (1.0, 1.0, 1.0))
]
MAX_SWAY = 0.03  # of a path's length, aside from a straight line
# A path that sways more is straight, too, if the misfit of positions is not much smaller than its sway: the roll about
# it is known to about misfit / sway only.
MAX_SWAY_WITH_MISFIT = 0.15
MIN_SWAY_OVER_MISFIT = 30.0
TINY = 1e-300  # prevents 0/0


@dataclass(frozen=True, slots=True)
class Misfit:
    """The misfit after the best similarity transform: of positions relative to the extent, of rotations in rad (rms).

    `turned_rad` is the rotation angle of the similarity transform.
    """

    trans: float
    rot_rad: float
    turned_rad: float

    @property
    def total(self) -> float:
        """Position and rotation misfit as one number."""
        return float(np.hypot(self.trans, self.rot_rad))


def misfit(T_gt: Array, T_est: Array) -> Misfit:
    """The misfit of matched poses (K, 4, 4), which does not depend on their world frames and scales."""
    alignment = align(T_est, T_gt, kind="sim3")
    aligned = _aligned(T_est, T_gt, alignment)
    angles_rad = se3.rotation_angle(_rotations_between(aligned, T_gt))
    return Misfit(
        trans=_position_misfit(aligned, T_gt),
        rot_rad=float(np.sqrt(np.mean(angles_rad**2))),
        turned_rad=float(se3.rotation_angle(alignment.rotation)),
    )


def _position_misfit(aligned: Array, T_gt: Array) -> float:
    """The rms distance of positions after alignment, relative to the extent of the path."""
    position_errors_m = (aligned - T_gt)[:, :3, 3]
    position_error_m = np.sqrt(np.sum(position_errors_m**2, axis=1).mean())
    extent_m = np.sqrt(T_gt[:, :3, 3].var(axis=0).sum())
    return float(position_error_m / extent_m)


def _aligned(T_est: Array, T_gt: Array, alignment: Alignment) -> Array:
    """The estimate (K, 4, 4) after an alignment of its positions; along a nearly straight path, rolled about it.

    Such positions hardly determine a rotation about the path, so the orientations determine it: a few metres of sway
    would otherwise turn an estimate of a straight road by tens of degrees.
    """
    aligned = alignment.apply(T_est)
    centre_m = T_gt[:, :3, 3].mean(axis=0)
    _, spreads, axes = np.linalg.svd(T_gt[:, :3, 3] - centre_m, full_matrices=False)
    sway = float(spreads[1] / (spreads[0] + TINY))
    position_misfit = _position_misfit(aligned, T_gt)
    hides_roll = sway <= min(MAX_SWAY_WITH_MISFIT, MIN_SWAY_OVER_MISFIT * position_misfit)
    if sway > MAX_SWAY and not hides_roll:
        return aligned

    path_axis = axes[0]
    left = T_gt[:, :3, :3] @ np.swapaxes(aligned[:, :3, :3], 1, 2)  # (K, 3, 3), in the world of the truth
    quaternion = se3.to_quaternion(left)
    half_sines = quaternion[:, :3] @ path_axis
    roll_rad = 2 * np.arctan2(half_sines, quaternion[:, 3])  # (K,), about the path
    mean_roll_rad = np.arctan2(np.sin(roll_rad).mean(), np.cos(roll_rad).mean())
    half_roll_rad = mean_roll_rad / 2
    R_roll = se3.from_quaternion(np.append(np.sin(half_roll_rad) * path_axis, np.cos(half_roll_rad)))
    about_centre = se3.transform(R_roll, centre_m - R_roll @ centre_m)
    rolled: Array = about_centre @ aligned
    return rolled


def _rotations_between(T_est: Array, T_gt: Array) -> Array:
    """The rotations R_est_gt (K, 3, 3) between matched poses (K, 4, 4)."""
    R_est_world = np.swapaxes(T_est[:, :3, :3], 1, 2)
    rotations: Array = R_est_world @ T_gt[:, :3, :3]
    return rotations


@dataclass(frozen=True, slots=True)
class Correction:
    """A correction of one side, the corrected poses (K, 4, 4), and the remaining misfit.

    `move` is None for the other order of the quaternions.
    """

    side: Side
    move: PoseConvention | None
    misfit: Misfit
    T_gt: Array
    T_est: Array

    @property
    def is_inverse(self) -> bool:
        """Whether the correction inverts poses or rotations."""
        return self.move is not None and self.move.kind in INVERSE

    @property
    def is_axis_rotation(self) -> bool:
        """Whether the correction changes the axes of positions and rotations without mirroring."""
        if self.move is None or self.move.kind != "axes":
            return False
        return float(np.linalg.det(self.move.matrix)) > 0

    def reduces(self, before: Misfit) -> bool:
        """Whether the correction reduces the misfit by more than it does for any real pair without a fault."""
        after = self.misfit.total
        limit = min(MAX_SHARE_LEFT * before.total, MAX_MISFIT)
        return after <= limit and before.total - after >= MIN_REDUCTION

    def reduces_by_lever(self, before: Misfit) -> bool:
        """Whether the correction reduces the misfit enough for a lever that was found from the motions."""
        after = self.misfit.total
        return after <= MAX_MISFIT and before.total - after >= MIN_LEVER_REDUCTION


@dataclass(frozen=True, slots=True)
class Lever:
    """A lever (3,) in m, and the misfit (rms, m) of motions without and with it.

    Its component along an axis about which the path hardly rotates is not observable, and is 0.
    """

    m: Array
    before_m: float
    after_m: float

    @property
    def ratio(self) -> float:
        """The share of the misfit that remains with the lever, 0 to 1."""
        return self.after_m / (self.before_m + TINY)

    @property
    def is_plain(self) -> bool:
        """Whether the lever is larger than noise could explain."""
        return self.ratio <= MAX_LEVER_RATIO and bool(np.any(self.m))


@dataclass(frozen=True, slots=True)
class Mismatch:
    """A fault of frames, its correction, the misfit before it, and the lever if the motions show one."""

    kind: Kind
    correction: Correction
    before: Misfit
    lever: Lever | None


def find_mismatch(
    T_gt: Array,
    T_est: Array,
    *,
    gt_order: QuaternionOrder | None,
    est_order: QuaternionOrder | None,
) -> Mismatch | None:
    """Find the fault of frames that explains the misfit of matched poses (K, 4, 4) best; None if there is none.

    A discrete correction (axes, inverse, order) is preferred to a fitted one unless that is clearly better.
    """
    before = misfit(T_gt, T_est)
    discrete = _best_discrete(before, T_gt, T_est, gt_order=gt_order, est_order=est_order)
    fitted = mounted(T_gt, T_est)
    if discrete.reduces(before) and not _is_fitted_preferred(discrete, fitted):
        return Mismatch(_kind(discrete), discrete, before, None)

    assert fitted.move is not None
    lever = find_lever(T_gt, T_est, fitted.move.matrix[:3, :3])
    if not lever.is_plain:
        rotation_rad = float(se3.rotation_angle(fitted.move.matrix[:3, :3]))
        is_beyond_alignment = rotation_rad > MIN_ROTATION_OVER_MISFIT * before.trans
        is_offset = is_beyond_alignment and fitted.reduces(before)
        return Mismatch("body_frame_offset", fitted, before, None) if is_offset else None
    if fitted.reduces(before) or fitted.reduces_by_lever(before):
        return Mismatch("body_frame_offset", fitted, before, lever)
    return None


def _best_discrete(
    before: Misfit,
    T_gt: Array,
    T_est: Array,
    *,
    gt_order: QuaternionOrder | None,
    est_order: QuaternionOrder | None,
) -> Correction:
    """The discrete correction with the smallest misfit."""
    candidates = list(discrete_corrections(T_gt, T_est, gt_order=gt_order, est_order=est_order))
    # In the same world frame, inverting either side has the same effect. Ground truth is rarely inverted.
    est_inverses = [each for each in candidates if each.side == "est" and each.is_inverse]
    if any(inverse.reduces(before) for inverse in est_inverses):
        candidates = [each for each in candidates if each.side == "est" or each.move is None]
    return min(candidates, key=lambda candidate: candidate.misfit.total)


def _is_fitted_preferred(discrete: Correction, fitted: Correction) -> bool:
    """Whether the estimate is that of another frame of the body instead of being in other axes.

    Motions do not distinguish rotated axes from a rotated body. The correction that does not rotate the world is used.
    """
    if fitted.misfit.total * AS_GOOD < discrete.misfit.total:
        return True
    is_as_good = fitted.misfit.total <= AS_GOOD * discrete.misfit.total
    leaves_world = fitted.misfit.turned_rad < discrete.misfit.turned_rad
    return discrete.is_axis_rotation and is_as_good and leaves_world


def _kind(correction: Correction) -> Kind:
    """The fault that a discrete correction corrects."""
    move = correction.move
    if move is None:
        return "quaternion_order"
    if move.kind in INVERSE:
        return INVERSE[move.kind]
    is_diagonal = np.count_nonzero(np.diag(move.matrix)) == 3
    is_mirrored = np.linalg.det(move.matrix) < 0
    return "mirrored_axes" if is_diagonal and is_mirrored else "axis_swap"


def discrete_corrections(
    T_gt: Array,
    T_est: Array,
    *,
    gt_order: QuaternionOrder | None,
    est_order: QuaternionOrder | None,
) -> Iterator[Correction]:
    """Yield the other quaternion order and the inverses of either side, and all 47 other signed axes of the estimate.

    The orders are those in which the files were read, None for files that contain matrices.
    """
    if est_order:
        yield _correction("est", None, T_gt, _reordered(T_est, est_order))
    if gt_order:
        yield _correction("gt", None, _reordered(T_gt, gt_order), T_est)
    for kind in INVERSE:
        inverse = PoseConvention(kind)
        yield _correction("est", inverse, T_gt, inverse.apply(T_est))
        yield _correction("gt", inverse, inverse.apply(T_gt), T_est)
    for axes in SIGNED_AXES:
        for move in (PoseConvention("positions", axes), PoseConvention("axes", axes)):
            yield _correction("est", move, T_gt, move.apply(T_est))


def _correction(
    side: Side,
    move: PoseConvention | None,
    T_gt: Array,
    T_est: Array,
) -> Correction:
    return Correction(side, move, misfit(T_gt, T_est), T_gt, T_est)


def _reordered(T: Array, read_as: QuaternionOrder) -> Array:
    """The poses (K, 4, 4) that result if the quaternions are read in the order other than `read_as`."""
    as_read = se3.to_quaternion(T[:, :3, :3])  # (K, 4), scalar last
    # The numbers in the file were read as x, y, z, w or as w, x, y, z, and are now read in the other order.
    columns = [1, 2, 3, 0] if read_as == "xyzw" else [3, 0, 1, 2]
    return se3.transform(se3.from_quaternion(as_read[:, columns]), T[:, :3, 3])


# --- Another frame of the same body ---

MOUNT_ROUNDS = 15
ROUNDS_PER_EXTRAPOLATION = 3
MAX_STEP_RATIO = 0.97  # a ratio of steps nearer to 1 would extrapolate too far
# Parts that a path is cut into to find a lever, which shows in rotations; drift shows with length instead.
PATH_PARTS = (30, 60, 120, 240)
MAX_LEVER_RATIO = 0.75  # real pairs without a lever keep 78 % of the motions' misfit or more
SIGNIFICANT_SIGMAS = 5.0
MIN_RELATIVE_STRENGTH = 1e-6  # of how well the rotations determine a lever; below it there is no rotation


def mounted(T_gt: Array, T_est: Array) -> Correction:
    """Fit the constant T_est_gt between estimate and truth: its rotation by the mean, and its lever by the motions.

    A lever that noise can explain is omitted.
    """
    lever_m = np.zeros(3)
    iterates_m: list[Array] = []
    for _ in range(MOUNT_ROUNDS):
        lever = find_lever(T_gt, T_est, _mean_rotation_left(T_gt, T_est, lever_m))
        iterates_m.append(lever.m)
        is_extrapolated = len(iterates_m) % ROUNDS_PER_EXTRAPOLATION == 0
        lever_m = _limit(iterates_m[-3:]) if is_extrapolated else lever.m
    if not lever.is_plain:
        lever_m = np.zeros(3)

    R_est_gt = _mean_rotation_left(T_gt, T_est, lever_m)
    move = PoseConvention("mount", se3.transform(R_est_gt, lever_m))
    return _correction("est", move, T_gt, move.apply(T_est))


def _limit(iterates: list[Array]) -> Array:
    """The limit of three iterates (3,) whose steps shrink by a constant ratio. Source: Aitken (1926)."""
    first_step = iterates[1] - iterates[0]
    second_step = iterates[2] - iterates[1]
    ratio = float(first_step @ second_step) / (float(first_step @ first_step) + TINY)
    if not 0 < ratio < MAX_STEP_RATIO:
        return iterates[2]
    return iterates[2] + (ratio / (1 - ratio)) * second_step


def _mean_rotation_left(T_gt: Array, T_est: Array, lever_m: Array) -> Array:
    """The mean rotation (3, 3) from the estimate, moved by a lever and aligned, to the truth."""
    moved = T_est @ se3.transform(IDENTITY, lever_m)
    aligned = _aligned(moved, T_gt, align(moved, T_gt, kind="sim3"))
    return se3.nearest_rotation(np.mean(_rotations_between(aligned, T_gt), axis=0))


def find_lever(T_gt: Array, T_est: Array, rotation: Array) -> Lever:
    """Find the lever that explains most of the motions, given the rotation (3, 3) between both frames of the body."""
    windows = sorted({max(1, len(T_gt) // parts) for parts in PATH_PARTS})
    levers = [_lever_of_motions(T_gt, T_est, rotation, window) for window in windows]
    return min(levers, key=lambda lever: lever.ratio)


def _lever_of_motions(T_gt: Array, T_est: Array, rotation: Array, window: int) -> Lever:
    """Fit X t_gt = s t_est + (X R_gt Xᵀ − I) l to the motions over `window` poses by least squares.

    It uses the rotations of the truth, as errors of the estimate's rotations correlate with those of its translations.
    """
    motion_gt = se3.inverse(T_gt[:-window]) @ T_gt[window:]
    motion_est = se3.inverse(T_est[:-window]) @ T_est[window:]
    t_est = motion_est[:, :3, 3].reshape(-1)  # (3 M,)
    t_gt = (motion_gt[:, :3, 3] @ rotation.T).reshape(-1)
    rotated = rotation @ motion_gt[:, :3, :3] @ rotation.T
    lever_terms = (rotated - IDENTITY).reshape(-1, 3)  # (3 M, 3)

    # Eliminate the scale from both sides: three equations per motion are left for the lever.
    t_est_sq = float(t_est @ t_est) + TINY
    values = t_gt - t_est * float(t_est @ t_gt) / t_est_sq
    terms = lever_terms - np.outer(t_est, t_est @ lever_terms) / t_est_sq

    strength, axes = np.linalg.eigh(terms.T @ terms)  # ascending
    before_m = _rms_length(values)
    if not strength[2] > 0:
        return Lever(np.zeros(3), before_m, before_m)
    strength = np.maximum(strength, MIN_RELATIVE_STRENGTH * strength[2])
    along_axes = (axes.T @ (terms.T @ values)) / strength

    # Windows overlap: only every window-th motion is independent.
    residuals_m = values - terms @ (axes @ along_axes)
    noise_m = np.sqrt(np.mean(residuals_m**2) * window)
    sigmas_m = noise_m / np.sqrt(strength)  # of the lever along each axis
    is_significant = np.abs(along_axes) > SIGNIFICANT_SIGMAS * sigmas_m
    lever_m = axes @ np.where(is_significant, along_axes, 0.0)

    after_m = _rms_length(values - terms @ lever_m)
    scale = float(t_est @ (t_gt - lever_terms @ lever_m)) / t_est_sq
    scaled_lever_m = lever_m / scale if scale > 0 else np.zeros(3)
    return Lever(scaled_lever_m, before_m, after_m)


def _rms_length(residuals_m: Array) -> float:
    """The root mean square length of vectors whose components are (3 M,)."""
    return float(np.sqrt(3 * np.mean(residuals_m**2)))
