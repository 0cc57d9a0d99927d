"""Photon noise: Poisson counts from normal draws, one a pixel however bright it is. Pure."""

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.geometry.se3 import Array

# From this mean on the expansion below is off by less than 6e-4 in total variation, 1e-4 in variance and 1e-5 in mean.
EXPANSION_FROM = 10.0
# A Poisson count of mean 10 exceeds this with probability 1e-25.
MOST_SMALL = 60


def poisson(mean: Array, normal: Array) -> Array:
    """Counts (...) of means (...), as float64: the quantile of each draw of a standard normal (...).

    The draws don't depend on the light, so a brighter frame leaves the noise of the next one as it was.
    Means of 10 or more by the expansion of the quantile in powers of 1/√mean, smaller ones by summing the distribution.
    Source: Giles (2016), Algorithm 955, ACM TOMS 42(1), Q_N1.
    """
    counts = _expansion(mean, normal)
    small = mean < EXPANSION_FROM
    if small.any():
        counts[small] = _summed(mean[small], scipy.special.ndtr(normal[small]))
    return counts


def _expansion(mean: Array, w: Array) -> Array:
    """floor(mean + √mean w + 1/3 + w²/6 - (w³ + 2 w) / (72 √mean)), step by step in place, as pictures are large."""
    root = np.sqrt(mean)
    square = w * w
    counts: Array = root * w
    counts += mean
    counts += 1 / 3
    counts += square / 6
    square += 2.0
    square *= w
    # Below 1 the sum takes over; this only keeps the division finite.
    square /= 72 * np.maximum(root, 1.0, out=root)
    counts -= square
    np.floor(counts, out=counts)
    # At mean 10, one draw in a million would come out at -1.
    return np.maximum(counts, 0.0, out=counts)


def _summed(mean: Array, probability: Array) -> NDArray[np.int8]:
    """The smallest counts (M,) whose distribution function reaches the probabilities (M,)."""
    counts, term = np.zeros(len(mean), np.int8), np.exp(-mean)
    reached = term.copy()
    for count in range(1, MOST_SMALL + 1):
        beyond = probability > reached
        if not beyond.any():
            break
        counts += beyond.view(np.int8)
        term *= mean
        term *= 1 / count
        reached += term
    return counts
