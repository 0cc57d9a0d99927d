"""Tracks points of a stereo pair through motions of the camera, and models what errors of calibration do to them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.patch_refinement import AFFINE, refined
from vobench.analysis.stereo_matches import MARGIN_PX, WINDOW_PX, MatchedShot, PairShot
from vobench.estimator.pose import cauchy_weights, cross_matrix, pose_from_points, twist
from vobench.estimator.stereo import StereoPair
from vobench.estimator.tracking import Points, comparable, follow, inside
from vobench.geometry import se3
from vobench.geometry.se3 import Array

FRAMES_APART = 5  # between the two views of a motion
MIN_TRACKED = 40
MIN_FLOW_PX = 2.0
RANSAC_PX = 3.0

# Standard deviations of true motions, of laser trackers and of cars.
TRUTH_SIGMA_M = 3e-4
TRUTH_RELATIVE_SIGMA = 2e-3  # of the length
TRUTH_SIGMA_RAD = 5e-4


@dataclass(frozen=True, slots=True)
class TrackedPoints:
    """Points that the left camera sees at two times, and the motion between these.

    `left_px`, `right_px` (N, 2) are pixels of both images before the motion, and `after_px` of the left image after it;
    `disparity_px` (N,) is the disparity before. `information` (6, 6) is the prior information of the motion's
    translation and rotation. `window` is the number of the run of images.
    """

    left_px: Points
    right_px: Points
    after_px: Points
    disparity_px: Array
    T_after_before: Array
    information: Array
    window: int


def track_motions(windows: Sequence[Sequence[MatchedShot]], pair: StereoPair) -> list[TrackedPoints]:
    """The tracked points of all motions over FRAMES_APART frames; none of a camera that is stationary."""
    motions = []
    for number, window in enumerate(windows):
        for first in range(len(window) - FRAMES_APART):
            tracks = _track(window[first : first + FRAMES_APART + 1], pair, window=number)
            if tracks:
                motions.append(tracks)
    return motions


def _track(shots: Sequence[MatchedShot], pair: StereoPair, *, window: int) -> TrackedPoints | None:
    """The points of the first of successive shots in the last that has enough of them; None if none has."""
    first = shots[0].shot
    last = first
    tracked = np.arange(len(shots[0].left_px))
    after_px = shots[0].left_px
    for later in shots[1:]:
        now = later.shot
        last_image, image = comparable(last.left, now.left)
        followed_px, is_followed = follow(last_image, image, after_px, window_px=WINDOW_PX)
        is_followed &= inside(followed_px, now.left, MARGIN_PX) & pair.seen(followed_px)
        if is_followed.sum() < MIN_TRACKED:
            break
        tracked = tracked[is_followed]
        after_px = followed_px[is_followed]
        last = now
    if last is first:
        return None

    after_px, has_converged = refined(first.left, last.left, shots[0].left_px[tracked], after_px, shape=AFFINE)
    if has_converged.sum() < MIN_TRACKED:
        return None
    tracked = tracked[has_converged]
    after_px = after_px[has_converged]
    left_px = shots[0].left_px[tracked]
    disparity_px = shots[0].disparity_px[tracked]

    after_view_px = pair.left.in_view(after_px)
    flow_px = np.linalg.norm(after_view_px - pair.left.in_view(left_px), axis=1)
    fit = pose_from_points(pair.points(left_px, disparity_px), after_view_px, pair.K, ransac_px=RANSAC_PX)
    if fit is None or float(np.median(flow_px)) < MIN_FLOW_PX:
        return None

    T_true = _true_motion(first, last, pair)
    return TrackedPoints(
        left_px=left_px[fit.inlier],
        right_px=shots[0].right_px[tracked][fit.inlier],
        after_px=after_px[fit.inlier],
        disparity_px=disparity_px[fit.inlier],
        T_after_before=fit.T_now_last if T_true is None else T_true,
        information=np.zeros((6, 6)) if T_true is None else true_information(T_true),
        window=window,
    )


def _true_motion(first: PairShot, last: PairShot, pair: StereoPair) -> Array | None:
    """The true motion (4, 4) in the frame of the view, None if it is unknown."""
    if first.T_world_left is None or last.T_world_left is None:
        return None
    T_view_left = pair.T_view_left
    T_last_world = se3.inverse(last.T_world_left)
    T_left_view = se3.inverse(T_view_left)
    motion: Array = T_view_left @ T_last_world @ first.T_world_left @ T_left_view
    return motion


def true_information(T_after_before: Array) -> Array:
    """The information (6, 6) of a true motion."""
    length_m = float(np.linalg.norm(T_after_before[:3, 3]))
    sigma_m = TRUTH_SIGMA_M + TRUTH_RELATIVE_SIGMA * length_m
    return np.diag(np.repeat([sigma_m**-2, TRUTH_SIGMA_RAD**-2], 3))


# --- The model of one motion ---

# The first six unknowns of a motion are its own translation and rotation, the others are shared by all motions.
MOTION = slice(0, 6)
SHARED = slice(6, None)
DEPTH_STEPS = 2
MEDIAN_LENGTH = 1.1774  # of two normal numbers
MIN_NOISE_PX = 0.03
CORRELATED_POINTS = 8.0  # neighbouring points have similar errors: so many count as one
DAMPING = 1e-9


@dataclass(frozen=True, slots=True)
class MotionModel:
    """How the points of a motion depend on it and on P errors of calibration, in the rectified view of the left camera.

    `before_px`, `after_px` (N, 2) and `disparity_px` (N,) are measured; the derivatives by the errors are `before_by`,
    `after_by` (N, 2, P) and `disparity_by` (N, P), and `scale_by` (N, P) those of the logarithm of disparities by the
    errors that change them in proportion. `region` (N,) numbers the parts of the
    image, in each run of images, that points are in.
    """

    K: Array
    focal_baseline: float
    before_px: Array
    after_px: Array
    disparity_px: Array
    before_by: Array
    after_by: Array
    disparity_by: Array
    scale_by: Array
    information: Array
    region: NDArray[np.int64]

    def expected(self, T_after_before: Array, errors: Array, inverse_depth: Array) -> Array:
        """The disparities before and the pixels after the motion (N, 3), for inverse depths (N,) in 1/m."""
        disparity_px = inverse_depth * self._disparity_by_depth(errors) + self.disparity_by @ errors
        moved = self._moved_rays(T_after_before, errors, inverse_depth)
        after_px = ((moved / moved[:, 2:]) @ self.K.T)[:, :2] + self.after_by @ errors
        expected: Array = np.c_[disparity_px, after_px]
        return expected

    def _disparity_by_depth(self, errors: Array) -> Array:
        """The derivatives (N,) of disparities by inverse depths."""
        by_depth: Array = self.focal_baseline * (1 + self.scale_by @ errors)
        return by_depth

    def _rays(self, errors: Array) -> Array:
        undisturbed_px = self.before_px - self.before_by @ errors
        homogeneous = np.c_[undisturbed_px, np.ones(len(undisturbed_px))]
        rays: Array = homogeneous @ np.linalg.inv(self.K).T
        return rays

    def _moved_rays(self, T_after_before: Array, errors: Array, inverse_depth: Array) -> Array:
        """The points (N, 3) after the motion, times their inverse depths before it."""
        rotated = self._rays(errors) @ T_after_before[:3, :3].T
        moved: Array = rotated + inverse_depth[:, None] * T_after_before[:3, 3]
        return moved

    def fitted_depths(self, T_after_before: Array, errors: Array) -> Array:
        """The inverse depths (N,) in 1/m that fit disparities and pixels best."""
        inverse_depth = self.disparity_px / self.focal_baseline
        measured = np.c_[self.disparity_px, self.after_px]
        for _ in range(DEPTH_STEPS):
            residual_px = measured - self.expected(T_after_before, errors, inverse_depth)
            by_depth = self._by_depth(T_after_before, errors, inverse_depth)
            squared_length = np.einsum("ni,ni->n", by_depth, by_depth)
            inverse_depth = inverse_depth + np.einsum("ni,ni->n", by_depth, residual_px) / squared_length
        return inverse_depth

    def linearized(self, T_after_before: Array, errors: Array) -> "Linearization":
        """Residuals and derivatives without those along the depth of each point, which is free."""
        inverse_depth = self.fitted_depths(T_after_before, errors)
        measured = np.c_[self.disparity_px, self.after_px]
        residual_px = measured - self.expected(T_after_before, errors, inverse_depth)
        by_depth = self._by_depth(T_after_before, errors, inverse_depth)
        jacobian = self._jacobian(T_after_before, errors, inverse_depth)
        direction = by_depth / np.linalg.norm(by_depth, axis=1, keepdims=True)
        residual_px = residual_px - direction * np.einsum("ni,ni->n", direction, residual_px)[:, None]
        jacobian = jacobian - direction[..., None] * np.einsum("ni,nij->nj", direction, jacobian)[:, None]
        return Linearization(residual_px, jacobian)

    def _by_point(self, moved: Array) -> Array:
        """The derivatives (N, 2, 3) of pixels by the points (N, 3) that they show."""
        focal_px = np.diag(self.K)[:2]
        slopes = moved[:, :2] / moved[:, 2:]
        identity = np.broadcast_to(np.eye(2), (len(moved), 2, 2))
        slopes_by_point = np.concatenate([identity, -slopes[..., None]], -1)
        by_point: Array = slopes_by_point * focal_px[:, None] / moved[:, 2, None, None]
        return by_point

    def _by_depth(self, T_after_before: Array, errors: Array, inverse_depth: Array) -> Array:
        """The derivatives (N, 3) of what is measured by inverse depths."""
        by_point = self._by_point(self._moved_rays(T_after_before, errors, inverse_depth))
        by_depth: Array = np.c_[self._disparity_by_depth(errors), by_point @ T_after_before[:3, 3]]
        return by_depth

    def _jacobian(self, T_after_before: Array, errors: Array, inverse_depth: Array) -> Array:
        """The derivatives (N, 3, 6 + P) of what is measured by the motion and by the errors."""
        R = T_after_before[:3, :3]
        rotated = self._rays(errors) @ R.T
        by_point = self._by_point(self._moved_rays(T_after_before, errors, inverse_depth))
        by_translation = inverse_depth[:, None, None] * by_point
        by_rotation = -by_point @ cross_matrix(rotated)
        by_before_px = by_point @ R[:, :2] / np.diag(self.K)[:2]
        after_by_errors = self.after_by - by_before_px @ self.before_by
        undisturbed_px = inverse_depth * self.focal_baseline
        disparity_by_errors = self.disparity_by + undisturbed_px[:, None] * self.scale_by

        disparity_by_motion = np.zeros((len(rotated), 6))
        of_disparity = np.concatenate([disparity_by_motion, disparity_by_errors], -1)
        of_pixels = np.concatenate([by_translation, by_rotation, after_by_errors], -1)
        return np.concatenate([of_disparity[:, None], of_pixels], 1)


@dataclass(frozen=True, slots=True)
class Linearization:
    """Residuals (N, 3) in px of points, and their derivatives (N, 3, 6 + P), both without the direction of depth."""

    residual_px: Array
    jacobian: Array

    def noise_px(self) -> float:
        """The standard deviation of residuals, robustly."""
        length_px = np.linalg.norm(self.residual_px, axis=1)
        return max(float(np.median(length_px)) / MEDIAN_LENGTH, MIN_NOISE_PX)

    def cauchy(self, noise_px: float) -> Array:
        """The Cauchy weights (N,) of residuals relative to their noise: 1 for a residual of 0."""
        length_px = np.linalg.norm(self.residual_px, axis=1)
        return cauchy_weights(length_px, noise_px)

    def normal_equations(self, weight: Array, information: Array, correction: Array) -> "NormalEquations":
        """The normal equations with weights (N,) in 1/px².

        `correction` (6,) is how far the motion is from its prior of some `information` (6, 6).
        """
        matrix = np.einsum("nij,n,nik->jk", self.jacobian, weight, self.jacobian, optimize=True)
        right_side = np.einsum("nij,n,ni->j", self.jacobian, weight, self.residual_px, optimize=True)
        matrix[MOTION, MOTION] += information
        right_side[MOTION] -= information @ correction
        return NormalEquations(matrix + DAMPING * np.eye(len(matrix)), right_side)

    def scores(self, weight: Array) -> Array:
        """What each point (N, 6 + P) adds to the right side of the normal equations."""
        scores: Array = np.einsum("nij,n,ni->nj", self.jacobian, weight, self.residual_px)
        return scores


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """Matrix (6 + P, 6 + P) and right side (6 + P,) of the unknowns of a motion and of those that are shared."""

    matrix: Array
    right_side: Array

    def without_motion(self) -> tuple[Array, Array]:
        """The matrix (P, P) and right side (P,) of the shared unknowns, by the Schur complement."""
        eliminated = np.linalg.solve(self.matrix[MOTION, MOTION], self.right_side[MOTION])
        shared_by_motion = self.matrix[SHARED, MOTION]
        matrix = self.matrix[SHARED, SHARED] - shared_by_motion @ self.motion_by_shared()
        right_side = self.right_side[SHARED] - shared_by_motion @ eliminated
        return matrix, right_side

    def motion_by_shared(self) -> Array:
        """The inverse of the motion's block times its coupling with the shared unknowns (6, P)."""
        return np.asarray(np.linalg.solve(self.matrix[MOTION, MOTION], self.matrix[MOTION, SHARED]), float)

    def motion_step(self, shared_step: Array) -> Array:
        """The step (6,) of the motion that belongs to a step (P,) of the shared unknowns."""
        right_side = self.right_side[MOTION] - self.matrix[MOTION, SHARED] @ shared_step
        return np.asarray(np.linalg.solve(self.matrix[MOTION, MOTION], right_side), float)


def moved(T: Array, step: Array) -> Array:
    """A motion (4, 4) changed by a translation and a rotation vector (6,)."""
    rotation = twist(step)[:3, :3] @ T[:3, :3]
    return se3.transform(rotation, T[:3, 3] + step[:3])
