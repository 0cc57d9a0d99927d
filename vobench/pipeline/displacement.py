"""How far points of a scene move in a picture while its camera, or they themselves, move."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.render.geometry import RayCaster, inventory
from vobench.scene.scene import Scene

# Rays that meet nothing look at the sky, which is as good as this far.
FAR_M = 1e3
GRID = (9, 7)


class Displacement:
    """Measures one scene's displacements, at a grid of pixels."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._at_rest = _Seen(scene, 0)

    def largest_px(
        self, camera: Camera, T_world_first: Array, T_world_last: Array, *, start_ns: int, end_ns: int
    ) -> float:
        """How far what the first pose sees at start_ns has moved for the last one at end_ns, in pixels, at most."""
        rays = _grid_rays(camera) @ T_world_first[:3, :3].T
        seen = _Seen(self._scene, start_ns) if self._scene.movers else self._at_rest
        before = seen.points(T_world_first[:3, 3], rays)
        after = seen.later(before, end_ns)
        first, last = (
            camera.project(se3.apply(se3.inverse(T), points.at_m))
            for T, points in ((T_world_first, before), (T_world_last, after))
        )
        moved = np.linalg.norm(last - first, axis=-1)
        return float(np.nanmax(moved)) if np.isfinite(moved).any() else 0.0


@dataclass(frozen=True, slots=True)
class _Points:
    """Points at_m (K, 3), and the mover each is on, -1 for none."""

    at_m: Array
    mover: NDArray[np.int32]


class _Seen:
    """What rays meet in a scene at an instant; panes are seen through."""

    def __init__(self, scene: Scene, t_ns: int) -> None:
        held = inventory(scene, t_ns=t_ns)
        self._scene, self._t_ns, self._mover = scene, t_ns, held.mover
        self._caster = RayCaster(held.surfaces, np.flatnonzero(~held.pane))

    def points(self, origin_m: Array, rays: Array) -> _Points:
        """The ends of unit rays (K, 3) from one origin."""
        hits = self._caster.hits(np.broadcast_to(origin_m, rays.shape), rays)
        distance = np.nan_to_num(hits.distance, nan=FAR_M)[:, None]
        return _Points(origin_m + distance * rays, np.where(hits.surface < 0, -1, self._mover[hits.surface]))

    def later(self, points: _Points, t_ns: int) -> _Points:
        """The same points of the same things at another instant."""
        at_m = points.at_m.copy()
        for index, mover in enumerate(self._scene.movers):
            T_later_now = mover.path.pose(t_ns) @ se3.inverse(mover.path.pose(self._t_ns))
            at_m[points.mover == index] = se3.apply(T_later_now, at_m[points.mover == index])
        return _Points(at_m, points.mover)


@lru_cache(maxsize=8)
def _grid_rays(camera: Camera) -> Array:
    """Rays (K, 3) through pixels spread over the whole picture, borders included, where the lens has any."""
    u, v = np.meshgrid(np.linspace(0, camera.width_px - 1, GRID[0]), np.linspace(0, camera.height_px - 1, GRID[1]))
    rays = camera.rays(np.stack([u, v], -1)).reshape(-1, 3)
    return rays[np.isfinite(rays).all(1)]
