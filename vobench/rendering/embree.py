"""Rays against triangles by Embree; where results must not depend on the processor, with one instruction set."""

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import MissingDependencyError
from vobench.portable import PORTABLE, is_portable
from vobench.rendering.array_types import Floats, Indices, Mask

PORTABLE_CONFIG = b"isa=sse4.2"
VERSION_PROPERTY = 0  # RTC_DEVICE_PROPERTY_VERSION
# versions of Embree 4
OLDEST = 40000
NEWEST = 49999
POINTER_OFFSET = 16  # of the device in embreex's object: behind Python's reference count and type
OBJECT_SIZE = 24


BEYOND_M = 1e9  # farther than any ray leads


@dataclass(frozen=True, slots=True)
class Hits:
    """The hits of R rays: `face` (R,) int32, -1 for none; `u`, `v` (R,) are the weights of its second and third corner.

    distance (R,) is in lengths of the ray's direction, NaN for none.
    """

    face: Indices
    u: Floats
    v: Floats
    distance: Floats

    def take(self, rays: Any) -> "Hits":
        """The hits of some rays, given by a mask, a slice or their indices."""
        return Hits(self.face[rays], self.u[rays], self.v[rays], self.distance[rays])

    def at(self, values: Floats) -> Floats:
        """Values (R, ...) between those of faces' corners (F, 3, ...)."""
        a, b, c = values[self.face].swapaxes(0, 1)
        shape = (-1, *[1] * (a.ndim - 1))
        u = self.u.reshape(shape)
        v = self.v.reshape(shape)
        return np.asarray(a + u * (b - a) + v * (c - a))


class TriangleCaster:
    """Embree over some triangles (K,) of a table of corners (F, 3, 3); hits name them by their place in the table.

    robust: no ray slips between two triangles that share an edge.
    """

    def __init__(
        self,
        corners_m: NDArray[Any],
        among: NDArray[Any],
        *,
        robust: bool,
    ) -> None:
        from embreex import mesh_construction

        self._among = np.append(among, -1).astype(np.int32)
        # A scene without triangles would make Embree fail; one beyond everything is never hit.
        corners = corners_m[among] if len(among) else np.full((1, 3, 3), BEYOND_M)
        self._triangles = np.ascontiguousarray(corners, np.float32)
        self._scene = new_scene(robust=robust)
        self._mesh = mesh_construction.TriangleMesh(self._scene, self._triangles)

    def hits(self, origins_m: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> Hits:
        """The nearest face along rays (R, 3), no farther than `reach` (R,) lengths of their directions."""
        rays = _rays(origins_m, directions, reach)
        result = self._scene.run(*rays, query="INTERSECT", output=1)
        hit = with_portable_places(result, self._triangles, rays[0], rays[1])
        face = self._among[hit["primID"]]
        distance = np.where(face < 0, np.float32(np.nan), hit["tfar"])
        return Hits(face, hit["u"], hit["v"], distance)

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike, reach: float) -> Indices:
        """The face of `hits` (R,) alone, which costs less."""
        triangle = self._scene.run(*_rays(origins_m, directions, reach), query="INTERSECT")
        return np.asarray(self._among[triangle])

    def stops(self, origins_m: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> Mask:
        """Whether a face is between origins and origins + reach * directions (R, 3); none where reach is negative."""
        rays = _rays(origins_m, directions, reach)
        is_blocked = self._scene.run(*rays, query="OCCLUDED") >= 0
        return np.asarray(is_blocked & (rays[2] > 0))


def _rays(
    origins_m: ArrayLike,
    directions: ArrayLike,
    reach: ArrayLike,
) -> tuple[Floats, Floats, Floats]:
    """Contiguous float32 arrays, as Embree wants them; reach (R,) or one for all, in lengths of the direction."""
    origins = np.ascontiguousarray(origins_m, np.float32)
    is_same = np.ndim(reach) == 0
    reaches = np.full(len(origins), reach, np.float32) if is_same else reach
    float32_directions = np.ascontiguousarray(directions, np.float32)
    return origins, float32_directions, np.ascontiguousarray(reaches, np.float32)


def new_scene(*, robust: bool = False) -> Any:
    """An empty scene of Embree's."""
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

    libraries = list(Path(embreex.__file__).parent.parent.glob("embreex.libs/libembree4*"))
    device = EmbreeDevice()
    if len(libraries) == 1 and EmbreeDevice.__basicsize__ == OBJECT_SIZE:
        embree = ctypes.CDLL(str(libraries[0]))
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
    hit: dict[str, Any],
    triangles_m: NDArray[Any],
    origins_m: NDArray[Any],
    directions: NDArray[Any],
) -> dict[str, Any]:
    """The hits of rays (R, 3) on triangles (K, 3, 3), with `u`, `v` and `tfar` recomputed where results are portable.

    Embree divides by an approximate reciprocal, whose last bits the maker of a processor chooses. The triangle that a
    ray meets does not depend on it.
    Source: Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997.
    """
    if not is_portable():
        return hit
    triangle = hit["primID"].astype(np.int64)
    rays = np.flatnonzero((triangle >= 0) & (triangle < len(triangles_m)))
    corners_m = triangles_m[triangle[rays]].astype(np.float64)
    a, b, c = np.moveaxis(corners_m, 1, 0)
    origin = origins_m[rays].astype(np.float64)
    direction = directions[rays].astype(np.float64)

    # Named as in the paper.
    p = np.cross(direction, c - a)
    q = np.cross(origin - a, b - a)
    determinant = _dot(b - a, p)
    hit["u"][rays] = _dot(origin - a, p) / determinant
    hit["v"][rays] = _dot(direction, q) / determinant
    hit["tfar"][rays] = _dot(c - a, q) / determinant
    return hit


def _dot(one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
    """Products (R,) of vectors (R, 3), summed in one order: BLAS and einsum choose theirs by the processor."""
    products = one * other
    return np.asarray(products[:, 0] + products[:, 1] + products[:, 2])
