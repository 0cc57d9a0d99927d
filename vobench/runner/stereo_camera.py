"""The stereo pair at work: light through the lens onto the chip, exposed by a shutter while the body moves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import SIDES, Side
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.rendering.renderer import Radiance, Renderer, View
from vobench.runner.motion import generator
from vobench.scene.light import Steady
from vobench.scene.scene import Scene, triangles
from vobench.sensor.exposure import Exposure, start, step, strips
from vobench.sensor.image_sensor import CameraSettings, NoiseStreams, expose, fixed_pattern
from vobench.sensor.lens import lens_maps, through_lens
from vobench.sensor.response import Grey
from vobench.suite.suite import Case
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.trajectory import Stamps

# Rays that meet nothing look at the sky, which is as good as this far.
FAR_M = 1e3
GRID = (9, 7)


class Displacement:
    """Measures one scene's displacements, at a grid of pixels."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._at_rest = _solid(scene, 0)

    def largest_px(
        self, camera: Camera, T_world_first: Array, T_world_last: Array, *, start_ns: int, end_ns: int
    ) -> float:
        """How far what the first pose sees at start_ns has moved for the last one at end_ns, in pixels, at most."""
        rays = _grid_rays(camera) @ T_world_first[:3, :3].T
        caster, mover_of = _solid(self._scene, start_ns) if self._scene.movers else self._at_rest
        hits = caster.hits(np.broadcast_to(T_world_first[:3, 3], rays.shape), rays)
        before_m = T_world_first[:3, 3] + np.nan_to_num(hits.distance, nan=FAR_M)[:, None] * rays
        after_m = before_m.copy()
        mover_at = np.where(hits.face < 0, -1, mover_of[hits.face])
        for index, mover in enumerate(self._scene.movers):
            T_later_now = mover.path.pose(end_ns) @ se3.inverse(mover.path.pose(start_ns))
            after_m[mover_at == index] = se3.apply(T_later_now, before_m[mover_at == index])
        first = camera.project(se3.apply(se3.inverse(T_world_first), before_m))
        last = camera.project(se3.apply(se3.inverse(T_world_last), after_m))
        moved = np.linalg.norm(last - first, axis=-1)
        return float(np.nanmax(moved)) if np.isfinite(moved).any() else 0.0


def _solid(scene: Scene, t_ns: int) -> tuple[RayCaster, NDArray[np.int32]]:
    """What rays meet in a scene at an instant, seen through panes; and the mover of each surface, -1 for none."""
    faces = triangles(scene, t_ns=t_ns)
    looks = [scene.materials.get(thing.material) for thing in faces.things]
    is_pane = np.array([look is not None and look.kind == "pane" for look in looks], bool)
    return RayCaster(faces, np.flatnonzero(~is_pane[faces.thing])), faces.mover


@lru_cache(maxsize=8)
def _grid_rays(camera: Camera) -> Array:
    """Rays (K, 3) through pixels spread over the whole picture, borders included, where the lens has any."""
    u, v = np.meshgrid(np.linspace(0, camera.width_px - 1, GRID[0]), np.linspace(0, camera.height_px - 1, GRID[1]))
    rays = camera.rays(np.stack([u, v], -1)).reshape(-1, 3)
    return rays[np.isfinite(rays).all(1)]


# Between two sub-frames, and between the first and last row of a strip, nothing should move further than this.
SUB_FRAME_PX = 1.0
STRIP_PX = 0.25
MOST_SUB_FRAMES = 32
# Where lamps change in time, a strip has so few rows that it sees one phase of theirs.
ROWS_UNDER_CHANGING_LIGHT = 4


@dataclass(frozen=True, slots=True)
class StereoPair:
    """A stereo pair, (H, W) or (H, W, 3) uint8 each, and the exposure that both had."""

    left: Grey
    right: Grey
    exposure: Exposure


@dataclass(frozen=True, slots=True)
class World:
    """What there is to see, who draws it, and the way through it."""

    scene: Scene
    renderer: Renderer
    motion: Motion


class StereoCamera:
    """Both cameras of a case on the true rig; the exposure loop watches the left picture and sets both."""

    def __init__(self, case: Case, world: World) -> None:
        displacement = Displacement(world.scene)
        self._left, self._right = (SimulatedCamera(case, side, world, displacement) for side in SIDES)
        self._settings = case.camera
        first = case.camera.exposure
        loop = case.camera.auto_exposure
        self._state = start(loop, first) if loop else (first,)

    def skip(self, pictures: int) -> None:
        """Leave out the first pictures: the noise of others is as it would be, auto-exposure starts anew."""
        for camera in (self._left, self._right):
            camera.skip(pictures)

    def shoot(self, t_ns: int, right_ns: int | None = None) -> StereoPair:
        """The pictures amid whose exposure is t_ns, the right one's where it has its own; call in order of time."""
        exposure = self._state[0]
        right_ns = t_ns if right_ns is None else right_ns
        pair = StereoPair(self._left.picture(t_ns, exposure), self._right.picture(right_ns, exposure), exposure)
        if loop := self._settings.auto_exposure:
            self._state = step(loop, self._state, pair.left, self._settings.chip.signal_of_grey)
        return pair


