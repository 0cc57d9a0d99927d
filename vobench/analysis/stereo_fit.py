"""Estimates the errors of a stereo pair's calibration from the rows and the disparities of matches.

x, y      the position of a match in the right view divided by the focal length; fx, fy are that of both views
rotated   by roll r to the right, pitch p upwards and yaw w to the right (the signs of `CalibrationError`), the right
          camera sees a point lower by fy (p (1 + y²) - r x - w x y) and further left by fx (w (1 + x²) - r y - p x y)
distorted by tangential terms p1 and p2, it sees a point lower by fy (p1 (x² + 3 y²) + 2 p2 x y)
          and further right by fx (2 p1 x y + p2 (3 x² + y²))
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.analysis.pair_calibration import CalibratedPair, calibrate, center_px
from vobench.analysis.pair_parameter import PITCH, ROLL, YAW
from vobench.analysis.robust_sigma import robust_sigma
from vobench.analysis.stereo_matches import (
    Matches,
    PairShot,
    all_matches,
    gain_of,
    match_shots,
    row_errors,
    row_matches,
)
from vobench.analysis.tracked_motion import track_motions
from vobench.estimator.pose import cauchy_weights
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
    with these `coefficients`. `roll_deg` follows from rows along x, `pitch_deg` and `yaw_deg` are the rotations that
    shift rows and disparities at the centre of the image as observed. `yaw_deg` follows from `yaw_from`, rows and
    motion if they agree; it is None if neither determines it. `xy_px` is the coefficient of xy in row errors, and
    `gain` the ratio of right and left. `calibrated` has all errors that were fitted.
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
    calibrated: CalibratedPair | None = None

    @property
    def offset_px(self) -> Uncertain | None:
        """The error of all disparities at the centre of the image; None if the motion does not determine it."""
        if self.yaw_deg is None or self.yaw_from == ROWS:
            return None
        yaw_rad = np.deg2rad([self.yaw_deg.value, self.yaw_deg.sigma])
        value_px, sigma_px = (self.focal_px * yaw_rad).tolist()
        return Uncertain(value_px, sigma_px)

    @property
    def has_lens_error(self) -> bool:
        """Whether no rotation of a camera explains rows and motion."""
        calibrated = self.calibrated
        return calibrated is not None and calibrated.has_lens_error and calibrated.is_offset_determined

    def offsets_px(self, columns: Sequence[float]) -> list[Uncertain]:
        """The errors of disparities at columns of the right image, as shares of its width, at half of its height."""
        assert self.calibrated is not None
        calibration = self.calibrated.calibration
        camera = calibration.pair.right.camera
        places_px = np.array([[share * camera.width_px, camera.height_px / 2] for share in columns])
        values_px, sigmas_px = calibration.disparity_error(places_px)
        pairs = zip(values_px.tolist(), sigmas_px.tolist(), strict=True)
        return [Uncertain(value_px, sigma_px) for value_px, sigma_px in pairs]


ROWS = "rows"
MOTION = "motion"
ROWS_AND_MOTION = "rows and motion"


def fit_pair(windows: Sequence[Sequence[PairShot]], pair: StereoPair) -> StereoFit | None:
    """Fit the errors of a stereo pair to runs of successive shots; None if there are too few matches."""
    matched_windows = [match_shots(window, pair) for window in windows]
    matches = all_matches(matched_windows, pair)
    if len(matches.row_px) < MIN_MATCHES:
        return None
    motions = track_motions(matched_windows, pair)
    calibrated = calibrate(row_matches(matched_windows, pair), motions, pair)
    if calibrated is None:
        return None

    coefficients, row_noise_px = robust_fit(_row_terms(matches.place), matches.row_px)
    roll_deg, pitch_deg = _roll_and_pitch(calibrated)
    yaw_deg, yaw_from = _yaw(calibrated)
    rows_px = [row_errors(shot, pair) for window in windows for shot in window[::ROW_SHOT_STEP]]
    gains = [gain_of(shot) for window in matched_windows for shot in window]
    return StereoFit(
        focal_px=float(pair.K[0, 0]),
        baseline_m=pair.baseline_m,
        matches=matches,
        row_mad_px=robust_sigma(np.concatenate(rows_px)),
        row_noise_px=row_noise_px,
        coefficients=coefficients,
        roll_deg=roll_deg,
        pitch_deg=pitch_deg,
        xy_px=Uncertain(*calibrated.with_lens_terms.row_twist()),
        gain=float(np.nanmedian(gains)),
        disparity_px=tuple(np.quantile(matches.disparity_px, DISPARITY_QUANTILES).tolist()),
        yaw_deg=yaw_deg,
        yaw_from=yaw_from,
        calibrated=calibrated,
    )


def _roll_and_pitch(calibrated: CalibratedPair) -> tuple[Uncertain, Uncertain]:
    """The right camera's roll, and the pitch that shifts rows at the centre of the image as observed, in degrees."""
    calibration = calibrated.calibration
    roll_deg = Uncertain(*calibration.value(ROLL))
    if not calibrated.has_lens_error:
        return roll_deg, Uncertain(*calibration.value(PITCH))
    pair = calibration.pair
    (shift_px,), (sigma_px,) = calibration.row_error(center_px(pair))
    return roll_deg, _degrees(shift_px, sigma_px, float(pair.K[1, 1]))


