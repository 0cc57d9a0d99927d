"""Functions that Numba compiles to machine code, which is kept in the cache folder for the next process.

The environment variable ``NUMBA_CACHE_DIR`` names another folder.
"""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., object])
FOLDER = "kernels"  # below vobench's cache folder


def _folder() -> Path:
    """The folder that Numba keeps machine code in: the one that Numba's own variable names, or one of the cache."""
    stated = os.environ.get("NUMBA_CACHE_DIR")
    if stated:
        return Path(stated)
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    cache = Path(os.environ.get("VOBENCH_CACHE") or home / "vobench")
    return cache / FOLDER


def _is_cached() -> bool:
    """Set the folder that Numba keeps machine code in; whether files can be written there."""
    folder = _folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        return False
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    return True


IS_CACHED = _is_cached()


def float32(value: float) -> float:
    """A constant with which kernels compute in float32. For type checkers it is a float, as all scalars of kernels."""
    return cast("float", np.float32(value))


def compiled(function: Function) -> Function:
    """Compile a function when it is first called. It runs without Python's lock, so threads run it side by side.

    If the cache folder cannot be written, each process compiles the function again.
    """
    kernel: Any = numba.njit(nogil=True, cache=IS_CACHED, error_model="numpy")(function)
    return cast("Function", kernel)