class SimulatedCamera:
    """One camera: where it is, how its shutter cuts time, its lens, and its chip with noise of its own."""

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
        self._white_cd_m2 = np.float32(case.scene.white_cd_m2)
        self._lens = lens_maps(self._settings, self._camera, stream("dirt"))
        self._noise = NoiseStreams(stream("shot"), stream("read"))
        shape = (self._camera.height_px, self._camera.width_px)
        self._pattern = fixed_pattern(shape, case.camera.chip, stream("pattern"))

    def skip(self, pictures: int) -> None:
        """Take the draws of so many pictures' noise."""
        chip = self._settings.chip
        shape = (self._camera.height_px, self._camera.width_px)
        for _ in range(pictures):
            if chip.shot_noise:
                self._noise.shot.standard_normal(shape)
            if chip.read_noise_e > 0:
                self._noise.read.standard_normal(shape)

    def picture(self, t_ns: int, exposure: Exposure) -> Grey:
        """The values (H, W), or (H, W, 3) in colour, of a picture stamped t_ns."""
        return self.exposed(self.light(t_ns, exposure), exposure)

    def light(self, t_ns: int, exposure: Exposure) -> Radiance:
        """What comes to the lens (H, W), or (H, W, 3) in colour, in shares of matt white."""
        views = self.views(t_ns, exposure)
        weights = self._settings.weights
        light: Radiance = self._world.renderer.radiance(self._camera, views, weights=weights) / self._white_cd_m2
        return light

    def exposed(self, light: Radiance, exposure: Exposure) -> Grey:
        """The values of a picture of that light."""
        at_chip: Radiance = through_lens(light, self._lens)
        return expose(at_chip, self._settings, self._noise, pattern=self._pattern, exposure=exposure)

    def views(self, t_ns: int, exposure: Exposure) -> list[View]:
        """How the rows are exposed, in strips and sub-frames as fine as the motion asks for."""
        height = self._camera.height_px
        cut = strips(
            height,
            self._settings.readout_s,
            t_ns,
            exposure.time_s,
            row_strips=self._row_strips(t_ns),
            sub_frames=self._sub_frames(t_ns, exposure),
        )
        return [View(s.rows, self._seen_from(s.mid_ns), s.start_ns, s.end_ns) for s in cut]

    def _sub_frames(self, t_ns: int, exposure: Exposure) -> int:
        if not self._settings.motion_blur:
            return 1
        moved_px = self._moved_px(t_ns, exposure.time_s)
        return int(np.clip(np.ceil(moved_px / SUB_FRAME_PX), 1, MOST_SUB_FRAMES))

    def _row_strips(self, t_ns: int) -> int:
        height = self._camera.height_px
        if not self._settings.readout_s:
            return 1
        least = -(-height // ROWS_UNDER_CHANGING_LIGHT) if self._light_changes else 1
        moved_px = self._moved_px(t_ns, self._settings.readout_s)
        return int(np.clip(np.ceil(moved_px / STRIP_PX), least, height))

    def _moved_px(self, t_ns: int, duration_s: float) -> float:
        half_ns = round(duration_s * 1e9) // 2
        start_ns = t_ns - half_ns
        end_ns = t_ns + half_ns
        first, last = self._seen_from(np.array([start_ns, end_ns]))
        return self._displacement.largest_px(self._camera, first, last, start_ns=start_ns, end_ns=end_ns)

    def _seen_from(self, t_ns: Stamps) -> Array:
        """T_world_camera (K, 4, 4) at instants (K,)."""
        T_world_camera: Array = self._world.motion.at(t_ns).T_world_body @ self._T_body_camera
        return T_world_camera


def exposed_by(case: Case, world: World, stamps: Sequence[int]) -> Callable[[CameraSettings], list[Grey]]:
    """What takes a case's left pictures at instants with any camera; the light is drawn once."""
    displacement = Displacement(world.scene)
    plain = CameraSettings()
    first = SimulatedCamera(replace(case, camera=plain), "left", world, displacement)
    lights = [first.light(t_ns, plain.exposure) for t_ns in stamps]

    def take(settings: CameraSettings) -> list[Grey]:
        camera = SimulatedCamera(replace(case, camera=settings), "left", world, displacement)
        return [camera.exposed(light, settings.exposure) for light in lights]

    return take
