"""Periodic noise for panoramas: reading a tile between its pixels, smoothing it, and fading it with distance."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]  # float32 where there are many

BAND_ROWS = 16  # of a map that are worked on at a time, so that their arrays stay in the processor's cache


def sample_tile(tile: Floats, u: Floats, v: Floats) -> Floats:
    """Values (r, c) of a periodic tile (N, N) at places (r, c) in tiles, interpolated; N is a power of two."""
    values = np.empty(u.shape, np.float32)
    for start in range(0, len(u), BAND_ROWS):
        band = slice(start, start + BAND_ROWS)
        values[band] = _sample_band(tile, u[band], v[band])
    return values


def _sample_band(tile: Floats, u: Floats, v: Floats) -> Floats:
    """The values at places in some rows."""
    size = len(tile)
    x = u * size
    y = v * size
    left = np.floor(x)
    top = np.floor(y)
    right_share = x - left
    lower_share = y - top

    # `& last` takes an index modulo the size, which is a power of two. The tile is indexed as one row of pixels.
    last = size - 1
    column = left.astype(np.int32) & last
    row = top.astype(np.int32) & last
    next_column = (column + 1) & last
    row_start = row * size
    next_row_start = ((row + 1) & last) * size

    pixels = tile.ravel()
    left_share = 1 - right_share
    upper = left_share * pixels.take(row_start + column) + right_share * pixels.take(row_start + next_column)
    lower = left_share * pixels.take(next_row_start + column) + right_share * pixels.take(next_row_start + next_column)
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
