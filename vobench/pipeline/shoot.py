"""The stereo pair at work: light through the lens onto the chip, exposed by a shutter while the robot moves."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.rig import SIDES, Side
from vobench.geometry.se3 import Array
from vobench.pipeline.displacement import Displacement
from vobench.pipeline.stream import generator
from vobench.render.renderer import Radiance, Renderer, View
from vobench.scene.light import Steady
from vobench.scene.scene import Scene
from vobench.sensor.camera import NoiseStreams, expose, fixed_pattern
from vobench.sensor.exposure import Exposure, ExposureState, start, step
from vobench.sensor.lens import lens_maps, through_lens
from vobench.sensor.response import Grey
from vobench.sensor.shutter import ShutterKind, strips
from vobench.suite.expand import Case
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.trajectory import Stamps

# Between two sub-frames, and between the first and last row of a strip, nothing should move further than this.
SUB_FRAME_PX, STRIP_PX = 1.0, 0.25
MOST_SUB_FRAMES = 32
# Where lamps change in time, a strip has so few rows that it sees one phase of theirs.
ROWS_UNDER_CHANGING_LIGHT = 4


@dataclass(frozen=True, slots=True)
class Pair:
    """A stereo pair (H, W) uint8 each, and the exposure that both had."""

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
        self._left, self._right = (Eye(case, side, world, displacement) for side in SIDES)
        self._chip, self._loop = case.camera.build_chip(), case.camera.build_auto_exposure()
        first = case.camera.build_exposure()
        self._state = start(self._loop, first) if self._loop else ExposureState((first,))

    def shoot(self, t_ns: int) -> Pair:
        """The pictures stamped t_ns, the middle of their exposure; call in order of time."""
        exposure = self._state.now
        pair = Pair(self._left.picture(t_ns, exposure), self._right.picture(t_ns, exposure), exposure)
        if self._loop:
            self._state = step(self._loop, self._state, pair.left, self._chip.signal_of_grey)
        return pair


class Eye:
    """One camera: where it is, how its shutter cuts time, its lens, and its chip with noise of its own."""

    def __init__(self, case: Case, side: Side, world: World, displacement: Displacement) -> None:
        def stream(name: str) -> np.random.Generator:
            return generator(case.seed, f"camera.{side}.{name}")

        rig = case.build_true_rig()
        self._camera, self._T_body_camera = rig.camera(side), rig.T_body_camera(side)
        self._world, self._displacement = world, displacement
        self._light_changes = not all(isinstance(light.level, Steady) for light in world.scene.lights)
        self._shutter, self._blurs = case.camera.build_shutter(), case.camera.motion_blur
        self._white_cd_m2, self._chip = np.float32(case.scene.white_cd_m2), case.camera.build_chip()
        self._lens = lens_maps(case.camera.build_lens(), self._camera, stream("dirt"))
        self._noise = NoiseStreams(stream("shot"), stream("read"))
        shape = (self._camera.height_px, self._camera.width_px)
        self._pattern = fixed_pattern(shape, self._chip, stream("pattern"))

    def picture(self, t_ns: int, exposure: Exposure) -> Grey:
        """The grey values (H, W) of a picture stamped t_ns."""
        luminance_cd_m2 = self._world.renderer.radiance(self._camera, self.views(t_ns, exposure))
        at_chip: Radiance = through_lens(luminance_cd_m2 / self._white_cd_m2, self._lens)
        return expose(at_chip, self._chip, self._noise, pattern=self._pattern, exposure=exposure)

    def views(self, t_ns: int, exposure: Exposure) -> list[View]:
        """How the rows are exposed, in strips and sub-frames as fine as the motion asks for."""
        height = self._camera.height_px
        cut = strips(
            height,
            self._shutter,
            t_ns,
            exposure.time_s,
            row_strips=self._row_strips(t_ns),
            sub_frames=self._sub_frames(t_ns, exposure),
        )
        return [View(s.rows, self._seen_from(s.mid_ns), s.start_ns, s.end_ns) for s in cut]

    def _sub_frames(self, t_ns: int, exposure: Exposure) -> int:
        if not self._blurs:
            return 1
        moved_px = self._moved_px(t_ns, exposure.time_s)
        return int(np.clip(np.ceil(moved_px / SUB_FRAME_PX), 1, MOST_SUB_FRAMES))

    def _row_strips(self, t_ns: int) -> int:
        height = self._camera.height_px
        if self._shutter.kind is ShutterKind.GLOBAL:
            return 1
        least = -(-height // ROWS_UNDER_CHANGING_LIGHT) if self._light_changes else 1
        moved_px = self._moved_px(t_ns, self._shutter.readout_s)
        return int(np.clip(np.ceil(moved_px / STRIP_PX), least, height))

    def _moved_px(self, t_ns: int, duration_s: float) -> float:
        half_ns = round(duration_s * 1e9) // 2
        start_ns, end_ns = t_ns - half_ns, t_ns + half_ns
        first, last = self._seen_from(np.array([start_ns, end_ns]))
        return self._displacement.largest_px(self._camera, first, last, start_ns=start_ns, end_ns=end_ns)

    def _seen_from(self, t_ns: Stamps) -> Array:
        """T_world_camera (K, 4, 4) at instants (K,)."""
        T_world_camera: Array = self._world.motion.at(t_ns).T_world_body @ self._T_body_camera
        return T_world_camera
