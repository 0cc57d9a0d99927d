"""Means of a repeated texture over rectangles, by a summed-area table.

Source: Crow, Summed-Area Tables for Texture Mapping, 1984.
"""

import math

import numpy as np

from vobench.rendering.array_types import Floats
from vobench.rendering.compiled import compiled


def rectangle_means(tile: Floats, centres_px: Floats, sizes_px: Floats) -> Floats:
    """The means (N, C) of a tile (h, w, C), which is repeated, over rectangles.

    centres_px (N, 2): column and row of the middle of each rectangle, where pixel 0 covers 0 to 1. sizes_px (N, 2): its
    width and height; less than a pixel counts as one.
    """
    height, width, channels = tile.shape
    sums = np.zeros((height + 1, width + 1, channels))
    sums[1:, 1:] = tile.cumsum(0, dtype=float).cumsum(1)
    means = np.empty((len(centres_px), channels), np.float32)
    _rectangle_means(sums, np.ascontiguousarray(centres_px, float), np.maximum(sizes_px, 1.0), means)
    return means


@compiled
def _rectangle_means(sums: Floats, centres_px: Floats, sizes_px: Floats, means: Floats) -> None:
    for index in range(len(centres_px)):
        width, height = sizes_px[index]
        left = centres_px[index, 0] - width / 2
        top = centres_px[index, 1] - height / 2
        right = left + width
        bottom = top + height
        for channel in range(sums.shape[2]):
            above_bottom = _sum_before(sums, bottom, right, channel) - _sum_before(sums, bottom, left, channel)
            above_top = _sum_before(sums, top, right, channel) - _sum_before(sums, top, left, channel)
            means[index, channel] = (above_bottom - above_top) / (width * height)


@compiled
def _sum_before(sums: Floats, row: float, column: float, channel: int) -> float:
    """The sum of a channel over rows 0 to `row` and columns 0 to `column` of the repeated tile."""
    height = sums.shape[0] - 1
    width = sums.shape[1] - 1
    full_rows = math.floor(row / height)
    full_columns = math.floor(column / width)
    row_in_tile = row - full_rows * height
    column_in_tile = column - full_columns * width
    of_tile = sums[height, width, channel]
    of_rows = _sum_in_tile(sums, row_in_tile, width, channel)
    of_columns = _sum_in_tile(sums, height, column_in_tile, channel)
    of_both = _sum_in_tile(sums, row_in_tile, column_in_tile, channel)
    return float(full_rows * full_columns * of_tile + full_columns * of_rows + full_rows * of_columns + of_both)


@compiled
def _sum_in_tile(sums: Floats, row: float, column: float, channel: int) -> float:
    """The sum of a channel over rows 0 to `row` and columns 0 to `column` of the tile."""
    first_row = min(int(row), sums.shape[0] - 2)
    first_column = min(int(column), sums.shape[1] - 2)
    row_share = row - first_row
    column_share = column - first_column
    upper = (1 - column_share) * sums[first_row, first_column, channel]
    upper += column_share * sums[first_row, first_column + 1, channel]
    lower = (1 - column_share) * sums[first_row + 1, first_column, channel]
    lower += column_share * sums[first_row + 1, first_column + 1, channel]
    return float((1 - row_share) * upper + row_share * lower)
