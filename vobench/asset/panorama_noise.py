"""Periodic noise for panoramas: reading a tile between its pixels, smoothing it, and fading it with distance."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]  # float32 where there are many


def sample_tile(tile: Floats, u: Floats, v: Floats) -> Floats:
    """Values of a periodic tile (N, N) at places (...) in tiles, interpolated bilinearly."""
    size = len(tile)
    x = u * size
    y = v * size
    left = np.floor(x)
    top = np.floor(y)
    right_share = x - left
    lower_share = y - top

    column = left.astype(np.int32) % size
    row = top.astype(np.int32) % size
    next_column = (column + 1) % size
    next_row = (row + 1) % size

    upper = (1 - right_share) * tile[row, column] + right_share * tile[row, next_column]
    lower = (1 - right_share) * tile[next_row, column] + right_share * tile[next_row, next_column]
    return np.asarray((1 - lower_share) * upper + lower_share * lower)


def smooth_tile(tile: Floats) -> Floats:
    """The mean of each pixel of a periodic tile and its neighbours, by the binomial filter of 3 x 3 pixels."""
    above = np.roll(tile, 1, 0)
    below = np.roll(tile, -1, 0)
    rows = (above + 2 * tile + below) / 4
    left = np.roll(rows, 1, 1)
    right = np.roll(rows, -1, 1)
    return np.asarray((left + 2 * rows + right) / 4)


def fade_pattern(values: Floats, footprint_m: Floats, cell_m: float) -> Floats:
    """Values around 0 of a pattern with cells of some size, faded where a pixel covers more than a cell."""
    sharpness = np.clip(cell_m / footprint_m - 0.5, 0, 1)
    return np.asarray(values * sharpness)
