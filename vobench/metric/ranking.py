"""Ranks of estimators and their significance: paired tests over cases and repeats, rank intervals, required repeats.

The loss of a trial is 1 minus the lost-aware score, which is approximately the error as a share of the path. Estimators
are ordered by the share of failed trials, then by the geometric mean of the loss, which no single case dominates.

Symbols: E estimators, C cases, R repeats. A unit is one repeat of one case. Pairs of estimators are compared on units.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from vobench.geometry.se3 import Array

Mask = NDArray[np.bool_]

ALPHA = 0.05  # the significance level of intervals, and of tests within a case
INTERVAL = (ALPHA / 2, 1 - ALPHA / 2)
DECIDED = 0.02  # that of tests of neighbours: at most 5 in 100 boards then decide between two equal estimators
RESAMPLES = 1000  # the number of resamples of the bootstrap
FLIPS = 4095  # the number of random sign patterns of a permutation test, if there are too many to try all
EXACT_UNITS = 12  # the largest number of units for which all sign patterns are tried
MANY_UNITS = 200  # the sum over more units is assumed to be normal
MIN_UNITS = 7  # with fewer units, no permutation of signs has a p-value below 2 %
MIN_TRIALS = 4  # the smallest number of trials of each of two estimators on one case, for the same reason
MIN_LOSS = 1e-9
MIN_LOSS_RATIO_RANGE = 1e-9  # an interval narrower than this is a single value
EFFECT = 1.1  # the ratio of losses that the required repeats would detect
POWER = 0.95
MAX_REPEATS = 10_000
DIGITS = 12  # the number of decimals to which means are compared
ROUNDING = 1e-15  # the largest spread of differences that count as equal


@dataclass(frozen=True, slots=True)
class Standing:
    """The rank of one estimator and its uncertainty. Values that require more units are None.

    `place` counts from 1, and `places` is its 95 % interval. `loss_ratio` is the mean loss relative to the first's,
    with its 95 % interval `ratio_interval`. `p_above` is the p-value of the difference to the estimator ranked above,
    corrected for the number of such tests; `decided_above` also requires that the interval of the difference excludes
    0. If it is not decided, `repeats` would detect a difference of 10 %, None if repeats alone cannot.
    """

    index: int
    place: int
    places: tuple[int, int]
    failed: float
    loss: float
    loss_ratio: float
    ratio_interval: tuple[float, float] | None
    p_above: float | None
    decided_above: bool
    repeats: int | None


def trial_loss(lost_aware: float | None, *, survived: bool) -> float:
    """A trial's loss in (0, 1], 1 minus its lost-aware score; at least 1/2 for a failed trial, whatever its score."""
    score = lost_aware if lost_aware is not None else 0.5 * survived
    if not survived and score >= 0.5:
        score -= 0.5  # the score of its poses counted it as survived
    return max(1.0 - score, MIN_LOSS)


class _Criterion(NamedTuple):
    """A criterion that orders estimators: the values of trials and their weights in the mean, both (E, C, R)."""

    values: Array
    weights: Array

    def means(self) -> Array:
        """The weighted mean (E,) of each estimator, rounded so that rounding errors do not order estimators."""
        means = np.einsum("ecr,ecr->e", self.values, self.weights)
        return np.asarray(np.round(means, DIGITS))


