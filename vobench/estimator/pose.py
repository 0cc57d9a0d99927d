"""Motion from points with a depth, and how far off the disparities of a pair are.

R, t       T_now_last: a point X of the last view is at R X + t in this one
rays       (N, 3) with z = 1 in the view's axes; disparity in px, inverse depth = disparity / (K[0, 0] baseline)
"""

from dataclasses import dataclass

import cv2
import numpy as np

from vobench.estimator.tools import Mask, StereoPair
from vobench.geometry import se3
from vobench.geometry.se3 import Array

PNP_ROUNDS = 100
PNP_CONFIDENCE = 0.999
POSE_STEPS = 10
MIN_POINTS = 6
NOISE_FLOOR_PX = 0.03  # the least scale of a robust weight: what sub-pixel tracks reach


@dataclass(frozen=True, slots=True)
class PoseFit:
    """A motion T_now_last of the view, which points (N,) it explains, and by how many px it misses most of these.

    `covariance` (6, 6) is of the error's translation and rotation, applied from the left, in m and rad.
    """

    T_now_last: Array
    inlier: Mask
    error_px: float
    covariance: Array


def pose_from_points(
    points_m: Array,
    uv_px: Array,
    K: Array,
    *,
    disparity_px: Array | None = None,
    baseline_m: float = 0.0,
    ransac_px: float = 1.0,
) -> PoseFit | None:
    """The motion that brings points (N, 3) to pixels (N, 2) of a pinhole K; None where there is none.

    With a right eye, `disparity_px` (N,) are the points' disparities now, NaN where not seen there. AP3P in RANSAC,
    then least squares with Cauchy's weights on left column, row and right column.
    Source: Ke and Roumeliotis (2017); Fischler and Bolles (1981).
    """
    if len(points_m) < MIN_POINTS:
        return None
    disparity_px = np.full(len(points_m), np.nan) if disparity_px is None else disparity_px
    ok, rotvec, t, inliers = cv2.solvePnPRansac(
        points_m,
        np.ascontiguousarray(uv_px),
        K,
        None,
        flags=cv2.SOLVEPNP_AP3P,
        iterationsCount=PNP_ROUNDS,
        reprojectionError=ransac_px,
        confidence=PNP_CONFIDENCE,
    )
    if not ok or inliers is None or len(inliers) < MIN_POINTS or not (np.isfinite(rotvec).all() & np.isfinite(t).all()):
        return None
    inlier = np.zeros(len(points_m), bool)
    inlier[inliers.ravel()] = True
    R = cv2.Rodrigues(rotvec)[0].astype(float)
    measured = np.c_[uv_px, uv_px[:, 0] - disparity_px]
    T, covariance = _least_squares_pose(se3.transform(R, t.ravel()), points_m[inlier], measured[inlier], K, baseline_m)
    error = np.linalg.norm(_stereo_pixels(se3.apply(T, points_m), K, baseline_m)[:, :2] - uv_px, axis=1)
    inlier = error < ransac_px
    if inlier.sum() < MIN_POINTS or not np.isfinite(T).all():
        return None
    return PoseFit(T, inlier, float(np.median(error[inlier])), covariance)


def _least_squares_pose(
    T: Array, points_m: Array, measured_px: Array, K: Array, baseline_m: float
) -> tuple[Array, Array]:
    """Gauss-Newton from T; the last step's inverse information, scaled by the noise seen, is the covariance."""
    known = np.isfinite(measured_px)
    information = np.eye(6)
    noise_px = NOISE_FLOOR_PX
    for _ in range(POSE_STEPS):
        moved = se3.apply(T, points_m)
        residual = np.where(known, measured_px - _stereo_pixels(moved, K, baseline_m), 0.0)
        noise_px = max(1.4826 * float(np.median(np.abs(residual[known]))), NOISE_FLOOR_PX)
        weight = known / (1 + (residual / (2.4 * noise_px)) ** 2)
        jacobian = _stereo_jacobian(moved, K, baseline_m)
        information = np.einsum("nij,ni,nik->jk", jacobian, weight, jacobian) + 1e-9 * np.eye(6)
        step = np.linalg.solve(information, np.einsum("nij,ni->j", jacobian, weight * residual))
        T = twist(step) @ T
        if np.abs(step).max() < 1e-9:
            break
    return T, np.linalg.inv(information / noise_px**2).astype(float)


def _stereo_pixels(points_m: Array, K: Array, baseline_m: float) -> Array:
    """Left column, row and right column (N, 3) of points in the view's axes; far off the picture behind it."""
    z = np.where(points_m[:, 2] > 0, points_m[:, 2], np.finfo(float).eps)
    uv = (points_m / z[:, None]) @ K.T
    pixels: Array = np.c_[uv[:, :2], uv[:, 0] - K[0, 0] * baseline_m / z]
    return pixels


def _stereo_jacobian(points_m: Array, K: Array, baseline_m: float) -> Array:
    """How these pixels (N, 3) change with a small translation and rotation (6,) of the points: (N, 3, 6)."""
    fx = K[0, 0]
    skew = K[0, 1]
    fy = K[1, 1]
    x, y, z = points_m.T
    z = np.where(z > 0, z, np.finfo(float).eps)
    zero = np.zeros_like(z)
    one = np.ones_like(z)
    column = np.stack([fx * one, skew * one, -(fx * x + skew * y) / z], -1)
    row = np.stack([zero, fy * one, -fy * y / z], -1)
    right = column + np.stack([zero, zero, K[0, 0] * baseline_m / z], -1)
    by_point = np.stack([column, row, right], 1) / z[:, None, None]
    by_turn = -by_point @ cross_matrix(points_m)
    return np.concatenate([by_point, by_turn], -1)


