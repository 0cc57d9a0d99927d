"""Consistency: whether the errors of an estimator agree with the covariances that it reports."""

from dataclasses import dataclass

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.comparison import POSES, Comparison, MetricDefinition
from vobench.trajectory.align import Alignment

POSITION = slice(0, 3)
ROTATION = slice(3, 6)
SMALLEST_NEES = 1e-12
BIAS_OF_CORRELATION = 5.0  # samples
SMALLEST_SINE = 1e-12  # of half the angle: below it the angle is twice the sine


@dataclass(frozen=True, slots=True)
class Consistency:
    """Normalised estimation errors squared (K,). Their means are 6, 3 and 3 if the covariances are correct."""

    pose: Array
    trans: Array
    rot: Array


def consistency(
    T_gt: Array,
    T_est: Array,
    covariance: Array,
    alignment: Alignment,
) -> Consistency:
    """The values eᵀ P⁻¹ e of matched poses (K, 4, 4) before alignment, with covariances P (K, 6, 6).

    e consists of the position error in m and the rotation vector of R_gt R_est⁻¹ in rad. P has the same order, in the
    axes of the estimate's world, as in ROS. Raises TrajectoryError if a P is not positive definite.
    Source: Bar-Shalom et al. (2001), section 5.4.
    """
    scales = np.diag([alignment.scale, 1.0])  # of positions, of rotations
    to_truth = np.kron(scales, alignment.rotation)
    _require_positive_definite(covariance)
    P = to_truth @ covariance @ to_truth.T

    T_aligned = alignment.apply(T_est)
    position_error = T_gt[:, :3, 3] - T_aligned[:, :3, 3]
    R_error = T_gt[:, :3, :3] @ se3.transposed(T_aligned[:, :3, :3])
    e = np.concatenate([position_error, rotation_vector(R_error)], axis=1)
    return Consistency(
        pose=_nees(e, P),
        trans=_nees(e[:, POSITION], P[:, POSITION, POSITION]),
        rot=_nees(e[:, ROTATION], P[:, ROTATION, ROTATION]),
    )


def independent_samples(nees: Array) -> float:
    """The effective number of independent samples in the normalised squared errors (K,) along a path, at least 1.

    Errors of successive poses are correlated. Their number is divided by the integrated autocorrelation time of their
    logarithm. An autocorrelation that is measured about the mean of the same samples looks too short;
    BIAS_OF_CORRELATION was chosen so that of consistent random walks and drifts of 45 to 2000 poses about 1 in 12 is
    called inconsistent, and of uncorrelated errors 1 in 30.
    """
    samples = np.log(np.maximum(nees, SMALLEST_NEES))
    deviations = samples - samples.mean()
    spectrum = np.fft.rfft(deviations, 2 * len(deviations))
    products = np.fft.irfft(spectrum * np.conj(spectrum))[: len(deviations)]
    if products[0] <= 0:
        return 1.0
    correlation = products / products[0]
    is_positive = correlation > 0
    positive = correlation if is_positive.all() else correlation[: int(is_positive.argmin())]
    correlation_time = 2 * positive.sum() - 1
    return max(1.0, float(len(nees) / correlation_time) - BIAS_OF_CORRELATION)


def median_interval(samples: float, degrees_of_freedom: int) -> tuple[float, float]:
    """The ends of the interval that holds the median NEES of a consistent estimator in 95 of 100 cases.

    `samples` is the number of independent ones. The median has the quantile of a beta distribution.
    """
    from scipy import stats

    half = (samples + 1) / 2
    quantiles = stats.beta.ppf([0.025, 0.975], half, half)
    low, high = stats.chi2.ppf(quantiles, degrees_of_freedom)
    return float(low), float(high)


def rotation_vector(R: Array) -> Array:
    """The rotation vectors (..., 3) in rad of rotations (..., 3, 3), computed from quaternions.

    They are accurate for all angles up to half a turn.
    """
    q = se3.to_quaternion(R)
    axis_times_sine = q[..., :3]
    sine = np.linalg.norm(axis_times_sine, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    is_turned = sine > SMALLEST_SINE
    divisor = np.where(is_turned, sine, 1.0)
    angle_per_sine = np.where(is_turned, angle / divisor, 2.0)
    return np.asarray(axis_times_sine * angle_per_sine)


def _nees(e: Array, P: Array) -> Array:
    """The normalised squared errors (K,) of errors (K, n) with covariances (K, n, n)."""
    weighted = np.linalg.solve(P, e[..., None])[..., 0]
    return np.asarray(np.sum(e * weighted, axis=-1))


def _require_positive_definite(covariance: Array) -> None:
    """Raise TrajectoryError for the first of covariances (K, n, n) that is not finite or positive definite."""
    smallest = np.full(1, np.nan)
    if np.isfinite(covariance).all():
        smallest = np.linalg.eigvalsh(covariance)[:, 0]
    bad = np.flatnonzero(~(smallest > 0))
    if bad.size:
        raise TrajectoryError(
            f"covariance {bad[0]} should be finite and positive definite, "
            f"but its smallest eigenvalue is {smallest[bad[0]]:.3g}"
        )


def _consistency(comparison: Comparison) -> Consistency:
    """The consistency of a comparison. It has no samples if the estimator reports no covariances."""
    if comparison.covariance is None:
        return Consistency(*np.zeros((3, 0)))
    matched = comparison.matched
    covariance = comparison.covariance[matched.pairs.est]
    return consistency(matched.T_gt, matched.T_est, covariance, comparison.alignment)


def _definition(
    part: str,
    error: str,
    *,
    title: str,
    expected: int,
) -> MetricDefinition:
    """The metric of a part of the pose whose error has `expected` components."""

    def measure(comparison: Comparison) -> Array:
        return np.asarray(getattr(comparison.once(_consistency), part))

    return MetricDefinition(
        id=f"nees_{part}",
        title=title,
        unit="1",
        formula=f"{error}ᵀ P⁻¹ {error} of each pose, P the covariance that the estimator states",
        source="Bar-Shalom et al. (2001), section 5.4",
        settings=POSES,
        blind=f"the size of the error: a large one that was announced is consistent; "
        f"honest ones give {expected} on average",
        headline="mean",
        measure=measure,
    )


METRICS = (
    _definition("pose", "e", title="consistency of the stated covariance", expected=6),
    _definition("trans", "e_p", title="consistency of the stated covariance, position", expected=3),
    _definition("rot", "e_R", title="consistency of the stated covariance, orientation", expected=3),
)