class _Trials:
    """Log losses and failures of trials (E, C, R). `exists` (E, C, R) marks the trials that were run."""

    def __init__(self, loss: Array, failed: Array) -> None:
        has_loss = ~np.isnan(loss)
        log_loss = np.log(np.where(has_loss, np.maximum(loss, MIN_LOSS), 1.0))
        # One additional failed trial outweighs any difference of losses.
        failure_cost = 100.0 * max(loss[0].size, 1)

        self.exists = ~np.isnan(failed)
        self.losses = _Criterion(log_loss, _weights(has_loss))
        self.failures = _Criterion(failure_cost * np.nan_to_num(failed), _weights(self.exists))
        self.criteria = (self.failures, self.losses)

    def has_enough(self, *estimators: int) -> bool:
        """Whether the estimators have enough units in common for a decision."""
        is_shared = self.exists[list(estimators)].all(axis=0)
        return int(is_shared.sum()) >= MIN_UNITS

    def resampled(self, criteria: Sequence[_Criterion], seed: int) -> Array:
        """Bootstrap means (B, E), with the same draws for all estimators.

        Cases are drawn with replacement, or repeats if there are few cases. Drawing both would count the variance
        between repeats twice, since it also makes cases differ. scipy.stats.bootstrap can draw neither repeats within
        cases nor weights, and would change the printed intervals.
        """
        rng = np.random.default_rng(seed)
        n_cases, n_repeats = self.exists.shape[1:]
        if n_cases >= MIN_UNITS:
            even = np.full(n_cases, 1 / n_cases)
            case_counts = rng.multinomial(n_cases, even, size=RESAMPLES)
            counts = case_counts.repeat(n_repeats, axis=1)
        else:
            even = np.full(n_repeats, 1 / n_repeats)
            repeat_counts = rng.multinomial(n_repeats, even, size=(RESAMPLES, n_cases))
            counts = repeat_counts.reshape(RESAMPLES, -1)  # (B, C R)

        total = np.zeros((RESAMPLES, len(self.exists)))
        for values, weights in criteria:
            flat_weights = weights.reshape(len(weights), -1)
            flat_values = values.reshape(flat_weights.shape)
            mass = counts @ flat_weights.T
            sums = counts @ (flat_weights * flat_values).T
            total += np.divide(sums, mass, out=np.zeros_like(mass), where=mass > 0)
        return total

    def differences(self, a: int, b: int) -> Array:
        """How much worse b is than a on each unit (N,); the sum is the difference of their means.

        A case whose repeats are all equal, as for deterministic estimators, is one unit.
        """
        is_shared = self.exists[a] & self.exists[b]
        difference = np.zeros(is_shared.shape)
        for values, weights in self.criteria:
            has_both = (weights[a] > 0) & (weights[b] > 0)
            pair_weights = _weights(has_both[None])[0]
            worse = np.where(has_both, values[b] - values[a], 0.0)
            difference += worse * pair_weights

        filled = np.where(is_shared, difference, difference[:, :1])
        is_constant = np.ptp(filled, axis=1) <= ROUNDING
        constant_cases = difference[is_constant].sum(axis=1)
        varying_units = difference[~is_constant][is_shared[~is_constant]]
        return np.concatenate([constant_cases, varying_units])

    def repeats(self, a: int, b: int, tests: int) -> int | None:
        """Repeats of each case that would detect a ratio of 1.1 between the losses of two estimators."""
        values, weights = self.losses
        has_both = (weights[a] > 0) & (weights[b] > 0)
        difference = np.where(has_both, values[b] - values[a], np.nan)
        cases = difference[has_both.any(axis=1)]
        return repeats_to_decide(cases, tests=tests) if len(cases) else None


def rank(loss: Array, failed: Array, *, seed: int = 1) -> list[Standing]:
    """The standings of estimators, best first, from the `loss` and `failed` (E, C, R) of their trials.

    `failed` is 1 or 0, or NaN for a missing trial. `loss` is also NaN for a trial without a loss, for example if the
    ground truth is stationary. Means are taken over repeats, and then over cases. All estimators must have the cases.
    """
    trials = _Trials(loss, failed)
    failures = trials.failures.means()
    losses = trials.losses.means()
    order = np.lexsort([losses, failures])
    neighbours = list(pairwise(order.tolist()))

    rng = np.random.default_rng(seed)
    p_values = holm([permutation_p(trials.differences(a, b), rng) for a, b in neighbours])
    ranked_means = trials.resampled(trials.criteria, seed)[:, order]  # (B, E)
    lower_ends = _interval(np.diff(ranked_means, axis=1))[0]
    is_decided = (np.array(p_values) < DECIDED) & (lower_ends > 0)
    decided: list[bool] = is_decided.tolist()
    intervals = _place_intervals(ranked_means, decided, is_enough=trials.has_enough(*order))

    log_losses = trials.resampled([trials.losses], seed)
    first_log_loss = log_losses[:, order[:1]]
    ratios = np.exp(_interval(log_losses - first_log_loss))  # (2, E)
    failed_shares = np.einsum("ecr,ecr->e", np.nan_to_num(failed), trials.failures.weights)

    standings = list[Standing]()
    places = _shared_places(failures[order], losses[order])
    for position, (estimator, place) in enumerate(zip(order.tolist(), places, strict=True)):
        is_first = position == 0
        pair = position - 1
        low, high = ratios[:, estimator].tolist()
        has_interval = trials.has_enough(order[0], estimator) and high - low > MIN_LOSS_RATIO_RANGE
        first_place, last_place = intervals[position]
        standing = Standing(
            index=estimator,
            place=place,
            places=(min(first_place, place), last_place),
            failed=float(failed_shares[estimator]),
            loss=float(np.exp(losses[estimator])),
            loss_ratio=float(np.exp(losses[estimator] - losses[order[0]])),
            ratio_interval=(low, high) if has_interval else None,
            p_above=None if is_first else p_values[pair],
            decided_above=not is_first and decided[pair],
            repeats=None if is_first else trials.repeats(*neighbours[pair], len(neighbours)),
        )
        standings.append(standing)
    return standings


