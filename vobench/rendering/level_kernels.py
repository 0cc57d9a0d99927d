"""Compiled kernels of values that are known at some texels: interpolation, differences and smoothing along a chart."""

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled

States = NDArray[np.uint8]  # (P,), whether the value of each point is known

UNKNOWN = np.uint8(0)
KNOWN = np.uint8(1)
INTERPOLATED = np.uint8(2)  # in the pass that is under way, in which it is no source yet


@compiled
def nearest_known(point: int, beside: Indices, steps: int, state: States) -> tuple[int, int]:
    """The nearest known point at most `steps` away in one direction and its distance in steps, -1 and 0 for none.

    `beside` (P,) is the point next to each in that direction, the point itself where its chart ends.
    """
    place = point
    for step in range(1, steps + 1):
        following = beside[place]
        if following == place:
            break
        place = following
        if state[place] == KNOWN:
            return place, step
    return -1, 0


@compiled
def fill_between(
    rows: Rows,
    before: Indices,
    after: Indices,
    steps: int,
    tolerance: float,
    is_relative: bool,
    state: States,
    values: Floats,
    is_steep: Mask,
) -> None:
    """Interpolate the unknown values of points at rows (N,) between known ones at most `steps` before and after.

    Mark in `is_steep` (P,) the points between which and whose sources the value differs by more than the tolerance, of
    the greater value if it is relative, and those that take their value from marked ones.
    """
    for place in range(len(rows)):
        point = rows[place]
        if state[point] != UNKNOWN:
            continue
        first, first_steps = nearest_known(point, before, steps, state)
        if first < 0:
            continue
        second, second_steps = nearest_known(point, after, steps, state)
        if second < 0:
            continue
        weighted = second_steps * values[first] + first_steps * values[second]
        values[point] = weighted / np.float32(first_steps + second_steps)
        state[point] = INTERPOLATED
        largest = tolerance * max(values[first], values[second]) if is_relative else tolerance
        differs = abs(values[first] - values[second]) > largest
        is_steep[point] = differs or is_steep[first] or is_steep[second]
    for place in range(len(rows)):
        if state[rows[place]] == INTERPOLATED:
            state[rows[place]] = KNOWN


@compiled
def mark_bends(
    rows: Rows,
    before: Indices,
    after: Indices,
    steps: int,
    tolerance: float,
    state: States,
    values: Floats,
    is_marked: Mask,
) -> None:
    """Mark the points at rows (N,) whose value differs from the mean of the known ones before and after them.

    It differs by more than the tolerance, relative to the value.
    """
    for place in range(len(rows)):
        point = rows[place]
        first, _ = nearest_known(point, before, steps, state)
        second, _ = nearest_known(point, after, steps, state)
        if first >= 0 and second >= 0:
            mean = (values[first] + values[second]) / 2
            is_marked[point] = is_marked[point] or abs(values[point] - mean) > tolerance * values[point]


@compiled
def next_to_marked(rows: Rows, neighbours: Indices, is_marked: Mask, result: Mask) -> None:
    """Write which of the points at rows (N,) are marked or have a marked neighbour (4, P)."""
    for place in range(len(rows)):
        point = rows[place]
        is_near = is_marked[point]
        for side in range(4):
            is_near = is_near or is_marked[neighbours[side, point]]
        result[place] = is_near


@compiled
def find_extremes(
    rows: Rows,
    neighbours: Indices,
    steps: int,
    state: States,
    values: Floats,
    low: Floats,
    high: Floats,
) -> None:
    """Write the extremes (N,) of known points at rows (N,) and the known ones at most `steps` away on four sides."""
    for place in range(len(rows)):
        point = rows[place]
        least = values[point]
        greatest = values[point]
        for side in range(4):
            other, _ = nearest_known(point, neighbours[side], steps, state)
            if other >= 0:
                least = min(least, values[other])
                greatest = max(greatest, values[other])
        low[place] = least
        high[place] = greatest


@compiled
def smooth_along(
    rows: Rows,
    before: Indices,
    after: Indices,
    steps: int,
    state: States,
    values: Floats,
    result: Floats,
) -> None:
    """Write the means (N,) of the values at rows (N,) and those of the known points before and after them."""
    for place in range(len(rows)):
        point = rows[place]
        total = 2 * values[point]
        first, _ = nearest_known(point, before, steps, state)
        total += values[point] if first < 0 else values[first]
        second, _ = nearest_known(point, after, steps, state)
        total += values[point] if second < 0 else values[second]
        result[place] = total / 4
