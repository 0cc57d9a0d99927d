"""Embree with results that do not depend on the processor, for VOBENCH_PORTABLE."""

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import MissingDependencyError
from vobench.portable import PORTABLE
from vobench.rendering.dot_product import dot

DEVICE_CONFIG = b"isa=sse4.2"  # the instruction set that Embree may use
UNEXPECTED_BUILD = f"{PORTABLE} needs embreex 4.4 as its wheel for Linux is built; run without it"

# The layout of a device of embreex: Python's reference count and type, then the pointer to the device of Embree.
POINTER_OFFSET = 16
OBJECT_SIZE = 24

# The versions of Embree 4, as Embree reports them.
VERSION_PROPERTY = 0  # RTC_DEVICE_PROPERTY_VERSION
OLDEST_VERSION = 40000
NEWEST_VERSION = 49999


@cache
def portable_device() -> Any:
    """A device of embreex that uses SSE4.2 on every processor.

    embreex creates devices without a configuration. This function therefore replaces the device of Embree in an object
    of embreex by one with a configuration.
    Raises MissingDependencyError if embreex is not built as this expects.
    """
    from embreex.rtcore import EmbreeDevice

    if EmbreeDevice.__basicsize__ != OBJECT_SIZE:
        raise MissingDependencyError(UNEXPECTED_BUILD)
    library = _embree_library()
    device = EmbreeDevice()
    pointer = ctypes.c_void_p.from_address(id(device) + POINTER_OFFSET)
    version = library.rtcGetDeviceProperty(pointer.value, VERSION_PROPERTY)
    if not OLDEST_VERSION <= version <= NEWEST_VERSION:
        raise MissingDependencyError(UNEXPECTED_BUILD)

    library.rtcReleaseDevice(pointer.value)
    pointer.value = library.rtcNewDevice(DEVICE_CONFIG)
    return device


def _embree_library() -> ctypes.CDLL:
    """The library of Embree that embreex contains, with the types of the functions that are called here."""
    import embreex

    site_packages = Path(embreex.__file__).parent.parent
    paths = list(site_packages.glob("embreex.libs/libembree4*"))
    if len(paths) != 1:
        raise MissingDependencyError(UNEXPECTED_BUILD)
    library = ctypes.CDLL(str(paths[0]))
    library.rtcNewDevice.restype = ctypes.c_void_p
    library.rtcNewDevice.argtypes = [ctypes.c_char_p]
    library.rtcReleaseDevice.argtypes = [ctypes.c_void_p]
    library.rtcGetDeviceProperty.restype = ctypes.c_ssize_t
    library.rtcGetDeviceProperty.argtypes = [ctypes.c_void_p, ctypes.c_int]
    return library


def with_portable_places(
    hits: dict[str, Any],
    triangles_m: NDArray[Any],
    origins_m: NDArray[Any],
    directions: NDArray[Any],
) -> dict[str, Any]:
    """Recompute `u`, `v` and `tfar` of Embree's hits of rays (R, 3) on triangles (K, 3, 3).

    Embree divides by an approximate reciprocal, whose last bits differ between makes of processors. The triangle that a
    ray hits, `primID`, does not depend on it.
    Source: Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997.
    """
    triangle = hits["primID"].astype(np.int64)
    is_hit = (triangle >= 0) & (triangle < len(triangles_m))
    rays = np.flatnonzero(is_hit)
    corners_m = triangles_m[triangle[rays]].astype(np.float64)
    a, b, c = np.moveaxis(corners_m, 1, 0)
    origin = origins_m[rays].astype(np.float64)
    direction = directions[rays].astype(np.float64)

    # p, q and the determinant are named as in the paper.
    p = np.cross(direction, c - a)
    q = np.cross(origin - a, b - a)
    determinant = dot(b - a, p)
    recomputed = {
        "u": dot(origin - a, p) / determinant,
        "v": dot(direction, q) / determinant,
        "tfar": dot(c - a, q) / determinant,
    }
    portable_hits = dict(hits)
    for name, values in recomputed.items():
        portable_hits[name] = hits[name].copy()
        portable_hits[name][rays] = values
    return portable_hits
