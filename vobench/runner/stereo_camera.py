"""Simulates the stereo cameras: the light through the lens onto the chip, and the shutter while the body moves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Side
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.rendering.renderer import Radiance, Renderer, View
from vobench.runner.motion import generator
from vobench.scene.light import Steady
from vobench.scene.scene import Scene, triangles
from vobench.scene.swaying import in_wind
from vobench.sensor.exposure import Exposure, initial_exposures, next_exposures
from vobench.sensor.image_sensor import CameraSettings, NoiseStreams, expose, fixed_pattern
from vobench.sensor.lens import apply_lens, lens_maps
from vobench.sensor.response import Grey
from vobench.sensor.rolling_shutter import row_strips
from vobench.suite.case import Case
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.trajectory import Stamps

FAR_M = 1e3  # the distance of the sky, which a ray sees if it hits nothing
# The numbers of pixels across and down at which displacements are measured.
GRID_COLUMNS = 9
GRID_ROWS = 7


class Displacement:
    """Measures the displacements in the picture of a scene at a grid of pixels."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._movers = in_wind(scene, triangles(scene)).movers
        self._at_rest = _faces_seen(scene, 0)

    def largest_px(
        self, camera: Camera, T_world_first: Array, T_world_last: Array, *, start_ns: int, end_ns: int
    ) -> float:
        """The largest displacement in px of visible points from the first pose at start_ns to the last at end_ns."""
        rays = _grid_rays(camera) @ T_world_first[:3, :3].T  # (K, 3), world
        camera_m = T_world_first[:3, 3]
        caster, mover_of_face = _faces_seen(self._scene, start_ns) if self._scene.movers else self._at_rest
        hits = caster.hits(np.broadcast_to(camera_m, rays.shape), rays)
        distance_m = np.nan_to_num(hits.distance, nan=FAR_M)
        before_m = camera_m + distance_m[:, None] * rays

        after_m = before_m.copy()
        mover_of_ray = np.where(hits.face < 0, -1, mover_of_face[hits.face])
        for index in np.unique(mover_of_ray[mover_of_ray >= 0]).tolist():
            path = self._movers[index].path
            T_end_start = path.pose(end_ns) @ se3.inverse(path.pose(start_ns))
            is_on_mover = mover_of_ray == index
            after_m[is_on_mover] = se3.apply(T_end_start, before_m[is_on_mover])

        first_px = camera.project(se3.apply(se3.inverse(T_world_first), before_m))
        last_px = camera.project(se3.apply(se3.inverse(T_world_last), after_m))
        moved_px = np.linalg.norm(last_px - first_px, axis=-1)
        return float(np.nanmax(moved_px)) if np.isfinite(moved_px).any() else 0.0


def _faces_seen(scene: Scene, t_ns: int) -> tuple[RayCaster, NDArray[np.int32]]:
    """A ray caster for the faces of a scene at an instant, without panes, and the mover of each face, -1 for none.

    Leaves in wind are where they would be without wind, which hardly changes how far they move.
    """
    faces = triangles(scene, t_ns=t_ns)
    materials = [scene.materials.get(thing.material) for thing in faces.things]
    is_pane = np.array([material is not None and material.kind == "pane" for material in materials], bool)
    opaque_faces = np.flatnonzero(~is_pane[faces.thing])
    return RayCaster(faces, opaque_faces), in_wind(scene, faces).faces.mover


@lru_cache(maxsize=8)
def _grid_rays(camera: Camera) -> Array:
    """The rays (K, 3) through pixels that are spread over the whole picture, including its borders."""
    columns = np.linspace(0, camera.width_px - 1, GRID_COLUMNS)
    rows = np.linspace(0, camera.height_px - 1, GRID_ROWS)
    u, v = np.meshgrid(columns, rows)
    rays = camera.rays(np.stack([u, v], -1)).reshape(-1, 3)
    return rays[np.isfinite(rays).all(1)]


# The largest displacement between two sub-frames, and between the first and the last row of a strip.
SUB_FRAME_PX = 1.0
STRIP_PX = 0.25
MOST_SUB_FRAMES = 32
ROWS_UNDER_CHANGING_LIGHT = 4  # the rows of a strip, so that it shows a single phase of lamps that change


@dataclass(frozen=True, slots=True)
class ExposedPair:
    """A stereo pair, each picture (H, W) or (H, W, 3) uint8, and the exposure of both."""

    left: Grey
    right: Grey
    exposure: Exposure


@dataclass(frozen=True, slots=True)
class World:
    """A scene, its renderer, and the motion of the body through it."""

    scene: Scene
    renderer: Renderer
    motion: Motion
    white_cd_m2: float


class StereoCamera:
    """The cameras of a case on the true rig. The auto-exposure measures the left picture, and controls both cameras."""

    def __init__(self, case: Case, world: World) -> None:
        displacement = Displacement(world.scene)
        self._left = SimulatedCamera(case, "left", world, displacement)
        self._right = SimulatedCamera(case, "right", world, displacement)
        self._settings = case.camera
        first = case.camera.exposure
        loop = case.camera.auto_exposure
        self._state = initial_exposures(loop, first) if loop else (first,)

    def skip(self, pictures: int) -> None:
        """Skip the first pictures. The noise of the others does not change, but the auto-exposure starts again."""
        for camera in (self._left, self._right):
            camera.skip(pictures)

    def shoot(self, t_ns: int, right_ns: int | None = None) -> ExposedPair:
        """The pictures whose mid-exposure time is t_ns, or right_ns for the right picture if that is given.

        Calls must be in order of time.
        """
        exposure = self._state[0]
        left = self._left.picture(t_ns, exposure)
        right = self._right.picture(t_ns if right_ns is None else right_ns, exposure)
        loop = self._settings.auto_exposure
        if loop:
            self._state = next_exposures(loop, self._state, left, self._settings.chip.signal_of_grey)
        return ExposedPair(left, right, exposure)


