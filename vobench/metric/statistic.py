"""The numbers that stand for many errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

PERCENTILES = np.array([0.5, 0.95, 0.99])


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of n errors in the errors' unit; sse is in the unit squared."""

    n: int
    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    sse: float
    p95: float
    p99: float


def statistics(errors: ArrayLike, *, ddof: int = 0) -> Statistics:
    """Statistics of one or more errors (N,); percentiles interpolate linearly, std has `ddof`, 0 for one error.

    Raises ValueError without errors: nothing measured is not an error of zero.
    """
    e = np.asarray(errors, float).ravel()
    if not e.size:
        raise ValueError("statistics need one error or more, got none")
    e = np.sort(e)
    at = (e.size - 1) * PERCENTILES
    below = at.astype(int)
    above = np.minimum(below + 1, e.size - 1)
    median, p95, p99 = e[below] + (at - below) * (e[above] - e[below])
    sse = np.sum(e * e)
    std = e.std(ddof=ddof) if e.size > ddof else 0.0
    numbers = [np.sqrt(sse / e.size), e.mean(), median, std, e[0], e[-1], sse, p95, p99]
    return Statistics(e.size, *map(float, numbers))
