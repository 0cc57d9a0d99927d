"""Computes errors block by block, so that the matrices of a block fit into the processor's cache."""

from collections.abc import Callable

import numpy as np

from vobench.geometry.se3 import Array

ErrorArrays = tuple[Array, ...]  # one array (N,) for each kind of error
BLOCK = 1 << 14  # samples per block


def in_blocks(n: int, work: Callable[[slice], ErrorArrays]) -> ErrorArrays:
    """The arrays (n,) that `work` returns for n samples. `work` is called with one block of samples at a time."""
    if n == 0:
        return work(slice(0, 0))
    blocks = [work(slice(begin, min(begin + BLOCK, n))) for begin in range(0, n, BLOCK)]
    return tuple(np.concatenate(arrays) for arrays in zip(*blocks, strict=True))
