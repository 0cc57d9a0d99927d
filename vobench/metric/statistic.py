"""The numbers that stand for many errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of n errors in the errors' unit; std has ddof 0, sse is in the unit squared."""

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


def statistics(errors: ArrayLike) -> Statistics:
    """Statistics of one or more errors (N,); percentiles interpolate linearly.

    Raises ValueError without errors: nothing measured is not an error of zero.
    """
    e = np.asarray(errors, float)
    if not e.size:
        raise ValueError("statistics need one error or more, got none")
    squares = e * e
    median, p95, p99 = np.percentile(e, [50, 95, 99])
    numbers = [np.sqrt(squares.mean()), e.mean(), median, e.std(), e.min(), e.max(), squares.sum(), p95, p99]
    return Statistics(e.size, *map(float, numbers))