def _yaw(calibrated: CalibratedPair) -> tuple[Uncertain | None, str]:
    """The right camera's yaw in degrees, and what it follows from: "rows", "motion" or "rows and motion".

    If no rotation explains rows and motion, it is the yaw that shifts disparities at the centre as the motion shows.
    """
    calibration = calibrated.calibration
    if not calibrated.is_offset_determined:
        yaw_deg = Uncertain(*calibration.value(YAW))
        return (yaw_deg, ROWS) if abs(yaw_deg.value) < MAX_YAW_FROM_ROWS_DEG else (None, "")
    if not calibrated.has_lens_error:
        return Uncertain(*calibration.value(YAW)), ROWS_AND_MOTION
    pair = calibration.pair
    (offset_px,), (sigma_px,) = calibration.disparity_error(center_px(pair))
    return _degrees(offset_px, sigma_px, float(pair.K[0, 0])), MOTION


def _degrees(value_px: float, sigma_px: float, focal_px: float) -> Uncertain:
    """The angle of a shift in px."""
    value_deg = float(np.rad2deg(value_px / focal_px))
    sigma_deg = float(np.rad2deg(sigma_px / focal_px))
    return Uncertain(value_deg, sigma_deg)


# --- Row errors ---

FIT_STEPS = 20
FIT_CONVERGED_PX = 1e-6
MIN_NOISE_PX = 1e-3


def _row_terms(place: Array) -> Array:
    """The terms 1, x, y, xy, y² (N, 5) of places (N, 2)."""
    x, y = place.T
    return np.stack([np.ones_like(x), x, y, x * y, y * y], -1)


def row_error(coefficients: Array, place: Array) -> Array:
    """The fitted row error (N,) in px at places (N, 2)."""
    error: Array = _row_terms(place) @ coefficients
    return error


def robust_fit(terms: Array, values: Array) -> tuple[Array, float]:
    """Fit coefficients (K,) of terms (N, K) with Cauchy weights; return them and the noise.

    Source: Holland and Welsch (1977).
    """
    coefficients = np.zeros(terms.shape[1])
    coefficients[0] = np.median(values)
    damping = 1e-9 * np.eye(terms.shape[1])
    for _ in range(FIT_STEPS):
        residuals = values - terms @ coefficients
        noise = max(robust_sigma(residuals), MIN_NOISE_PX)
        weight = cauchy_weights(residuals, noise)
        information = terms.T @ (weight[:, None] * terms) + damping
        step = np.linalg.solve(information, terms.T @ (weight * residuals))
        coefficients = coefficients + step
        if np.abs(step).max() < FIT_CONVERGED_PX:
            break
    return coefficients, noise
