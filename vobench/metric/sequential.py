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
    """The log wealth (..., N) after each of N units in a bet that the mean of differences (..., N) exceeds `mean`.

    The wealth process starts at 1. It is a nonnegative supermartingale if the true mean is `mean` or smaller; then it
    ever reaches 1 / alpha with probability alpha at most (Ville's inequality). Differences are clipped to ±BOUND.

    Source: Waudby-Smith and Ramdas (2024), Estimating means of bounded random variables by betting.
    """
    excess = np.clip(differences, -BOUND, BOUND) - mean
    log_mixture = np.full(excess.shape, -np.inf)
    for share, weight in zip(STAKES, WEIGHTS, strict=True):
        stake = share / (BOUND + mean)  # such that no difference can cost all of the wealth
        log_growth = np.log1p(stake * excess).cumsum(axis=-1)
        log_mixture = np.logaddexp(log_mixture, log_growth + np.log(weight))
    return log_mixture


def log_wealth(differences: Array, mean: float) -> float:
    """The log wealth after the last of the differences (N,), in any order; 0 without differences."""
    if not len(differences):
        return 0.0
    return float(log_wealths(differences, mean)[-1])


def e_value(differences: Array) -> float:
    """The two-sided e-value of differences (N,) against a mean of zero: the average wealth of two opposite bets.

    If the mean is zero, it ever exceeds 1 / alpha with probability alpha at most.
    """
    log_upward = log_wealth(differences, 0.0)
    log_downward = log_wealth(-differences, 0.0)
    log_value = np.logaddexp(log_upward, log_downward) - np.log(2.0)
    return float(np.exp(min(log_value, 700.0)))


def interval(differences: Array, alpha: float) -> tuple[float, float]:
    """The confidence sequence for the mean of differences (N,), at time N: its lower and upper limit.

    The limits are ±BOUND while no mean is rejected. With probability 1 - alpha, the intervals at all times cover the
    mean.
    """
    lower = _lower_limit(differences, alpha / 2)
    upper = -_lower_limit(-differences, alpha / 2)
    return lower, upper


def _lower_limit(differences: Array, alpha: float) -> float:
    """The largest mean that the bet rejects at level alpha, by bisection; -BOUND if it rejects none."""
    threshold = -np.log(alpha)
    rejected = -BOUND
    not_rejected = BOUND
    for _ in range(BISECTIONS):
        middle = (rejected + not_rejected) / 2
        if log_wealth(differences, middle) >= threshold:
            rejected = middle
        else:
            not_rejected = middle
    return rejected


class PairState(StrEnum):
    """What is known of a pair of estimators."""

    OPEN = "open"
    FIRST_BETTER = "first better"
    SECOND_BETTER = "second better"
    EQUIVALENT = "alike"


@dataclass(frozen=True, slots=True)
class PairVerdict:
    """A pair of estimators after N units: the differences of their log losses, and what is known of their mean.

    `differences` are positive where the second loses more. The pair is decided if the confidence sequence at this
    moment excludes a ratio of 1, and equivalent if it is within the chosen `ratio`, in either direction.
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
    def has_interval(self) -> bool:
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
        exceeds_lower_limit = log_wealth(differences, -limit) >= threshold
        is_below_upper_limit = log_wealth(-differences, -limit) >= threshold
        if exceeds_lower_limit and is_below_upper_limit:
            return PairState.EQUIVALENT
        return PairState.OPEN

    def units_needed(self, most: int) -> int | None:
        """The number of units after which the pair is no longer open if the others are like those seen.

        None with fewer than MIN_UNITS units, or beyond `most`.
        """
        if not self.has_interval:
            return None
        differences = np.array(self.differences)
        limit = float(np.log(self.ratio))
        first_better = self._units_to_reject(differences, 0.0)
        second_better = self._units_to_reject(-differences, 0.0)
        above_lower_limit = self._units_to_reject(differences, -limit)
        below_upper_limit = self._units_to_reject(-differences, -limit)
        equivalent = max(above_lower_limit, below_upper_limit)
        needed = min(first_better, second_better, equivalent)
        return int(needed) if needed <= most else None

    def _units_to_reject(self, differences: Array, mean: float) -> float:
        """The number of units after which the bet rejects a mean; infinite if it never does."""
        excess = np.clip(differences, -BOUND, BOUND) - mean
        units = []
        for share, weight in zip(STAKES, WEIGHTS, strict=True):
            stake = share / (BOUND + mean)
            growth_per_unit = float(np.log1p(stake * excess).mean())
            growth_needed = float(np.log(2.0 / self.alpha) - np.log(weight))
            units.append(growth_needed / growth_per_unit if growth_per_unit > 0 else inf)
        fewest = min(units)
        return ceil(fewest) if fewest < inf else inf


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
    """The pairs that are neither decided nor equivalent."""
    return [pair for pair in verdicts if pair.verdict is PairState.OPEN]
