"""The path tracer: pictures by Mitsuba, the reference of the raster engine."""

import zlib
from collections.abc import Iterator, Sequence
from copy import copy
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
    """The parts of a scene that change: each light's level, and the instant that decides where movers and suns are."""

    levels: tuple[float, ...]
    t_ns: float


def state(scene: Scene, start_ns: int, end_ns: int) -> SceneState:
    """Lights at their mean over an interval, things where they are at its middle; 0 where nothing ever moves."""
    levels = tuple(light.level.mean(start_ns, end_ns) for light in scene.lights)
    suns_move = any(light.moves for light in scene.lights)
    something_moves = bool(scene.movers) or suns_move
    middle_ns = (start_ns + end_ns) / 2
    return SceneState(levels, middle_ns if something_moves else 0.0)


class MitsubaScene:
    """A scene in Mitsuba's memory; mitsuba.prepare() must have been called."""

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
        materials = scene.materials.values()
        is_seen_through = any(material.kind == "pane" or material.cutout is not None for material in materials)
        integrator = {
            "type": "volpath" if is_seen_through else "path",
            "max_depth": -1 if max_depth is None else max_depth,
        }
        self._integrator = mi.load_dict(integrator)

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
            nominal_picture = self._pictures.setdefault(index, self._parameters[key].array)
            picture = nominal_picture * wanted.levels[index]
            self._parameters[key] = mi.TensorXf(picture, shape=self._parameters[key].shape)
            return
        # Opaque, for a constant would be compiled into the kernel.
        channels = [wanted.levels[index] * channel for channel in nominal(light).tolist()]
        strength = [dr.opaque(mi.Float, channel) for channel in channels]
        key = f"{light_key(index)}.{STRENGTH[type(light)]}"
        self._parameters[key] = strength[0] if isinstance(light, Sky) else mi.Color3f(*strength)
        if isinstance(light, Sun) and light.moves:
            direction = light.direction(wanted.t_ns).tolist()
            self._parameters[f"{light_key(index)}.direction"] = mi.Vector3f(*direction)

    def _move(self, t_ns: float) -> None:
        poses = [mover.path.pose(t_ns) for mover in self._scene.movers]
        faces = self._faces.with_movers_at(poses)
        for group in groups(self._scene, self._faces):
            if group.mover < 0:
                continue
            corners_m = faces.corners_m[group.faces]
            normals = faces.normals[group.faces]
            self._parameters[f"{group.key}.vertex_positions"] = corners_m.ravel().astype(np.float32)
            self._parameters[f"{group.key}.vertex_normals"] = normals.ravel().astype(np.float32)

    def trace(
        self,
        rays: Floats,
        rows: Indices,
        T_world_camera: Array,
        samples: int,
        seed: int,
    ) -> Floats:
        """Radiance (R, W, 3), the sum over `samples` paths a pixel, of rows (R,) seen from T_world_camera (R, 4, 4).

        rays (H + 1, W + 1, 3) are directions in the camera's frame through the corners of its pixels.
        """
        import drjit as dr
        import mitsuba as mi

        columns = rays.shape[1] - 1
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, len(rows) * columns * samples)
        ray = _primary_rays(rays, rows, T_world_camera, samples, sampler.next_2d())
        is_valid = dr.isfinite(ray.d.x)  # false where the lens sees nothing
        ray.o = self._past_backs(ray, is_valid)
        radiance, _, _ = self._integrator.sample(self._world, sampler, ray, None, is_valid)
        path_radiance = dr.select(is_valid, radiance, 0.0).numpy()
        paths = path_radiance.reshape(3, len(rows), columns, samples)
        return np.moveaxis(paths.sum(-1), 0, -1)

    def _past_backs(self, ray: Any, is_valid: Any) -> Any:
        """Origins of rays moved on past surfaces that they see from behind, which no picture shows."""
        import drjit as dr
        import mitsuba as mi

        def step(origin: Any, is_active: Any) -> tuple[Any, Any]:
            onward = mi.Ray3f(origin, ray.d)
            hit = self._world.ray_intersect(onward, mi.RayFlags.Minimal, True, is_active)
            faces_away = dr.dot(hit.n, ray.d) > 0
            is_back = is_active & hit.is_valid() & faces_away
            shape = dr.reinterpret_array(mi.UInt32, hit.shape)
            is_back &= dr.gather(mi.Bool, self._one_sided, shape, is_back)
            return dr.select(is_back, hit.spawn_ray(ray.d).o, origin), is_back

        loop_state = (mi.Point3f(ray.o), mi.Bool(is_valid))
        return dr.while_loop(loop_state, lambda _, is_active: is_active, step)[0]


def _primary_rays(
    rays: Floats,
    rows: Indices,
    T_world_camera: Array,
    samples: int,
    within: Any,
) -> Any:
    """Rays `within` [0, 1)² of the pixels, sample by sample, pixel by pixel, row by row.

    Bilinear between the directions of a pixel's corners, which is exact to 1e-3 px.
    """
    import drjit as dr
    import mitsuba as mi

    grid = mi.Float(rays.ravel())
    width = rays.shape[1]
    # Opaque, for a constant would be compiled into the kernel.
    pixel = dr.arange(mi.UInt32, dr.width(within)) // dr.opaque(mi.UInt32, samples)
    entry = pixel // (width - 1)  # in `rows`
    column = pixel % (width - 1)
    row = dr.gather(mi.UInt32, mi.UInt32(rows.astype(np.uint32)), entry)
    corner = row * width + column
    top_left = dr.gather(mi.Vector3f, grid, corner)
    top_right = dr.gather(mi.Vector3f, grid, corner + 1)
    bottom_left = dr.gather(mi.Vector3f, grid, corner + width)
    bottom_right = dr.gather(mi.Vector3f, grid, corner + width + 1)
    top = dr.lerp(top_left, top_right, within.x)
    bottom = dr.lerp(bottom_left, bottom_right, within.x)
    direction = dr.lerp(top, bottom, within.y)

    matrix_columns = [mi.Float(T_world_camera[:, :3, k].ravel().astype(np.float32)) for k in range(4)]
    x, y, z, origin = (dr.gather(mi.Vector3f, values, entry) for values in matrix_columns)
    world_direction = direction.x * x + direction.y * y + direction.z * z
    return mi.RayDifferential3f(mi.Point3f(origin), dr.normalize(world_direction))


