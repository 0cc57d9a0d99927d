"""Comparisons that may be looked at after every unit: confidence sequences, and verdicts on pairs of estimators.

The confidence interval of a t test holds if its number of units was chosen before. Whoever looks after every unit and
stops when the test is significant is wrong far more often. A confidence sequence is a sequence of intervals, one for
each number of units, that all hold together, so that its error does not depend on when one looks or stops.

Symbols: N independent units, such as places; E estimators.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.significance import PairedDifference, paired_difference

# The variance of the standardised difference under the alternative. It decides where intervals are narrowest, not
# whether they hold: with 0.5 they are within 3 % of the narrowest from 15 to 100 units.
PRIOR_VARIANCE = 0.5
MIN_UNITS = 7  # with fewer the sequence makes no statement, for means of few skewed differences are far from normal


def half_width(difference: PairedDifference, alpha: float) -> float:
    """Half the width of the confidence sequence of the mean after N units; infinite while it makes no statement.

    The intervals for all N hold together with probability 1 - alpha if the differences are normal, whatever their
    variance: they consist of the means whose Bayes factor, a t test with a normal prior on the standardised difference
    and the right Haar prior on the scale, never reaches 1 / alpha; Ville's inequality bounds that.

    Source: Lai (1976), On confidence sequences; Wang and Ramdas (2025), Anytime-valid t-tests and confidence sequences
    for Gaussian means with unknown variance, theorem 4.6; Pérez-Ortiz, Lardy, de Heide and Grünwald (2024),
    E-statistics, group invariance and anytime-valid testing.
    """
    units = difference.units
    if units < MIN_UNITS:
        return float("inf")
    degrees_of_freedom = units - 1
    gain = 1.0 + units * PRIOR_VARIANCE
    threshold = (np.sqrt(gain) / alpha) ** (2.0 / units)
    if threshold >= gain:
        return float("inf")  # no t statistic of so few units has so large a Bayes factor
    t_squared = degrees_of_freedom * (threshold - 1.0) / (1.0 - threshold / gain)
    return float(np.sqrt(t_squared / units) * difference.std)


def bayes_factor(difference: PairedDifference) -> float:
    """The Bayes factor of `half_width` against a mean of zero: an e-value, whatever N is and why one stopped there.

    Under a mean of zero it exceeds 1 / alpha, at any time, with probability alpha at most. It is 1 while there is no
    statement.
    """
    units = difference.units
    if units < MIN_UNITS or difference.mean == 0.0:
        return 1.0
    if difference.std == 0.0:
        return float("inf")
    gain = 1.0 + units * PRIOR_VARIANCE
    t_squared = units * (difference.mean / difference.std) ** 2
    scaled = t_squared / (units - 1)
    log_factor = 0.5 * units * (np.log1p(scaled) - np.log1p(scaled / gain)) - 0.5 * np.log(gain)
    return float(np.exp(min(log_factor, 700.0)))


class PairState(StrEnum):
    """What is known of a pair of estimators."""

    OPEN = "open"
    FIRST_BETTER = "first better"
    SECOND_BETTER = "second better"
    ALIKE = "alike"


@dataclass(frozen=True, slots=True)
class PairVerdict:
    """A pair of estimators after N units: the ratio of the second's loss to the first's, and what is known of it.

    `interval` is the confidence sequence of the ratio at this moment. The pair is decided if it excludes 1, and alike
    if it is within the chosen ratio, in either direction.
    """

    first: int
    second: int
    difference: PairedDifference
    alpha: float
    ratio: float

    @property
    def interval(self) -> tuple[float, float]:
        """The lower and the upper end of the ratio of losses."""
        half = half_width(self.difference, self.alpha)
        with np.errstate(over="ignore"):
            return float(np.exp(self.difference.mean - half)), float(np.exp(self.difference.mean + half))

    @property
    def loss_ratio(self) -> float:
        """The ratio of losses that the units showed."""
        return float(np.exp(self.difference.mean))

    @property
    def verdict(self) -> PairState:
        """What is known of the pair."""
        low, high = self.interval
        if low > 1.0:
            return PairState.FIRST_BETTER
        if high < 1.0:
            return PairState.SECOND_BETTER
        if low > 1.0 / self.ratio and high < self.ratio:
            return PairState.ALIKE
        return PairState.OPEN

    def units_needed(self, most: int) -> int | None:
        """The number of units after which the pair is no longer open if mean and deviation stay as they were measured.

        None while the sequence makes no statement, or beyond `most`.
        """
        if self.difference.units < MIN_UNITS:
            return None
        distance = self._distance_to_verdict()
        for units in range(self.difference.units, most + 1):
            later = PairedDifference(units, self.difference.mean, self.difference.std)
            if half_width(later, self.alpha) < distance:
                return units
        return None

    def _distance_to_verdict(self) -> float:
        """How narrow half the interval has to be: for an order, or for the two to be alike; the easier of both."""
        to_order = abs(self.difference.mean)
        to_alike = float(np.log(self.ratio)) - abs(self.difference.mean)
        return max(to_order, to_alike)


def pair_verdicts(log_losses: Array, *, ratio: float, alpha: float) -> list[PairVerdict]:
    """The verdicts on all pairs of estimators, by the logarithm of their loss (E, N) in the same units.

    All intervals of all pairs, at all times, hold together with probability 1 - alpha (Bonferroni), so that the
    probability of any false verdict is alpha at most. NaN marks a unit that an estimator lacks.
    """
    pairs = list(combinations(range(len(log_losses)), 2))
    verdicts = list[PairVerdict]()
    for first, second in pairs:
        difference = paired_difference(log_losses[second] - log_losses[first])
        verdicts.append(PairVerdict(first, second, difference, alpha / len(pairs), ratio))
    return verdicts


def open_pairs(verdicts: Sequence[PairVerdict]) -> list[PairVerdict]:
    """The pairs that are neither decided nor alike."""
    return [pair for pair in verdicts if pair.verdict is PairState.OPEN]
