"""Memory that is free for this process but that the C library has not given back to the system."""

import ctypes
import gc
import sys


def give_back() -> None:
    """Give freed memory back to the system, so that what a stage has used does not add to the peak of the next.

    glibc keeps freed blocks of less than 32 MB in its heaps, and so up to 300 MB after a stage of a bake. Other C
    libraries have no such function, and nothing is done.
    """
    if not sys.platform.startswith("linux"):
        return
    library = ctypes.CDLL(None)
    if hasattr(library, "malloc_trim"):
        library.malloc_trim(0)


def collect() -> None:
    """Free what refers to itself, as meshes of trimesh do, and give its memory back.

    Python frees such objects by itself only after a while, in which a process that goes from place to place grows with
    each of them.
    """
    gc.collect()
    give_back()
