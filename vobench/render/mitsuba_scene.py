"""A scene that Mitsuba traces paths in, and what of it changes from moment to moment."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.render.geometry import inventory
from vobench.render.mitsuba_plugins import STRENGTH, groups, light_key, load, nominal, positions
from vobench.scene.light import Light, Sun
from vobench.scene.material import Glass
from vobench.scene.scene import Scene

Floats = NDArray[np.float32]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class State:
    """What of a scene changes: each light's level, and the instant at which movers and suns are looked at."""

    levels: tuple[float, ...]
    t_ns: float


def state(scene: Scene, start_ns: int, end_ns: int) -> State:
    """Lights at their mean over an interval, things where they are amid it; 0 where nothing ever moves."""
    moves = bool(scene.movers) or any(isinstance(light, Sun) and light.moves for light in scene.lights)
    levels = tuple(light.level.mean(start_ns, end_ns) for light in scene.lights)
    return State(levels, (start_ns + end_ns) / 2 if moves else 0.0)


class MitsubaScene:
    """A scene in Mitsuba's memory; llvm.prepare() must have been called."""

    def __init__(self, scene: Scene, *, max_depth: int | None) -> None:
        import mitsuba as mi

        self._scene, self._state = scene, State((1.0,) * len(scene.lights), 0.0)
        self._groups = groups(inventory(scene))
        self._world = load(mi, scene)
        self._parameters = mi.traverse(self._world)
        # `path` is faster, but sees through panes only by chance; `volpath` looks for lights through them.
        self._has_panes = any(isinstance(material, Glass) for material in scene.materials.values())
        kind = "volpath" if self._has_panes else "path"
        self._integrator = mi.load_dict({"type": kind, "max_depth": -1 if max_depth is None else max_depth})

    def become(self, wanted: State) -> None:
        """Set every light's level, and move suns and movers to where they are."""
        if wanted == self._state:
            return
        for index, light in enumerate(self._scene.lights):
            self._shine(index, light, wanted)
        if wanted.t_ns != self._state.t_ns:
            self._move(wanted.t_ns)
        self._parameters.update()
        self._state = wanted

    def _shine(self, index: int, light: Light, wanted: State) -> None:
        import drjit as dr
        import mitsuba as mi

        key = f"{light_key(index)}.{STRENGTH[type(light)]}"
        self._parameters[key] = dr.opaque(mi.Float, wanted.levels[index] * nominal(light))
        if isinstance(light, Sun) and light.moves:
            self._parameters[f"{light_key(index)}.direction"] = mi.Vector3f(*light.direction(wanted.t_ns).tolist())

    def _move(self, t_ns: float) -> None:
        surfaces = inventory(self._scene, t_ns=t_ns).surfaces
        for group in self._groups:
            if group.mover >= 0:
                vertices = positions([surfaces[i] for i in group.surfaces]).ravel().astype(np.float32)
                self._parameters[f"{group.key}.vertex_positions"] = vertices

    def trace(self, rays: Floats, rows: Indices, T_world_camera: Array, samples: int, seed: int) -> Floats:
        """Radiance (R, W), the sum over `samples` paths a pixel, of rows (R,) seen from T_world_camera (R, 4, 4).

        rays (H + 1, W + 1, 3) are directions in the camera's frame through the corners of its pixels.
        """
        import drjit as dr
        import mitsuba as mi

        columns = rays.shape[1] - 1
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, len(rows) * columns * samples)
        ray = _primary_rays(rays, rows, T_world_camera, samples, sampler.next_2d())
        seen = dr.isfinite(ray.d.x)
        ray.o = self._past_backs(ray, seen)
        radiance, _, _ = self._integrator.sample(self._world, sampler, ray, None, seen)
        light = dr.select(seen, radiance[0], 0.0).numpy().reshape(len(rows), columns, samples)
        total: Floats = light.sum(-1)
        return total

    def _past_backs(self, ray: Any, seen: Any) -> Any:
        """Origins of rays moved on past surfaces that they see from behind, which no picture shows."""
        import drjit as dr
        import mitsuba as mi

        def step(origin: Any, looking: Any) -> tuple[Any, Any]:
            si = self._world.ray_intersect(mi.Ray3f(origin, ray.d), mi.RayFlags.Minimal, True, looking)
            behind = looking & si.is_valid() & (dr.dot(si.n, ray.d) > 0)
            if self._has_panes:
                behind &= ~mi.has_flag(si.bsdf().flags(), mi.BSDFFlags.Null)
            return dr.select(behind, si.spawn_ray(ray.d).o, origin), behind

        return dr.while_loop((mi.Point3f(ray.o), mi.Bool(seen)), lambda _, looking: looking, step)[0]


def _primary_rays(rays: Floats, rows: Indices, T_world_camera: Array, samples: int, within: Any) -> Any:
    """Rays `within` [0, 1)² of the pixels, sample by sample, pixel by pixel, row by row.

    Bilinear between the directions of a pixel's corners, which is exact to 1e-3 px.
    """
    import drjit as dr
    import mitsuba as mi

    grid, width = mi.Float(rays.ravel()), rays.shape[1]
    # Opaque, for a constant would be compiled into the kernel.
    pixel = dr.arange(mi.UInt32, dr.width(within)) // dr.opaque(mi.UInt32, samples)
    entry, column = pixel // (width - 1), pixel % (width - 1)
    corner = dr.gather(mi.UInt32, mi.UInt32(rows.astype(np.uint32)), entry) * width + column
    top = dr.lerp(*(dr.gather(mi.Vector3f, grid, corner + i) for i in (0, 1)), within.x)
    bottom = dr.lerp(*(dr.gather(mi.Vector3f, grid, corner + width + i) for i in (0, 1)), within.x)
    direction = dr.lerp(top, bottom, within.y)
    columns = [mi.Float(T_world_camera[:, :3, k].ravel().astype(np.float32)) for k in range(4)]
    x, y, z, origin = (dr.gather(mi.Vector3f, c, entry) for c in columns)
    return mi.RayDifferential3f(mi.Point3f(origin), dr.normalize(direction.x * x + direction.y * y + direction.z * z))
