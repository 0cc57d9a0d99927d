"""vobench render."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vobench.cli import terminal
from vobench.errors import InputError, UnknownNameError, unknown
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import PRESETS, looking
from vobench.geometry.se3 import Array
from vobench.render.geometry import Shot
from vobench.render.renderer import Radiance, still
from vobench.render.truth import TruthCaster
from vobench.run.simulate import open_renderer
from vobench.run.store import Context, default_store
from vobench.scene.light import NS_PER_S
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CAMERAS, CameraSettings, NoiseStreams, expose, fixed_pattern
from vobench.sensor.pixel_truth import CHANNELS, picture
from vobench.sensor.response import Grey
from vobench.sequence.picture import write_png
from vobench.suite import catalog
from vobench.suite.scene_file import build, read_scene
from vobench.suite.suite import ENGINES, MOST_SAMPLES, Rendering

Place = tuple[float, float, float]
LATEST_S = 1e9  # stamps are 64 bits of nanoseconds
# Without a next picture nothing flows.
STILL_CHANNELS = tuple(name for name in CHANNELS if name not in {"flow", "occlusion"})


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """Where a camera stands and looks, and when."""

    at_m: Place
    yaw_deg: float
    pitch_deg: float
    t_s: float

    def check(self) -> None:
        """Raise InputError where an angle or the time is no number, or a stamp cannot hold the time."""
        for option, value in (("--yaw", self.yaw_deg), ("--pitch", self.pitch_deg), ("--time", self.t_s)):
            if not np.isfinite(value):
                raise InputError(f"{option} should be a finite number, got {value}")
        if abs(self.t_s) > LATEST_S:
            raise InputError(f"--time should be within {LATEST_S:.0e} s of the start, got {self.t_s:g}")

    @property
    def T_world_camera(self) -> Array:
        """The camera's pose (4, 4)."""
        turned = se3.transform(se3.rotation_z(np.deg2rad(self.yaw_deg)), self.at_m)
        return turned @ looking(pitch_deg=self.pitch_deg, position_m=(0.0, 0.0, 0.0))

    @property
    def t_ns(self) -> int:
        """The instant."""
        return round(self.t_s * NS_PER_S)


@dataclass(frozen=True, slots=True)
class Look:
    """What draws and takes the picture: the lens of a preset, a chip, an exposure, an engine."""

    camera: str
    sensor: str
    exposure_gain: float
    engine: str
    samples: int | None

    def rendering(self) -> Rendering:
        """The engine. Raises UnknownNameError, and InputError for samples that it does not take."""
        _require_known("engine", self.engine, ENGINES)
        if self.samples is not None and self.engine != "path":
            raise InputError(f"--samples belongs to --engine path, but the engine is {self.engine}; leave it out")
        if self.samples is not None and not 1 <= self.samples <= MOST_SAMPLES:
            raise InputError(f"--samples should be from 1 to {MOST_SAMPLES}, got {self.samples}")
        return Rendering(engine=self.engine, samples=self.samples)

    def lens(self) -> Camera:
        """The lens. Raises UnknownNameError."""
        _require_known("camera", self.camera, PRESETS)
        return PRESETS[self.camera].left

    def chip(self) -> CameraSettings:
        """The chip at its exposure. Raises UnknownNameError."""
        _require_known("camera sensor", self.sensor, CAMERAS)
        return CameraSettings(chip=CAMERAS[self.sensor], exposure_gain=self.exposure_gain)


def show(scene_name: str, viewpoint: Viewpoint, look: Look, *, out: Path, truth: bool, as_json: bool) -> None:
    """Draw one picture of a scene, and with `truth` its ground truth beside it."""
    rendering, lens, chip = look.rendering(), look.lens(), look.chip()
    viewpoint.check()
    if out.suffix != ".png" or out.is_dir() or not out.parent.is_dir():
        raise InputError(f"--out should be a .png in a folder that exists, got {out}")
    spec = read_scene(catalog.find("scene", scene_name).path)
    if not spec.room.holds(viewpoint.at_m):
        raise InputError(f"--at should be inside the room ({spec.room.extent}), got {viewpoint.at_m}")
    scene, shop = build(spec, {}), Context(default_store(), terminal.Bars())
    with closing(open_renderer(spec, scene, rendering, shop)) as renderer:
        luminance_cd_m2 = renderer.radiance(lens, still(lens, viewpoint.T_world_camera, t_ns=viewpoint.t_ns))
    write_png(out, _exposed(luminance_cd_m2 / np.float32(spec.white_cd_m2), chip))
    written = [out, *(_write_truth(out, scene, lens, viewpoint) if truth else [])]
    if as_json:
        terminal.print_json({"files": [str(path) for path in written]})
    else:
        print("\n".join(map(str, written)))


def _require_known(kind: str, name: str, known: Iterable[str]) -> None:
    if name not in known:
        raise UnknownNameError(unknown(kind, name, list(known)))


def _exposed(radiance: Radiance, camera: CameraSettings) -> Grey:
    pattern, shot, read = np.random.default_rng(0).spawn(3)
    shape = (radiance.shape[0], radiance.shape[1])
    return expose(radiance, camera, NoiseStreams(shot, read), pattern=fixed_pattern(shape, camera.chip, pattern))


def _write_truth(out: Path, scene: Scene, camera: Camera, viewpoint: Viewpoint) -> Iterator[Path]:
    """Every channel as a picture for people beside `out`, and all values in one .npz."""
    shot = Shot(viewpoint.T_world_camera, viewpoint.t_ns)
    channels = TruthCaster(scene).frame(camera, shot, STILL_CHANNELS).channels()
    for name, values in channels.items():
        path = out.with_suffix(f".{name}.png")
        write_png(path, picture(name, values))
        yield path
    arrays = out.with_suffix(".truth.npz")
    np.savez_compressed(arrays, allow_pickle=False, **channels)
    yield arrays
