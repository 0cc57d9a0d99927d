"""Compares the errors of repeats before and after a change, with an exact test and a confidence interval.

Repeat i before and repeat i after the change share their seed, so they are compared in pairs.
"""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from scipy import stats

from vobench.geometry.se3 import Array

MIN_LOSS = 1e-12
CONFIDENCE = 0.95
SURE_P = 0.025  # of a one-sided test
MOST_EXACT = 12  # pairs whose signs are all tried; for more, signs are drawn
SIGN_DRAWS = 4096
# Repeats of which one has this multiple of another one's error fail by chance, wholly or not at all.
ALL_OR_NOTHING_RATIO = 4.0
FAILED_SHARE = 0.5  # of the largest error of both sides; smaller ones have not failed wholly


@dataclass(frozen=True, slots=True)
class PairedChange:
    """The share by which a change reduces the mean error, with its 95 % interval, and the p-values of both directions.

    `p_less` is the one-sided p-value of the error being smaller after the change, and `p_more` of its being larger.
    """

    reduction: float
    low: float
    high: float
    p_less: float
    p_more: float


def compare_pairs(before: Array, after: Array) -> PairedChange:
    """Compare the mean errors (n,) of repeats before and after a change; at least two repeats are needed."""
    reduction = 1 - after.mean() / max(before.mean(), MIN_LOSS)
    low, high = reduction_interval(before, after)
    differences = before - after
    return PairedChange(float(reduction), low, high, sign_flip_p(differences), sign_flip_p(-differences))


def reduction_interval(before: Array, after: Array) -> tuple[float, float]:
    """The 95 % interval of the share by which the mean of errors (n,) is reduced.

    It is a t interval of the logarithm of the ratio of means, by the delta method. Repeats that fail wholly or not at
    all say little about how often they do: then the interval also covers what one more repeat on either side, as good
    or as bad as any, would give.
    """
    low, high = _t_interval(before, after)
    everything = np.concatenate([before, after])
    smallest = everything.min()
    largest = everything.max()
    if not (_is_all_or_nothing(before, largest) or _is_all_or_nothing(after, largest)):
        return low, high
    pessimistic = _t_interval(np.append(before, smallest), np.append(after, largest))
    optimistic = _t_interval(np.append(before, largest), np.append(after, smallest))
    return min(low, pessimistic[0], optimistic[0]), max(high, pessimistic[1], optimistic[1])


def _t_interval(before: Array, after: Array) -> tuple[float, float]:
    """The t interval of 1 - mean(after) / mean(before) for pairs (n,), on the logarithm of the ratio."""
    mean_before = max(float(before.mean()), MIN_LOSS)
    mean_after = max(float(after.mean()), MIN_LOSS)
    influence = after / mean_after - before / mean_before
    standard_error = influence.std(ddof=1) / np.sqrt(len(before))
    half_width = stats.t.ppf((1 + CONFIDENCE) / 2, len(before) - 1) * standard_error
    log_ratio = np.log(mean_after / mean_before)
    return float(1 - np.exp(log_ratio + half_width)), float(1 - np.exp(log_ratio - half_width))


def _is_all_or_nothing(losses: Array, largest: float) -> bool:
    """Whether some of the errors (n,) are near the `largest` of both sides and others far below."""
    has_failed = losses.max() >= FAILED_SHARE * largest
    has_spread = losses.max() > ALL_OR_NOTHING_RATIO * max(losses.min(), MIN_LOSS)
    return bool(has_failed and has_spread)


def sign_flip_p(differences: Array) -> float:
    """The one-sided p-value of the mean of paired differences (n,) being above 0.

    If before and after are drawn alike, each difference is as likely as its negative. Of n pairs, the smallest p-value
    is 1 / 2^n. Source: Fisher (1935), "The Design of Experiments", section 21.
    """
    count = len(differences)
    sums = _signs(count) @ differences
    tolerance = 1e-12 * np.abs(differences).sum()
    return float((sums >= differences.sum() - tolerance).mean())


@cache
def _signs(count: int) -> Array:
    """All signs (2^n, n) of n differences or, of many, some that are drawn (SIGN_DRAWS, n); the first are positive."""
    if count <= MOST_EXACT:
        return np.array(list(product((1.0, -1.0), repeat=count)))
    drawn = np.random.default_rng(0).integers(0, 2, (SIGN_DRAWS - 1, count)) * 2.0 - 1
    return np.concatenate([np.ones((1, count)), drawn])
