"""Freed memory goes back to the system."""

import gc
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest

from vobench.rendering.freed_memory import collect, give_back

MANY = 200
SMALL = 100_000  # bytes: glibc keeps such blocks in its heap


def resident_pages() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc tells how much memory a process has")
def test_blocks_that_were_freed_are_no_memory_of_the_process_any_more() -> None:
    blocks = [np.ones(SMALL, np.uint8) for _ in range(MANY)]
    last = np.ones(SMALL, np.uint8)  # above the others, so that the heap cannot shrink by itself
    del blocks
    before = resident_pages()
    give_back()
    page = 4096
    assert before - resident_pages() > 0.5 * MANY * SMALL / page
    assert last.all()


class Ring:
    """An object that refers to itself."""

    def __init__(self) -> None:
        self.itself = self


def test_what_refers_to_itself_is_freed() -> None:
    gc.disable()
    try:
        ring = weakref.ref(Ring())
        assert ring() is not None
        collect()
        assert ring() is None
    finally:
        gc.enable()