def _weights(has_value: Mask) -> Array:
    """The weight of each trial (E, C, R) in its estimator's mean: equal for cases, and for repeats within a case."""
    repeats = has_value.sum(axis=2, keepdims=True)
    cases = (repeats > 0).sum(axis=1, keepdims=True)
    share_of_case = has_value / np.maximum(repeats, 1)
    weights: Array = share_of_case / np.maximum(cases, 1)
    return weights


def _interval(draws: Array) -> Array:
    """The ends (2, N) of the interval that holds 95 % of the draws (B, N)."""
    ends: Array = np.quantile(draws, INTERVAL, axis=0)
    return ends


def _shared_places(failures: Array, losses: Array) -> list[int]:
    """The places, from 1, of ordered estimators with means (E,). Equal estimators share the first of their places."""
    places = list[int]()
    means = list(zip(failures.tolist(), losses.tolist(), strict=True))
    for position, mean in enumerate(means):
        is_tied = position > 0 and mean == means[position - 1]
        places.append(places[-1] if is_tied else position + 1)
    return places


def permutation_p(differences: Array, rng: np.random.Generator) -> float:
    """Two-sided p-value of the sum of paired differences (N,), whose signs are random under the null hypothesis.

    All signs are tried for up to 12 differences, and 4,095 random patterns for more. Above 200, the sum is assumed to
    be normal.
    scipy.stats.permutation_test draws other patterns, which would change the printed p-values.
    Source: Fisher (1935), section 21.
    """
    differences = differences[differences != 0]
    n = len(differences)
    if n > MANY_UNITS:
        std = np.sqrt(np.sum(differences * differences))
        z = -abs(differences.sum()) / std
        return float(2 * special.ndtr(z))

    if n <= EXACT_UNITS:
        patterns = np.arange(2**n)[:, None]
        is_flipped = (patterns >> np.arange(n)) & 1
        signs = 1.0 - 2.0 * is_flipped
    else:
        is_flipped = rng.integers(0, 2, (FLIPS, n))
        observed_signs = np.ones((1, n))
        signs = np.concatenate([observed_signs, 1.0 - 2.0 * is_flipped])
    sums = np.abs(signs @ differences)
    observed = sums[0] * (1 - 1e-12) - 1e-300  # the margin makes sums equal that differ by rounding errors
    return float(np.mean(sums >= observed))


def holm(p_values: list[float]) -> list[float]:
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


def _place_intervals(ranked_means: Array, decided: list[bool], *, is_enough: bool) -> list[tuple[int, int]]:
    """The first and last place of each ranked estimator in 95 % of draws (B, E), including undecided neighbours."""
    n = ranked_means.shape[1]
    if not is_enough:
        return [(1, n)] * n
    rounded = np.round(ranked_means, DIGITS)
    order = np.argsort(rounded, axis=1, kind="stable")
    places = np.argsort(order, axis=1) + 1
    ends = np.quantile(places, INTERVAL, axis=0, method="nearest")
    first, last = ends.astype(int).tolist()
    for position, is_decided in enumerate(decided):
        place = position + 1
        if not is_decided:
            last[position] = max(last[position], place + 1)
            first[position + 1] = min(first[position + 1], place)
    for position in range(n):  # the place itself is always included
        first[position] = min(first[position], position + 1)
        last[position] = max(last[position], position + 1)
    return list(zip(first, last, strict=True))


