"""Estimates the common error of all disparities of a stereo pair from tracks between keyframes.

R, t       T_now_last: a point X in the frame of the last view is R X + t in the frame of the current view
rays       (N, 3) with z = 1 in the frame of a view
disparity  in px; the inverse depth is disparity / (K[0, 0] baseline)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.pose import (
    MIN_POINTS,
    cauchy_weights,
    cross_matrix,
    normal_equations,
    robust_noise_px,
    twist,
)
from vobench.estimator.stereo import StereoPair
from vobench.geometry import se3
from vobench.geometry.se3 import Array

OFFSET_PRIOR_PX = 0.3  # standard deviation of the prior
# An offset is applied if it exceeds both limits: one in standard deviations, one in px.
APPLIED_SIGMAS = 3.0
LEAST_APPLIED_PX = 0.15
FIT_STEPS = 5
# The noise of a disparity: relative to the noise of a track, and its minimum.
NOISE_RATIO = 2.0
LEAST_NOISE_PX = 0.1
MOST_BIAS_PX = 0.05
CORRELATED = 8.0  # the number of neighbouring tracks that count as one, because their errors are correlated
# Cells of the view. All tracks of one may have the same error in every view, such as those on the edge of one object.
CELL_COLUMNS = 4
CELL_ROWS = 2
CELLS = CELL_COLUMNS * CELL_ROWS
# Parameters of the fit.
MOTION = slice(0, 6)
OFFSET = 6


@dataclass(frozen=True, slots=True)
class DisparityOffset:
    """The estimated offset of all disparities of a pair, updated with each pair of views. Its prior is 0.

    `information` is the sum of the information of all fits (1/px²), and `weighted` that of information times offset
    (1/px). `information_without` and `weighted_without` (CELLS,) are the same sums without the tracks of one cell.
    """

    information: float = 1 / OFFSET_PRIOR_PX**2
    weighted: float = 0.0
    information_without: tuple[float, ...] = (1 / OFFSET_PRIOR_PX**2,) * CELLS
    weighted_without: tuple[float, ...] = (0.0,) * CELLS

    @property
    def estimate_px(self) -> float:
        """The estimate of the offset in px."""
        return self.weighted / self.information

    @property
    def px(self) -> float:
        """The offset to subtract from every disparity: 0 until the estimate is large and certain enough."""
        threshold_px = max(APPLIED_SIGMAS * self.sigma_px, LEAST_APPLIED_PX)
        return self.estimate_px if abs(self.estimate_px) > threshold_px else 0.0

    @property
    def sigma_px(self) -> float:
        """The standard deviation of the estimate in px: that of its information, or the jackknife's if it is larger.

        The view hardly changes between successive fits, and errors of stereo at an object repeat with it. Estimates
        without one cell of the view show them, as they differ: the jackknife with groups.
        Source: Efron and Tibshirani (1993), chapter 11.
        """
        estimates_px = np.divide(self.weighted_without, self.information_without)  # (CELLS,)
        jackknife_px = float(np.sqrt((CELLS - 1) * estimates_px.var()))
        of_information_px: float = self.information**-0.5
        return max(of_information_px, jackknife_px)

    def after(
        self, rays0: Array, rays1: Array, disparity_px: Array, T_now_last: Array, pair: StereoPair
    ) -> "DisparityOffset":
        """The estimate after another pair of views.

        Tracks are given by their rays (N, 3) in the last and in the current view, and by their disparities (N,) in the
        last view, NaN if unknown. The motion between the views is refined together with the offset.
        """
        has_rays = np.isfinite(rays0).all(1) & np.isfinite(rays1).all(1)
        known = np.isfinite(disparity_px) & has_rays
        if known.sum() < MIN_POINTS:
            return self
        tracks = _Tracks(rays0[known], rays1[known], disparity_px[known], pair)
        fit = tracks.fitted_offset(T_now_last, self.estimate_px)
        if fit is None:
            return self
        information_without = np.add(self.information_without, fit.information_without)
        weighted_without = np.add(self.weighted_without, fit.information_without * fit.offset_without_px)
        return DisparityOffset(
            information=self.information + fit.information,
            weighted=self.weighted + fit.information * fit.offset_px,
            information_without=tuple(information_without.tolist()),
            weighted_without=tuple(weighted_without.tolist()),
        )


@dataclass(frozen=True, slots=True)
class _OffsetFit:
    """The offset that fits the tracks of two views in px, and its information in 1/px².

    The arrays (CELLS,) are the same without the tracks of one cell.
    """

    offset_px: float
    information: float
    offset_without_px: Array
    information_without: Array


@dataclass(frozen=True, slots=True)
class _Linearization:
    """The residuals (N, 2) in px of tracks at a motion and an offset, with their weights and derivatives.

    `by_point` (N, 2, 3) are the derivatives with respect to the moved point, and `jacobian` (N, 2, 7) those with
    respect to translation, rotation and offset.
    """

    residual_px: Array
    noise_px: float
    weight: Array
    by_point: Array
    jacobian: Array


@dataclass(frozen=True, slots=True)
class _Tracks:
    rays0: Array
    rays1: Array
    disparity_px: Array
    pair: StereoPair

    def fitted_offset(self, T: Array, offset_px: float) -> _OffsetFit | None:
        """The offset that fits the tracks, after the motion is eliminated.

        A point with ray x0 and disparity d moves to R x0 + t (d - o) / (f b). The offset o, t and R are fitted by
        least squares with Cauchy weights. None if the depths vary hardly more than their noise.
        """
        for _ in range(FIT_STEPS):
            fit = self._linearized(T, offset_px)
            information, gradient = normal_equations(fit.jacobian, fit.weight, fit.residual_px)
            step = np.linalg.solve(information, gradient).astype(float)
            R_step = twist(step[MOTION])[:3, :3]
            T = se3.transform(R_step @ T[:3, :3], T[:3, 3] + step[:3])
            offset_px += float(step[OFFSET])

        bias_px = self._bias_px(fit, information, T[:3, 3])
        if not abs(bias_px) < MOST_BIAS_PX:
            return None
        unit = 1 / (CORRELATED * fit.noise_px**2)
        marginal = unit * _marginal_information(information)
        if not np.isfinite(offset_px) or marginal <= 0:
            return None

        # One step of Gauss-Newton without the tracks of each cell, from the fit to all tracks.
        step_without_px = np.zeros(CELLS)
        marginal_without = np.full(CELLS, marginal)
        fit = self._linearized(T, offset_px)
        cell = self._cell()
        for k in np.unique(cell):
            others = cell != k
            if others.sum() < MIN_POINTS:
                marginal_without[k] = 0.0
                continue
            information, gradient = normal_equations(fit.jacobian[others], fit.weight[others], fit.residual_px[others])
            marginal_without[k] = max(unit * _marginal_information(information), 0.0)
            step, *_ = np.linalg.lstsq(information, gradient)  # without a cell the depths may be equal
            step_without_px[k] = step[OFFSET]
        return _OffsetFit(offset_px - bias_px, marginal, offset_px - bias_px + step_without_px, marginal_without)

    def _cell(self) -> NDArray[np.intp]:
        """The cell (N,) of the view that each track starts in."""
        pixels = (self.rays0 @ self.pair.K.T)[:, :2]
        size_px = 2 * self.pair.K[:2, 2]  # about, as the principal point is near the middle
        column, row = np.floor(pixels / size_px * [CELL_COLUMNS, CELL_ROWS]).astype(np.intp).T
        in_row = np.clip(column, 0, CELL_COLUMNS - 1)
        first_of_row = CELL_COLUMNS * np.clip(row, 0, CELL_ROWS - 1)
        cell: NDArray[np.intp] = first_of_row + in_row
        return cell

    def _linearized(self, T: Array, offset_px: float) -> _Linearization:
        focal_px = np.diag(self.pair.K)[:2]  # (2,), horizontal and vertical
        rho_per_px = 1 / self.pair.focal_baseline
        rho = (self.disparity_px - offset_px) * rho_per_px
        turned = self.rays0 @ T[:3, :3].T
        moved = turned + rho[:, None] * T[:3, 3]  # points (N, 3) now, times rho
        slopes = moved[:, :2] / moved[:, 2:]
        residual_px = (self.rays1[:, :2] - slopes) * focal_px
        noise_px = robust_noise_px(residual_px)

        identity = np.broadcast_to(np.eye(2), (len(rho), 2, 2))
        slopes_by_point = np.concatenate([identity, -slopes[..., None]], -1)
        by_point = slopes_by_point * focal_px[:, None] / moved[:, 2, None, None]
        by_translation = rho[:, None, None] * by_point
        by_rotation = -by_point @ cross_matrix(turned)
        by_offset = -rho_per_px * by_point @ T[:3, 3]
        jacobian = np.concatenate([by_translation, by_rotation, by_offset[..., None]], -1)
        return _Linearization(residual_px, noise_px, cauchy_weights(residual_px, noise_px), by_point, jacobian)

    def _bias_px(self, fit: _Linearization, information: Array, t_m: Array) -> float:
        """The expected error of the offset. Noise of the depths biases t, and thereby the offset, towards 0.

        This is the bias of a regression with errors in variables.
        """
        noise_rho = max(NOISE_RATIO * fit.noise_px, LEAST_NOISE_PX) * (1 / self.pair.focal_baseline)
        weighted = np.einsum("nij,ni,nik->jk", fit.by_point, fit.weight, fit.by_point)
        pull_on_t = noise_rho**2 * weighted @ t_m
        pull = np.r_[pull_on_t, np.zeros(4)]
        return -float(np.linalg.solve(information, pull)[OFFSET])


def _marginal_information(information: Array) -> float:
    """The information of the offset after the motion is eliminated."""
    of_motion = np.linalg.solve(information[MOTION, MOTION], information[MOTION, OFFSET])
    return float(information[OFFSET, OFFSET] - information[OFFSET, MOTION] @ of_motion)
