"""Absolute trajectory error, and the errors between poses that all metrics are made of."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.comparison import HARTLEY, OURS, POSES, STURM_ATE, ZHANG, Comparison, MetricDefinition
from vobench.trajectory.associate import Index

Rows = tuple[Array, ...]
BLOCK = 1 << 14  # poses worked on at once: their matrices stay in the processor's cache, and memory small


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Translation errors (N,) in metres and rotation errors (N,) in radians, both non-negative."""

    trans_m: Array
    rot_rad: Array

    def __len__(self) -> int:
        return len(self.trans_m)


def angle_rad(R: Array) -> Array:
    """Angles (...) of rotations (..., 3, 3) that text with few digits has left slightly skew.

    One Newton step towards the nearest rotation first: KITTI's six digits leave R 2e-7 off
    orthonormal, which alone would shift an angle by 3e-7 rad. Source: Higham (1986), eq. 3.6.
    """
    steps = 1.5 * np.eye(3) - 0.5 * np.swapaxes(R, -1, -2) @ R
    return se3.rotation_angle(R @ steps)


def matrix_norms(E: Array) -> Rows:
    """Norms (N,) of errors (N, 4, 4) less the identity: the rotation's, and the whole's with its metres.

    They are evo's rot_part and full.
    """
    squares = np.square(E - np.eye(4))
    return np.sqrt(squares[:, :3, :3].sum((1, 2))), np.sqrt(squares.sum((1, 2)))


def motion_errors(T_gt_first_last: Array, T_est_first_last: Array) -> PoseErrors:
    """What is left of true motions (N, 4, 4) after the estimated ones are undone."""
    return PoseErrors(*_left(_columns(T_gt_first_last), _columns(T_est_first_last)))


def errors_between(T_gt: Array, T_est: Array, first: Index, last: Index) -> PoseErrors:
    """`motion_errors` of the motions from poses `first` to `last` (N,) of trajectories (K, 4, 4).

    Source: Sturm et al. (2012), section V-A: (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j).
    """
    gt = _columns(T_gt)
    est = _columns(T_est)

    def moved(T: Array, part: slice) -> Array:
        return _moved(T.take(first[part], axis=-1), T.take(last[part], axis=-1))

    found = in_blocks(len(first), lambda part: _left(moved(gt, part), moved(est, part)))
    return PoseErrors(*found)


# Below, N poses are (3, 4, N): each number of all of them side by side, which is faster than N small matrices.


def _columns(T: Array) -> Array:
    return np.ascontiguousarray(np.moveaxis(T[:, :3], 0, -1))


def _moved(first: Array, last: Array) -> Array:
    """Poses `last` seen from `first`."""
    back = first[:, :3]
    R = np.einsum("kin,kjn->ijn", back, last[:, :3])
    t = np.einsum("kin,kn->in", back, last[:, 3] - first[:, 3])
    return np.concatenate([R, t[:, None]], axis=1)


def _left(gt: Array, est: Array) -> Rows:
    """Lengths and angles (N,) of est seen from gt; the angles as `angle_rad` takes them."""
    E = _moved(gt, est)
    R = E[:, :3]
    t = E[:, 3]
    steps = -0.5 * np.einsum("kin,kjn->ijn", R, R)
    steps[range(3), range(3)] += 1.5
    R = np.einsum("ikn,kjn->ijn", R, steps)
    vee = np.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    cosine = R[0, 0] + R[1, 1] + R[2, 2] - 1.0
    return np.sqrt(np.einsum("in,in->n", t, t)), np.arctan2(np.sqrt(np.einsum("in,in->n", vee, vee)), cosine)


def in_blocks(n: int, work: Callable[[slice], Rows]) -> Rows:
    """What `work` makes of n samples, each a tuple of arrays (n,), a block at a time."""
    found = [work(slice(begin, min(begin + BLOCK, n))) for begin in range(0, max(n, 1), BLOCK)]
    return tuple(np.concatenate(arrays) for arrays in zip(*found, strict=True))


def motions(T_world_frame: Array, first: Index, last: Index) -> Array:
    """Pose of frame `last` seen from frame `first`, (N, 4, 4), for index arrays (N,)."""
    T_first_last: Array = se3.inverse(T_world_frame[first]) @ T_world_frame[last]
    return T_first_last