def repeats_to_decide(differences: Array, *, tests: int = 1) -> int | None:
    """The number of repeats that detect a ratio of losses of 1.1 with a power of 95 %.

    `differences` (C, R) are the differences between the log losses of two estimators; NaN marks a missing trial.
    Repeats reduce the variance within cases, but not that between cases. The result is None if an F test shows a
    variance between cases that hides the ratio, because more cases are needed then.
    """
    n_cases = len(differences)
    trials_per_case = np.sum(~np.isnan(differences), axis=1)
    typical_trials = float(np.mean(trials_per_case))
    degrees_of_freedom = int((trials_per_case - 1).sum())
    case_means = np.nanmean(differences, axis=1)
    spread = float(np.var(case_means, ddof=1)) if n_cases > 1 else 0.0
    within = spread
    if degrees_of_freedom:
        residuals = differences - case_means[:, None]
        within = float(np.nansum(residuals**2) / degrees_of_freedom)
    between = _variance_between_cases(
        spread,
        within,
        n_cases=n_cases,
        degrees_of_freedom=degrees_of_freedom,
        trials=typical_trials,
    )

    n_tests = max(tests, 1)
    z = special.ndtri(POWER) - special.ndtri(DECIDED / 2 / n_tests)
    allowed = (np.log(EFFECT) / z) ** 2  # the largest variance of the mean difference
    left = allowed - between / n_cases
    if left <= 0:
        return None
    units = max(MIN_UNITS, np.log2(2 * n_tests / DECIDED))
    fewest = ceil(units / n_cases)
    needed = max(fewest, ceil(within / n_cases / left))
    return needed if needed <= MAX_REPEATS else None


def _variance_between_cases(
    spread: float,
    within: float,
    *,
    n_cases: int,
    degrees_of_freedom: int,
    trials: float,
) -> float:
    """The variance of case means that repeats do not explain; 0 if an F test does not detect it."""
    if not degrees_of_freedom:
        return 0.0
    if within == 0:
        return spread
    if n_cases == 1:
        return 0.0
    f_ratio = spread * trials / within
    p = special.fdtrc(n_cases - 1, degrees_of_freedom, f_ratio)
    return max(0.0, spread - within / trials) if p < ALPHA else 0.0


def mean_places(loss: Array, failed: Array) -> Array:
    """The place (E,) of each estimator, by failed trials and then by median loss, averaged over cases.

    Equal estimators share the mean of their places. `loss` and `failed` (E, C, R) are those of `rank`.
    """
    has_no_loss = np.isnan(loss).all(axis=2, keepdims=True)
    median_loss = np.nanmedian(np.where(has_no_loss, 0.0, loss), axis=2)
    failed_share = np.nanmean(failed, axis=2)
    key = np.round(10.0 * failed_share + median_loss, DIGITS)  # a loss is at most 1
    better = (key < key[:, None]).sum(axis=1)
    equal = (key == key[:, None]).sum(axis=1)  # including the estimator itself
    case_places = better + (equal + 1) / 2
    places: Array = case_places.mean(axis=1)
    return places


def difference_p(a: Array, b: Array) -> float:
    """The two-sided p-value of the difference between values (N,) and (M,) of two estimators on one case.

    It is 1 if either estimator has fewer than four values. Only the order of values matters, so infinity can represent
    a failure. Unlike scipy.stats.mannwhitneyu, the test is exact with ties.
    Source: Mann and Whitney (1947).
    """
    if min(len(a), len(b)) < MIN_TRIALS:
        return 1.0
    n_pairs = len(a) * len(b)
    wins_of_a = np.sum(a[:, None] < b)
    ties = np.sum(a[:, None] == b)
    wins = float(wins_of_a + 0.5 * ties)
    fewer_wins = int(np.ceil(min(wins, n_pairs - wins)))
    one_sided = float(_chance_of_wins(len(a), len(b))[fewer_wins])
    return min(1.0, 2 * one_sided)


@cache
def _chance_of_wins(n: int, m: int) -> Array:
    """The probability of k or fewer wins, for each k, among the n m pairs of two equal estimators.

    The counts are the coefficients of the Gaussian binomial, the product of (1 - q^(m + i)) / (1 - q^i) for i to n.
    """
    counts = np.ones(1)
    for i in range(1, n + 1):
        product = np.concatenate([counts, np.zeros(m + i)])
        product[m + i :] -= counts
        n_wins = range(len(counts) + m)
        counts = np.array([product[k::-i].sum() for k in n_wins])
    chances: Array = np.cumsum(counts) / counts.sum()
    return chances
