"""Every rectangle of a scene, rays against them, and how much light passes between two points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.scene.material import Glass, Material, Mirror, pane_reflectance
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

Floats = NDArray[Any]  # float32 where there are many, float64 inside formulas
Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]
T = TypeVar("T")

# Rays start this far off their surface; float32 resolves 1e-6 m at 10 m.
RAY_OFFSET_M = 1e-4


@dataclass(frozen=True, slots=True)
class SurfaceList:
    """Every rectangle of a scene in one order: static ones, the lights' panels, movers'.

    surfaces are where they are at one instant; mover (S,) is the index of the mover a surface belongs to, -1 for
    none; panel (S,) the index among scene.panels, -1 for none; pane (S,) whether it is glass.
    """

    surfaces: tuple[Surface, ...]
    mover: Indices
    panel: Indices
    pane: Mask


def inventory(scene: Scene, *, t_ns: float = 0) -> SurfaceList:
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
    return SurfaceList(tuple(surfaces), np.array(mover, np.int32), np.array(panel, np.int32), np.array(pane, bool))


def corners(surface: Surface) -> Array:
    """The four corners (4, 3), counter-clockwise from the visible side."""
    o, u, v = surface.corner_m, surface.edge_u_m, surface.edge_v_m
    return np.stack([o, o + u, o + u + v, o + v])


def take(table: T, which: NDArray[np.int64] | Mask | slice) -> T:
    """Some rows of all the arrays that a dataclass has."""
    return type(table)(*(getattr(table, field.name)[which] for field in fields(table)))  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere around something: centre (..., 3) and radius (...)."""

    centre_m: Array
    radius_m: Any

    take = take


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

    take = take


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
        """Whether anything is between each of (R, 3) origins and its target (R, 3)."""
        return self.stops(origins_m, np.asarray(targets_m) - np.asarray(origins_m))

    def stops(self, origins_m: ArrayLike, way: ArrayLike) -> Mask:
        """Whether anything is between origins and origins + way (R, 3)."""
        blocked = np.asarray(self._scene.run(*_rays(origins_m, way, reach=1 - 1e-3), query="OCCLUDED"))
        return np.asarray(blocked >= 0)

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike) -> Indices:
        """Which surface each ray (R, 3) meets first, -1 for none: `hits` for those who work out the rest."""
        triangle: Indices = self._scene.run(*_rays(origins_m, directions, reach=1e8), query="INTERSECT")
        # The triangle -1 halves to -1, the added last place.
        return np.asarray(np.append(self._among, np.int32(-1))[triangle >> 1])

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


FAR_M = 1e3  # beyond every scene
MOST_PANES = 16  # crossed by one ray


def smooth_mirror(surface: Surface, materials: Mapping[str, Material]) -> Mirror | None:
    """The mirror, where a surface is one that shows lamps as sharp as they are. Coats mirror too, but faintly."""
    material = materials.get(surface.material)
    return material if isinstance(material, Mirror) and material.roughness == 0 else None