def absolute_errors(T_gt: Array, T_est: Array) -> PoseErrors:
    """Distances and angles between matched poses (K, 4, 4), the estimate already aligned.

    Source: Sturm et al. (2012), section V-B; the rotation is the angle of R_est⁻¹ R_gt.
    """

    def block(part: slice) -> Rows:
        gt = T_gt[part]
        est = T_est[part]
        trans_m = np.linalg.norm(est[:, :3, 3] - gt[:, :3, 3], axis=1)
        return trans_m, angle_rad(np.swapaxes(est[:, :3, :3], -1, -2) @ gt[:, :3, :3])

    return PoseErrors(*in_blocks(len(T_gt), block))


def absolute(of: Comparison) -> PoseErrors:
    """`absolute_errors` of a comparison."""
    return absolute_errors(of.matched.T_gt, of.T_aligned)


def _matrices(of: Comparison) -> Rows:
    T_gt = of.matched.T_gt
    T_est = of.T_aligned
    return in_blocks(len(T_gt), lambda part: matrix_norms(se3.inverse(T_est[part]) @ T_gt[part]))


def _axes(of: Comparison) -> dict[str, Array]:
    """Signed errors (K,) by axis, in m and degrees, in the truth's world: R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll)."""
    T_gt = of.matched.T_gt
    T_est = of.T_aligned
    xyz_m = T_est[:, :3, 3] - T_gt[:, :3, 3]
    rpy_rad = se3.roll_pitch_yaw_rad(T_est[:, :3, :3] @ np.swapaxes(T_gt[:, :3, :3], -1, -2))
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    return dict(zip(names, (*xyz_m.T, *np.rad2deg(rpy_rad).T), strict=True))


def _of_axis(axis: str) -> Callable[[Comparison], Array]:
    return lambda of: of.once(_axes)[axis]


DRIFT = "where along the path an error was made: one early turn moves everything after it"
LOST = "frames without a pose: read coverage beside it"
_pose_metric = partial(MetricDefinition, settings=POSES)
METRICS = (
    _pose_metric(
        "ate_trans",
        "absolute trajectory error, position",
        "m",
        "‖p_est − p_gt‖ of each aligned pose",
        STURM_ATE,
        blind=f"{DRIFT}; {LOST}",
        full=False,
        measure=lambda of: of.once(absolute).trans_m,
    ),
    _pose_metric(
        "ate_rot",
        "absolute trajectory error, angle",
        "deg",
        "angle of R_est⁻¹ R_gt of each aligned pose",
        STURM_ATE,
        blind=f"a roll that the alignment had to guess: read alignment.unobservable; {LOST}",
        full=False,
        measure=lambda of: np.rad2deg(of.once(absolute).rot_rad),
    ),
    _pose_metric(
        "ate_rot_chordal",
        "absolute trajectory error, rotation as a matrix",
        "1",
        "‖R_est⁻¹ R_gt − I‖_F = 2√2 sin(angle / 2)",
        HARTLEY,
        blind=f"the same as ate_rot on another scale; {LOST}",
        measure=lambda of: of.once(_matrices)[0],
    ),
    _pose_metric(
        "ate_full",
        "absolute trajectory error, whole pose",
        "1",
        "‖T_est⁻¹ T_gt − I‖_F",
        "evo's full",
        blind=f"metres and rotations are added: it changes with the unit of length; {LOST}",
        measure=lambda of: of.once(_matrices)[1],
    ),
    *(
        _pose_metric(
            f"ate_{axis}",
            f"absolute trajectory error along the truth's {axis}",
            "m",
            f"{axis} of p_est − p_gt, with its sign",
            OURS,
            blind=f"errors along the other axes; {LOST}",
            measure=_of_axis(axis),
        )
        for axis in ("x", "y", "z")
    ),
    *(
        _pose_metric(
            f"ate_{axis}",
            f"absolute trajectory error in {axis}",
            "deg",
            f"{axis} of R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll), with its sign",
            ZHANG,
            blind=f"the angles of rotations near 90° of pitch, where roll and yaw are one; {LOST}",
            measure=_of_axis(axis),
        )
        for axis in ("roll", "pitch", "yaw")
    ),
)
