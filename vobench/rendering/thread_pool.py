"""Work on slices of arrays, on all cores."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vobench import stop

T = TypeVar("T")
CHUNK = 1 << 14  # the number of points of a slice, whose arrays fit into the processor's cache


def in_chunks(
    work: Callable[[slice], T],
    count: int,
    *,
    chunk: int = CHUNK,
    done: Callable[[float], object] | None = None,
) -> list[T]:
    """The results of `work` for consecutive slices of range(count), in order.

    `work` is called with each slice, possibly in another thread.
    `chunk` is the length of a slice.
    `done` is called after each slice with the share of the slices that are finished. If there is only one slice, it is
    not called.
    """
    slices = [slice(start, min(start + chunk, count)) for start in range(0, count, chunk)]

    def checked(part: slice) -> T:
        stop.check()
        return work(part)

    if len(slices) == 1:
        return [checked(slices[0])]
    results = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for result in pool.map(checked, slices):
            results.append(result)
            if done:
                done(len(results) / len(slices))
    return results


def chunked(work: Callable[[slice], NDArray[Any]], count: int) -> NDArray[Any]:
    """The results of `work` for consecutive slices of range(count), concatenated to an array (count, ...)."""
    results = in_chunks(work, count)
    if not results:
        # The result for an empty slice has the right shape and type.
        results = [work(slice(0, 0))]
    return np.concatenate(results)
