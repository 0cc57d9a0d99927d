"""The camera's motion between two views: direction from epipolar geometry, length from stereo.

x0, x1     rays (N, 3) with z = 1 through the tracks in the last view and in this one, in the rectified view's axes
rho        inverse depth (N,) in 1/m of the tracks in the last view, NaN where stereo has none
R, t       T_now_last: a point X of the last view is at R X + t in this one; t = s d, |d| = 1
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vobench.plugin import Array, Mask, cross_matrix, se3

MIN_STEREO = 12  # points with depth that a length needs
MAX_BEHIND = 0.1  # share of points that may land behind the camera
CONFIDENCE = 0.9999
SCALE_ITERATIONS = 5
LEAST_SCALE_NOISE = 1e-16  # squared, in units of a ray
NO_TRANSLATION = 1e-9
HUBER_PX = 0.1  # about the noise of a good track
MAX_EVALUATIONS = 20
TINY = np.finfo(float).tiny


@dataclass(frozen=True, slots=True)
class Matches:
    """Tracks from the last view to this one, as rays, pixels of the picture and inverse depths.

    K is the view's matrix: it gives the rays pixels without distortion. uv0_px and uv1_px are the picture's own.
    """

    x0: Array
    x1: Array
    uv0_px: Array
    uv1_px: Array
    rho: Array
    K: Array

    @property
    def focal_px(self) -> float:
        """Pixels per unit of a ray, for pixels that need not be square."""
        fx_fy = self.K[0, 0] * self.K[1, 1]
        return float(np.sqrt(fx_fy))

    @property
    def flat0_px(self) -> Array:
        """Undistorted pixels (N, 2) of the tracks in the last view."""
        return (self.x0 @ self.K.T)[:, :2]

    @property
    def flat1_px(self) -> Array:
        """Undistorted pixels (N, 2) of the tracks in this view."""
        return (self.x1 @ self.K.T)[:, :2]

    @property
    def flow_px(self) -> float:
        """Median length of the tracks."""
        lengths_px = np.linalg.norm(self.uv1_px - self.uv0_px, axis=1)
        return float(np.median(lengths_px))


@dataclass(frozen=True, slots=True)
class Shape:
    """A rotation and a direction that explain the tracks up to length and sign."""

    R: Array
    direction: Array


@dataclass(frozen=True, slots=True)
class TwoViews:
    """Every motion that the essential matrix or the homography of two views allows."""

    shapes: list[Shape]
    inlier: Mask
    h_ratio: float


@dataclass(frozen=True, slots=True)
class Motion:
    """A shape with its length: T_now_last in metres, and the median transfer error of the tracks in px."""

    shape: Shape
    T_now_last: Array
    transfer_px: float


def two_views(matches: Matches, ransac_px: float) -> TwoViews:
    """Fit both models and decompose them into motions.

    On a plane the essential matrix has two exact solutions and RANSAC returns either; in a room
    the homography fits a part only. So all motions of both are candidates.
    """
    E, on_E = essential(matches, ransac_px)
    H, on_H = homography(matches, ransac_px)
    shapes: list[Shape] = []
    if E is not None:
        shapes += from_essential(E)
    if H is not None:
        shapes += from_homography(H, matches.K)
    h_ratio = on_H.sum() / max(on_E.sum(), 1)
    inlier = on_E if E is not None and h_ratio < 1 else on_H
    return TwoViews(shapes, inlier, float(h_ratio))


def essential(matches: Matches, ransac_px: float) -> tuple[Array | None, Mask]:
    """The essential matrix and its inliers; None if there is none. Source: Nistér (2004)."""
    uv0_px = matches.flat0_px
    uv1_px = matches.flat1_px
    E, inlier = cv2.findEssentialMat(uv0_px, uv1_px, matches.K, cv2.USAC_MAGSAC, prob=CONFIDENCE, threshold=ransac_px)
    if E is None or len(E) < 3 or not np.isfinite(E).all():
        return None, np.zeros(len(matches.x0), bool)
    return E[:3].astype(float), inlier.ravel() > 0


def homography(matches: Matches, ransac_px: float) -> tuple[Array | None, Mask]:
    """The homography in px and its inliers; None if there is none."""
    uv0_px = matches.flat0_px
    uv1_px = matches.flat1_px
    H, inlier = cv2.findHomography(uv0_px, uv1_px, cv2.USAC_MAGSAC, ransac_px, confidence=CONFIDENCE)
    if H is None or not np.isfinite(H).all():
        return None, np.zeros(len(matches.x0), bool)
    return H.astype(float), inlier.ravel() > 0


def from_essential(E: Array) -> Iterator[Shape]:
    """Two rotations and one direction; its sign comes with the length, from stereo."""
    R_a, R_b, direction = cv2.decomposeEssentialMat(E)
    for R in (R_a, R_b):
        yield Shape(R.astype(float), direction.ravel().astype(float))


def from_homography(H: Array, K: Array) -> Iterator[Shape]:
    """Up to four motions over a plane. Source: Malis and Vargas (2007).

    For a pure rotation OpenCV returns a matrix that is no rotation, so the nearest one is taken.
    """
    _, rotations, translations, _ = cv2.decomposeHomographyMat(H, K)
    for R, t in zip(rotations, translations, strict=True):
        length = np.linalg.norm(t)
        direction = np.array([0.0, 0.0, 1.0])
        if length > NO_TRANSLATION:
            direction = t.ravel() / length
        yield Shape(se3.nearest_rotation(R.astype(float)), direction)


def best_motion(shapes: list[Shape], matches: Matches) -> Motion | None:
    """The shape with the least transfer error, each with its length from stereo; None without enough depths."""
    if np.isfinite(matches.rho).sum() < MIN_STEREO:
        return None
    motions = [scaled(shape, matches) for shape in shapes]
    possible = [motion for motion in motions if motion is not None]
    return min(possible, key=lambda motion: motion.transfer_px, default=None)


def scaled(shape: Shape, matches: Matches) -> Motion | None:
    """The shape with the length that fits stereo best; None if points land behind the camera.

    x1 is parallel to R x0 + s rho d, which is linear in s: a s + b = 0, two equations a point.
    """
    has_depth = np.isfinite(matches.rho)
    x0 = matches.x0[has_depth]
    x1 = matches.x1[has_depth]
    rho = matches.rho[has_depth, None]

    turned = x0 @ shape.R.T
    shift = rho * shape.direction
    slopes = x1[:, :2]
    b = turned[:, :2] - slopes * turned[:, 2:]
    a = shift[:, :2] - slopes * shift[:, 2:]
    s = robust_scale(a, b)

    landed = turned + s * shift  # points (N, 3) now, times rho
    share_behind = (landed[:, 2] <= 0).mean()
    if not np.isfinite(s) or share_behind > MAX_BEHIND:
        return None
    residual = landed[:, :2] / landed[:, 2:] - slopes
    error_px = np.linalg.norm(residual, axis=1) * matches.focal_px
    T_now_last = se3.transform(shape.R, s * shape.direction)
    return Motion(shape, T_now_last, float(np.median(error_px)))


def robust_scale(a: Array, b: Array) -> float:
    """The s that makes a s + b (N, 2) small for most points: least squares with Cauchy's weights."""
    aa = (a * a).sum(1)
    ab = (a * b).sum(1)
    scales = -ab / np.maximum(aa, TINY)
    s = float(np.median(scales))
    for _ in range(SCALE_ITERATIONS):
        squared = ((a * s + b) ** 2).sum(1)
        noise_squared = max(2 * float(np.median(squared)), LEAST_SCALE_NOISE)
        weight = 1 / (1 + squared / noise_squared)
        weighted_aa = float(weight @ aa)
        weighted_ab = float(weight @ ab)
        s = -weighted_ab / max(weighted_aa, TINY)
    return s


