"""Renders one picture of a scene from any camera pose, with per-pixel ground truth."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import InputError, SettingError, require_known
from vobench.geometry import se3
from vobench.geometry.rig import PRESETS, looking
from vobench.geometry.se3 import Array
from vobench.rendering.renderer import Radiance, single_instant
from vobench.rendering.shot import CameraShot
from vobench.runner.key import cache_folder
from vobench.runner.simulate import open_renderer
from vobench.runner.store import SILENT, Progress
from vobench.runner.task import bake_task, perform
from vobench.sensor.image_sensor import CAMERAS, CameraSettings, NoiseStreams, expose, fixed_pattern
from vobench.sensor.pixel_truth import CHANNELS, picture
from vobench.sensor.response import Grey
from vobench.sequence.picture import write_png
from vobench.setting import Triple
from vobench.suite.scene_build import build
from vobench.suite.scene_entry import DRAWN
from vobench.suite.scene_file import read_place
from vobench.suite.suite_spec import Rendering
from vobench.suite.white import white_of
from vobench.trajectory.nanoseconds import NS_PER_S

LATEST_S = 1e9  # stamps are nanoseconds in 64 bits
# Flow and occlusion need the next picture.
STILL_CHANNELS = tuple(name for name in CHANNELS if name not in {"flow", "occlusion"})


@dataclass(frozen=True, slots=True)
class ScenePicture:
    """An RGB picture (H, W, 3) uint8, and the channels of its ground truth by name."""

    rgb: Grey
    truth: Mapping[str, NDArray[Any]]

    def save(self, path: Path) -> list[Path]:
        """Write the picture as PNG, a picture of each channel beside it, and the values of all channels as one .npz.

        Returns the files that were written.
        """
        write_png(path, self.rgb)
        written = [path]
        for name, values in self.truth.items():
            beside = path.with_suffix(f".{name}.png")
            write_png(beside, picture(name, values))
            written.append(beside)
        if self.truth:
            arrays = path.with_suffix(".truth.npz")
            np.savez_compressed(arrays, allow_pickle=False, **dict(self.truth))
            written.append(arrays)
        return written


def render_scene(
    scene: str,
    *,
    seed: int | None = None,
    lighting: str = DRAWN,
    camera: str = "paper_blender",
    at_m: Triple = (0.0, 0.0, 1.2),
    yaw_deg: float = 0.0,
    pitch_deg: float = 10.0,
    time_s: float = 0.0,
    sensor: str = "clean",
    gain: float = 1.0,
    engine: str = "raster",
    samples: int | None = None,
    with_truth: bool = False,
    progress: Progress = SILENT,
) -> ScenePicture:
    """Render one picture of a scene. Its light is computed unless it is cached.

    Args:
        scene: the scene's name, or the path of its file or model.
        seed: that of the place which the scene's generator creates; None for the scene as its file describes it.
        lighting: of that place: day, evening, night, overcast, or drawn by the seed.
        camera: the rig preset whose left lens is used.
        at_m: the position of the camera in the world.
        yaw_deg: the direction in which it looks: 0 is along x, 90 along y.
        pitch_deg: the angle by which it looks below the horizon.
        time_s: the time of the picture, because lights and things can change.
        sensor: the chip behind the lens.
        gain: multiplies the exposure.
        engine: raster, path (Mitsuba's path tracer) or pyrender (stock pyrender).
        samples: light paths per pixel, only for the engine path.
        with_truth: whether depth, ids and other channels of the picture are computed, too.
        progress: shows the computation of the light.

    Raises:
        UnknownNameError: no scene, camera or sensor has that name.
        InputError: a setting is wrong, or the camera is outside of the room.
        MissingDependencyError: this machine cannot render.
    """
    rendering = _rendering(engine, samples)
    require_known("camera", camera, PRESETS)
    require_known("camera sensor", sensor, CAMERAS)
    lens = PRESETS[camera].left
    chip = CAMERAS[sensor]
    T_world_camera, t_ns = _pose(at_m, yaw_deg, pitch_deg, time_s)
    spec = read_place(scene, seed=seed, lighting=lighting)
    if spec.room and not spec.room.holds(at_m):
        raise InputError(f"--at should be inside the room ({spec.room.extent}), got {at_m}")

    built = build(spec, {})
    light = None
    if rendering.needs_bake or spec.white_cd_m2 is None:
        light = perform(bake_task(spec), cache_folder(), progress=progress)
    white_cd_m2 = white_of(spec, light)
    with closing(open_renderer(built, rendering, light, white_cd_m2=white_cd_m2)) as renderer:
        radiance = renderer.radiance(lens, single_instant(lens, T_world_camera, t_ns=t_ns), weights=None)
    rgb = _exposed(radiance / np.float32(white_cd_m2), CameraSettings(chip=chip, exposure_gain=gain))

    truth: dict[str, NDArray[Any]] = {}
    if with_truth:
        from vobench.rendering.truth import TruthCaster

        truth = TruthCaster(built).frame(lens, CameraShot(T_world_camera, t_ns), STILL_CHANNELS).channels()
    return ScenePicture(rgb, truth)


def _rendering(engine: str, samples: int | None) -> Rendering:
    """The settings of an engine. Raises InputError for an unknown engine, or for samples that it does not use."""
    try:
        return Rendering(engine=engine, samples=samples)
    except SettingError as error:
        options = [f"--{key}" for key in error.keys]
        raise InputError(": ".join([*options, error.sentence])) from None


def _pose(at_m: Triple, yaw_deg: float, pitch_deg: float, time_s: float) -> tuple[Array, int]:
    """The pose T_world_camera (4, 4) and the time in ns of the camera.

    Raises InputError if a value is not finite, or if the time is too large for a stamp.
    """
    for option, value in (("--yaw", yaw_deg), ("--pitch", pitch_deg), ("--time", time_s)):
        if not np.isfinite(value):
            raise InputError(f"{option} should be a finite number, got {value}")
    if abs(time_s) > LATEST_S:
        raise InputError(f"--time should be within {LATEST_S:.0e} s of the start, got {time_s:g}")
    T_world_turned = se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), at_m)
    T_turned_camera = looking(pitch_deg=pitch_deg, position_m=(0.0, 0.0, 0.0))
    return T_world_turned @ T_turned_camera, round(time_s * NS_PER_S)


def _exposed(radiance: Radiance, camera: CameraSettings) -> Grey:
    """The RGB picture (H, W, 3) uint8 of a camera with a separate chip for each colour."""
    pattern_rng, shot_rng, read_rng = np.random.default_rng(0).spawn(3)
    noise = NoiseStreams(shot_rng, read_rng)
    shape = (radiance.shape[0], radiance.shape[1])
    chips = [fixed_pattern(shape, camera.chip, rng) for rng in pattern_rng.spawn(3)]
    exposed = []
    for channel, chip in zip(np.moveaxis(radiance, -1, 0), chips, strict=True):
        exposed.append(expose(channel, camera, noise, pattern=chip))
    return np.stack(exposed, -1)
