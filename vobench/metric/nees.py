"""Consistency: whether an estimator's errors are as large as its own covariances say."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.comparison import POSES, Comparison, MetricDefinition
from vobench.trajectory.align import Alignment

POSE = slice(0, 6)
POSITION = slice(0, 3)
ROTATION = slice(3, 6)


@dataclass(frozen=True, slots=True)
class Consistency:
    """Normalised estimation error squared, each (K,): on average 6, 3 and 3 where the covariances are honest."""

    pose: Array
    trans: Array
    rot: Array


def consistency(T_gt: Array, T_est: Array, covariance: Array, alignment: Alignment) -> Consistency:
    """eᵀ P⁻¹ e of matched poses (K, 4, 4), the estimate not yet aligned, and its covariances P (K, 6, 6).

    e is the position error in m and the rotation vector of R_gt R_est⁻¹ in rad, P in this order about the
    fixed axes of the estimate's world, as in ROS. Raises TrajectoryError for a P that isn't positive definite.
    Source: Bar-Shalom et al. (2001), section 5.4.
    """
    turned = np.kron(np.diag([alignment.scale, 1.0]), alignment.rotation)
    P = turned @ _checked(covariance) @ turned.T
    T_aligned = alignment.apply(T_est)
    turn = rotation_vector(T_gt[:, :3, :3] @ np.swapaxes(T_aligned[:, :3, :3], -1, -2))
    e = np.concatenate([T_gt[:, :3, 3] - T_aligned[:, :3, 3], turn], axis=1)
    pose, trans, rot = (_nees(e[:, part], P[:, part, part]) for part in (POSE, POSITION, ROTATION))
    return Consistency(pose, trans, rot)


def rotation_vector(R: Array) -> Array:
    """Axis times angle (..., 3) in rad of rotations (..., 3, 3), by way of the quaternion: exact up to half a turn."""
    q = se3.to_quaternion(R)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    vector: Array = q[..., :3] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)
    return vector


def _nees(e: Array, P: Array) -> Array:
    return np.asarray(np.sum(e * np.linalg.solve(P, e[..., None])[..., 0], axis=-1))


def _checked(covariance: Array) -> Array:
    least = np.linalg.eigvalsh(covariance)[:, 0] if np.isfinite(covariance).all() else np.full(1, np.nan)
    bad = np.flatnonzero(~(least > 0))
    if bad.size:
        raise TrajectoryError(
            f"covariance {bad[0]} should be finite and positive definite, "
            f"but its least eigenvalue is {least[bad[0]]:.3g}"
        )
    return covariance


def _consistency(of: Comparison) -> Consistency:
    if of.covariance is None:
        return Consistency(*np.zeros((3, 0)))
    of_pose = of.covariance[of.matched.pairs.est]
    return consistency(of.matched.T_gt, of.matched.T_est, of_pose, of.alignment)


def _of_part(part: str) -> Callable[[Comparison], Array]:
    return lambda of: np.asarray(getattr(of.once(_consistency), part))


METRICS = tuple(
    MetricDefinition(
        name,
        title,
        "1",
        f"{error}ᵀ P⁻¹ {error} of each pose, P the covariance that the estimator states",
        "Bar-Shalom et al. (2001), section 5.4",
        POSES,
        f"the size of the error: a large one that was announced is consistent; honest ones give {dof} on average",
        headline="mean",
        measure=_of_part(part),
    )
    for name, title, error, dof, part in (
        ("nees_pose", "consistency of the stated covariance", "e", "6", "pose"),
        ("nees_trans", "consistency of the stated covariance, position", "e_p", "3", "trans"),
        ("nees_rot", "consistency of the stated covariance, orientation", "e_R", "3", "rot"),
    )
)
