"""Visibility and transmittance between two points: walls that stop light, panes that let a share of it through."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vobench.render.geometry import RAY_OFFSET_M, Floats, Hits, Indices, RayCaster
from vobench.scene.material import Glass, Material, Mirror, pane_reflectance
from vobench.scene.surface import Surface

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
        """Whether nothing opaque stands between origins and origins + way (R, 3)."""
        return ~self.opaque.stops(origins_m, way)

    def pane_passes(self, pane: int, directions: Floats) -> Floats:
        """Share (R,) that one pane lets through along unit directions (R, 3)."""
        cosine = directions @ self.normals[pane]
        share: Floats = self._tint[pane] * (1 - pane_reflectance(cosine, float(self._eta[pane])))
        return share

    def crosses_pane(self, origins_m: Floats, way: Floats) -> NDArray[np.bool_]:
        """Whether a pane stands between origins and origins + way (R, 3)."""
        if not self.panes:
            return np.zeros(len(origins_m), bool)
        return self._glass.stops(origins_m, way)

    def first_panes(self, origins_m: Floats, way: Floats) -> tuple[NDArray[np.int64], Hits]:
        """Which rays from origins along way (R, 3) cross a pane (K,), and where they meet their first."""
        rays = np.flatnonzero(self.crosses_pane(origins_m, way))
        return rays, self._glass.hits(origins_m[rays], way[rays])

    def pane_mirrors(self, panes: Indices, cosine: Floats) -> Floats:
        """Share (R,) that panes (R,) throw back at cosines (R,)."""
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