SAMPLES = 64  # paths a pixel, by default
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

    def __init__(
        self,
        scene: Scene,
        *,
        samples: int = SAMPLES,
        seed: int = 0,
        max_depth: int | None = 16,
    ) -> None:
        if samples < 1:
            raise RenderError(f"cannot trace {samples} paths a pixel; samples must be 1 or more")
        if max_depth is not None and max_depth < 1:
            raise RenderError(f"cannot trace paths of {max_depth} segments; max_depth must be 1 or more, or None")
        mitsuba.prepare()
        self._scene = scene
        self._samples = samples
        self._seed = seed
        self._mitsuba = MitsubaScene(scene, max_depth=max_depth)

    def radiance(
        self,
        camera: Camera,
        views: Sequence[View],
        *,
        weights: ArrayLike | None = LUMINANCE,
    ) -> Radiance:
        """Radiance (H, W) in cd/m², linear and unclipped, averaged over each pixel's area; views tile the rows.

        It is the sum of red, green and blue times weights, or (H, W, 3) where these are None. A pixel one of whose
        corners the lens does not see is black.
        """
        picture = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
        for (moment, samples), batch in _batches(self._scene, views, self._samples):
            self._mitsuba.become(moment)
            light = self._trace(camera, batch, samples)
            row_weight = batch.weight[:, None, None].astype(np.float32)
            np.add.at(picture, batch.rows, light * row_weight)
        if weights is None:
            return picture
        return np.asarray(picture @ np.asarray(weights, np.float32))

    def with_seed(self, seed: int) -> "PathRenderer":
        """The same renderer with other noise; the two share Mitsuba's copy of the scene.

        Two copies in one process are refused by OptiX, which the variant for GPUs uses.
        """
        other = copy(self)
        other._seed = seed
        return other

    def close(self) -> None:
        """Give back Mitsuba's copy of the scene."""
        del self._mitsuba

    def _trace(self, camera: Camera, batch: RowBatch, samples: int) -> Radiance:
        """Mean radiance (R, W, 3) of the rows of a batch over `samples` paths a pixel, some at a time."""
        pixel_count = len(batch.rows) * camera.width_px
        at_once = max(1, min(samples, MAX_LANES // pixel_count))
        counts = [at_once] * (samples // at_once)
        if samples % at_once:
            counts.append(samples % at_once)
        rays = _corner_rays(camera)
        total = np.zeros((len(batch.rows), camera.width_px, 3), np.float32)
        for seed, count in zip(_seeds(self._seed, batch, len(counts)), counts, strict=True):
            stop.check()
            total += self._mitsuba.trace(rays, batch.rows, batch.T_world_camera, count, seed)
        return total / np.float32(samples)


@lru_cache(maxsize=1)
def _corner_rays(camera: Camera) -> Radiance:
    """Directions (H + 1, W + 1, 3) float32 through the corners of the pixels, cached from picture to picture."""
    columns_px = np.arange(camera.width_px + 1) - 0.5
    rows_px = np.arange(camera.height_px + 1) - 0.5
    u, v = np.meshgrid(columns_px, rows_px)
    return camera.rays(np.stack([u, v], -1)).astype(np.float32)


def _batches(
    scene: Scene,
    views: Sequence[View],
    samples: int,
) -> Iterator[tuple[tuple[SceneState, int], RowBatch]]:
    """All rows at all their moments, gathered by the scene's state and by the paths a pixel has at that moment.

    A row exposed in M moments has its samples spread evenly over them, at least one for each.
    """
    gathered: dict[tuple[SceneState, int], list[tuple[View, int]]] = {}
    for view in views:
        moment_count = len(view.start_ns)
        samples_each = -(-samples // moment_count)
        for moment in range(moment_count):
            scene_state = state(scene, int(view.start_ns[moment]), int(view.end_ns[moment]))
            gathered.setdefault((scene_state, samples_each), []).append((view, moment))
    for key, members in gathered.items():
        yield key, _row_batch(members)


def _row_batch(members: Sequence[tuple[View, int]]) -> RowBatch:
    """The rows of views, each at one of its moments."""
    rows = [np.arange(view.rows.start, view.rows.stop) for view, _ in members]
    counts = [len(view_rows) for view_rows in rows]
    start_ns = [view.start_ns[moment] for view, moment in members]
    T_world_camera = [view.T_world_camera[moment] for view, moment in members]
    weights = [1 / len(view.start_ns) for view, _ in members]
    return RowBatch(
        np.concatenate(rows),
        np.repeat(start_ns, counts),
        np.repeat(T_world_camera, counts, axis=0),
        np.repeat(weights, counts),
    )


def _seeds(seed: int, batch: RowBatch, count: int) -> list[int]:
    """Seeds that differ between pictures from other places or times."""
    moment = batch.rows, batch.start_ns, batch.T_world_camera
    words = [zlib.crc32(np.ascontiguousarray(part).tobytes()) for part in moment]
    sequence = np.random.SeedSequence([seed, *words])
    return [int(word) for word in sequence.generate_state(count)]
