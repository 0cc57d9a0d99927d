"""Estimates the motion of a view from points with known depth, by RANSAC and robust least squares.

R, t       T_now_last: a point X in the frame of the last view is R X + t in the frame of the current view
"""

from dataclasses import dataclass

import cv2
import numpy as np

from vobench.estimator.tracking import Mask
from vobench.geometry import se3
from vobench.geometry.se3 import Array

PNP_ROUNDS = 100
PNP_CONFIDENCE = 0.999
POSE_STEPS = 10
CONVERGED_STEP = 1e-9  # m and rad
MIN_POINTS = 6
NOISE_FLOOR_PX = 0.03  # smallest scale of robust weights: the accuracy of sub-pixel tracks
SIGMA_OF_MEDIAN = 1.4826  # the ratio of standard deviation and median absolute deviation of normal errors
CAUCHY_SIGMAS = 2.4  # the residual, in standard deviations, at which the Cauchy weight is one half
DAMPING = 1e-9  # keeps the normal equations solvable
EPSILON = np.finfo(float).eps


@dataclass(frozen=True, slots=True)
class PoseFit:
    """A motion T_now_last of the view, its inliers (N,), and the median reprojection error of the inliers in px.

    `covariance` (6, 6) is that of an error applied from the left: translation in m, then rotation in rad.
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
    """The motion after which points (N, 3) project to pixels (N, 2) of a pinhole K; None if no motion fits.

    For a stereo pair, `disparity_px` (N,) are the current disparities, NaN for points that the right camera does not
    see. AP3P with RANSAC finds an initial motion. It is refined by least squares with Cauchy weights on the left
    column, the row and the right column.
    Source: Ke and Roumeliotis (2017); Fischler and Bolles (1981).
    """
    if len(points_m) < MIN_POINTS:
        return None
    ransac = _ransac_pose(points_m, uv_px, K, ransac_px)
    if ransac is None:
        return None
    T_start, inlier = ransac

    if disparity_px is None:
        disparity_px = np.full(len(points_m), np.nan)
    measured_px = np.c_[uv_px, uv_px[:, 0] - disparity_px]
    T, covariance = _least_squares_pose(T_start, points_m[inlier], measured_px[inlier], K, baseline_m)

    projected_px = _stereo_pixels(se3.apply(T, points_m), K, baseline_m)[:, :2]
    error_px = np.linalg.norm(projected_px - uv_px, axis=1)
    inlier = error_px < ransac_px
    if inlier.sum() < MIN_POINTS or not np.isfinite(T).all():
        return None
    return PoseFit(T, inlier, float(np.median(error_px[inlier])), covariance)


def _ransac_pose(points_m: Array, uv_px: Array, K: Array, ransac_px: float) -> tuple[Array, Mask] | None:
    """An initial motion T_now_last and its inliers (N,); None if there are too few."""
    is_solved, rotvec, t_m, inliers = cv2.solvePnPRansac(
        points_m,
        np.ascontiguousarray(uv_px),
        K,
        None,
        flags=cv2.SOLVEPNP_AP3P,
        iterationsCount=PNP_ROUNDS,
        reprojectionError=ransac_px,
        confidence=PNP_CONFIDENCE,
    )
    if not is_solved or inliers is None or len(inliers) < MIN_POINTS:
        return None
    if not np.isfinite(rotvec).all() or not np.isfinite(t_m).all():
        return None
    inlier = np.zeros(len(points_m), bool)
    inlier[inliers.ravel()] = True
    R = cv2.Rodrigues(rotvec)[0].astype(float)
    return se3.transform(R, t_m.ravel()), inlier


def _least_squares_pose(
    T: Array, points_m: Array, measured_px: Array, K: Array, baseline_m: float
) -> tuple[Array, Array]:
    """The motion refined by Gauss-Newton from T, and its covariance.

    The covariance is the inverse information of the last step, scaled by the noise of the residuals.
    """
    known = np.isfinite(measured_px)
    information = np.eye(6)
    noise_px = NOISE_FLOOR_PX
    for _ in range(POSE_STEPS):
        moved_m = se3.apply(T, points_m)
        residual_px = np.where(known, measured_px - _stereo_pixels(moved_m, K, baseline_m), 0.0)
        noise_px = robust_noise_px(residual_px[known])
        weight = np.where(known, cauchy_weights(residual_px, noise_px), 0.0)
        jacobian = _stereo_jacobian(moved_m, K, baseline_m)
        information, gradient = normal_equations(jacobian, weight, residual_px)
        step = np.linalg.solve(information, gradient).astype(float)
        T = twist(step) @ T
        if np.abs(step).max() < CONVERGED_STEP:
            break
    covariance = np.linalg.inv(information / noise_px**2)
    return T, covariance.astype(float)


def robust_noise_px(residual_px: Array) -> float:
    """The standard deviation of residuals from their median absolute deviation; at least NOISE_FLOOR_PX."""
    median_px = float(np.median(np.abs(residual_px)))
    return max(SIGMA_OF_MEDIAN * median_px, NOISE_FLOOR_PX)


def cauchy_weights(residual_px: Array, noise_px: float) -> Array:
    """The Cauchy weights of residuals: 1 at 0, and one half at CAUCHY_SIGMAS standard deviations."""
    relative = residual_px / (CAUCHY_SIGMAS * noise_px)
    weights: Array = 1 / (1 + relative**2)
    return weights


def normal_equations(jacobian: Array, weight: Array, residual: Array) -> tuple[Array, Array]:
    """The information (P, P) and the gradient (P,) of weighted least squares.

    `jacobian` is (N, M, P). `weight` and `residual` are (N, M).
    """
    size = jacobian.shape[-1]
    information: Array = np.einsum("nij,ni,nik->jk", jacobian, weight, jacobian)
    gradient: Array = np.einsum("nij,ni->j", jacobian, weight * residual)
    return information + DAMPING * np.eye(size), gradient


def _stereo_pixels(points_m: Array, K: Array, baseline_m: float) -> Array:
    """The left column, row and right column (N, 3) in px of points (N, 3) in the frame of the view.

    Points behind the camera get values far outside of the picture.
    """
    z_m = _positive(points_m[:, 2])
    uv_px = (points_m / z_m[:, None]) @ K.T
    right_px = uv_px[:, 0] - K[0, 0] * baseline_m / z_m
    pixels: Array = np.c_[uv_px[:, :2], right_px]
    return pixels


def _stereo_jacobian(points_m: Array, K: Array, baseline_m: float) -> Array:
    """The derivatives (N, 3, 6) of `_stereo_pixels` with respect to a small translation and rotation of the points."""
    fx = K[0, 0]
    skew = K[0, 1]
    fy = K[1, 1]
    x, y, z = points_m.T
    z = _positive(z)
    zero = np.zeros_like(z)
    one = np.ones_like(z)
    column_by_z = -(fx * x + skew * y) / z
    row_by_z = -fy * y / z
    disparity = fx * baseline_m / z
    column = np.stack([fx * one, skew * one, column_by_z], -1)
    row = np.stack([zero, fy * one, row_by_z], -1)
    right = column + np.stack([zero, zero, disparity], -1)
    by_point = np.stack([column, row, right], 1) / z[:, None, None]
    by_rotation = -by_point @ cross_matrix(points_m)
    return np.concatenate([by_point, by_rotation], -1)


def _positive(z: Array) -> Array:
    """The depths, with a tiny positive value for points behind the camera."""
    return np.where(z > 0, z, EPSILON)


def cross_matrix(vectors: Array) -> Array:
    """The matrices (N, 3, 3) whose product with a vector is the cross product of vectors (N, 3) and that vector."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    row_x = np.stack([zero, -z, y], -1)
    row_y = np.stack([z, zero, -x], -1)
    row_z = np.stack([-y, x, zero], -1)
    return np.stack([row_x, row_y, row_z], 1)


def adjoint(T_a_b: Array) -> Array:
    """The matrix (6, 6) that transforms a small translation and rotation from frame b to frame a."""
    R = T_a_b[:3, :3]
    t = T_a_b[:3, 3]
    zero = np.zeros((3, 3))
    t_cross = cross_matrix(t[None])[0]
    return np.block([[R, t_cross @ R], [zero, R]])


def twist(step: Array) -> Array:
    """The small motion (4, 4) with a translation and a rotation vector, which are given as `step` (6,)."""
    R = cv2.Rodrigues(step[3:])[0].astype(float)
    return se3.transform(R, step[:3])


def carried_on(T_odom_before: Array, T_odom_now: Array, share: float = 1.0) -> Array:
    """The pose of a body that continues its motion between two poses, after `share` of the time between them."""
    T_before_now = se3.inverse(T_odom_before) @ T_odom_now
    rotvec = cv2.Rodrigues(T_before_now[:3, :3])[0].ravel()
    step = np.r_[T_before_now[:3, 3], rotvec]
    return T_odom_now @ twist(share * step)
