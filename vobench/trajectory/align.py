"""The motion (and scale) that lays an estimate over the ground truth, and what of it the data can't tell."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array

Kind = Literal["none", "origin", "se3", "sim3", "scale", "yaw"]

# A path that leaves its line, or moves against the other, by less than this share of its extent
# shows rounding and not shape. Taking it for a line moves no point by more than this share.
NEGLIGIBLE = 1e-6
ROUNDING = 1e-14  # what a mean over equal float64 coordinates may be off, relative to them
UNCORRELATED = 1e-12  # a normalised covariance this small is rounding
# A path that leaves its line by less than this share of its extent is nearly straight. Its roll counts as
# seen where the sides agree so well about it that chance leaves it uncertain by less than nine degrees.
NEARLY_STRAIGHT = 1e-2
MAX_ROLL_STD_RAD = 0.15
IDENTITY = np.eye(3)


class _Shape(Enum):
    """How much of a rotation two matched paths determine."""

    POINT = 0
    LINE = 1
    FULL = 3


@dataclass(frozen=True, slots=True)
class Alignment:
    """x_gt = scale · rotation @ x_est + translation, with rotation (3, 3) and translation (3,) in metres.

    `unobservable` names what the positions leave open: "rotation", "roll about the path", "scale".
    """

    kind: Kind
    rotation: Array
    translation: Array
    scale: float
    unobservable: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "kind": self.kind,
            "rotation": self.rotation.tolist(),
            "translation": self.translation.tolist(),
            "scale": self.scale,
            "unobservable": list(self.unobservable),
        }

    @classmethod
    def from_dict(cls, stated: Mapping[str, Any]) -> "Alignment":
        """The alignment that `as_dict` wrote."""
        arrays = {key: np.array(stated[key]) for key in ("rotation", "translation")}
        return cls(**{**stated, **arrays, "unobservable": tuple(stated["unobservable"])})

    def apply(self, T_est: Array) -> Array:
        """Poses (..., 4, 4) of the estimate, moved: positions are scaled, orientations only turned."""
        positions = self.scale * T_est[..., :3, 3] @ self.rotation.T + self.translation
        return se3.transform(self.rotation @ T_est[..., :3, :3], positions)


def align(T_est: Array, T_gt: Array, *, kind: Kind, first_n: int | None = None) -> Alignment:
    """Alignment of matched poses (K, 4, 4), fitted to the first `first_n` of them, or to all.

    se3, sim3, yaw (a turn about z) and scale (sim3's, without its motion) fit the positions, origin the
    first pose. A rotation that the positions leave open is taken as near as they allow to the one that
    lays the first orientation over the truth's, so that no score hangs on the estimate's own frame.
    Raises AlignmentError without pairs, or where positions are too large to square.
    """
    if kind == "none":
        return Alignment(kind, IDENTITY, np.zeros(3), 1.0, ())
    T_est = T_est[:first_n]
    T_gt = T_gt[:first_n]
    _require_pairs(T_est, T_gt)
    T_origin = T_gt[0] @ se3.inverse(T_est[0])
    if kind == "origin":
        return Alignment(kind, T_origin[:3, :3], T_origin[:3, 3], 1.0, ())
    est_m = T_est[:, :3, 3]
    gt_m = T_gt[:, :3, 3]
    toward = T_origin[:3, :3]
    if kind == "yaw":
        return align_yaw(est_m, gt_m, toward=toward)
    fit = align_positions(est_m, gt_m, kind=kind, toward=toward)
    if kind == "scale":
        left_open = tuple(name for name in fit.unobservable if name == "scale")
        return Alignment(kind, IDENTITY, np.zeros(3), fit.scale, left_open)
    return fit


def align_positions(
    est_m: Array, gt_m: Array, *, kind: Literal["se3", "sim3", "scale"], toward: Array = IDENTITY
) -> Alignment:
    """Least-squares alignment of positions (K, 3); of equally good rotations the one nearest to `toward`.

    Where either side stands still the rotation is `toward` and the scale 1, so that what is left is
    the spread about the mean. On a line it is the smallest turn from `toward` that lays direction
    on direction. Raises AlignmentError as `align`. Source: Umeyama (1991), eqs. 34-43.
    """
    _require_pairs(est_m, gt_m)
    est_mean = est_m.mean(axis=0)
    gt_mean = gt_m.mean(axis=0)
    x = est_m - est_mean
    y = gt_m - gt_mean
    covariance = _covariance(y, x)
    shape = _shape(x, y, rounding_m=ROUNDING * float(max(np.abs(est_mean).max(), np.abs(gt_mean).max())))
    is_turned_anyhow = kind == "scale" and shape is _Shape.LINE  # the scale alone needs no roll that is true
    rotation = _rotation(covariance, _Shape.FULL if is_turned_anyhow else shape, toward)
    known_scale = kind == "se3" or shape is _Shape.POINT
    scale = 1.0 if known_scale else float(np.sum(rotation * covariance) / np.mean(np.sum(x * x, axis=1)))
    unobservable = {
        _Shape.POINT: ("rotation",) if kind == "se3" else ("rotation", "scale"),
        _Shape.LINE: ("roll about the path",),
        _Shape.FULL: (),
    }[shape]
    return Alignment(kind, rotation, gt_mean - scale * rotation @ est_mean, scale, unobservable)


def align_yaw(est_m: Array, gt_m: Array, *, toward: Array = IDENTITY) -> Alignment:
    """Least-squares turn about z and translation of positions (K, 3), for worlds that know the vertical.

    Where the level motion leaves the yaw open, that of `toward` is taken. Raises AlignmentError as `align`.
    Source: Zhang and Scaramuzza (2018), section III-C.
    """
    _require_pairs(est_m, gt_m)
    est_mean = est_m.mean(axis=0)
    gt_mean = gt_m.mean(axis=0)
    x = est_m - est_mean
    y = gt_m - gt_mean
    covariance = _covariance(y, x)[:2, :2]
    turning = np.array([covariance[0, 0] + covariance[1, 1], covariance[1, 0] - covariance[0, 1]])
    extents = np.sqrt([np.trace(_covariance(path, path)) for path in (x[:, :2], y[:, :2])])
    rounding_m = ROUNDING * float(max(np.abs(est_mean).max(), np.abs(gt_mean).max()))
    if (
        extents.min() <= max(NEGLIGIBLE * extents.max(), rounding_m)
        or np.hypot(*turning) <= UNCORRELATED * extents.prod()
    ):
        turning = np.array([toward[0, 0] + toward[1, 1], toward[1, 0] - toward[0, 1]])
        left_open: tuple[str, ...] = ("yaw",)
    else:
        left_open = ()
    rotation = se3.rotation_z(np.arctan2(turning[1], turning[0]))
    return Alignment("yaw", rotation, gt_mean - rotation @ est_mean, 1.0, left_open)


def turn(from_direction: ArrayLike, to_direction: ArrayLike) -> Array:
    """The smallest rotation (3, 3) that takes one direction (3,) onto another; Rodrigues' formula.

    Of opposite directions it turns about the axis across them that is nearest to a coordinate axis.
    """
    a, b = (np.asarray(v, float) / np.linalg.norm(v) for v in (from_direction, to_direction))
    axis = np.cross(a, b)
    if np.linalg.norm(axis) < UNCORRELATED:
        axis = IDENTITY[np.argmin(np.abs(a))]
    axis = axis - (axis @ a) * a
    K = np.cross(IDENTITY, axis / np.linalg.norm(axis))
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
    rotation: Array = IDENTITY + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return rotation


def _rotation(covariance: Array, shape: _Shape, toward: Array) -> Array:
    if shape is _Shape.POINT:
        return toward
    U, _, Vt = np.linalg.svd(covariance)
    if shape is _Shape.LINE:
        return turn(toward @ Vt[0], U[:, 0]) @ toward
    handed = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    rotation: Array = (U * handed) @ Vt
    return rotation


def _shape(x: Array, y: Array, *, rounding_m: float) -> _Shape:
    """What two centred paths (K, 3) determine together; `rounding_m` is what their coordinates can't resolve."""
    extents = np.sqrt([np.trace(_covariance(path, path)) for path in (x, y)])
    if extents.min() <= max(NEGLIGIBLE * extents.max(), rounding_m):
        return _Shape.POINT
    common = np.linalg.svd(_covariance(y, x) / extents.prod(), compute_uv=False)
    if common[0] <= UNCORRELATED:
        return _Shape.POINT
    if common[1] <= UNCORRELATED * common[0] or _is_line(x) or _is_line(y) or _is_noise(x, y):
        return _Shape.LINE
    return _Shape.FULL


def _is_line(x: Array) -> bool:
    spread = np.linalg.eigvalsh(_covariance(x, x))
    return bool(spread[1] <= NEGLIGIBLE**2 * spread[2])


def _is_noise(x: Array, y: Array) -> bool:
    """Whether two paths (K, 3), one nearly straight, leave their lines in ways too unlike to tell the roll.

    After the best roll, sideways motions with correlation r leave it uncertain by √((1 - r²) / (r² n)).
    """
    (x_spread, x_axes), (y_spread, y_axes) = (np.linalg.eigh(_covariance(path, path)) for path in (x, y))
    if min(x_spread[1] / x_spread[2], y_spread[1] / y_spread[2]) > NEARLY_STRAIGHT**2:
        return False
    a = (x @ x_axes[:, :2]) @ [1, 1j]
    b = (y @ y_axes[:, :2]) @ [1, 1j]
    power = float(np.linalg.norm(a) * np.linalg.norm(b))
    r = min(max(abs(np.vdot(a, b)), abs(np.vdot(a, b.conj()))) / power, 1.0)
    free = max(2 * len(x) - 5, 1)  # numbers measured, less two means, a roll, and a direction's two
    return bool(1 - r**2 > r**2 * free * MAX_ROLL_STD_RAD**2)


def _covariance(y: Array, x: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        covariance: Array = y.T @ x / len(x)
    if not np.isfinite(covariance).all():
        largest = max(np.abs(x).max(), np.abs(y).max())
        raise AlignmentError(f"positions should be finite and below 1e150 m to be aligned, but reach {largest:.3g} m")
    return covariance


def _require_pairs(est: Array, gt: Array) -> None:
    if est.shape != gt.shape or not len(est):
        raise AlignmentError(f"alignment needs one or more matched poses, got {len(est)} estimated and {len(gt)} true")
