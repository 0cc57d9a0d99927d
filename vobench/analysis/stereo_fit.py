"""Estimates the errors of a stereo pair's calibration from the rows and the disparities of matches.

x, y      the position of a match in the right view divided by the focal length; fx, fy are that of both views
rotated   by roll r to the right, pitch p upwards and yaw w to the right (the signs of `CalibrationError`), the right
          camera sees a point lower by fy (p (1 + y²) - r x - w x y) and further left by fx (w (1 + x²) - r y - p x y)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.analysis.disparity_offset import fit_offset
from vobench.analysis.stereo_matches import Matches, PairShot, all_matches, gain_of, match_shots, row_errors
from vobench.estimator.stereo import StereoPair
from vobench.geometry.se3 import Array

MIN_MATCHES = 50  # for a fit of five coefficients
ROW_SHOT_STEP = 3  # row errors are measured in every third shot
PLAIN_SIGMAS = 3.0
MAX_YAW_FROM_ROWS_DEG = 0.3  # larger values are due to the lens
DISPARITY_QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True, slots=True)
class Uncertain:
    """A value and its standard deviation."""

    value: float
    sigma: float

    @property
    def is_plain(self) -> bool:
        """Whether the value differs from 0 by more than 3 standard deviations."""
        return abs(self.value) > PLAIN_SIGMAS * self.sigma


@dataclass(frozen=True, slots=True)
class StereoFit:
    """The errors of a stereo pair relative to its nominal calibration: the right camera's rotation, rows and gain.

    `row_mad_px` is the spread of row errors as they are, `row_noise_px` that around the fit a + b x + c y + d xy + e y²
    with these `coefficients`. Roll follows from b, pitch from a, and `xy_px` is d. `yaw_deg` follows from rows and
    motion if they agree, and otherwise only from `yaw_from`; it is None if neither determines it. `gain` is the ratio
    of right and left.
    """

    focal_px: float
    baseline_m: float
    matches: Matches
    row_mad_px: float
    row_noise_px: float
    coefficients: Array
    roll_deg: Uncertain
    pitch_deg: Uncertain
    xy_px: Uncertain
    gain: float
    disparity_px: tuple[float, ...]
    yaw_deg: Uncertain | None
    yaw_from: str

    @property
    def offset_px(self) -> Uncertain | None:
        """The error of all disparities at the centre of the image that corresponds to the yaw."""
        if self.yaw_deg is None:
            return None
        yaw_rad = np.deg2rad([self.yaw_deg.value, self.yaw_deg.sigma])
        value_px, sigma_px = (self.focal_px * yaw_rad).tolist()
        return Uncertain(value_px, sigma_px)


def fit_pair(windows: Sequence[Sequence[PairShot]], pair: StereoPair) -> StereoFit | None:
    """Fit the errors of a stereo pair to runs of successive shots; None if there are too few matches."""
    matched_windows = [match_shots(window, pair) for window in windows]
    matches = all_matches(matched_windows, pair)
    if len(matches.row_px) < MIN_MATCHES:
        return None

    fx = float(pair.K[0, 0])
    fy = float(pair.K[1, 1])
    coefficients, sigmas, row_noise_px = robust_fit(_row_terms(matches.place), matches.row_px)
    xy_px = Uncertain(float(coefficients[3]), float(sigmas[3]))
    roll_pitch_rad = np.array([-coefficients[1], coefficients[0]]) / fy

    yaw_of_rows = _degrees(-xy_px.value, xy_px.sigma, fy)
    offset = fit_offset(matched_windows, pair, roll_pitch_rad)
    yaw_of_motion = None if offset is None else _degrees(offset.value_px, offset.sigma_px, fx)
    yaw_deg, yaw_from = combined_yaw(yaw_of_rows, yaw_of_motion)

    rows_px = [row_errors(shot, pair) for window in windows for shot in window[::ROW_SHOT_STEP]]
    gains = [gain_of(shot) for window in matched_windows for shot in window]
    return StereoFit(
        focal_px=fx,
        baseline_m=pair.baseline_m,
        matches=matches,
        row_mad_px=robust_sigma(np.concatenate(rows_px)),
        row_noise_px=row_noise_px,
        coefficients=coefficients,
        roll_deg=_degrees(-coefficients[1], sigmas[1], fy),
        pitch_deg=_degrees(coefficients[0], sigmas[0], fy),
        xy_px=xy_px,
        gain=float(np.nanmedian(gains)),
        disparity_px=tuple(np.quantile(matches.disparity_px, DISPARITY_QUANTILES).tolist()),
        yaw_deg=yaw_deg,
        yaw_from=yaw_from,
    )


def _degrees(value_px: float, sigma_px: float, focal_px: float) -> Uncertain:
    """The angle of a shift in px."""
    value_deg = float(np.rad2deg(value_px / focal_px))
    sigma_deg = float(np.rad2deg(sigma_px / focal_px))
    return Uncertain(value_deg, sigma_deg)


def combined_yaw(of_rows: Uncertain, of_motion: Uncertain | None) -> tuple[Uncertain | None, str]:
    """The right camera's yaw in degrees, and what it follows from: "rows", "motion" or "rows and motion".

    If row errors and motion agree, they are combined by inverse-variance weighting. Otherwise the row errors are
    attributed to the lens, and only the motion is used.
    """
    if of_motion is None:
        return (of_rows, "rows") if abs(of_rows.value) < MAX_YAW_FROM_ROWS_DEG else (None, "")
    difference_deg = abs(of_rows.value - of_motion.value)
    if difference_deg > PLAIN_SIGMAS * np.hypot(of_rows.sigma, of_motion.sigma):
        return of_motion, "motion"

    weight_of_rows = of_rows.sigma**-2
    weight_of_motion = of_motion.sigma**-2
    total_weight = weight_of_rows + weight_of_motion
    mean_deg = (weight_of_rows * of_rows.value + weight_of_motion * of_motion.value) / total_weight
    return Uncertain(mean_deg, total_weight**-0.5), "rows and motion"


# --- Row errors ---

MAD_TO_SIGMA = 1.4826  # of a normal distribution
FIT_STEPS = 20
FIT_CONVERGED_PX = 1e-6
CAUCHY_WIDTH = 2.4  # standard deviations at which a residual has half its weight
CORRELATED_MATCHES = 8.0  # neighbouring matches have similar errors: so many count as one
MIN_NOISE_PX = 1e-3


def _row_terms(place: Array) -> Array:
    """The terms 1, x, y, xy, y² (N, 5) of places (N, 2)."""
    x, y = place.T
    return np.stack([np.ones_like(x), x, y, x * y, y * y], -1)


def row_error(coefficients: Array, place: Array) -> Array:
    """The fitted row error (N,) in px at places (N, 2)."""
    error: Array = _row_terms(place) @ coefficients
    return error


def robust_fit(terms: Array, values: Array) -> tuple[Array, Array, float]:
    """Fit coefficients (K,) of terms (N, K) with Cauchy weights; return them, their standard deviations, and the noise.

    Source: Holland and Welsch (1977).
    """
    coefficients = np.zeros(terms.shape[1])
    coefficients[0] = np.median(values)
    damping = 1e-9 * np.eye(terms.shape[1])
    for _ in range(FIT_STEPS):
        residuals = values - terms @ coefficients
        noise = max(robust_sigma(residuals), MIN_NOISE_PX)
        weight = 1 / (1 + (residuals / (CAUCHY_WIDTH * noise)) ** 2)
        information = terms.T @ (weight[:, None] * terms) + damping
        step = np.linalg.solve(information, terms.T @ (weight * residuals))
        coefficients = coefficients + step
        if np.abs(step).max() < FIT_CONVERGED_PX:
            break
    variances = CORRELATED_MATCHES * np.diag(np.linalg.inv(information))
    sigmas = noise * np.sqrt(variances)
    return coefficients, sigmas, noise


def robust_sigma(values: Array) -> float:
    """The standard deviation of a normal distribution with the median absolute deviation of values."""
    deviations = np.abs(values - np.median(values))
    return MAD_TO_SIGMA * float(np.median(deviations))
