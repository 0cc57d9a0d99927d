"""A scene in the memory of Mitsuba: it is brought into the state of an instant, and paths are traced through it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.rendering.mitsuba_description import load_scene, mesh_groups, one_sided_shapes, textured_material
from vobench.rendering.mitsuba_light import STRENGTH_PARAMETERS, light_key, nominal_strength
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.scene import Scene, triangles

Float32s = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class SceneState:
    """What changes in a scene: the level of each light, and the instant that decides where movers and suns are."""

    levels: tuple[float, ...]
    t_ns: float


def scene_state(scene: Scene, start_ns: int, end_ns: int) -> SceneState:
    """The mean level of each light over an interval, and its middle as the instant; 0 if nothing ever moves."""
    levels = tuple(light.level.mean(start_ns, end_ns) for light in scene.lights)
    suns_move = any(light.moves for light in scene.lights)
    is_moving = bool(scene.movers) or suns_move
    middle_ns = (start_ns + end_ns) / 2
    return SceneState(levels, middle_ns if is_moving else 0.0)


class MitsubaScene:
    """A scene in the memory of Mitsuba. mitsuba.prepare() must have been called before.

    max_depth: the number of segments of a path at most, None for no limit.
    """

    def __init__(self, scene: Scene, *, max_depth: int | None) -> None:
        import mitsuba as mi

        self._scene = scene
        self._state = SceneState((1.0,) * len(scene.lights), 0.0)
        self._faces = triangles(scene)
        self._pictures = dict[int, Any]()
        self._world = load_scene(mi, scene)
        self._parameters = mi.traverse(self._world)
        # `path` is faster, but sees through panes and holes only by chance; `volpath` samples lights through them.
        self._one_sided = one_sided_shapes(mi, scene, self._world)
        materials = scene.materials.values()
        is_seen_through = any(material.kind == "pane" or material.cutout is not None for material in materials)
        integrator = {
            "type": "volpath" if is_seen_through else "path",
            "max_depth": -1 if max_depth is None else max_depth,
        }
        self._integrator = mi.load_dict(integrator)

    def become(self, wanted: SceneState) -> None:
        """Set the levels of all lights, and move suns and movers to where they are then."""
        if wanted == self._state:
            return
        for index, light in enumerate(self._scene.lights):
            self._set_light(index, light, wanted)
        if wanted.t_ns != self._state.t_ns:
            self._move_things(wanted.t_ns)
        self._parameters.update()
        self._state = wanted

    def _set_light(self, index: int, light: Light, wanted: SceneState) -> None:
        """Set the level of a light and, if it is a moving sun, its direction."""
        import drjit as dr
        import mitsuba as mi

        if textured_material(self._scene, light):
            key = f"{light_key(index)}.emitter.radiance.data"
            nominal_picture = self._pictures.setdefault(index, self._parameters[key].array)
            picture = nominal_picture * wanted.levels[index]
            self._parameters[key] = mi.TensorXf(picture, shape=self._parameters[key].shape)
            return
        # Opaque, for a constant would be compiled into the kernel.
        channels = [wanted.levels[index] * channel for channel in nominal_strength(light).tolist()]
        strength = [dr.opaque(mi.Float, channel) for channel in channels]
        key = f"{light_key(index)}.{STRENGTH_PARAMETERS[type(light)]}"
        self._parameters[key] = strength[0] if isinstance(light, Sky) else mi.Color3f(*strength)
        if isinstance(light, Sun) and light.moves:
            direction = light.direction(wanted.t_ns).tolist()
            self._parameters[f"{light_key(index)}.direction"] = mi.Vector3f(*direction)

    def _move_things(self, t_ns: float) -> None:
        """Set the vertices of the movers to where they are at an instant."""
        poses = [mover.path.pose(t_ns) for mover in self._scene.movers]
        faces = self._faces.with_movers_at(poses)
        for group in mesh_groups(self._scene, self._faces):
            if group.mover < 0:
                continue
            corners_m = faces.corners_m[group.faces]
            normals = faces.normals[group.faces]
            self._parameters[f"{group.key}.vertex_positions"] = corners_m.ravel().astype(np.float32)
            self._parameters[f"{group.key}.vertex_normals"] = normals.ravel().astype(np.float32)

    def trace(
        self,
        rays: Float32s,
        rows: NDArray[np.int64],
        T_world_camera: Array,
        samples: int,
        seed: int,
    ) -> Float32s:
        """The radiance (R, W, 3) of rows (R,) of a picture, as the sum over `samples` paths per pixel.

        rays (H + 1, W + 1, 3): directions in the camera's frame through the corners of its pixels. T_world_camera
        (R, 4, 4): the pose for each row.
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
        """The origins of rays after the surfaces that they meet from behind, which no picture shows."""
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
    rays: Float32s,
    rows: NDArray[np.int64],
    T_world_camera: Array,
    samples: int,
    within: Any,
) -> Any:
    """Camera rays at positions `within` [0, 1)² of pixels: all samples of a pixel, all pixels of a row, all rows.

    Directions are interpolated bilinearly between the corners of a pixel, which is exact to 1e-3 px.
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
