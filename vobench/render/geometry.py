"""A scene as triangles and rays: what blocks what, and how far away it is."""

from dataclasses import dataclass

import numpy as np
from embreex import mesh_construction, rtcore_scene
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.scene.scene import Scene, Surface

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]

# Rays start this far off their surface; float32 resolves 1e-6 m at 10 m.
RAY_OFFSET_M = 1e-4


def all_surfaces(scene: Scene) -> list[Surface]:
    """Every rectangle that can be seen, the lights' panels last."""
    return [*scene.surfaces, *(light.surface for light in scene.lights)]


def corners(surface: Surface) -> Array:
    """The four corners (4, 3), counter-clockwise from the visible side."""
    o, u, v = surface.corner_m, surface.edge_u_m, surface.edge_v_m
    return np.stack([o, o + u, o + u + v, o + v])


@dataclass(frozen=True, slots=True)
class Hits:
    """Where rays end: surface (R,) int32, -1 for none; u, v (R,) fractions of its edges."""

    surface: Indices
    u: Floats
    v: Floats


class RayCaster:
    """Rays against a scene, with Embree; two triangles a rectangle."""

    def __init__(self, scene: Scene) -> None:
        quads = np.stack([corners(s) for s in all_surfaces(scene)]).astype(np.float32)
        triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
        self._scene = rtcore_scene.EmbreeScene()
        self._mesh = mesh_construction.TriangleMesh(self._scene, np.ascontiguousarray(triangles))

    def occluded(self, origins_m: ArrayLike, targets_m: ArrayLike) -> NDArray[np.bool_]:
        """Whether anything stands between each of (R, 3) origins and its target (R, 3)."""
        way = np.asarray(targets_m) - np.asarray(origins_m)
        blocked: NDArray[np.int32] = self._scene.run(*_rays(origins_m, way, reach=1 - 1e-3), query="OCCLUDED")
        return blocked >= 0

    def hits(self, origins_m: ArrayLike, directions: ArrayLike) -> Hits:
        """The nearest surface along each ray (R, 3)."""
        hit = self._nearest(origins_m, directions)
        second = hit["primID"] % 2 == 1
        # Embree's (u, v) weigh a triangle's second and third corner; ours run along the edges.
        a, b = hit["u"], hit["v"]
        u, v = np.where(second, a, a + b), np.where(second, a + b, b)
        surface = np.where(hit["primID"] < 0, -1, hit["primID"] // 2).astype(np.int32)
        return Hits(surface, u.astype(np.float32), v.astype(np.float32))

    def distance(self, origins_m: ArrayLike, directions: ArrayLike) -> Floats:
        """How many lengths of its direction each ray (R, 3) travels; NaN where it meets nothing."""
        hit = self._nearest(origins_m, directions)
        return np.where(hit["primID"] < 0, np.nan, hit["tfar"]).astype(np.float32)

    def depth(self, camera: Pinhole, T_world_camera: Array) -> Floats:
        """Depth (H, W) in metres along the optical axis at the pixels' centres."""
        rays = camera.rays(camera.pixel_grid()).reshape(-1, 3) @ T_world_camera[:3, :3].T
        origins = np.broadcast_to(T_world_camera[:3, 3], rays.shape)
        return self.distance(origins, rays).reshape(camera.height_px, camera.width_px)

    def _nearest(self, origins_m: ArrayLike, directions: ArrayLike) -> dict[str, NDArray[np.float32]]:
        rays = _rays(origins_m, directions, reach=1e8)
        hit: dict[str, NDArray[np.float32]] = self._scene.run(*rays, query="INTERSECT", output=1)
        return hit


def _rays(origins_m: ArrayLike, directions: ArrayLike, *, reach: float) -> tuple[Floats, Floats, Floats]:
    """Contiguous float32 arrays, as Embree wants them; `reach` in lengths of the direction."""
    origins = np.ascontiguousarray(origins_m, np.float32)
    return origins, np.ascontiguousarray(directions, np.float32), np.full(len(origins), reach, np.float32)