def cross_matrix(vectors: Array) -> Array:
    """Matrices (N, 3, 3) that take the cross product with vectors (N, 3) from the left."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)


def adjoint(T_a_b: Array) -> Array:
    """The matrix (6, 6) that takes a small translation and rotation in b to the same motion in a."""
    R = T_a_b[:3, :3]
    return np.block([[R, cross_matrix(T_a_b[None, :3, 3])[0] @ R], [np.zeros((3, 3)), R]])


def twist(step: Array) -> Array:
    """The small motion (4, 4) of a translation and a rotation vector (6,)."""
    return se3.transform(cv2.Rodrigues(step[3:])[0].astype(float), step[:3])


OFFSET_PRIOR_PX = 0.3
OFFSET_SIGMAS = 3.0
OFFSET_LEAST_PX = 0.15
OFFSET_STEPS = 5
# of a disparity, over that of a track, and at least
STEREO_NOISE = 2.0
STEREO_NOISE_PX = 0.1
MOST_BIAS_PX = 0.05
CORRELATED = 8.0  # tracks near each other err alike: so many count as one


@dataclass(frozen=True, slots=True)
class DisparityOffset:
    """How much too large all disparities of a pair are, learnt from view to view under a prior of zero.

    Sums of information in 1/px² and of information times offset in 1/px.
    """

    information: float = 1 / OFFSET_PRIOR_PX**2
    weighted: float = 0.0

    @property
    def estimate_px(self) -> float:
        """The best guess."""
        return self.weighted / self.information

    @property
    def px(self) -> float:
        """What to take off every disparity: nothing until the guess is large and certain enough."""
        sigma_px = self.information**-0.5
        is_plain = abs(self.estimate_px) > max(OFFSET_SIGMAS * sigma_px, OFFSET_LEAST_PX)
        return self.estimate_px if is_plain else 0.0

    def after(
        self, rays0: Array, rays1: Array, disparity_px: Array, T_now_last: Array, pair: StereoPair
    ) -> "DisparityOffset":
        """What is known after one more pair of views.

        Takes tracks as rays (N, 3) of the last view and of this one, the disparities (N,) measured in the last,
        NaN for none, and the motion between as estimated: motion and offset are fitted together.
        """
        known = np.isfinite(disparity_px) & np.isfinite(rays0).all(1) & np.isfinite(rays1).all(1)
        if known.sum() < MIN_POINTS:
            return self
        offset_px, information = _fitted_offset(
            rays0[known], rays1[known], disparity_px[known], T=T_now_last, pair=pair, offset_px=self.estimate_px
        )
        if not np.isfinite(offset_px) or information <= 0:
            return self
        return DisparityOffset(self.information + information, self.weighted + information * offset_px)


def _fitted_offset(
    rays0: Array, rays1: Array, disparity_px: Array, *, T: Array, pair: StereoPair, offset_px: float
) -> tuple[float, float]:
    """An offset of disparity and its information in 1/px², everything that the motion could explain taken out.

    A point of ray x0 comes to R x0 + t (d - o) / (f b): least squares in t, R and o with Cauchy's weights. Where
    depths differ by little more than their noise, the fit would mistake the noise for depth: no information.
    """
    focal = np.array([pair.K[0, 0], pair.K[1, 1]])
    unit = 1 / pair.focal_baseline
    for _ in range(OFFSET_STEPS):
        rho = (disparity_px - offset_px) * unit
        turned = rays0 @ T[:3, :3].T
        moved = turned + rho[:, None] * T[:3, 3]
        slope = moved[:, :2] / moved[:, 2:]
        residual = (rays1[:, :2] - slope) * focal
        noise_px = max(1.4826 * float(np.median(np.abs(residual))), NOISE_FLOOR_PX)
        weight = 1 / (1 + (residual / (2.4 * noise_px)) ** 2)
        by_point = np.concatenate([np.broadcast_to(np.eye(2), (len(rho), 2, 2)), -slope[..., None]], -1)
        by_point = by_point * focal[:, None] / moved[:, 2, None, None]
        by_turn = -by_point @ cross_matrix(turned)
        by_offset = -unit * by_point @ T[:3, 3]
        jacobian = np.concatenate([rho[:, None, None] * by_point, by_turn, by_offset[..., None]], -1)
        information = np.einsum("nij,ni,nik->jk", jacobian, weight, jacobian) + 1e-9 * np.eye(7)
        step = np.linalg.solve(information, np.einsum("nij,ni->j", jacobian, weight * residual))
        T = se3.transform(twist(step[:6])[:3, :3] @ T[:3, :3], T[:3, 3] + step[:3])
        offset_px += float(step[6])
    # Noise in depth pulls the length of t down, and the offset with it (errors in variables): by so much.
    noise_rho = max(STEREO_NOISE * noise_px, STEREO_NOISE_PX) * unit
    pull = noise_rho**2 * np.einsum("nij,ni,nik->jk", by_point, weight, by_point) @ T[:3, 3]
    bias_px = -float(np.linalg.solve(information, np.r_[pull, np.zeros(4)])[6])
    if not abs(bias_px) < MOST_BIAS_PX:
        return offset_px, 0.0
    of_motion = np.linalg.solve(information[:6, :6], information[:6, 6])
    alone = float(information[6, 6] - information[6, :6] @ of_motion)
    return offset_px - bias_px, alone / (CORRELATED * noise_px**2)


def carried_on(T_odom_before: Array, T_odom_now: Array, share: float = 1.0) -> Array:
    """Where a body comes to be that goes on as it did from one pose to the next, for `share` of that time."""
    T_before_now = se3.inverse(T_odom_before) @ T_odom_now
    turn = cv2.Rodrigues(T_before_now[:3, :3])[0].ravel()
    return T_odom_now @ twist(share * np.r_[T_before_now[:3, 3], turn])
