"""Fits the errors of a stereo pair's calibration to row errors and to tracks through the motions of the camera.

All motions and the errors are fitted together, by robust least squares. Neighbouring matches, and those of one object
in successive images, have similar errors. Standard deviations therefore follow from the sums of scores over regions of
the image in each run of images, of which near ones are correlated.
Source: Liang and Zeger (1986), the sandwich estimator; Conley (1999), spatial correlation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from vobench.analysis.pair_parameter import (
    LENS_TERMS,
    PARAMETERS,
    PairParameter,
    left_derivatives,
    pair_derivatives,
    parameters_of,
)
from vobench.analysis.robust_sigma import robust_sigma
from vobench.analysis.stereo_matches import RowMatches
from vobench.analysis.tracked_motion import (
    CORRELATED_POINTS,
    MOTION,
    SHARED,
    Linearization,
    MotionModel,
    NormalEquations,
    TrackedPoints,
    moved,
)
from vobench.estimator.pose import cauchy_weights
from vobench.estimator.stereo import MIN_DISPARITY_PX, StereoPair, shifted_left
from vobench.geometry.se3 import Array

FIT_STEPS = 8
CONVERGED = 1e-4  # of the standard deviations of priors
MIN_ROW_NOISE_PX = 0.03
REGION_COLUMNS = 6  # of the image
REGION_ROWS = 4
REGIONS = REGION_COLUMNS * REGION_ROWS
CORRELATION_COLUMNS = 4  # the distance at which the errors of two regions are no longer correlated
CORRELATION_ROWS = 4
# The degrees of freedom of variances are the number of runs, at least these. Residuals of few runs are too small, as
# the fit follows them: benchmarks/pair_calibration.py shows that intervals hold so.
MIN_FREEDOM = 2
MIN_REGIONS = 4
TINY = 1e-12  # prevents 1/0
COVERED = 0.975  # the quantile of a two-sided interval of 95 %

# Errors of matching that are equal in all images, such as those of patches at depth edges.
ROW_BIAS_PX = 0.01
DISPARITY_BIAS_PX = 0.02
BIAS_GRID = 9  # places along each side of the image

TWIST_PLACES = np.array([[-1, -1], [1, 1], [-1, 1], [1, -1]])  # the mixed second difference of rows is that of xy
TWIST_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])
TWIST_STEP = 0.1  # of x and y


@dataclass(frozen=True, slots=True)
class PairCalibration:
    """The fitted errors (P,) in standard deviations of their priors, with their covariance (P, P).

    The covariance is such that intervals of 1.96 standard deviations cover 95 %.
    """

    parameters: tuple[PairParameter, ...]
    errors: Array
    covariance: Array
    pair: StereoPair

    @property
    def right_names(self) -> tuple[str, ...]:
        """The names of the errors of the right camera."""
        return tuple(parameter.name for parameter in self.parameters if not parameter.is_common)

    def value(self, name: str) -> tuple[float, float]:
        """The value and the standard deviation of an error; 0 and 0 of one that was not fitted."""
        for index, parameter in enumerate(self.parameters):
            if parameter.name == name:
                sigma = float(self.covariance[index, index]) ** 0.5
                return parameter.sigma * float(self.errors[index]), parameter.sigma * sigma
        return 0.0, 0.0

    def drawn(self, rng: np.random.Generator) -> "PairCalibration":
        """The calibration with errors that are drawn from the distribution of the fitted ones."""
        return replace(self, errors=rng.multivariate_normal(self.errors, self.covariance))

    def disparity_error(self, right_px: Array) -> tuple[Array, Array]:
        """The errors (N,) of disparities that the right camera causes at its pixels (N, 2), and their deviations."""
        return self._field(right_px, axis=0, sign=-1.0)

    def row_error(self, right_px: Array) -> tuple[Array, Array]:
        """The row errors (N,) that the right camera causes at its pixels (N, 2), and their standard deviations."""
        return self._field(right_px, axis=1, sign=1.0)

    def row_twist(self) -> tuple[float, float]:
        """The coefficient of xy in row errors in px, and its standard deviation; x and y are over the focal length."""
        K = self.pair.K
        places_px = K[:2, 2] + TWIST_STEP * TWIST_PLACES * np.diag(K)[:2]
        derivatives = self._derivatives(self.pair.right.from_view(places_px), axis=1)
        direction = TWIST_SIGNS @ derivatives / (4 * TWIST_STEP**2)
        return float(direction @ self.errors), float(direction @ self.covariance @ direction) ** 0.5

    def _field(self, right_px: Array, *, axis: int, sign: float) -> tuple[Array, Array]:
        derivatives = sign * self._derivatives(right_px, axis=axis)
        variance = np.einsum("np,pq,nq->n", derivatives, self.covariance, derivatives)
        return derivatives @ self.errors, np.sqrt(variance)

    def _derivatives(self, right_px: Array, *, axis: int) -> Array:
        """The derivatives (N, P) of columns (axis 0) or rows (1) of the right view by the errors of its camera."""
        derivatives = pair_derivatives(self.parameters, self.pair, right_px, right_px).right_px[:, axis]
        is_common = np.array([parameter.is_common for parameter in self.parameters])
        return np.where(is_common, 0.0, derivatives)

    def wald_p_value(self, names: Sequence[str]) -> float:
        """The p-value of the hypothesis that these errors are all 0."""
        chosen = [index for index, parameter in enumerate(self.parameters) if parameter.name in names]
        errors = self.errors[chosen]
        covariance = self.covariance[np.ix_(chosen, chosen)]
        squared_distance = float(errors @ np.linalg.solve(covariance, errors))
        return float(stats.chi2.sf(squared_distance, len(chosen)))


MAX_OFFSET_SIGMA_PX = 0.3  # an offset of disparities that is less certain is not determined
LENS_P_VALUE = 1e-3


@dataclass(frozen=True, slots=True)
class CalibratedPair:
    """The calibration by the simplest model that explains the matches.

    `with_lens_terms` is always that with errors of the right lens. `has_lens_error` tells whether rotations and the
    focal length are not sufficient. `is_offset_determined` tells whether the motion determines the offset of
    disparities without the assumption that the lenses are right.
    """

    calibration: PairCalibration
    with_lens_terms: PairCalibration
    has_lens_error: bool
    is_offset_determined: bool


def calibrate(rows: RowMatches, motions: Sequence[TrackedPoints], pair: StereoPair) -> CalibratedPair | None:
    """Fit the errors of a pair, with those of the right lens only if rotations do not explain rows and motion.

    None if the matches are in too few regions to tell how certain the errors are.
    """
    with_lens = fit_calibration(rows, motions, pair, with_lens_terms=True)
    without = fit_calibration(rows, motions, pair, with_lens_terms=False)
    if with_lens is None or without is None:
        return None
    _, sigma_px = with_lens.disparity_error(center_px(pair))
    has_lens_error = with_lens.wald_p_value(LENS_TERMS) < LENS_P_VALUE
    return CalibratedPair(
        calibration=with_lens if has_lens_error else without,
        with_lens_terms=with_lens,
        has_lens_error=has_lens_error,
        is_offset_determined=float(sigma_px[0]) < MAX_OFFSET_SIGMA_PX,
    )


def center_px(pair: StereoPair) -> Array:
    """The pixel (1, 2) of the right camera at the principal point of its view."""
    return pair.right.from_view(pair.K[None, :2, 2])


def fit_calibration(
    rows: RowMatches,
    motions: Sequence[TrackedPoints],
    pair: StereoPair,
    *,
    with_lens_terms: bool,
) -> PairCalibration | None:
    """Fit the errors of a pair. None if the matches are in too few regions to tell how certain they are."""
    parameters = parameters_of(pair, with_lens_terms=with_lens_terms)
    return _JointFit(parameters, rows, motions, pair).solve()


class _JointFit:
    """The row errors and the models of all motions, with the current estimates."""

    def __init__(
        self,
        parameters: tuple[PairParameter, ...],
        rows: RowMatches,
        motions: Sequence[TrackedPoints],
        pair: StereoPair,
    ) -> None:
        assert parameters[0] is PARAMETERS[0], "the first error is that of the baseline"
        self._parameters = parameters
        self._pair = pair
        # At the row of the left image, since the noise of a row must not be explained by derivatives at that row.
        same_row_px = _at_left_row(rows.left_px, rows.right_px, pair)
        row_by = pair_derivatives(parameters, pair, rows.left_px, same_row_px).row_px
        is_known = np.isfinite(row_by).all(1)
        self._row_px = rows.row_px[is_known]
        self._row_by = row_by[is_known]
        self._row_region = _regions(rows.left_px, rows.window, pair)[is_known]
        self._models = [_model(parameters, tracks, pair) for tracks in motions]
        self._T = [tracks.T_after_before for tracks in motions]
        self._corrections = [np.zeros(6) for _ in motions]  # of the motions, relative to their prior
        self._errors = np.zeros(len(parameters))

    def solve(self) -> PairCalibration | None:
        """The fitted errors and their covariance."""
        regions = np.unique(np.concatenate([self._row_region, *[model.region for model in self._models]]))
        if len(regions) < MIN_REGIONS:
            return None
        for _ in range(FIT_STEPS):
            if self._step() < CONVERGED:
                break
        return PairCalibration(self._parameters, self._errors, self._covariance(regions), self._pair)

    def _step(self) -> float:
        """Take a step of Gauss-Newton, and return its largest component."""
        information, right_side = self._row_equations()
        information += np.eye(len(self._errors))  # the prior
        right_side -= self._errors
        all_equations = []
        for index, model in enumerate(self._models):
            fit = model.linearized(self._T[index], self._errors)
            noise_px = fit.noise_px()
            weight = fit.cauchy(noise_px) / (CORRELATED_POINTS * noise_px**2)
            equations = fit.normal_equations(weight, model.information, self._corrections[index])
            matrix_of_shared, side_of_shared = equations.without_motion()
            information += matrix_of_shared
            right_side += side_of_shared
            all_equations.append(equations)

        step = np.asarray(np.linalg.solve(information, right_side), float)
        self._errors = self._errors + step
        for index, equations in enumerate(all_equations):
            motion_step = equations.motion_step(step)
            self._T[index] = moved(self._T[index], motion_step)
            self._corrections[index] = self._corrections[index] + motion_step
        return float(np.abs(step).max())

    # --- Rows ---

    def _row_residuals(self) -> tuple[Array, Array, float]:
        """The residuals (N,) of row errors in px, their Cauchy weights, and their variance in px²."""
        residual_px = self._row_px - self._row_by @ self._errors
        noise_px = max(robust_sigma(residual_px), MIN_ROW_NOISE_PX)
        weight = cauchy_weights(residual_px, noise_px)
        return residual_px, weight, CORRELATED_POINTS * noise_px**2

    def _row_equations(self) -> tuple[Array, Array]:
        residual_px, weight, variance_px2 = self._row_residuals()
        weighted = self._row_by.T * (weight / variance_px2)
        return weighted @ self._row_by, weighted @ residual_px

    # --- The covariance ---

    def _covariance(self, regions: NDArray[np.int64]) -> Array:
        """The covariance (P, P) of the errors at the solution, by the sandwich estimator."""
        size = len(self._errors)
        prior = np.eye(size)
        curvature, scores = self._row_curvature_and_scores()
        curvature += prior
        run_count = int(regions.max()) // REGIONS + 1
        sums = np.zeros((run_count * REGIONS, size))
        np.add.at(sums, self._row_region, scores)
        of_truth = np.zeros((size, size))
        for index, model in enumerate(self._models):
            fit = model.linearized(self._T[index], self._errors)
            equations, scores = _curvature_and_scores(fit, model.information)
            curvature += equations.without_motion()[0]
            motion_by_shared = equations.motion_by_shared()
            np.add.at(sums, model.region, scores[:, SHARED] - scores[:, MOTION] @ motion_by_shared)
            of_truth += motion_by_shared.T @ model.information @ motion_by_shared

        by_run = sums.reshape(run_count, REGIONS, size)
        of_scores = np.einsum("wip,ij,wjq->pq", by_run, _region_correlation(), by_run)
        freedom = max(run_count, MIN_FREEDOM)
        # Few runs make the variance of scores uncertain, but not that of the prior and of the true motions.
        few_runs = stats.t.ppf(COVERED, freedom) / stats.norm.ppf(COVERED)
        spread = of_scores * few_runs**2 + prior + of_truth
        inverse_curvature = np.linalg.inv(curvature)
        total: Array = inverse_curvature @ spread @ inverse_curvature.T + self._bias_covariance()
        return total

    def _row_curvature_and_scores(self) -> tuple[Array, Array]:
        """The second derivatives (P, P) of the loss of row errors, and the scores (N, P) of matches."""
        residual_px, weight, variance_px2 = self._row_residuals()
        # The derivative of residual times Cauchy's weight.
        slope = weight**2 * (2 - 1 / weight)
        curvature = (self._row_by.T * (slope / variance_px2)) @ self._row_by
        scores = self._row_by * (weight * residual_px / variance_px2)[:, None]
        return curvature, scores

    def _bias_covariance(self) -> Array:
        """The covariance (P, P) that errors of matching cause which are equal in all images.

        Each error of the right camera is uncertain by as much as shifts rows and disparities by these errors.
        """
        camera = self._pair.right.camera
        columns = np.linspace(0, camera.width_px - 1, BIAS_GRID)
        rows = np.linspace(0, camera.height_px - 1, BIAS_GRID)
        grid_px = np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2)
        derivatives = pair_derivatives(self._parameters, self._pair, grid_px, grid_px).right_px
        mean_squares = np.nanmean(derivatives**2, axis=0)  # (2, P)
        information = mean_squares[0] / DISPARITY_BIAS_PX**2 + mean_squares[1] / ROW_BIAS_PX**2
        is_common = np.array([parameter.is_common for parameter in self._parameters])
        return np.diag(np.where(is_common, 0.0, 1 / np.maximum(information, TINY)))


def _curvature_and_scores(fit: Linearization, information: Array) -> tuple[NormalEquations, Array]:
    """The second derivatives of a motion's loss as normal equations, and the scores (N, 6 + P) of its points."""
    noise_px = fit.noise_px()
    variance_px2 = CORRELATED_POINTS * noise_px**2
    weight = fit.cauchy(noise_px)
    # The mean derivative, over all directions in the plane, of a residual times its Cauchy weight is the weight's
    # square.
    equations = fit.normal_equations(weight**2 / variance_px2, information, np.zeros(6))
    return equations, fit.scores(weight / variance_px2)