class SimulatedCamera:
    """One camera: its poses, its shutter, its lens, and its chip with a separate noise stream."""

    def __init__(self, case: Case, side: Side, world: World, displacement: Displacement) -> None:
        def stream(name: str) -> np.random.Generator:
            return generator(case.seed, f"camera.{side}.{name}")

        rig = case.build_true_rig()
        self._camera = rig.camera(side)
        self._T_body_camera = rig.T_body_camera(side)
        self._world = world
        self._displacement = displacement
        self._light_changes = not all(isinstance(light.level, Steady) for light in world.scene.lights)
        self._settings = case.camera.eye(side)
        self._white_cd_m2 = np.float32(world.white_cd_m2)
        self._lens = lens_maps(self._settings, self._camera, stream("dirt"), stream("drops"))
        self._noise = NoiseStreams(stream("shot"), stream("read"))
        shape = (self._camera.height_px, self._camera.width_px)
        self._pattern = fixed_pattern(shape, case.camera.chip, stream("pattern"))

    def skip(self, pictures: int) -> None:
        """Draw and discard the noise of a number of pictures."""
        chip = self._settings.chip
        shape = (self._camera.height_px, self._camera.width_px)
        for _ in range(pictures):
            if chip.shot_noise:
                self._noise.shot.standard_normal(shape)
            if chip.read_noise_e > 0:
                self._noise.read.standard_normal(shape)

    def picture(self, t_ns: int, exposure: Exposure) -> Grey:
        """The grey values (H, W), or colours (H, W, 3), of a picture with stamp t_ns."""
        return self.exposed(self.light(t_ns, exposure), exposure)

    def light(self, t_ns: int, exposure: Exposure) -> Radiance:
        """The light at the lens (H, W), or (H, W, 3) in colour, relative to diffuse white."""
        views = self.views(t_ns, exposure)
        radiance = self._world.renderer.radiance(self._camera, views, weights=self._settings.weights)
        light: Radiance = radiance / self._white_cd_m2
        return light

    def exposed(self, light: Radiance, exposure: Exposure) -> Grey:
        """The values of a picture that is exposed to light."""
        at_chip: Radiance = apply_lens(light, self._lens)
        return expose(at_chip, self._settings, self._noise, pattern=self._pattern, exposure=exposure)

    def views(self, t_ns: int, exposure: Exposure) -> list[View]:
        """The views of strips of rows and sub-frames, which are as fine as the motion requires."""
        strips = row_strips(
            self._camera.height_px,
            readout_s=self._settings.readout_s,
            t_ns=t_ns,
            exposure_s=exposure.time_s,
            strip_count=self._strip_count(t_ns),
            sub_frames=self._sub_frames(t_ns, exposure),
        )
        views = []
        for strip in strips:
            T_world_camera = self._poses(strip.mid_ns)
            views.append(View(strip.rows, T_world_camera, strip.start_ns, strip.end_ns))
        return views

    def _sub_frames(self, t_ns: int, exposure: Exposure) -> int:
        if not self._settings.motion_blur:
            return 1
        moved_px = self._moved_px(t_ns, exposure.time_s)
        sub_frames = np.ceil(moved_px / SUB_FRAME_PX)
        return int(np.clip(sub_frames, 1, MOST_SUB_FRAMES))

    def _strip_count(self, t_ns: int) -> int:
        height = self._camera.height_px
        if not self._settings.readout_s:
            return 1
        least = 1
        if self._light_changes:
            least = math.ceil(height / ROWS_UNDER_CHANGING_LIGHT)
        moved_px = self._moved_px(t_ns, self._settings.readout_s)
        strip_count = np.ceil(moved_px / STRIP_PX)
        return int(np.clip(strip_count, least, height))

    def _moved_px(self, t_ns: int, duration_s: float) -> float:
        half_ns = round(duration_s * 1e9) // 2
        start_ns = t_ns - half_ns
        end_ns = t_ns + half_ns
        T_world_first, T_world_last = self._poses(np.array([start_ns, end_ns]))
        return self._displacement.largest_px(
            self._camera, T_world_first, T_world_last, start_ns=start_ns, end_ns=end_ns
        )

    def _poses(self, t_ns: Stamps) -> Array:
        """The poses T_world_camera (K, 4, 4) at instants (K,)."""
        T_world_body = self._world.motion.at(t_ns).T_world_body
        T_world_camera: Array = T_world_body @ self._T_body_camera
        return T_world_camera


def left_lights(case: Case, world: World, stamps: Sequence[int]) -> list[Radiance]:
    """The light (H, W) at the left lens of a case at some times, at the usual exposure time."""
    plain = CameraSettings()
    camera = SimulatedCamera(replace(case, camera=plain), "left", world, Displacement(world.scene))
    return [camera.light(t_ns, plain.exposure) for t_ns in stamps]
