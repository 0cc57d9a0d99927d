"""A scene as triangles and rays: what blocks what, and how far away it is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.scene.material import Glass
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

Floats = NDArray[Any]  # float32 where there are many, float64 inside formulas
Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]

# Rays start this far off their surface; float32 resolves 1e-6 m at 10 m.
RAY_OFFSET_M = 1e-4


@dataclass(frozen=True, slots=True)
class Inventory:
    """Every rectangle of a scene in one order: what stands still, the lights' panels, what moves.

    surfaces are where they are at one instant; mover (S,) is the index of the mover a surface belongs to, -1 for
    none; panel (S,) the index among scene.panels, -1 for none; pane (S,) whether it is glass.
    """

    surfaces: tuple[Surface, ...]
    mover: Indices
    panel: Indices
    pane: Mask


def inventory(scene: Scene, *, t_ns: float = 0) -> Inventory:
    """All rectangles of a scene, the movers' where they are at t_ns; the order never changes."""
    surfaces, mover, panel = list(scene.surfaces), [-1] * len(scene.surfaces), [-1] * len(scene.surfaces)
    for index, light in enumerate(scene.panels):
        surfaces, mover, panel = [*surfaces, light.surface], [*mover, -1], [*panel, index]
    for index, thing in enumerate(scene.movers):
        T_world_mover = thing.path.pose(t_ns)
        surfaces += [surface.moved(T_world_mover) for surface in thing.surfaces]
        mover += [index] * len(thing.surfaces)
        panel += [-1] * len(thing.surfaces)
    pane = [isinstance(scene.materials.get(s.material), Glass) for s in surfaces]
    return Inventory(tuple(surfaces), np.array(mover, np.int32), np.array(panel, np.int32), np.array(pane, bool))


def corners(surface: Surface) -> Array:
    """The four corners (4, 3), counter-clockwise from the visible side."""
    o, u, v = surface.corner_m, surface.edge_u_m, surface.edge_v_m
    return np.stack([o, o + u, o + u + v, o + v])


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere around something: centre (..., 3) and radius (...)."""

    centre_m: Array
    radius_m: Any

    def take(self, which: NDArray[np.int64]) -> "Ball":
        """Some of many."""
        return Ball(self.centre_m[which], self.radius_m[which])


def ball(surfaces: Sequence[Surface]) -> Ball:
    """Around the corners of them all."""
    points = np.concatenate([corners(s) for s in surfaces])
    centre = (points.min(0) + points.max(0)) / 2
    return Ball(centre, float(np.linalg.norm(points - centre, axis=1).max()))


@dataclass(frozen=True, slots=True)
class Hits:
    """Where rays end: surface (R,) int32, -1 for none; u, v (R,) fractions of its edges.

    distance (R,) is in lengths of the ray's direction, NaN for none.
    """

    surface: Indices
    u: Floats
    v: Floats
    distance: Floats


class RayCaster:
    """Rays against some of the surfaces of a list, with Embree; two triangles a rectangle.

    `among` (K,) says which; hits name surfaces by their place in the whole list.
    """

    def __init__(self, surfaces: Sequence[Surface], among: ArrayLike) -> None:
        self._among = np.asarray(among, np.int32)
        quads = [corners(surfaces[i]) for i in self._among]
        # A scene without triangles would make Embree fail; one beyond everything is never hit.
        quads = quads or [np.full((4, 3), 1e7)]
        triangles = np.stack(quads).astype(np.float32)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
        from embreex import mesh_construction, rtcore_scene

        self._scene = rtcore_scene.EmbreeScene()
        self._mesh = mesh_construction.TriangleMesh(self._scene, np.ascontiguousarray(triangles))

    def occluded(self, origins_m: ArrayLike, targets_m: ArrayLike) -> Mask:
        """Whether anything stands between each of (R, 3) origins and its target (R, 3)."""
        return self.stops(origins_m, np.asarray(targets_m) - np.asarray(origins_m))

    def stops(self, origins_m: ArrayLike, way: ArrayLike) -> Mask:
        """Whether anything stands between origins and origins + way (R, 3)."""
        blocked = np.asarray(self._scene.run(*_rays(origins_m, way, reach=1 - 1e-3), query="OCCLUDED"))
        is_blocked: Mask = blocked >= 0
        return is_blocked

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike) -> Indices:
        """Which surface each ray (R, 3) meets first, -1 for none: `hits` for those who work out the rest."""
        triangle: Indices = self._scene.run(*_rays(origins_m, directions, reach=1e8), query="INTERSECT")
        if not len(self._among):
            return np.full(len(triangle), -1, np.int32)
        # The triangle -1 halves to -1, the added last place.
        surface: Indices = np.append(self._among, np.int32(-1))[triangle >> 1]
        return surface

    def hits(self, origins_m: ArrayLike, directions: ArrayLike) -> Hits:
        """The nearest surface along each ray (R, 3)."""
        rays = _rays(origins_m, directions, reach=1e8)
        hit: dict[str, NDArray[np.float32]] = self._scene.run(*rays, query="INTERSECT", output=1)
        missed, second = hit["primID"] < 0, hit["primID"] % 2 == 1
        # Embree's (u, v) weigh a triangle's second and third corner; ours run along the edges.
        a, b = hit["u"], hit["v"]
        u, v = np.where(second, a, a + b), np.where(second, a + b, b)
        surface = np.full(len(a), -1, np.int32)
        surface[~missed] = self._among[hit["primID"][~missed].astype(np.int32) // 2]
        distance = np.where(missed, np.nan, hit["tfar"])
        return Hits(surface, u.astype(np.float32), v.astype(np.float32), distance.astype(np.float32))


def _rays(origins_m: ArrayLike, directions: ArrayLike, *, reach: float) -> tuple[Floats, Floats, Floats]:
    """Contiguous float32 arrays, as Embree wants them; `reach` in lengths of the direction."""
    origins = np.ascontiguousarray(origins_m, np.float32)
    return origins, np.ascontiguousarray(directions, np.float32), np.full(len(origins), reach, np.float32)
