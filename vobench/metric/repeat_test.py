"""Whether two estimators differ on one and the same case, by the repeats of their trials."""

from collections.abc import Mapping
from functools import cache
from itertools import combinations

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.significance import holm

ALPHA = 0.05
MIN_TRIALS = 4  # of each of two estimators: with fewer no order of them has a p-value below ALPHA


def difference_p(a: Array, b: Array) -> float:
    """Two-sided p-value of values (N,) and (M,) of two estimators on one case; 1 with fewer than four of either.

    Only their order counts, so infinity may stand for a failure. Unlike scipy.stats.mannwhitneyu it is exact with ties.
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


def worse_than_best(values: Mapping[str, Array], best: str) -> set[str]:
    """The estimators that are significantly worse than the best one on this case, by the values of their trials.

    All pairs are tested, with Holm's correction at 5 %: the best estimator was chosen by these same values, so that
    tests against it alone would find a difference too often.
    """
    pairs = list(combinations(values, 2))
    corrected = holm([difference_p(values[a], values[b]) for a, b in pairs])
    worse = set[str]()
    for (a, b), p in zip(pairs, corrected, strict=True):
        if best in (a, b) and p < ALPHA:
            worse.add(b if a == best else a)
    return worse
