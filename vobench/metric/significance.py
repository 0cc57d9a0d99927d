"""Whether a paired difference is significant, how many pairs would show it, and corrections for several tests.

Symbols: N independent units, such as places.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from vobench.geometry.se3 import Array

ROUNDING = 1e-12  # a standard deviation of logarithms below this is rounding
POWER = 0.95
MOST_UNITS = 100_000
CAUTION = 0.2  # the probability that the true standard deviation is above the one that a number of units assumes


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """The differences of two estimators over N independent units: their mean and its uncertainty.

    `std` is the standard deviation of one difference; it is NaN for a single unit.
    """

    units: int
    mean: float
    std: float

    @property
    def _standard_error(self) -> float:
        return self.std / float(np.sqrt(self.units))

    @property
    def _degrees_of_freedom(self) -> int:
        return self.units - 1

    @property
    def p(self) -> float:
        """The two-sided p-value of the mean under Student's t distribution. Source: Student (1908)."""
        if self.mean == 0 or self.units < 2:
            return 1.0
        if self.std <= ROUNDING:
            return 0.0
        t = abs(self.mean) / self._standard_error
        return float(2 * stats.t.sf(t, self._degrees_of_freedom))

    def interval(self, alpha: float) -> tuple[float, float] | None:
        """The confidence interval of the mean at the level 1 - alpha, None for a single unit."""
        if self.units < 2:
            return None
        half_width = float(stats.t.isf(alpha / 2, self._degrees_of_freedom)) * self._standard_error
        return self.mean - half_width, self.mean + half_width

    def detectable(self, alpha: float) -> float | None:
        """The smallest true mean that these units show at the level alpha in POWER of experiments, None for one unit.

        The standard deviation is taken as it was measured.
        """
        if self.units < 2:
            return None
        low = 0.0
        high = self.std
        while _power(high, self.std, self.units, alpha) < POWER:
            high = 2 * high + ROUNDING
        for _ in range(60):
            middle = (low + high) / 2
            if _power(middle, self.std, self.units, alpha) < POWER:
                low = middle
            else:
                high = middle
        return high

    def units_needed(self, effect: float, alpha: float) -> int | None:
        """The number of units that show a true mean of `effect` at the level alpha in POWER of experiments.

        The standard deviation is taken at the upper end of its one-sided interval, since one that is measured over few
        units is often too small. None for a single unit, or above MOST_UNITS.
        """
        if self.units < 2:
            return None
        chi_square = float(stats.chi2.ppf(CAUTION, self._degrees_of_freedom))
        cautious_std = self.std * float(np.sqrt(self._degrees_of_freedom / chi_square))
        low = 1
        high = 2
        while _power(effect, cautious_std, high, alpha) < POWER:
            low = high
            high = 2 * high
            if high > MOST_UNITS:
                return None
        while high - low > 1:
            middle = (low + high) // 2
            if _power(effect, cautious_std, middle, alpha) < POWER:
                low = middle
            else:
                high = middle
        return high


def paired_difference(differences: Array) -> PairedDifference:
    """The summary of differences (N,); NaN marks a unit without one."""
    known = differences[~np.isnan(differences)]
    units = len(known)
    mean = float(known.mean()) if units else 0.0
    std = float(known.std(ddof=1)) if units > 1 else float("nan")
    return PairedDifference(units, mean, std)


def paired_p_values(values: Array) -> Array:
    """The p-values (E, E) of `PairedDifference` between the rows of values (E, N); the diagonal is 1.

    Units that lack a value of any row are left out.
    """
    known = values[:, ~np.isnan(values).any(axis=0)]
    units = known.shape[1]
    if units < 2:
        return np.ones((len(values), len(values)))
    means = known.mean(axis=1)
    differences = np.abs(means[:, None] - means)
    covariance = np.atleast_2d(np.cov(known))
    variances = np.diagonal(covariance)
    difference_variances = np.maximum(variances[:, None] + variances - 2 * covariance, 0.0)
    standard_errors = np.sqrt(difference_variances / units)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(differences > ROUNDING, differences / standard_errors, 0.0)
    return np.asarray(2 * stats.t.sf(t, units - 1))


def _power(effect: float, std: float, units: int, alpha: float) -> float:
    """The probability that a two-sided t test over `units` finds a true mean of `effect`, with its sign right."""
    if std <= ROUNDING:
        return float(effect > 0)
    degrees_of_freedom = units - 1
    threshold = float(stats.t.isf(alpha / 2, degrees_of_freedom))
    noncentrality = effect / std * float(np.sqrt(units))
    return float(stats.nct.sf(threshold, degrees_of_freedom, noncentrality))


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted p-values of several tests, which bound the probability of any false positive.

    Source: Holm (1979).
    """
    corrected = list(p_values)
    largest = 0.0
    for position, test in enumerate(np.argsort(p_values, kind="stable")):
        remaining = len(p_values) - position
        largest = max(largest, min(1.0, remaining * p_values[test]))
        corrected[test] = largest
    return corrected
