"""The standard deviation of values of which some are outliers."""

import numpy as np

from vobench.geometry.se3 import Array

MAD_TO_SIGMA = 1.4826  # of a normal distribution


def robust_sigma(values: Array) -> float:
    """The standard deviation of a normal distribution with the median absolute deviation of values."""
    deviations = np.abs(values - np.median(values))
    return MAD_TO_SIGMA * float(np.median(deviations))
