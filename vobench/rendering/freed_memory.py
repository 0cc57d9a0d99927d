"""Memory that is free for this process but that the C library has not given back to the system."""

import ctypes
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
