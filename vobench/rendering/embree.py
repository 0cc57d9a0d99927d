"""Ray casting by Embree: the nearest triangle along each ray, or whether a ray is blocked."""

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.portable import is_portable
from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.portable_embree import portable_device, with_portable_places

# No ray reaches this distance. A triangle there stands for an empty set of triangles, with which Embree would fail.
BEYOND_M = 1e9


@dataclass(frozen=True, slots=True)
class Hits:
    """The hits of R rays on triangles.

    `face` (R,) int32 is the triangle that each ray hits, -1 for none.
    `u`, `v` (R,) are the weights of the triangle's second and third corner at the hit.
    `distance` (R,) is in lengths of the ray's direction, NaN without a hit.
    """

    face: Indices
    u: Floats
    v: Floats
    distance: Floats

    def take(self, rays: Any) -> "Hits":
        """The hits of some rays, given by a mask, a slice or their indices."""
        return Hits(self.face[rays], self.u[rays], self.v[rays], self.distance[rays])

    def at(self, values: Floats) -> Floats:
        """The values (R, ...) at the hits, interpolated between those at the corners of the triangles (F, 3, ...)."""
        a, b, c = values[self.face].swapaxes(0, 1)
        ones = [1] * (a.ndim - 1)
        u = self.u.reshape(-1, *ones)
        v = self.v.reshape(-1, *ones)
        return np.asarray(a + u * (b - a) + v * (c - a))


class TriangleCaster:
    """Casts rays at the triangles in some rows (K,) of a table of corners (F, 3, 3).

    Hits name triangles by their row in the table. With `robust`, no ray passes between two triangles that share an
    edge.
    """

    def __init__(self, corners_m: NDArray[Any], rows: NDArray[Any], *, robust: bool) -> None:
        from embreex import mesh_construction

        # Embree numbers the K triangles from 0, and reports -1 if there is no hit. Then the last entry is read.
        self._rows = np.append(rows, -1).astype(np.int32)
        corners = corners_m[rows] if len(rows) else np.full((1, 3, 3), BEYOND_M)
        self._triangles = np.ascontiguousarray(corners, np.float32)
        self._scene = new_scene(robust=robust)
        self._mesh = mesh_construction.TriangleMesh(self._scene, self._triangles)

    def hits(self, origins_m: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> Hits:
        """The nearest triangle along rays (R, 3), up to `reach` (R,) lengths of their directions."""
        rays = _rays(origins_m, directions, reach)
        embree_hits = self._scene.run(*rays, query="INTERSECT", output=1)
        if is_portable():
            embree_hits = with_portable_places(embree_hits, self._triangles, rays.origins_m, rays.directions)
        face = self._rows[embree_hits["primID"]]
        distance = np.where(face < 0, np.float32(np.nan), embree_hits["tfar"])
        return Hits(face, embree_hits["u"], embree_hits["v"], distance)

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike, reach: float) -> Indices:
        """Only the `face` (R,) of `hits`, which is faster."""
        rays = _rays(origins_m, directions, reach)
        triangle = self._scene.run(*rays, query="INTERSECT")
        return np.asarray(self._rows[triangle])

    def stops(self, origins_m: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> Mask:
        """Whether a triangle blocks each ray (R,) between its origin and origin + reach * direction.

        False for rays whose reach is negative.
        """
        rays = _rays(origins_m, directions, reach)
        is_blocked = self._scene.run(*rays, query="OCCLUDED") >= 0
        return np.asarray(is_blocked & (rays.reach > 0))


class _Rays(NamedTuple):
    """R rays as Embree requires them: contiguous float32 arrays of shapes (R, 3), (R, 3) and (R,)."""

    origins_m: NDArray[np.float32]
    directions: NDArray[np.float32]
    reach: NDArray[np.float32]


def _rays(origins_m: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> _Rays:
    """Convert rays for Embree. `reach` (R,) may also be one number for all rays."""
    float32_origins_m = np.ascontiguousarray(origins_m, np.float32)
    float32_directions = np.ascontiguousarray(directions, np.float32)
    if np.ndim(reach) == 0:
        float32_reach = np.full(len(float32_origins_m), reach, np.float32)
    else:
        float32_reach = np.ascontiguousarray(reach, np.float32)
    return _Rays(float32_origins_m, float32_directions, float32_reach)


def new_scene(*, robust: bool = False) -> Any:
    """An empty scene of Embree."""
    from embreex.rtcore_scene import EmbreeScene

    return EmbreeScene(portable_device() if is_portable() else _device(), robust=robust)


@cache
def _device() -> Any:
    """The device of Embree that all scenes of a process share. Embree fails with a device for each of 1000 scenes."""
    from embreex.rtcore import EmbreeDevice

    return EmbreeDevice()
