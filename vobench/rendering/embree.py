"""Embree's scenes; where results must not depend on the make of the processor, with one instruction set."""

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import MissingDependencyError
from vobench.portable import PORTABLE, is_portable

Floats = NDArray[np.float32]
PORTABLE_CONFIG = b"isa=sse4.2"
VERSION_PROPERTY = 0  # RTC_DEVICE_PROPERTY_VERSION
# versions of Embree 4
OLDEST = 40000
NEWEST = 49999
POINTER_OFFSET = 16  # of the device in embreex's object: behind Python's reference count and type
OBJECT_SIZE = 24


def new_scene(*, robust: bool = False) -> Any:
    """An empty scene for rays; `robust`: no ray slips between two triangles that share an edge."""
    from embreex.rtcore_scene import EmbreeScene

    return EmbreeScene(_portable_device(), robust=robust) if is_portable() else EmbreeScene(robust=robust)


@cache
def _portable_device() -> Any:
    """A device that is held to SSE4.2.

    embreex creates devices without a configuration, so its pointer is exchanged for one of a device with ours. Raises
    MissingDependencyError where embreex is not built as this expects.
    """
    import embreex
    from embreex.rtcore import EmbreeDevice

    found = list(Path(embreex.__file__).parent.parent.glob("embreex.libs/libembree4*"))
    device = EmbreeDevice()
    if len(found) == 1 and EmbreeDevice.__basicsize__ == OBJECT_SIZE:
        embree = ctypes.CDLL(str(found[0]))
        embree.rtcNewDevice.restype = ctypes.c_void_p
        embree.rtcNewDevice.argtypes = [ctypes.c_char_p]
        embree.rtcReleaseDevice.argtypes = [ctypes.c_void_p]
        embree.rtcGetDeviceProperty.restype = ctypes.c_ssize_t
        embree.rtcGetDeviceProperty.argtypes = [ctypes.c_void_p, ctypes.c_int]
        slot = ctypes.c_void_p.from_address(id(device) + POINTER_OFFSET)
        if OLDEST <= embree.rtcGetDeviceProperty(slot.value, VERSION_PROPERTY) <= NEWEST:
            embree.rtcReleaseDevice(slot.value)
            slot.value = embree.rtcNewDevice(PORTABLE_CONFIG)
            return device
    raise MissingDependencyError(f"{PORTABLE} needs embreex 4.4 as its wheel for Linux is built; run without it")


def with_portable_places(
    hit: dict[str, Any], triangles_m: NDArray[Any], origins_m: NDArray[Any], directions: NDArray[Any]
) -> dict[str, Any]:
    """The hits of rays (R, 3) on triangles (K, 3, 3), with `u`, `v` and `tfar` recomputed where results are portable.

    Embree divides by an approximate reciprocal, whose last bits the maker of a processor chooses. The triangle that a
    ray meets does not depend on it.
    Source: Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997.
    """
    if not is_portable():
        return hit
    triangle = hit["primID"].astype(np.int64)
    met = np.flatnonzero((triangle >= 0) & (triangle < len(triangles_m)))
    a, b, c = np.moveaxis(triangles_m[triangle[met]].astype(np.float64), 1, 0)
    origin = origins_m[met].astype(np.float64)
    direction = directions[met].astype(np.float64)

    p = np.cross(direction, c - a)
    q = np.cross(origin - a, b - a)
    determinant = _dot(b - a, p)
    for name, value in (("u", _dot(origin - a, p)), ("v", _dot(direction, q)), ("tfar", _dot(c - a, q))):
        hit[name][met] = value / determinant
    return hit


def _dot(one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
    """Products (R,) of vectors (R, 3), summed in one order: BLAS and einsum choose theirs by the processor."""
    products = one * other
    return np.asarray(products[:, 0] + products[:, 1] + products[:, 2])