def refined(motion: Motion, matches: Matches, inlier: Mask) -> Motion:
    """The motion near the given one that fits all tracks by their epipolar lines, and those with depth by their pixel.

    The distance to the line is Sampson's; the pixel is that of the transferred point.
    """
    x0 = matches.x0[inlier]
    x1 = matches.x1[inlier]
    rho = matches.rho[inlier, None]
    has_depth = np.isfinite(rho[:, 0])
    focal_px = matches.focal_px
    R_start = motion.T_now_last[:3, :3]
    t_start_m = motion.T_now_last[:3, 3]
    size_m = max(float(np.linalg.norm(t_start_m)), NO_TRANSLATION)

    def moved(delta: Array) -> Array:
        R = Rotation.from_rotvec(delta[:3]).as_matrix() @ R_start
        return se3.transform(R, t_start_m + size_m * delta[3:])

    def cost(delta: Array) -> Array:
        T = moved(delta)
        landed = x0[has_depth] @ T[:3, :3].T + rho[has_depth] * T[:3, 3]
        transfer = landed[:, :2] / landed[:, 2:] - x1[has_depth, :2]
        epipolar = sampson(shape_of(T), x0, x1)
        residual_px: Array = focal_px * np.r_[epipolar, transfer.ravel()]
        return residual_px

    fit = least_squares(cost, np.zeros(6), loss="huber", f_scale=HUBER_PX, max_nfev=MAX_EVALUATIONS)
    T_now_last = moved(fit.x)
    transfer_px = cost(fit.x)[len(x0) :].reshape(-1, 2)
    error_px = np.linalg.norm(transfer_px, axis=1)
    return Motion(shape_of(T_now_last), T_now_last, float(np.median(error_px)))


def shape_of(T_now_last: Array) -> Shape:
    """A motion without its length."""
    t_m = T_now_last[:3, 3]
    length_m = max(float(np.linalg.norm(t_m)), NO_TRANSLATION)
    return Shape(T_now_last[:3, :3], t_m / length_m)


def sampson(shape: Shape, x0: Array, x1: Array) -> Array:
    """First-order distance (N,) of rays (N, 3) to the epipolar geometry. Source: Sampson (1982)."""
    E = cross_matrix(shape.direction[None])[0] @ shape.R
    line1 = x0 @ E.T
    line0 = x1 @ E
    a1, b1, _ = line1.T
    a0, b0, _ = line0.T
    gradient = np.sqrt(a1**2 + b1**2 + a0**2 + b0**2 + TINY)
    algebraic_error = (x1 * line1).sum(1)
    distance: Array = algebraic_error / gradient
    return distance