class Visibility:
    """Opaque surfaces and panes of a list, of those `among` (K,) names."""

    def __init__(self, surfaces: Sequence[Surface], materials: Mapping[str, Material], among: Sequence[int]) -> None:
        glass = {i: m for i in among if isinstance(m := materials.get(surfaces[i].material), Glass)}
        self.surfaces = surfaces
        self.normals = np.array([s.normal for s in surfaces], np.float32).reshape(-1, 3)
        self.opaque = RayCaster(surfaces, [i for i in among if i not in glass])
        self.panes = tuple(glass)
        self.mirrors = [(surfaces[i], m.tint) for i in among if (m := smooth_mirror(surfaces[i], materials))]
        self._glass = RayCaster(surfaces, self.panes)
        self._eta, self._tint = np.ones(len(surfaces)), np.ones(len(surfaces), np.float32)
        for index, pane in glass.items():
            self._eta[index], self._tint[index] = pane.eta, pane.tint

    def passing(self, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) of light that comes from origins + way (R, 3) to the origins (R, 3)."""
        clear = np.flatnonzero(self.clear(origins_m, way))
        share = np.zeros(len(origins_m), np.float32)
        share[clear] = self.through_panes(origins_m[clear], way[clear])
        return share

    def clear(self, origins_m: Floats, way: Floats) -> NDArray[np.bool_]:
        """Whether nothing opaque is between origins and origins + way (R, 3)."""
        return ~self.opaque.stops(origins_m, way)

    def pane_passes(self, pane: int, directions: Floats) -> Floats:
        """Share (R,) that one pane lets through along unit directions (R, 3)."""
        cosine = directions @ self.normals[pane]
        return np.asarray(self._tint[pane] * (1 - pane_reflectance(cosine, float(self._eta[pane]))))

    def crosses_pane(self, origins_m: Floats, way: Floats) -> NDArray[np.bool_]:
        """Whether a pane is between origins and origins + way (R, 3)."""
        if not self.panes:
            return np.zeros(len(origins_m), bool)
        return self._glass.stops(origins_m, way)

    def first_panes(self, origins_m: Floats, way: Floats) -> tuple[NDArray[np.int64], Hits]:
        """Which rays from origins along way (R, 3) cross a pane (K,), and where they meet their first."""
        rays = np.flatnonzero(self.crosses_pane(origins_m, way))
        return rays, self._glass.hits(origins_m[rays], way[rays])

    def pane_mirrors(self, panes: Indices, cosine: Floats) -> Floats:
        """Share (R,) that panes (R,) reflect at cosines (R,)."""
        return pane_reflectance(cosine, self._eta[panes]).astype(np.float32)

    def through_panes(self, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) that all panes between origins and origins + way (R, 3) let through."""
        share = np.ones(len(origins_m), np.float32)
        rays = np.flatnonzero(self.crosses_pane(origins_m, way))
        gone = np.zeros(len(rays), np.float32)
        for _ in range(MOST_PANES):
            if not len(rays):
                break
            ahead = way[rays] * (1 - gone)[:, None]
            hits = self._glass.hits(origins_m[rays] + way[rays] * gone[:, None], ahead)
            met = np.flatnonzero((hits.surface >= 0) & (hits.distance < 1))
            rays, pane, ahead = rays[met], hits.surface[met], ahead[met]
            length = np.linalg.norm(ahead, axis=1)
            cosine = np.einsum("ij,ij->i", ahead, self.normals[pane]) / length
            share[rays] *= self._tint[pane] * (1 - pane_reflectance(cosine, self._eta[pane])).astype(np.float32)
            gone = gone[met] + (1 - gone[met]) * (hits.distance[met] + RAY_OFFSET_M / length)
        return share

    def sky_panes(self) -> tuple[int, ...]:
        """The panes behind which, on either side, something of the sky can be seen."""
        return tuple(pane for pane in self.panes if self._sees_sky(self.surfaces[pane]))

    def _sees_sky(self, pane: Surface) -> bool:
        """Whether any of 1024 fixed rays, half to each side, leaves the scene without another pane."""
        u, v, tilt, turn = np.random.default_rng(0).random((4, 512))
        x_axis, y_axis = (edge / np.linalg.norm(edge) for edge in (pane.edge_u_m, pane.edge_v_m))
        radius, angle = np.sqrt(tilt)[:, None], 2 * np.pi * turn[:, None]
        flat = radius * (np.cos(angle) * x_axis + np.sin(angle) * y_axis)
        up = np.sqrt(1 - radius**2) * pane.normal
        directions = np.concatenate([flat + up, flat - up])
        origins = np.tile(pane.at(u, v), (2, 1)) + RAY_OFFSET_M * directions
        blocked = self.opaque.stops(origins, FAR_M * directions)
        return bool((~blocked & ~self.crosses_pane(origins, FAR_M * directions)).any())