def _model(parameters: tuple[PairParameter, ...], tracks: TrackedPoints, pair: StereoPair) -> MotionModel:
    """The model of a motion.

    Derivatives are those at the pixels that the motion and the fitted depths predict: derivatives at the measured
    pixels would have the noise of these, and so explain it.
    """
    left_px = np.asarray(tracks.left_px, float)
    nothing = np.zeros((*left_px.shape, 1))
    window = np.full(len(left_px), tracks.window)
    model = MotionModel(
        K=pair.K,
        focal_baseline=pair.focal_baseline,
        before_px=pair.left.in_view(left_px),
        after_px=pair.left.in_view(tracks.after_px),
        disparity_px=tracks.disparity_px,
        before_by=nothing,
        after_by=nothing,
        disparity_by=nothing[:, 0],
        scale_by=nothing[:, 0],
        information=tracks.information,
        region=_regions(left_px, window, pair),
    )
    no_error = np.zeros(1)
    depths = model.fitted_depths(tracks.T_after_before, no_error)
    expected_px = model.expected(tracks.T_after_before, no_error, depths)
    disparity_px = np.maximum(expected_px[:, 0], MIN_DISPARITY_PX)
    right_px = pair.right.from_view(shifted_left(model.before_px, disparity_px))
    before = pair_derivatives(parameters, pair, left_px, right_px)
    is_common = np.array([parameter.is_common for parameter in parameters])
    scale_by = np.where(is_common, before.disparity_px / disparity_px[:, None], 0.0)
    scale_by[:, 0] = parameters[0].sigma  # of the baseline
    after_by = left_derivatives(parameters, pair, pair.left.from_view(expected_px[:, 1:]))
    is_known = np.isfinite(after_by).all((1, 2)) & np.isfinite(before.left_px).all((1, 2))
    is_known &= np.isfinite(before.disparity_px).all(1)
    return replace(
        model,
        before_px=model.before_px[is_known],
        after_px=model.after_px[is_known],
        disparity_px=model.disparity_px[is_known],
        before_by=before.left_px[is_known],
        after_by=after_by[is_known],
        disparity_by=np.where(is_common, 0.0, before.disparity_px)[is_known],
        scale_by=scale_by[is_known],
        region=model.region[is_known],
    )


