"""Work on slices of arrays, on all cores."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vobench import stop

T = TypeVar("T")
CHUNK = 1 << 14  # points at once: their arrays fit the processor's cache


def in_chunks(
    work: Callable[[slice], T],
    count: int,
    *,
    chunk: int = CHUNK,
    done: Callable[[float], object] | None = None,
) -> list[T]:
    """The results of `work` for each slice of `count` things, in order; `done` is called with shares of the work."""
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
    """The results of `work` for slices of `count` things, one after the other (count, ...)."""
    return np.concatenate(in_chunks(work, count) or [work(slice(0, 0))])
