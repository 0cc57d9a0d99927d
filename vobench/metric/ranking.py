"""Who is better, and whether that is decided: paired tests over cases and repeats, rank intervals, repeats to ask for.

Of each trial its loss counts, 1 minus the lost-aware score: about the error as a share of the path. Estimators are
ordered by the share of trials that failed, then by the geometric mean of the loss, in which no case outweighs another.

Symbols: E estimators, C cases, R repeats; a unit is a case and a repeat, on which estimators are compared in pairs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy import special

from vobench.geometry.se3 import Array

ALPHA = 0.05  # of intervals, and of tests within a case
DECIDED = 0.02  # of tests of neighbours, so that of two alike 95 in 100 boards say so with room to spare
RESAMPLES = 1000  # of the bootstrap
FLIPS = 4095  # of signs, where all of them would be more
EXACT_UNITS = 12  # up to here all signs are tried
MANY_UNITS = 200  # beyond these none is, for the sum is normal
MIN_UNITS = 7  # with fewer no permutation of signs has a chance below 2 %
MIN_TRIALS = 4  # of each of two on one case, for the same reason
MIN_LOSS = 1e-9
EFFECT = 1.1  # the ratio of losses that repeats are asked for to find
POWER = 0.95
MOST_REPEATS = 10_000


@dataclass(frozen=True, slots=True)
class Standing:
    """How one estimator stands among others; what cannot be told from so few units is None.

    `place` counts from 1; with 95 % it is one of `places`. `loss_ratio` is its mean loss over the first's, within
    `ratio_interval`. `p_above`: the chance that it and the one ranked above differ so by luck, corrected for the
    number of such tests; `decided_above` also asks that the interval of their difference leaves 0 out. Where it is
    not, `repeats` would find a difference of 10 %, None where repeats alone cannot.
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
    """A trial's loss in (0, 1], 1 minus its lost-aware score; of a failed one 1/2 or more, whatever its score says."""
    score = lost_aware if lost_aware is not None else 0.5 * survived
    if not survived and score >= 0.5:
        score -= 0.5  # it was scored as a survivor's, by its poses alone
    return max(1.0 - score, MIN_LOSS)


class _Trials:
    """Losses and failures of trials (E, C, R), and what each trial weighs in its estimator's means.

    A share is values and weights, whose products add up to the means that estimators are ordered by.
    """

    def __init__(self, loss: Array, failed: Array) -> None:
        has_loss = ~np.isnan(loss)
        self.there = ~np.isnan(failed)
        self.losses = np.log(np.where(has_loss, np.maximum(loss, MIN_LOSS), 1.0)), _weights(has_loss)
        # One trial more that fails weighs more than any difference of losses.
        self.fails = 100.0 * max(loss[0].size, 1) * np.nan_to_num(failed), _weights(self.there)
        self.shares = self.fails, self.losses

    def enough(self, *estimators: int) -> bool:
        """Whether so many units have trials of all of these that anything can be decided."""
        return int(self.there[list(estimators)].all(axis=0).sum()) >= MIN_UNITS

    def resampled(self, shares: Sequence[tuple[Array, Array]], seed: int) -> Array:
        """Means (B, E) over cases drawn with replacement, the same for everybody; of few cases their repeats are drawn.

        Drawing both would count what differs between repeats twice, for it makes cases differ too.
        """
        rng = np.random.default_rng(seed)
        (n_cases, n_repeats) = self.there.shape[1:]
        if n_cases >= MIN_UNITS:
            drawn = rng.multinomial(n_cases, np.full(n_cases, 1 / n_cases), size=RESAMPLES).repeat(n_repeats, axis=1)
        else:
            drawn = rng.multinomial(n_repeats, np.full(n_repeats, 1 / n_repeats), size=(RESAMPLES, n_cases))
            drawn = drawn.reshape(RESAMPLES, -1)
        total = np.zeros((RESAMPLES, len(self.there)))
        for values, weights in shares:
            flat = weights.reshape(len(weights), -1)
            mass = drawn @ flat.T
            sums = drawn @ (flat * values.reshape(flat.shape)).T
            total += np.divide(sums, mass, out=np.zeros_like(mass), where=mass > 0)
        return total

    def differences(self, a: int, b: int) -> Array:
        """What b is worse than a by on each unit, so that they add up to the difference of means.

        A case whose repeats are all alike, as those of estimators without chance are, is one unit.
        """
        has = self.there[a] & self.there[b]
        d = np.zeros(has.shape)
        for values, weights in self.shares:
            both = (weights[a] > 0) & (weights[b] > 0)
            d += np.where(both, values[b] - values[a], 0.0) * _weights(both[None])[0]
        single = np.ptp(np.where(has, d, d[:, :1]), axis=1) <= 1e-15
        return np.concatenate([d[single].sum(axis=1), d[~single][has[~single]]])

    def repeats(self, a: int, b: int, tests: int) -> int | None:
        """How many repeats of each case would find a ratio of 1.1 between the losses of two."""
        values, weights = self.losses
        has = (weights[a] > 0) & (weights[b] > 0)
        d = np.where(has, values[b] - values[a], np.nan)[has.any(axis=1)]
        return repeats_to_decide(d, tests=tests) if len(d) else None


