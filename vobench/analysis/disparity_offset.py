"""Fits the offset of a stereo pair's disparities to points that are tracked through the motion of the camera."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.analysis.patch_refinement import AFFINE, refined
from vobench.analysis.stereo_matches import MARGIN_PX, WINDOW_PX, MatchedShot, PairShot
from vobench.estimator.pose import pose_from_points, twist
from vobench.estimator.stereo import StereoPair
from vobench.estimator.tracking import comparable, follow, inside
from vobench.geometry import se3
from vobench.geometry.se3 import Array

FRAMES_APART = 5  # between the two views of a motion
OFFSET_STEPS = 6

# Prior standard deviations of the parameters that all motions share, which hold those that motions do not determine:
# offset of disparity (px), scale of disparity, principal point (2, px) and focal length (ratio) of both cameras.
SHARED_SIGMA = np.array([1.0, 0.006, 3.0, 3.0, 0.005])
MAX_RELATIVE_SIGMA = 0.5  # of the prior: an offset that is less certain is not determined

# The first six unknowns of a motion's normal equations are its own translation and rotation, the others are shared.
MOTION = slice(0, 6)
SHARED = slice(6, None)


@dataclass(frozen=True, slots=True)
class FittedOffset:
    """The offset of disparities at the centre of the image, and its standard deviation, in px."""

    value_px: float
    sigma_px: float


@dataclass(frozen=True, slots=True)
class TrackedPoints:
    """Points seen at two times: pixels (N, 2) of the view before and after, disparities (N,) before, and the motion.

    `information` (6, 6) is the prior information of the motion's translation and rotation.
    """

    before_px: Array
    after_px: Array
    disparity_px: Array
    T_after_before: Array
    information: Array


@dataclass(frozen=True, slots=True)
class _NormalEquations:
    """Matrix (11, 11) and right side (11,) of the unknowns of a motion and of those that are shared."""

    matrix: Array
    right_side: Array

    def without_motion(self) -> tuple[Array, Array]:
        """The matrix (5, 5) and right side (5,) of the shared unknowns, by the Schur complement."""
        coupling = np.c_[self.matrix[MOTION, SHARED], self.right_side[MOTION]]
        eliminated = np.linalg.solve(self.matrix[MOTION, MOTION], coupling)
        shared_by_motion = self.matrix[SHARED, MOTION]
        matrix = self.matrix[SHARED, SHARED] - shared_by_motion @ eliminated[:, :-1]
        right_side = self.right_side[SHARED] - shared_by_motion @ eliminated[:, -1]
        return matrix, right_side

    def motion_step(self, shared_step: Array) -> Array:
        """The step (6,) of the motion that belongs to a step (5,) of the shared unknowns."""
        right_side = self.right_side[MOTION] - self.matrix[MOTION, SHARED] @ shared_step
        return np.asarray(np.linalg.solve(self.matrix[MOTION, MOTION], right_side), float)


def fit_offset(
    windows: Sequence[Sequence[MatchedShot]],
    pair: StereoPair,
    roll_pitch_rad: Array,
) -> FittedOffset | None:
    """Fit the offset of disparity that the right camera's yaw causes; None if the motion does not determine it.

    The image motion of a point gives its distance in units of the camera's motion. All motions and the errors of the
    cameras are fitted together. `roll_pitch_rad` is the right camera's rotation according to the rows.
    """
    all_tracks = _tracks(windows, pair)
    if not all_tracks:
        return None

    prior = np.diag(SHARED_SIGMA**-2)
    shared = np.zeros(len(SHARED_SIGMA))
    motions = [tracks.T_after_before for tracks in all_tracks]
    corrections = [np.zeros(6) for _ in all_tracks]  # of the motions, relative to their prior
    for _ in range(OFFSET_STEPS):
        equations = []
        for tracks, T_after_before, correction in zip(all_tracks, motions, corrections, strict=True):
            model = _Model(tracks, pair, roll_pitch_rad)
            equations.append(model.normal_equations(T_after_before, shared, correction))

        information = prior.copy()
        right_side = -prior @ shared
        for equation in equations:
            matrix_of_shared, side_of_shared = equation.without_motion()
            information += matrix_of_shared
            right_side += side_of_shared
        shared_step = np.asarray(np.linalg.solve(information, right_side), float)
        shared = shared + shared_step

        for index, equation in enumerate(equations):
            step = equation.motion_step(shared_step)
            motions[index] = _moved(motions[index], step)
            corrections[index] = corrections[index] + step

    sigma_px = float(np.linalg.inv(information)[0, 0]) ** 0.5
    is_determined = sigma_px < MAX_RELATIVE_SIGMA * SHARED_SIGMA[0]
    return FittedOffset(float(shared[0]), sigma_px) if is_determined else None


# --- The model of one motion ---

MOTION_DIFFERENCES = np.array([1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6])  # m and rad, for numerical derivatives
SHARED_DIFFERENCES = np.array([1e-3, 1e-5, 1e-3, 1e-3, 1e-6])
DEPTH_DIFFERENCE_PX = 1e-3  # of disparity
DEPTH_STEPS = 2
MEDIAN_LENGTH = 1.1774  # of two normal numbers
MIN_NOISE_PX = 0.03
CAUCHY_WIDTH = 2.4  # standard deviations at which a residual has half its weight
CORRELATED_POINTS = 8.0  # neighbouring points have similar errors: so many count as one


@dataclass(frozen=True, slots=True)
class _Model:
    """What the points of one motion should look like, given its unknowns."""

    tracks: TrackedPoints
    pair: StereoPair
    roll_pitch_rad: Array

    def measurements(self, T_after_before: Array, shared: Array, inverse_depth: Array) -> Array:
        """The disparities in the first frame and pixels in the second (N, 3), for inverse depths (N,) in 1/m."""
        offset_px = shared[0]
        disparity_scale = 1 + shared[1]
        K = self.pair.K.copy()
        K[:2, :2] *= 1 + shared[4]
        K[:2, 2] += shared[2:4]

        homogeneous = np.c_[self.tracks.before_px, np.ones(len(inverse_depth))]
        rays = homogeneous @ np.linalg.inv(K).T
        x = rays[:, 0] - self.tracks.disparity_px / K[0, 0]
        y = rays[:, 1]
        roll, pitch = self.roll_pitch_rad
        yaw_excess_px = offset_px * (1 + x * x)
        excess_px = yaw_excess_px - K[0, 0] * (roll * y + pitch * x * y)
        disparity_px = inverse_depth * self.pair.focal_baseline * disparity_scale + excess_px

        rotated = rays @ T_after_before[:3, :3].T
        points_after = rotated + inverse_depth[:, None] * T_after_before[:3, 3]
        after_px = ((points_after / points_after[:, 2:]) @ K.T)[:, :2]
        measurements: Array = np.c_[disparity_px, after_px]
        return measurements

    def normal_equations(self, T_after_before: Array, shared: Array, correction: Array) -> _NormalEquations:
        """Linearise around the unknowns, with Cauchy weights.

        The inverse depth of every point is free: its direction is projected out of residuals and derivatives.
        `correction` (6,) is how far the motion is from its prior.
        """
        inverse_depth, residual_px, by_depth = self._fit_depths(T_after_before, shared)
        residual_px -= by_depth * np.einsum("ni,ni->n", by_depth, residual_px)[:, None]
        weight = _cauchy_weights(residual_px)
        jacobian = self._jacobian(T_after_before, shared, inverse_depth)
        jacobian -= by_depth[..., None] * np.einsum("ni,nij->nj", by_depth, jacobian)[:, None]

        matrix = np.einsum("nij,n,nik->jk", jacobian, weight, jacobian)
        right_side = np.einsum("nij,n,ni->j", jacobian, weight, residual_px)
        matrix[MOTION, MOTION] += self.tracks.information
        right_side[MOTION] -= self.tracks.information @ correction
        return _NormalEquations(matrix + 1e-9 * np.eye(len(matrix)), right_side)

    def _fit_depths(self, T_after_before: Array, shared: Array) -> tuple[Array, Array, Array]:
        """Inverse depths (N,), the residuals (N, 3) in px before the last step, and its unit direction (N, 3)."""
        measured = np.c_[self.tracks.disparity_px, self.tracks.after_px]
        inverse_depth = self.tracks.disparity_px / self.pair.focal_baseline
        difference = DEPTH_DIFFERENCE_PX / self.pair.focal_baseline
        for _ in range(DEPTH_STEPS):
            expected = self.measurements(T_after_before, shared, inverse_depth)
            changed = self.measurements(T_after_before, shared, inverse_depth + difference)
            derivative = (changed - expected) / difference
            residual_px = measured - expected
            squared_length = np.einsum("ni,ni->n", derivative, derivative)
            inverse_depth = inverse_depth + np.einsum("ni,ni->n", derivative, residual_px) / squared_length
        length = np.linalg.norm(derivative, axis=1, keepdims=True)
        return inverse_depth, residual_px, derivative / length

    def _jacobian(self, T_after_before: Array, shared: Array, inverse_depth: Array) -> Array:
        """Derivatives (N, 3, 11) by the motion and by the shared unknowns."""
        expected = self.measurements(T_after_before, shared, inverse_depth)
        columns = []
        for difference in np.diag(MOTION_DIFFERENCES):
            changed = self.measurements(_moved(T_after_before, difference), shared, inverse_depth)
            columns.append((changed - expected) / difference.sum())
        for difference in np.diag(SHARED_DIFFERENCES):
            changed = self.measurements(T_after_before, shared + difference, inverse_depth)
            columns.append((changed - expected) / difference.sum())
        return np.stack(columns, -1)


def _cauchy_weights(residual_px: Array) -> Array:
    """Weights (N,) in 1/px² of residuals (N, 3) that have two degrees of freedom."""
    length_px = np.linalg.norm(residual_px, axis=1)
    noise_px = max(float(np.median(length_px)) / MEDIAN_LENGTH, MIN_NOISE_PX)
    relative_length = length_px / (CAUCHY_WIDTH * noise_px)
    variance_px2 = CORRELATED_POINTS * noise_px**2
    weight: Array = 1 / (1 + relative_length**2) / variance_px2
    return weight


def _moved(T: Array, step: Array) -> Array:
    """A motion (4, 4) changed by a translation and a rotation vector (6,)."""
    rotation = twist(step)[:3, :3] @ T[:3, :3]
    return se3.transform(rotation, T[:3, 3] + step[:3])


# --- Tracks ---

MIN_TRACKED = 40
MIN_FLOW_PX = 2.0
RANSAC_PX = 3.0

# Standard deviations of true motions, of laser trackers and of cars.
TRUTH_SIGMA_M = 3e-4
TRUTH_RELATIVE_SIGMA = 2e-3  # of the length
TRUTH_SIGMA_RAD = 5e-4


def _tracks(windows: Sequence[Sequence[MatchedShot]], pair: StereoPair) -> list[TrackedPoints]:
    """The tracked points of all motions over FRAMES_APART frames."""
    all_tracks = []
    for window in windows:
        for first in range(len(window) - FRAMES_APART):
            tracks = _track(window[first : first + FRAMES_APART + 1], pair)
            if tracks:
                all_tracks.append(tracks)
    return all_tracks


def _track(shots: Sequence[MatchedShot], pair: StereoPair) -> TrackedPoints | None:
    """The points of the first of successive shots in the last that has enough of them; None if none has."""
    first = shots[0].shot
    last = first
    before_px = shots[0].left_px
    after_px = before_px
    disparity_px = shots[0].disparity_px
    for later in shots[1:]:
        now = later.shot
        last_image, image = comparable(last.left, now.left)
        followed_px, is_followed = follow(last_image, image, after_px, window_px=WINDOW_PX)
        is_followed &= inside(followed_px, now.left, MARGIN_PX) & pair.seen(followed_px)
        if is_followed.sum() < MIN_TRACKED:
            break
        before_px = before_px[is_followed]
        after_px = followed_px[is_followed]
        disparity_px = disparity_px[is_followed]
        last = now
    if last is first:
        return None

    after_px, has_converged = refined(first.left, last.left, before_px, after_px, shape=AFFINE)
    if has_converged.sum() < MIN_TRACKED:
        return None
    before_px = before_px[has_converged]
    after_px = after_px[has_converged]
    disparity_px = disparity_px[has_converged]

    before_view_px = pair.left.in_view(before_px)
    after_view_px = pair.left.in_view(after_px)
    points_m = pair.points(before_px, disparity_px)
    fit = pose_from_points(points_m, after_view_px, pair.K, ransac_px=RANSAC_PX)
    flow_px = np.linalg.norm(after_view_px - before_view_px, axis=1)
    if fit is None or float(np.median(flow_px)) < MIN_FLOW_PX:
        return None

    T_true = _true_motion(first, last, pair)
    return TrackedPoints(
        before_px=before_view_px[fit.inlier],
        after_px=after_view_px[fit.inlier],
        disparity_px=disparity_px[fit.inlier],
        T_after_before=fit.T_now_last if T_true is None else T_true,
        information=np.zeros((6, 6)) if T_true is None else _true_information(T_true),
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


def _true_information(T_after_before: Array) -> Array:
    """The information (6, 6) of a true motion."""
    length_m = float(np.linalg.norm(T_after_before[:3, 3]))
    sigma_m = TRUTH_SIGMA_M + TRUTH_RELATIVE_SIGMA * length_m
    return np.diag(np.repeat([sigma_m**-2, TRUTH_SIGMA_RAD**-2], 3))