def _region_correlation() -> Array:
    """The correlations (R, R) of the errors of regions that are assumed: Bartlett's window of their distance."""
    column = np.arange(REGIONS) % REGION_COLUMNS
    row = np.arange(REGIONS) // REGION_COLUMNS
    columns_apart = np.abs(column[:, None] - column)
    rows_apart = np.abs(row[:, None] - row)
    along = np.clip(1 - columns_apart / CORRELATION_COLUMNS, 0, None)
    across = np.clip(1 - rows_apart / CORRELATION_ROWS, 0, None)
    correlation: Array = along * across
    return correlation


def _at_left_row(left_px: Array, right_px: Array, pair: StereoPair) -> Array:
    """The right pixels (N, 2) of matches, moved to the row of the left pixels in the rectified views."""
    left_view_px = pair.left.in_view(left_px)
    right_view_px = pair.right.in_view(right_px)
    return pair.right.from_view(np.stack([right_view_px[:, 0], left_view_px[:, 1]], -1))


def _regions(left_px: Array, window: NDArray[np.int64], pair: StereoPair) -> NDArray[np.int64]:
    """The number (N,) of the region of the image and of the run of images in which matches (N, 2) are."""
    camera = pair.left.camera
    shares = np.asarray(left_px, float) / [camera.width_px, camera.height_px]
    column, row = (shares * [REGION_COLUMNS, REGION_ROWS]).astype(np.int64).T
    region = np.clip(column, 0, REGION_COLUMNS - 1) + REGION_COLUMNS * np.clip(row, 0, REGION_ROWS - 1)
    numbers: NDArray[np.int64] = region + REGIONS * window
    return numbers