def rank(loss: Array, failed: Array, *, seed: int = 1) -> list[Standing]:
    """Estimators, best first, by their trials' `loss` and `failed` (E, C, R).

    `failed` is 1 or 0, NaN where there is no such trial; `loss` is NaN too where a trial has none, as one of a case
    that stands still. Means are over cases, within a case over repeats: give cases that all estimators have.
    """
    trials = _Trials(loss, failed)
    fails, losses = (np.round(np.einsum("ecr,ecr->e", *share), 12) for share in trials.shares)
    order = np.lexsort([losses, fails])
    drawn = trials.resampled(trials.shares, seed)
    drawn_losses = trials.resampled([trials.losses], seed)
    pairs = list(pairwise(order.tolist()))
    rng = np.random.default_rng(seed)
    p = holm([permutation_p(trials.differences(a, b), rng) for a, b in pairs])
    least = _interval(np.diff(drawn[:, order], axis=1))[0]
    decided = [bool(chance < DECIDED and low > 0) for chance, low in zip(p, least, strict=True)]
    places = _places(drawn[:, order], decided, enough=trials.enough(*order))
    ratios = np.exp(_interval(drawn_losses - drawn_losses[:, order[:1]]))
    shares = np.einsum("ecr,ecr->e", np.nan_to_num(failed), trials.fails[1])
    found = list[Standing]()
    for at, e in enumerate(order.tolist()):
        above = order[at - 1]
        is_tied = at > 0 and (fails[e], losses[e]) == (fails[above], losses[above])
        is_told = trials.enough(order[0], e) and np.ptp(ratios[:, e]) > 1e-9
        place = found[-1].place if is_tied else at + 1
        standing = Standing(
            index=e,
            place=place,
            places=(min(places[at][0], place), places[at][1]),
            failed=float(shares[e]),
            loss=float(np.exp(losses[e])),
            loss_ratio=float(np.exp(losses[e] - losses[order[0]])),
            ratio_interval=(float(ratios[0, e]), float(ratios[1, e])) if is_told else None,
            p_above=p[at - 1] if at else None,
            decided_above=at > 0 and decided[at - 1],
            repeats=trials.repeats(int(above), e, len(pairs)) if at else None,
        )
        found.append(standing)
    return found


def _weights(has: NDArray[np.bool_]) -> Array:
    """What each trial (E, C, R) weighs in its estimator's mean: cases alike, within a case repeats alike."""
    repeats = has.sum(axis=2, keepdims=True)
    cases = (repeats > 0).sum(axis=1, keepdims=True)
    weights: Array = has / np.maximum(repeats, 1) / np.maximum(cases, 1)
    return weights


def _interval(drawn: Array) -> Array:
    """The ends (2, N) between which 95 % of the draws (B, N) lie."""
    ends: Array = np.quantile(drawn, [ALPHA / 2, 1 - ALPHA / 2], axis=0)
    return ends


def permutation_p(differences: Array, rng: np.random.Generator) -> float:
    """The chance of a sum so far from 0 were the sign of each difference (N,) a toss of a coin.

    All signs are tried up to 12 differences, else 4,095 drawn ones; of more than 200 the sum is taken as normal.
    Source: Fisher (1935), section 21.
    """
    d = differences[differences != 0]
    n = len(d)
    if n > MANY_UNITS:
        return float(2 * special.ndtr(-abs(d.sum()) / np.sqrt(np.sum(d * d))))
    if n <= EXACT_UNITS:
        signs = 1.0 - 2.0 * ((np.arange(2**n)[:, None] >> np.arange(n)) & 1)
    else:
        signs = np.concatenate([np.ones((1, n)), 1.0 - 2.0 * rng.integers(0, 2, (FLIPS, n))])
    sums = np.abs(signs @ d)
    return float(np.mean(sums >= sums[0] * (1 - 1e-12) - 1e-300))


