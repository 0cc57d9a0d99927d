"""Computes errors block by block, so that the matrices of a block fit into the processor's cache."""

from collections.abc import Callable
from dataclasses import fields
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Errors = TypeVar("Errors", bound="DataclassInstance")  # its fields are arrays (N,), one for each kind of error
BLOCK = 1 << 14  # samples per block


def in_blocks(n: int, work: Callable[[slice], Errors]) -> Errors:
    """The errors that `work` returns for n samples. `work` is called with one block of samples at a time."""
    if n == 0:
        return work(slice(0, 0))
    blocks = [work(slice(begin, min(begin + BLOCK, n))) for begin in range(0, n, BLOCK)]
    arrays = {}
    for kind in fields(blocks[0]):
        arrays[kind.name] = np.concatenate([getattr(block, kind.name) for block in blocks])
    return type(blocks[0])(**arrays)
