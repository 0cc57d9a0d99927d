"""Offsets of the samples of texels that are also stratified over neighbouring texels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Rows

BITS = 12  # the number of bits of an index along the curve; texels at a distance of 64 have the same offsets
BITS_PER_AXIS = BITS // 2


@dataclass(frozen=True, slots=True)
class SobolPattern:
    """The offsets of the samples of texels on a map with a width.

    The points of the Sobol sequence are assigned to texels along a Z-order curve. The points of each square of
    2^n x 2^n texels are therefore a (0, 2n, 2)-net. Only every stride-th texel along rows and columns has a point.
    `shift` (1, 2) is added to all offsets.
    Source: Ahmed and Wonka, Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error, 2020.
    """

    width: int
    stride: int
    shift: Floats

    def offsets(self, index: Rows, others: Floats) -> Floats:
        """Two offsets (P, 2) in [0, 1) for each texel, given its flat index (P,) on the map.

        Texels without a point have the offsets in `others` (P, 2).
        """
        row, column = np.divmod(index, self.width)
        is_left_out = (row % self.stride != 0) | (column % self.stride != 0)
        curve_index = _spread_bits(column // self.stride) | _spread_bits(row // self.stride) << np.uint32(1)
        points = _sobol_points(curve_index)
        shifted = points.astype(np.float32) / np.float32(1 << BITS) + self.shift
        return np.where(is_left_out[:, None], others, shifted - np.floor(shifted))


def _sobol_points(index: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """The points (N, 2) of Sobol's sequence at indices (N,), in units of 2^-BITS."""
    first = np.zeros(len(index), np.uint32)
    second = np.zeros(len(index), np.uint32)
    first_direction = 1 << BITS - 1
    second_direction = 1 << BITS - 1
    for bit in range(BITS):
        is_set = (index >> np.uint32(bit)) & np.uint32(1)
        first ^= is_set * np.uint32(first_direction)
        second ^= is_set * np.uint32(second_direction)
        first_direction >>= 1
        second_direction ^= second_direction >> 1
    return np.stack([first, second], -1)


def _spread_bits(numbers: Rows) -> NDArray[np.uint32]:
    """Numbers (N,) whose bits are the lowest BITS_PER_AXIS of each, with a zero between two bits."""
    bits = (numbers & ((1 << BITS_PER_AXIS) - 1)).astype(np.uint32)
    bits = (bits | bits << np.uint32(4)) & np.uint32(0x30F)
    bits = (bits | bits << np.uint32(2)) & np.uint32(0x333)
    return (bits | bits << np.uint32(1)) & np.uint32(0x555)