def holm(p: list[float]) -> list[float]:
    """Chances of several tests, the least so corrected that it is the chance of any wrong finding.

    Source: Holm (1979).
    """
    order = np.argsort(p, kind="stable")
    corrected = list(p)
    least = 0.0
    for at, k in enumerate(order):
        least = max(least, min(1.0, (len(p) - at) * p[k]))
        corrected[k] = least
    return corrected


def _places(drawn: Array, decided: list[bool], *, enough: bool) -> list[tuple[int, int]]:
    """The places that each of the ranked may have: those of 95 % of the draws, and its neighbours' if undecided."""
    n = drawn.shape[1]
    if not enough:
        return [(1, n)] * n
    places = np.argsort(np.argsort(np.round(drawn, 12), axis=1, kind="stable"), axis=1) + 1
    low, high = np.quantile(places, [ALPHA / 2, 1 - ALPHA / 2], axis=0, method="nearest").astype(int).tolist()
    for k, is_decided in enumerate(decided):
        if not is_decided:
            high[k] = max(high[k], k + 2)
            low[k + 1] = min(low[k + 1], k + 1)
    return [(min(lo, k + 1), max(hi, k + 1)) for k, (lo, hi) in enumerate(zip(low, high, strict=True))]


def repeats_to_decide(differences: Array, *, tests: int = 1) -> int | None:
    """How many repeats find a ratio of 1.1 in 95 of 100 boards, from differences (C, R) of log losses of a pair.

    Repeats average what differs within a case, not what differs between cases: where that is more than chance (an
    F test) and hides the ratio, more cases are needed and this is None. NaN where there is no trial.
    """
    n = np.sum(~np.isnan(differences), axis=1)
    means = np.nanmean(differences, axis=1)
    n_cases = len(differences)
    free = int((n - 1).sum())
    spread = float(np.var(means, ddof=1)) if n_cases > 1 else 0.0
    within = float(np.nansum((differences - means[:, None]) ** 2) / free) if free else spread
    between = spread
    typical = float(np.mean(n))
    if free and n_cases > 1 and within > 0 and special.fdtrc(n_cases - 1, free, between * typical / within) < ALPHA:
        between = max(0.0, between - within / typical)
    else:
        between = between if free and within == 0 else 0.0
    z = special.ndtri(POWER) - special.ndtri(DECIDED / 2 / max(tests, 1))
    left = (np.log(EFFECT) / z) ** 2 - between / n_cases
    least = ceil(max(MIN_UNITS, np.log2(2 * max(tests, 1) / DECIDED)) / n_cases)
    needed = max(least, ceil(within / n_cases / left)) if left > 0 else MOST_REPEATS + 1
    return needed if needed <= MOST_REPEATS else None


def mean_places(loss: Array, failed: Array) -> Array:
    """Each estimator's place (E,) in a case, by failed trials and then the median loss, as a mean over cases.

    Equal ones share their places. `loss` and `failed` (E, C, R) are those of `rank`.
    """
    missing = np.isnan(loss)
    middle = np.nanmedian(np.where(missing.all(axis=2, keepdims=True), 0.0, loss), axis=2)
    key = np.round(10.0 * np.nanmean(failed, axis=2) + middle, 12)  # no loss is more than 1
    before = (key < key[:, None]).sum(axis=1)
    alike = (key == key[:, None]).sum(axis=1)
    places: Array = (before + (alike + 1) / 2).mean(axis=1)
    return places


def difference_p(a: Array, b: Array) -> float:
    """The chance that values (N,) and (M,) of two on one case are so unlike by luck; 1 with fewer than four of each.

    Only their order counts, so that infinity may stand for a failure. Source: Mann and Whitney (1947).
    """
    if min(len(a), len(b)) < MIN_TRIALS:
        return 1.0
    wins = float(np.sum(a[:, None] < b) + 0.5 * np.sum(a[:, None] == b))
    least = int(np.ceil(min(wins, len(a) * len(b) - wins)))
    return min(1.0, 2 * float(_chance_of_wins(len(a), len(b))[least]))


@cache
def _chance_of_wins(n: int, m: int) -> Array:
    """The chance of k or fewer wins, for each k, among the n m pairs of two that are alike."""
    ways = np.ones(1)
    for i in range(1, n + 1):  # the Gaussian binomial coefficient, a factor (1 - q^(m + i)) / (1 - q^i) at a time
        product = np.concatenate([ways, np.zeros(m + i)])
        product[m + i :] -= ways
        ways = np.array([product[k::-i].sum() for k in range(len(ways) + m)])
    chances: Array = np.cumsum(ways) / ways.sum()
    return chances
