"""Aligns an estimate with the ground truth, and detects the parts of the alignment that are not observable."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array

AlignmentKind = Literal["none", "origin", "se3", "sim3", "scale", "yaw"]

# A deviation from a line, or a motion relative to the other path, below this share of the extent is
# rounding. Treating the path as a line moves no point by more than this share.
NEGLIGIBLE = 1e-6
ROUNDING = 1e-14  # relative error of a mean over equal float64 coordinates
UNCORRELATED = 1e-12  # a normalised covariance this small is rounding
# A path that deviates from a line by less than this share of its extent is nearly straight. Its roll is
# observable if the lateral motions correlate so well that its standard deviation is below nine degrees.
NEARLY_STRAIGHT = 1e-2
MAX_ROLL_STD_RAD = 0.15
IDENTITY = np.eye(3)


class _Shape(Enum):
    """The parts of a rotation that two matched paths determine."""

    POINT = 0
    LINE = 1
    FULL = 3


@dataclass(frozen=True, slots=True)
class _Centred:
    """Matched positions (K, 3) in m minus their means. `rounding_m` is the resolution of their coordinates."""

    est: Array
    gt: Array
    est_mean: Array
    gt_mean: Array
    rounding_m: float

    @classmethod
    def of_positions(cls, est_m: Array, gt_m: Array) -> "_Centred":
        """The positions (K, 3), centred."""
        est_mean = est_m.mean(axis=0)
        gt_mean = gt_m.mean(axis=0)
        largest_m = max(np.abs(est_mean).max(), np.abs(gt_mean).max())
        return cls(
            est=est_m - est_mean,
            gt=gt_m - gt_mean,
            est_mean=est_mean,
            gt_mean=gt_mean,
            rounding_m=ROUNDING * float(largest_m),
        )


@dataclass(frozen=True, slots=True)
class Alignment:
    """The transform x_gt = scale · rotation @ x_est + translation; rotation is (3, 3), and translation (3,) in m.

    `unobservable` lists the parts that the positions do not determine: "rotation", "roll about the path", "scale".
    """

    kind: AlignmentKind
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
    def from_dict(cls, values: Mapping[str, Any]) -> "Alignment":
        """The alignment that `as_dict` wrote."""
        return cls(
            kind=values["kind"],
            rotation=np.array(values["rotation"]),
            translation=np.array(values["translation"]),
            scale=values["scale"],
            unobservable=tuple(values["unobservable"]),
        )

    def apply(self, T_est: Array) -> Array:
        """The aligned poses (..., 4, 4) of the estimate. The scale applies only to positions."""
        scaled_m = self.scale * T_est[..., :3, 3]
        positions_m = scaled_m @ self.rotation.T + self.translation
        R = self.rotation @ T_est[..., :3, :3]
        return se3.transform(R, positions_m)


def align(
    T_est: Array,
    T_gt: Array,
    *,
    kind: AlignmentKind,
    first_n: int | None = None,
) -> Alignment:
    """The alignment of matched poses (K, 4, 4), fitted to the first `first_n` of them or to all.

    | kind   | what is fitted                                              | to             |
    |--------|-------------------------------------------------------------|----------------|
    | none   | nothing                                                     |                |
    | origin | rotation and translation                                    | the first pose |
    | se3    | rotation and translation                                    | the positions  |
    | sim3   | rotation, translation and scale                             | the positions  |
    | scale  | as for sim3, but only the scale is applied                  | the positions  |
    | yaw    | a rotation about z, and translation                         | the positions  |

    If the positions do not determine the rotation, it is as near as possible to the one that aligns the first
    orientations, so that no score depends on the estimate's own frame.
    Raises AlignmentError without pairs, or for positions too large to square.
    """
    if kind == "none":
        return Alignment(kind, IDENTITY, np.zeros(3), 1.0, ())
    T_est = T_est[:first_n]
    T_gt = T_gt[:first_n]
    _require_pairs(T_est, T_gt)

    T_origin = T_gt[0] @ se3.inverse(T_est[0])
    R_origin = T_origin[:3, :3]
    if kind == "origin":
        return Alignment(kind, R_origin, T_origin[:3, 3], 1.0, ())

    est_m = T_est[:, :3, 3]
    gt_m = T_gt[:, :3, 3]
    if kind == "yaw":
        return align_yaw(est_m, gt_m, toward=R_origin)
    fit = align_positions(est_m, gt_m, kind=kind, toward=R_origin)
    if kind == "scale":
        unobservable = tuple(name for name in fit.unobservable if name == "scale")
        return Alignment(kind, IDENTITY, np.zeros(3), fit.scale, unobservable)
    return fit


def align_positions(
    est_m: Array,
    gt_m: Array,
    *,
    kind: Literal["se3", "sim3", "scale"],
    toward: Array = IDENTITY,
) -> Alignment:
    """The least-squares alignment of positions (K, 3). Of equally good rotations, the one nearest to `toward` is used.

    If either side is stationary, the rotation is `toward` and the scale is 1, so that the errors are the spread about
    the mean. For a straight path, it is the smallest rotation from `toward` that aligns the directions.
    Raises AlignmentError as in `align`. Source: Umeyama (1991), eqs. 34-43.
    """
    _require_pairs(est_m, gt_m)
    centred = _Centred.of_positions(est_m, gt_m)
    shape = _shape(centred)
    # If only the scale is wanted, the rotation is not returned, so that its roll may be any. The full rotation is then
    # used also for a line: it correlates the paths best, and the scale is the least-squares one.
    fitted_shape = shape
    if kind == "scale" and shape is _Shape.LINE:
        fitted_shape = _Shape.FULL
    covariance = _covariance(centred.gt, centred.est)
    rotation = _rotation(covariance, fitted_shape, toward)

    scale = 1.0
    if kind != "se3" and shape is not _Shape.POINT:
        correlation = np.sum(rotation * covariance)
        variance = np.mean(np.sum(centred.est * centred.est, axis=1))
        scale = float(correlation / variance)
    translation = centred.gt_mean - scale * rotation @ centred.est_mean
    return Alignment(kind, rotation, translation, scale, _unobservable(shape, kind))


def _unobservable(shape: _Shape, kind: AlignmentKind) -> tuple[str, ...]:
    """The parts of an alignment that paths of a shape do not determine."""
    if shape is _Shape.FULL:
        return ()
    if shape is _Shape.LINE:
        return ("roll about the path",)
    return ("rotation",) if kind == "se3" else ("rotation", "scale")


def _yaw_direction(M: Array) -> tuple[float, float]:
    """The cosine and sine, times a common factor, of the yaw that fits a matrix (2 or 3, 2 or 3) best."""
    cosine = M[0, 0] + M[1, 1]
    sine = M[1, 0] - M[0, 1]
    return cosine, sine


def align_yaw(
    est_m: Array,
    gt_m: Array,
    *,
    toward: Array = IDENTITY,
) -> Alignment:
    """The least-squares rotation about z and translation of positions (K, 3), for worlds with a known vertical.

    If the horizontal motion does not determine the yaw, it is that of `toward`. Raises AlignmentError as `align`.
    Source: Zhang and Scaramuzza (2018), section III-C.
    """
    _require_pairs(est_m, gt_m)
    centred = _Centred.of_positions(est_m, gt_m)
    covariance = _covariance(centred.gt, centred.est)[:2, :2]
    cosine, sine = _yaw_direction(covariance)
    extents = np.array([_extent(centred.est[:, :2]), _extent(centred.gt[:, :2])])
    is_stationary = _is_stationary(extents, centred.rounding_m)
    is_uncorrelated = np.hypot(cosine, sine) <= UNCORRELATED * extents.prod()

    unobservable: tuple[str, ...] = ()
    if is_stationary or is_uncorrelated:
        cosine, sine = _yaw_direction(toward)
        unobservable = ("yaw",)
    rotation = se3.rotation_z(np.arctan2(sine, cosine))
    translation = centred.gt_mean - rotation @ centred.est_mean
    return Alignment("yaw", rotation, translation, 1.0, unobservable)


def rotation_between(from_direction: ArrayLike, to_direction: ArrayLike) -> Array:
    """The smallest rotation (3, 3) from one direction (3,) to another, by Rodrigues' formula.

    Between opposite directions it turns about the perpendicular axis that is nearest to a coordinate axis.
    """
    a = np.asarray(from_direction, float) / np.linalg.norm(from_direction)
    b = np.asarray(to_direction, float) / np.linalg.norm(to_direction)
    normal = np.cross(a, b)
    sine = np.linalg.norm(normal)
    angle_rad = np.arctan2(sine, a @ b)

    are_parallel = sine < UNCORRELATED
    approximate_axis = IDENTITY[np.argmin(np.abs(a))] if are_parallel else normal
    perpendicular = approximate_axis - (approximate_axis @ a) * a
    axis = perpendicular / np.linalg.norm(perpendicular)

    # Row i is the cross product of the coordinate axis i and the axis of rotation.
    cross_matrix = np.cross(IDENTITY, axis)
    versine = 1 - np.cos(angle_rad)
    rotation: Array = IDENTITY + np.sin(angle_rad) * cross_matrix + versine * cross_matrix @ cross_matrix
    return rotation


def _rotation(covariance: Array, shape: _Shape, toward: Array) -> Array:
    """The rotation that maximises the correlation of two paths of a shape."""
    if shape is _Shape.POINT:
        return toward
    U, _, Vt = np.linalg.svd(covariance)
    if shape is _Shape.LINE:
        est_direction = toward @ Vt[0]
        gt_direction = U[:, 0]
        return rotation_between(est_direction, gt_direction) @ toward
    handedness = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    rotation: Array = (U * np.array([1.0, 1.0, handedness])) @ Vt
    return rotation


def _shape(centred: _Centred) -> _Shape:
    """The shape that says which parts of a rotation two matched paths determine."""
    extents = np.array([_extent(centred.est), _extent(centred.gt)])
    if _is_stationary(extents, centred.rounding_m):
        return _Shape.POINT
    covariance = _covariance(centred.gt, centred.est)
    correlations = np.linalg.svd(covariance / extents.prod(), compute_uv=False)
    if correlations[0] <= UNCORRELATED:
        return _Shape.POINT
    is_common_line = correlations[1] <= UNCORRELATED * correlations[0]
    is_line = is_common_line or _is_line(centred.est) or _is_line(centred.gt)
    if is_line or _is_roll_uncertain(centred.est, centred.gt):
        return _Shape.LINE
    return _Shape.FULL


def _extent(path: Array) -> float:
    """The root mean square distance in m of a centred path (K, n) from its mean."""
    return float(np.sqrt(np.trace(_covariance(path, path))))


def _is_stationary(extents: Array, rounding_m: float) -> bool:
    """Whether one of two paths with extents (2,) in m is stationary except for rounding errors."""
    smallest_m = max(NEGLIGIBLE * extents.max(), rounding_m)
    return bool(extents.min() <= smallest_m)


def _is_line(path: Array) -> bool:
    """Whether a centred path (K, 3) is straight except for rounding errors."""
    variances = np.linalg.eigvalsh(_covariance(path, path))
    return bool(variances[1] <= NEGLIGIBLE**2 * variances[2])


def _is_roll_uncertain(est: Array, gt: Array) -> bool:
    """Whether the lateral motions of two centred paths (K, 3), one nearly straight, correlate too little for the roll.

    If lateral motions correlate by r, the best roll has the standard deviation √((1 - r²) / (r² n)) for n degrees of
    freedom.
    """
    est_variances, est_axes = np.linalg.eigh(_covariance(est, est))
    gt_variances, gt_axes = np.linalg.eigh(_covariance(gt, gt))
    est_straightness = est_variances[1] / est_variances[2]
    gt_straightness = gt_variances[1] / gt_variances[2]
    if min(est_straightness, gt_straightness) > NEARLY_STRAIGHT**2:
        return False

    # The lateral motions are complex numbers. A roll is a factor, and a reflection a conjugation.
    est_lateral = (est @ est_axes[:, :2]) @ [1, 1j]
    gt_lateral = (gt @ gt_axes[:, :2]) @ [1, 1j]
    power = float(np.linalg.norm(est_lateral) * np.linalg.norm(gt_lateral))
    rotated = abs(np.vdot(est_lateral, gt_lateral))
    reflected = abs(np.vdot(est_lateral, gt_lateral.conj()))
    r = min(max(rotated, reflected) / power, 1.0)

    # The number of measured values minus that of fitted ones, which are two means, a roll, and two angles of direction.
    degrees_of_freedom = max(2 * len(est) - 5, 1)
    # The standard deviation is compared in squares, and multiplied by r² n, since r may be zero.
    return bool(1 - r**2 > r**2 * degrees_of_freedom * MAX_ROLL_STD_RAD**2)


def _covariance(y: Array, x: Array) -> Array:
    """The covariance (n, n) of two centred paths (K, n). Raises AlignmentError if it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        covariance: Array = y.T @ x / len(x)
    if not np.isfinite(covariance).all():
        largest_m = max(np.abs(x).max(), np.abs(y).max())
        raise AlignmentError(f"positions should be finite and below 1e150 m to be aligned, but reach {largest_m:.3g} m")
    return covariance


def _require_pairs(est: Array, gt: Array) -> None:
    """Raise AlignmentError unless there are as many estimated as true poses, and one or more."""
    if est.shape != gt.shape or not len(est):
        raise AlignmentError(f"alignment needs one or more matched poses, got {len(est)} estimated and {len(gt)} true")
