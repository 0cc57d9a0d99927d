"""Which lamps are hidden from the pixels of a picture, by one ray for many pixels where neighbours agree.

Pixels form square blocks. A block whose pixels all show one plane is decided by rays from its corners if these agree,
and otherwise by a ray from each of its pixels. Wherever a shadow crosses into a block that its corners had decided,
that block is asked again pixel by pixel, so that narrow shadows are followed. What can be missed is a spot of shadow or
of light that lies within blocks and touches none of their corners.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Indices, Mask, Pixels

BLOCK_PX = 4
LAMPS_AT_ONCE = 32  # a bit each
Bits = NDArray[np.uint32]
ALL = np.uint32(0xFFFFFFFF)


class _Blocks:
    """The blocks (M, N) of a picture of h × w pixels; those at its right and lower edge may be smaller.

    pixels (M, N, K): flat indices; a smaller block repeats some. corners (M + 1, N + 1): those at the blocks' corners.
    """

    def __init__(self, height: int, width: int) -> None:
        self.height = height
        self.width = width
        starts_down = np.arange(0, height, BLOCK_PX)
        starts_across = np.arange(0, width, BLOCK_PX)
        self.shape = (len(starts_down), len(starts_across))
        down = np.minimum(starts_down[:, None] + np.arange(BLOCK_PX), height - 1)  # (M, B)
        across = np.minimum(starts_across[:, None] + np.arange(BLOCK_PX), width - 1)  # (N, B)
        square = down[:, None, :, None] * width + across[None, :, None, :]
        self.pixels = square.reshape(*self.shape, BLOCK_PX * BLOCK_PX)
        corners_down = np.append(starts_down, height - 1)
        corners_across = np.append(starts_across, width - 1)
        self.corners = corners_down[:, None] * width + corners_across

    def smooth(self, plane: Indices) -> Mask:
        """Which blocks (M, N) show one plane; pixels whose plane (R,) is negative are in no such block."""
        own = plane[self.pixels]
        first = own[..., :1]
        at_corners = _of_corners(plane[self.corners])
        is_smooth = (own == first).all(-1) & (at_corners == own[..., 0]).all(0)
        return np.asarray(is_smooth & (own[..., 0] >= 0))

    def crossed(self, bits: Bits, plane: Indices) -> Bits:
        """Bits (M, N) that change within a plane where two blocks meet, for both of them."""
        picture = bits.reshape(self.height, self.width)
        planes = plane.reshape(self.height, self.width)
        result = np.zeros(self.shape, np.uint32)
        before = slice(BLOCK_PX - 1, -1, BLOCK_PX)
        after = slice(BLOCK_PX, None, BLOCK_PX)

        change = picture[:, before] ^ picture[:, after]
        change[planes[:, before] != planes[:, after]] = 0
        across = np.bitwise_or.reduceat(change, np.arange(0, self.height, BLOCK_PX), axis=0)
        result[:, :-1] |= across
        result[:, 1:] |= across

        change = picture[before] ^ picture[after]
        change[planes[before] != planes[after]] = 0
        down = np.bitwise_or.reduceat(change, np.arange(0, self.width, BLOCK_PX), axis=1)
        result[:-1] |= down
        result[1:] |= down
        return result


blocks_of = lru_cache(maxsize=8)(_Blocks)


def _of_corners(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """The values (4, M, N) at the four corners of each block, of values (M + 1, N + 1) at all corners."""
    return np.stack([values[:-1, :-1], values[:-1, 1:], values[1:, :-1], values[1:, 1:]])


def hidden_lamps(
    blocks: _Blocks,
    plane: Indices,
    facing: Bits,
    is_hidden: Callable[[int, Pixels], Mask],
) -> Bits:
    """Bits (R,) of the lamps that are hidden from each pixel.

    plane (R,): equal where pixels show one plane, negative where each pixel must be asked. facing (R,): bits of the
    lamps that each pixel is turned to, the same all over a plane. is_hidden: whether a lamp, by its bit, is hidden from
    pixels (P,).
    """
    bits = np.zeros(len(facing), np.uint32)

    def ask(lamps: Bits, pixels: Pixels) -> None:
        """Ask for lamps (G,) at groups of pixels (G, K)."""
        asked = np.bitwise_or.reduce(lamps, initial=np.uint32(0))
        for lamp in range(LAMPS_AT_ONCE):
            bit = np.uint32(1 << lamp)
            if not asked & bit:
                continue
            wanted = pixels[(lamps & bit) != 0].ravel()
            wanted = wanted[(facing[wanted] & bit) != 0]
            if len(wanted):
                bits[wanted[is_hidden(lamp, wanted)]] |= bit

    corners = blocks.corners.ravel()
    ask(facing[corners], corners[:, None])
    at_corners = _of_corners(bits[blocks.corners])
    agreed = np.bitwise_and.reduce(at_corners)
    disputed = np.bitwise_or.reduce(at_corners) ^ agreed
    pending = np.where(blocks.smooth(plane), disputed, ALL)
    done = np.zeros(blocks.shape, np.uint32)
    bits[blocks.pixels] = (agreed & ~pending)[..., None]
    while pending.any():
        ask(pending.ravel(), blocks.pixels.reshape(-1, BLOCK_PX**2))
        done |= pending
        pending = blocks.crossed(bits, plane) & ~done
        if pending.any():
            bits[blocks.pixels] &= ~pending[..., None]
    return bits
