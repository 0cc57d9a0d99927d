"""As many points of a curve or a path as a small plot can show."""

import numpy as np

from vobench.geometry.se3 import Array

MOST_POINTS = 160


def spread_indices(count: int) -> list[int]:
    """At most MOST_POINTS of the indices below `count`, evenly spread, with the first and the last."""
    if not count:
        return []
    chosen = np.linspace(0, count - 1, min(count, MOST_POINTS)).astype(int)
    indices: list[int] = np.unique(chosen).tolist()
    return indices


def path_points(path_m: Array) -> list[list[float]]:
    """At most MOST_POINTS of a path (N, 2), rounded to 0.1 mm."""
    chosen_m = path_m[spread_indices(len(path_m))]
    return [[round(float(x_m), 4), round(float(y_m), 4)] for x_m, y_m in chosen_m]


def peak_indices(errors: Array) -> list[int]:
    """At most MOST_POINTS of the indices of a curve (N,): the largest of each part, so that no peak is lost."""
    if not len(errors):
        return []
    parts = np.array_split(np.arange(len(errors)), min(len(errors), MOST_POINTS))
    return [int(part[np.argmax(errors[part])]) for part in parts]
