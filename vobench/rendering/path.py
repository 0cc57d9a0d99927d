"""The path tracer: pictures by Mitsuba, the reference of the raster engine."""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench import stop
from vobench.errors import RenderError
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.rendering import mitsuba
from vobench.rendering.mitsuba import STRENGTH, groups, lamp_look, light_key, load, nominal, one_sided
from vobench.rendering.renderer import Radiance, View
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.material import LUMINANCE
from vobench.scene.scene import Scene, triangles

Floats = NDArray[np.float32]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class SceneState:
    """What of a scene changes: each light's level, and the instant that decides where movers and suns are."""

    levels: tuple[float, ...]
    t_ns: float


def state(scene: Scene, start_ns: int, end_ns: int) -> SceneState:
    """Lights at their mean over an interval, things where they are amid it; 0 where nothing ever moves."""
    moves = bool(scene.movers) or any(isinstance(light, Sun) and light.moves for light in scene.lights)
    levels = tuple(light.level.mean(start_ns, end_ns) for light in scene.lights)
    return SceneState(levels, (start_ns + end_ns) / 2 if moves else 0.0)


class MitsubaScene:
    """A scene in Mitsuba's memory; llvm.prepare() must have been called."""

    def __init__(self, scene: Scene, *, max_depth: int | None) -> None:
        import mitsuba as mi

        self._scene = scene
        self._state = SceneState((1.0,) * len(scene.lights), 0.0)
        self._faces = triangles(scene)
        self._pictures = dict[int, Any]()
        self._world = load(mi, scene)
        self._parameters = mi.traverse(self._world)
        # `path` is faster, but sees through panes and holes only by chance; `volpath` samples lights through them.
        self._one_sided = one_sided(mi, scene, self._world)
        passes = any(m.kind == "pane" or m.cutout is not None for m in scene.materials.values())
        kind = "volpath" if passes else "path"
        self._integrator = mi.load_dict({"type": kind, "max_depth": -1 if max_depth is None else max_depth})

    def become(self, wanted: SceneState) -> None:
        """Set every light's level, and move suns and movers to where they are."""
        if wanted == self._state:
            return
        for index, light in enumerate(self._scene.lights):
            self._shine(index, light, wanted)
        if wanted.t_ns != self._state.t_ns:
            self._move(wanted.t_ns)
        self._parameters.update()
        self._state = wanted

    def _shine(self, index: int, light: Light, wanted: SceneState) -> None:
        import drjit as dr
        import mitsuba as mi

        if lamp_look(self._scene, light):
            key = f"{light_key(index)}.emitter.radiance.data"
            self._pictures.setdefault(index, self._parameters[key].array)
            self._parameters[key] = mi.TensorXf(
                self._pictures[index] * wanted.levels[index], shape=self._parameters[key].shape
            )
            return
        # Opaque, for a constant would be compiled into the kernel.
        strength = [dr.opaque(mi.Float, wanted.levels[index] * part) for part in nominal(light).tolist()]
        value = strength[0] if isinstance(light, Sky) else mi.Color3f(*strength)
        self._parameters[f"{light_key(index)}.{STRENGTH[type(light)]}"] = value
        if isinstance(light, Sun) and light.moves:
            self._parameters[f"{light_key(index)}.direction"] = mi.Vector3f(*light.direction(wanted.t_ns).tolist())

    def _move(self, t_ns: float) -> None:
        faces = self._faces.moved([mover.path.pose(t_ns) for mover in self._scene.movers])
        for group in groups(self._scene, self._faces):
            if group.mover >= 0:
                for name, values in (("positions", faces.corners_m), ("normals", faces.normals)):
                    self._parameters[f"{group.key}.vertex_{name}"] = values[group.faces].ravel().astype(np.float32)

    def trace(self, rays: Floats, rows: Indices, T_world_camera: Array, samples: int, seed: int) -> Floats:
        """Radiance (R, W, 3), the sum over `samples` paths a pixel, of rows (R,) seen from T_world_camera (R, 4, 4).

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
        light = dr.select(seen, radiance, 0.0).numpy().reshape(3, len(rows), columns, samples)
        return np.moveaxis(light.sum(-1), 0, -1)

    def _past_backs(self, ray: Any, seen: Any) -> Any:
        """Origins of rays moved on past surfaces that they see from behind, which no picture shows."""
        import drjit as dr
        import mitsuba as mi

        def step(origin: Any, looking: Any) -> tuple[Any, Any]:
            si = self._world.ray_intersect(mi.Ray3f(origin, ray.d), mi.RayFlags.Minimal, True, looking)
            behind = looking & si.is_valid() & (dr.dot(si.n, ray.d) > 0)
            behind &= dr.gather(mi.Bool, self._one_sided, dr.reinterpret_array(mi.UInt32, si.shape), behind)
            return dr.select(behind, si.spawn_ray(ray.d).o, origin), behind

        return dr.while_loop((mi.Point3f(ray.o), mi.Bool(seen)), lambda _, looking: looking, step)[0]


def _primary_rays(rays: Floats, rows: Indices, T_world_camera: Array, samples: int, within: Any) -> Any:
    """Rays `within` [0, 1)² of the pixels, sample by sample, pixel by pixel, row by row.

    Bilinear between the directions of a pixel's corners, which is exact to 1e-3 px.
    """
    import drjit as dr
    import mitsuba as mi

    grid = mi.Float(rays.ravel())
    width = rays.shape[1]
    # Opaque, for a constant would be compiled into the kernel.
    pixel = dr.arange(mi.UInt32, dr.width(within)) // dr.opaque(mi.UInt32, samples)
    entry = pixel // (width - 1)
    column = pixel % (width - 1)
    corner = dr.gather(mi.UInt32, mi.UInt32(rows.astype(np.uint32)), entry) * width + column
    top = dr.lerp(*(dr.gather(mi.Vector3f, grid, corner + i) for i in (0, 1)), within.x)
    bottom = dr.lerp(*(dr.gather(mi.Vector3f, grid, corner + width + i) for i in (0, 1)), within.x)
    direction = dr.lerp(top, bottom, within.y)
    columns = [mi.Float(T_world_camera[:, :3, k].ravel().astype(np.float32)) for k in range(4)]
    x, y, z, origin = (dr.gather(mi.Vector3f, c, entry) for c in columns)
    return mi.RayDifferential3f(mi.Point3f(origin), dr.normalize(direction.x * x + direction.y * y + direction.z * z))


SAMPLES = 64  # paths a pixel where nobody says how many
MAX_LANES = 1 << 22  # paths traced at once; more cost memory and are no faster


@dataclass(frozen=True, slots=True)
class RowBatch:
    """Rows of the picture that see one state of the scene, each from a pose of its own; one light path per sample.

    rows (R,), start_ns (R,), T_world_camera (R, 4, 4), weight (R,): the share in the row's whole exposure.
    """

    rows: NDArray[np.int64]
    start_ns: NDArray[np.int64]
    T_world_camera: Array
    weight: Array


class PathRenderer:
    """Pictures of a scene by path tracing, `samples` paths a pixel, each up to max_depth segments long.

    max_depth 2 is direct light, None ends paths by Russian roulette alone. The noise is a function of seed, time
    and pose: the same picture has the same bytes, and no two pictures share their noise.
    """

    def __init__(self, scene: Scene, *, samples: int = SAMPLES, seed: int = 0, max_depth: int | None = 16) -> None:
        if samples < 1:
            raise RenderError(f"cannot trace {samples} paths a pixel; samples must be 1 or more")
        if max_depth is not None and max_depth < 1:
            raise RenderError(f"cannot trace paths of {max_depth} segments; max_depth must be 1 or more, or None")
        mitsuba.prepare()
        self._scene = scene
        self._samples = samples
        self._seed = seed
        self._mitsuba = MitsubaScene(scene, max_depth=max_depth)

    def radiance(self, camera: Camera, views: Sequence[View], *, weights: ArrayLike | None = LUMINANCE) -> Radiance:
        """Radiance (H, W) in cd/m², linear and unclipped, averaged over each pixel's area; views tile the rows.

        It is the sum of red, green and blue times weights, or (H, W, 3) where these are None. A pixel one of whose
        corners the lens does not see is black.
        """
        picture = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
        for (moment, samples), batch in _batches(self._scene, views, self._samples):
            self._mitsuba.become(moment)
            light = self._trace(camera, batch, samples)
            np.add.at(picture, batch.rows, light * batch.weight[:, None, None].astype(np.float32))
        return picture if weights is None else np.asarray(picture @ np.asarray(weights, np.float32))

    def close(self) -> None:
        """Give back Mitsuba's copy of the scene."""
        del self._mitsuba

    def _trace(self, camera: Camera, batch: RowBatch, samples: int) -> Radiance:
        """Mean radiance (R, W, 3) of the rows of a batch over `samples` paths a pixel, some at a time."""
        at_once = max(1, min(samples, MAX_LANES // (len(batch.rows) * camera.width_px)))
        counts = [at_once] * (samples // at_once) + [samples % at_once] * (samples % at_once > 0)
        rays = _corner_rays(camera)
        total = np.zeros((len(batch.rows), camera.width_px, 3), np.float32)
        for seed, count in zip(_seeds(self._seed, batch, len(counts)), counts, strict=True):
            stop.check()
            total += self._mitsuba.trace(rays, batch.rows, batch.T_world_camera, count, seed)
        return total / np.float32(samples)


@lru_cache(maxsize=1)
def _corner_rays(camera: Camera) -> Radiance:
    """Directions (H + 1, W + 1, 3) float32 through the corners of the pixels, kept from picture to picture."""
    u, v = np.meshgrid(np.arange(camera.width_px + 1) - 0.5, np.arange(camera.height_px + 1) - 0.5)
    return camera.rays(np.stack([u, v], -1)).astype(np.float32)


def _batches(scene: Scene, views: Sequence[View], samples: int) -> Iterator[tuple[tuple[SceneState, int], RowBatch]]:
    """All rows at all their moments, gathered by the scene's state and by the paths a pixel has at that moment.

    A row exposed in M moments has its samples spread evenly over them, at least one for each.
    """
    gathered: dict[tuple[SceneState, int], list[tuple[View, int]]] = {}
    for view in views:
        moments = len(view.start_ns)
        for m in range(moments):
            key = state(scene, int(view.start_ns[m]), int(view.end_ns[m])), -(-samples // moments)
            gathered.setdefault(key, []).append((view, m))
    for key, members in gathered.items():
        rows = [np.arange(view.rows.start, view.rows.stop) for view, _ in members]
        lengths = [len(r) for r in rows]
        batch = RowBatch(
            np.concatenate(rows),
            np.repeat([view.start_ns[m] for view, m in members], lengths),
            np.repeat([view.T_world_camera[m] for view, m in members], lengths, axis=0),
            np.repeat([1 / len(view.start_ns) for view, _ in members], lengths),
        )
        yield key, batch


def _seeds(seed: int, batch: RowBatch, count: int) -> list[int]:
    """Seeds that differ between pictures from other places or times."""
    moment = batch.rows, batch.start_ns, batch.T_world_camera
    words = [zlib.crc32(np.ascontiguousarray(part).tobytes()) for part in moment]
    return [int(word) for word in np.random.SeedSequence([seed, *words]).generate_state(count)]
