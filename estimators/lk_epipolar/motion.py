"""How the camera moved between two views: direction from epipolar geometry, length from stereo.

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
SCALE_ITERATIONS = 5
NO_TRANSLATION = 1e-9
HUBER_PX = 0.1  # about the noise of a good track
MAX_EVALUATIONS = 20


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
        return float(np.sqrt(self.K[0, 0] * self.K[1, 1]))

    @property
    def flat0_px(self) -> Array:
        """Pixels (N, 2) of the tracks in the last view, had the lens no distortion."""
        return (self.x0 @ self.K.T)[:, :2]

    @property
    def flat1_px(self) -> Array:
        """Pixels (N, 2) of the tracks in this view, had the lens no distortion."""
        return (self.x1 @ self.K.T)[:, :2]

    @property
    def flow_px(self) -> float:
        """Median length of the tracks."""
        return float(np.median(np.linalg.norm(self.uv1_px - self.uv0_px, axis=1)))


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
    """A shape with its length: T_now_last in metres, and the median distance in px by which it misses the tracks."""

    shape: Shape
    T_now_last: Array
    transfer_px: float


def two_views(matches: Matches, ransac_px: float) -> TwoViews:
    """Fit both models and take them apart.

    On a plane the essential matrix has two exact solutions and RANSAC returns either; in a room
    the homography fits a part only. So keep all that either allows.
    """
    E, on_E = essential(matches, ransac_px)
    H, on_H = homography(matches, ransac_px)
    shapes = [] if E is None else list(from_essential(E))
    shapes += [] if H is None else list(from_homography(H, matches.K))
    h_ratio = on_H.sum() / max(on_E.sum(), 1)
    return TwoViews(shapes, on_E if E is not None and h_ratio < 1 else on_H, float(h_ratio))


def essential(matches: Matches, ransac_px: float) -> tuple[Array | None, Mask]:
    """The essential matrix and its inliers; None where there is none. Source: Nistér (2004)."""
    E, inlier = cv2.findEssentialMat(
        matches.flat0_px, matches.flat1_px, matches.K, cv2.USAC_MAGSAC, prob=0.9999, threshold=ransac_px
    )
    if E is None or E.shape[0] < 3 or not np.isfinite(E).all():
        return None, np.zeros(len(matches.x0), bool)
    return E[:3].astype(float), inlier.ravel() > 0


def homography(matches: Matches, ransac_px: float) -> tuple[Array | None, Mask]:
    """The homography in px and its inliers; None where there is none."""
    H, inlier = cv2.findHomography(matches.flat0_px, matches.flat1_px, cv2.USAC_MAGSAC, ransac_px, confidence=0.9999)
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

    For a pure rotation OpenCV returns a matrix that is no rotation: take the nearest one.
    """
    _, rotations, translations, _ = cv2.decomposeHomographyMat(H, K)
    for R, t in zip(rotations, translations, strict=True):
        length = np.linalg.norm(t)
        direction = t.ravel() / length if length > NO_TRANSLATION else np.array([0.0, 0.0, 1.0])
        yield Shape(se3.nearest_rotation(R.astype(float)), direction)


def best_motion(shapes: list[Shape], matches: Matches) -> Motion | None:
    """Of all shapes, each with its length from stereo, the one that sends the points to their tracks."""
    if np.isfinite(matches.rho).sum() < MIN_STEREO:
        return None
    motions = [motion for shape in shapes if (motion := scaled(shape, matches)) is not None]
    return min(motions, key=lambda motion: motion.transfer_px, default=None)


def scaled(shape: Shape, matches: Matches) -> Motion | None:
    """The shape with the length that fits stereo best; None where points land behind the camera.

    x1 is parallel to R x0 + s rho d, which is linear in s: a s + b = 0, two equations a point.
    """
    seen = np.isfinite(matches.rho)
    x0 = matches.x0[seen]
    x1 = matches.x1[seen]
    rho = matches.rho[seen, None]
    turned = x0 @ shape.R.T
    shift = rho * shape.direction
    b = turned[:, :2] - x1[:, :2] * turned[:, 2:]
    a = shift[:, :2] - x1[:, :2] * shift[:, 2:]
    s = robust_scale(a, b)
    landed = turned + s * shift
    if not np.isfinite(s) or (landed[:, 2] <= 0).mean() > MAX_BEHIND:
        return None
    error = np.linalg.norm(landed[:, :2] / landed[:, 2:] - x1[:, :2], axis=1) * matches.focal_px
    return Motion(shape, se3.transform(shape.R, s * shape.direction), float(np.median(error)))


def robust_scale(a: Array, b: Array) -> float:
    """The s that makes a s + b (N, 2) small for most points: least squares with Cauchy's weights."""
    aa = (a * a).sum(1)
    ab = (a * b).sum(1)
    s = float(np.median(-ab / np.maximum(aa, np.finfo(float).tiny)))
    for _ in range(SCALE_ITERATIONS):
        squared = ((a * s + b) ** 2).sum(1)
        weight = 1 / (1 + squared / max(2 * float(np.median(squared)), 1e-16))
        s = -float(weight @ ab) / max(float(weight @ aa), np.finfo(float).tiny)
    return s


def refined(motion: Motion, matches: Matches, inlier: Mask) -> Motion:
    """The motion near the given one that fits best: all tracks by epipolar lines, those with depth by their place.

    The distance to the line is Sampson's; the place is that of the transferred point, in px.
    """
    x0 = matches.x0[inlier]
    x1 = matches.x1[inlier]
    rho = matches.rho[inlier, None]
    known = np.isfinite(rho[:, 0])
    focal_px = matches.focal_px
    size_m = max(float(np.linalg.norm(motion.T_now_last[:3, 3])), NO_TRANSLATION)

    def moved(delta: Array) -> Array:
        R = Rotation.from_rotvec(delta[:3]).as_matrix() @ motion.T_now_last[:3, :3]
        return se3.transform(R, motion.T_now_last[:3, 3] + size_m * delta[3:])

    def cost(delta: Array) -> Array:
        T = moved(delta)
        landed = x0[known] @ T[:3, :3].T + rho[known] * T[:3, 3]
        off = landed[:, :2] / landed[:, 2:] - x1[known, :2]
        residual: Array = focal_px * np.r_[sampson(shape_of(T), x0, x1), off.ravel()]
        return residual

    fit = least_squares(cost, np.zeros(6), loss="huber", f_scale=HUBER_PX, max_nfev=MAX_EVALUATIONS)
    T = moved(fit.x)
    error = np.linalg.norm(cost(fit.x)[len(x0) :].reshape(-1, 2), axis=1)
    return Motion(shape_of(T), T, float(np.median(error)))


def shape_of(T_now_last: Array) -> Shape:
    """A motion without its length."""
    t = T_now_last[:3, 3]
    return Shape(T_now_last[:3, :3], t / max(float(np.linalg.norm(t)), NO_TRANSLATION))


def sampson(shape: Shape, x0: Array, x1: Array) -> Array:
    """First-order distance (N,) of rays (N, 3) to the epipolar geometry. Source: Sampson (1982)."""
    E = cross_matrix(shape.direction[None])[0] @ shape.R
    line1 = x0 @ E.T
    line0 = x1 @ E
    gradient = line1[:, 0] ** 2 + line1[:, 1] ** 2 + line0[:, 0] ** 2 + line0[:, 1] ** 2
    distance: Array = (x1 * line1).sum(1) / np.sqrt(gradient + np.finfo(float).tiny)
    return distance
