"""Comparisons that may be looked at after every unit: e-values, confidence sequences, and verdicts on estimators.

The confidence interval of a t test holds if its number of units was chosen before, and if the first dozen units show
what all of them are like. Whoever looks after every unit and stops when the test is significant is wrong far more
often, and so is whoever has not yet seen the rare places in which one of two estimators fails. The intervals here hold
together for every number of units, and for every distribution of differences that are bounded.

Symbols: N independent units, such as places; E estimators.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from math import ceil, inf

import numpy as np

from vobench.geometry.se3 import Array

# A unit counts for at most this ratio of losses. A failed trial loses at least 1/2, so this is the ratio to a loss of
# half a percent, which is an ATE of 0.1 % of the path.
LARGEST_RATIO = 100.0
BOUND = float(np.log(LARGEST_RATIO))
# The shares of the largest possible stake that are bet, and their weights. Where no unit is far from the others, the
# largest stake wins soonest; where some are, such as failures, a smaller one does.
STAKES = np.array([0.95, 0.5, 0.25, 0.12, 0.06])
WEIGHTS = np.array([0.7, 0.1, 0.1, 0.05, 0.05])
MIN_UNITS = 7  # with fewer, an interval excludes hardly anything, and no pair is decided
BISECTIONS = 50


def log_wealths(differences: Array, mean: float) -> Array:
    """The logarithm of the wealth, after each of N units, of a bet that the mean is larger than `mean`, (..., N).

    The bet is on differences (..., N), and begins with a wealth of 1. Whatever their distribution, a wealth of
    1 / alpha is reached with probability alpha at most, at any time, if their mean is `mean` or smaller (Ville's
    inequality). Differences beyond the BOUND count like it.

    Source: Waudby-Smith and Ramdas (2024), Estimating means of bounded random variables by betting.
    """
    excess = np.clip(differences, -BOUND, BOUND) - mean
    log_wealth = np.full(excess.shape, -np.inf)
    for share, weight in zip(STAKES, WEIGHTS, strict=True):
        stake = share / (BOUND + mean)  # such that no difference can cost all of the wealth
        gains = np.log1p(stake * excess).cumsum(axis=-1)
        log_wealth = np.logaddexp(log_wealth, gains + np.log(weight))
    return log_wealth


def log_wealth(differences: Array, mean: float) -> float:
    """The wealth of `log_wealths` after all of the differences (N,), which does not depend on their order."""
    return float(log_wealths(differences, mean)[-1]) if len(differences) else 0.0


def e_value(differences: Array) -> float:
    """The e-value of differences (N,) against a mean of zero: half of a bet on more, half of one on less.

    If the mean is zero it exceeds 1 / alpha, at any time, with probability alpha at most.
    """
    log_value = np.logaddexp(log_wealth(differences, 0.0), log_wealth(-differences, 0.0)) - np.log(2.0)
    return float(np.exp(min(log_value, 700.0)))


def interval(differences: Array, alpha: float) -> tuple[float, float]:
    """The confidence sequence of the mean of differences (N,) after N units, from -BOUND to BOUND before it states any.

    The intervals for all N hold together with probability 1 - alpha.
    """
    return _lower_end(differences, alpha / 2), -_lower_end(-differences, alpha / 2)


def _lower_end(differences: Array, alpha: float) -> float:
    """The largest mean that a bet on more refutes at the level alpha; -BOUND if it refutes none."""
    threshold = -np.log(alpha)
    refuted = -BOUND
    not_refuted = BOUND
    for _ in range(BISECTIONS):
        middle = (refuted + not_refuted) / 2
        if log_wealth(differences, middle) >= threshold:
            refuted = middle
        else:
            not_refuted = middle
    return refuted


class PairState(StrEnum):
    """What is known of a pair of estimators."""

    OPEN = "open"
    FIRST_BETTER = "first better"
    SECOND_BETTER = "second better"
    ALIKE = "alike"


@dataclass(frozen=True, slots=True)
class PairVerdict:
    """A pair of estimators after N units: the differences of their log losses, and what is known of their mean.

    `differences` are positive where the second loses more. The pair is decided if the confidence sequence at this
    moment excludes a ratio of 1, and alike if it is within the chosen `ratio`, in either direction.
    """

    first: int
    second: int
    differences: tuple[float, ...]
    alpha: float
    ratio: float

    @property
    def units(self) -> int:
        """The number of units that both estimators have."""
        return len(self.differences)

    @property
    def interval(self) -> tuple[float, float]:
        """The lower and the upper end of the ratio of losses."""
        low, high = interval(np.array(self.differences), self.alpha)
        return float(np.exp(low)), float(np.exp(high))

    @property
    def is_stated(self) -> bool:
        """Whether there are enough units for an interval that excludes anything of interest."""
        return self.units >= MIN_UNITS

    @property
    def loss_ratio(self) -> float:
        """The ratio of losses that the units showed."""
        return float(np.exp(np.mean(self.differences))) if self.differences else 1.0

    @property
    def verdict(self) -> PairState:
        """What is known of the pair."""
        differences = np.array(self.differences)
        threshold = np.log(2.0 / self.alpha)
        limit = float(np.log(self.ratio))
        if log_wealth(differences, 0.0) >= threshold:
            return PairState.FIRST_BETTER
        if log_wealth(-differences, 0.0) >= threshold:
            return PairState.SECOND_BETTER
        if min(log_wealth(differences, -limit), log_wealth(-differences, -limit)) >= threshold:
            return PairState.ALIKE
        return PairState.OPEN

    def units_needed(self, most: int) -> int | None:
        """The number of units after which the pair is no longer open if the others are like those seen.

        None with fewer than MIN_UNITS units, or beyond `most`.
        """
        if not self.is_stated:
            return None
        differences = np.array(self.differences)
        limit = float(np.log(self.ratio))
        to_order = min(self._units_to_refute(differences, 0.0), self._units_to_refute(-differences, 0.0))
        to_alike = max(self._units_to_refute(differences, -limit), self._units_to_refute(-differences, -limit))
        needed = min(to_order, to_alike)
        return int(needed) if needed <= most else None

    def _units_to_refute(self, differences: Array, mean: float) -> float:
        """The number of units after which a bet on more refutes a mean; infinite if it never does."""
        excess = np.clip(differences, -BOUND, BOUND) - mean
        units = []
        for share, weight in zip(STAKES, WEIGHTS, strict=True):
            growth = float(np.log1p(share / (BOUND + mean) * excess).mean())  # of the logarithm, in each unit
            missing = float(np.log(2.0 / self.alpha) - np.log(weight))
            units.append(missing / growth if growth > 0 else inf)
        return ceil(min(units)) if min(units) < inf else inf


def pair_verdicts(log_losses: Array, *, ratio: float, alpha: float) -> list[PairVerdict]:
    """The verdicts on all pairs of estimators, by the logarithm of their loss (E, N) in the same units.

    All intervals of all pairs, at all times, hold together with probability 1 - alpha (Bonferroni), so that the
    probability of any false verdict is alpha at most. NaN marks a unit that an estimator lacks.
    """
    pairs = list(combinations(range(len(log_losses)), 2))
    verdicts = list[PairVerdict]()
    for first, second in pairs:
        differences = known_differences(log_losses[second] - log_losses[first])
        verdicts.append(PairVerdict(first, second, tuple(differences.tolist()), alpha / len(pairs), ratio))
    return verdicts


def known_differences(differences: Array) -> Array:
    """The differences (N,) that are not NaN."""
    known: Array = differences[~np.isnan(differences)]
    return known


def open_pairs(verdicts: Sequence[PairVerdict]) -> list[PairVerdict]:
    """The pairs that are neither decided nor alike."""
    return [pair for pair in verdicts if pair.verdict is PairState.OPEN]
