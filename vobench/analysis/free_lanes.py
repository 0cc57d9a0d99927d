"""Finds where a path fits into a place: every position and direction at which the floor along it is free."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.suite.free_space import FloorMap

# The step between two headings moves the end of a path by so many cells, within bounds.
STEP_CELLS = 2.0
STEP_BOUNDS_RAD = (np.deg2rad(0.75), np.deg2rad(10.0))
MOST_POINTS = 120  # of a path that are looked up in the map
ROUNDING_CELLS = 0.7  # by which the nearest cell may be away from a point

Cells = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Lane:
    """A direction and a position (2,) of the start of a path at which it is free by the map of a floor."""

    heading_rad: float
    xy_m: Array


def free_lanes(floor: FloorMap, path_m: Array, *, clearance_m: float, most: int) -> list[Lane]:
    """Lanes for a path (N, 2), at most so many, spread evenly over all that there are.

    All cells of the map are tried as the start, and all headings. A lane is free if each point of the path has its
    clearance, to within the size of a cell.
    """
    distance_m = floor.clearance().distance_m
    is_clear = distance_m >= clearance_m - ROUNDING_CELLS * floor.cell_m
    offsets_m = _resampled(path_m, floor.cell_m) - path_m[0]
    lanes = []
    for heading_rad in _headings(offsets_m, floor.cell_m):
        starts = _free_starts(is_clear, _rotated_cells(offsets_m, heading_rad, floor.cell_m))
        for start in _evenly(starts, most):
            row, column = np.unravel_index(start, is_clear.shape)
            lanes.append(Lane(heading_rad, np.array([floor.x_m[column], floor.y_m[row]])))
    chosen = _evenly(np.arange(len(lanes)), most)
    return [lanes[index] for index in chosen]


def _resampled(path_m: Array, cell_m: float) -> Array:
    """Points (P, 2) along a path (N, 2), about one in each cell."""
    steps_m = np.linalg.norm(np.diff(path_m, axis=0), axis=1)
    along_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    count = int(np.clip(along_m[-1] / cell_m, 2, MOST_POINTS))
    at_m = np.linspace(0, along_m[-1], count)
    x_m = np.interp(at_m, along_m, path_m[:, 0])
    y_m = np.interp(at_m, along_m, path_m[:, 1])
    return np.stack([x_m, y_m], -1)


def _headings(offsets_m: Array, cell_m: float) -> Iterator[float]:
    """Headings around the circle in steps that suit the extent of a path."""
    reach_m = float(np.linalg.norm(offsets_m, axis=1).max())
    step_rad = np.clip(STEP_CELLS * cell_m / max(reach_m, cell_m), *STEP_BOUNDS_RAD)
    count = int(np.ceil(2 * np.pi / step_rad))
    for index in range(count):
        yield 2 * np.pi * index / count


def _rotated_cells(offsets_m: Array, heading_rad: float, cell_m: float) -> Cells:
    """The rows and columns (P, 2), relative to the start, of the points of a path that is turned; farthest first."""
    cosine = np.cos(heading_rad)
    sine = np.sin(heading_rad)
    x_m = cosine * offsets_m[:, 0] - sine * offsets_m[:, 1]
    y_m = sine * offsets_m[:, 0] + cosine * offsets_m[:, 1]
    cells = np.rint(np.stack([y_m, x_m], -1) / cell_m).astype(int)
    distinct = np.unique(cells, axis=0)
    nearest_first = np.argsort(np.abs(distinct).max(1), kind="stable")
    return np.asarray(distinct[nearest_first[::-1]])


def _free_starts(is_clear: NDArray[np.bool_], cells: Cells) -> Cells:
    """The flat indices of the cells at which a path may start, of which these cells (P, 2) have to be clear."""
    width = is_clear.shape[1]
    first_row, first_column = np.maximum(-cells.min(0), 0).tolist()
    rows, columns = (np.array(is_clear.shape) - np.maximum(cells.max(0), 0) - (first_row, first_column)).tolist()
    if rows <= 0 or columns <= 0:
        return np.zeros(0, np.intp)
    is_free = np.ones((rows, columns), bool)
    for row, column in cells.tolist():
        top = first_row + row
        left = first_column + column
        is_free &= is_clear[top : top + rows, left : left + columns]
        if not is_free.any():
            return np.zeros(0, np.intp)
    free_rows, free_columns = np.nonzero(is_free)
    return np.asarray((free_rows + first_row) * width + free_columns + first_column)


def _evenly(items: Cells, most: int) -> Cells:
    """At most so many items, evenly spaced."""
    if len(items) <= most:
        return items
    return np.asarray(items[np.linspace(0, len(items) - 1, most).astype(int)])
