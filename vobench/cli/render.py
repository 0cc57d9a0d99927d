"""Draw one picture of a scene: vobench render."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from vobench.cli import terminal
from vobench.errors import InputError, SettingError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import PRESETS, looking
from vobench.geometry.se3 import Array
from vobench.rendering.occlusion import Shot
from vobench.rendering.renderer import Radiance, still
from vobench.rendering.truth import TruthCaster
from vobench.runner.key import cache_folder
from vobench.runner.simulate import open_renderer
from vobench.runner.task import bake_task, perform
from vobench.scene.light import NS_PER_S
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CAMERAS, CameraSettings, NoiseStreams, expose, fixed_pattern
from vobench.sensor.pixel_truth import CHANNELS, picture
from vobench.sensor.response import Grey
from vobench.sequence.picture import write_png
from vobench.setting import Triple
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.suite import Rendering

LATEST_S = 1e9  # stamps are 64 bits of nanoseconds
# Without a next picture nothing flows.
STILL_CHANNELS = tuple(name for name in CHANNELS if name not in {"flow", "occlusion"})


def render_command(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name, or a path to its YAML.")],
    *,
    out: Annotated[Path, typer.Option(help="The picture to write.")] = Path("frame.png"),
    camera: Annotated[str, typer.Option(help="The left lens of this rig preset.")] = "paper_blender",
    at: Annotated[Triple, typer.Option(metavar="X Y Z", help="Where it stands, in metres.")] = (0.0, 0.0, 1.2),
    yaw: Annotated[float, typer.Option(help="Where it looks, in degrees: 0 along x, 90 along y.")] = 0.0,
    pitch: Annotated[float, typer.Option(help="How far below the horizon it looks, in degrees.")] = 10.0,
    time: Annotated[float, typer.Option(help="When, in seconds; lights and things may move.")] = 0.0,
    sensor: Annotated[str, typer.Option(help="The chip behind the lens.")] = "clean",
    gain: Annotated[float, typer.Option(min=1e-6, help="Multiplies the exposure.")] = 1.0,
    engine: Annotated[
        str, typer.Option(help="raster; path, Mitsuba's path tracer; or pyrender, as it comes.")
    ] = "raster",
    samples: Annotated[int | None, typer.Option(help="Light paths a pixel, for --engine path alone.")] = None,
    truth: Annotated[bool, typer.Option("--truth", help="Write ground truth beside the picture.")] = False,
    trust: terminal.Trust = False,
    json: terminal.Json = False,
) -> None:
    """Draw one picture of a scene, to look at and to debug scenes with."""
    del trust  # done by its callback
    rendering, lens = _rendering(engine, samples), PRESETS[terminal.known("camera", camera, PRESETS)].left
    chip = CameraSettings(chip=CAMERAS[terminal.known("camera sensor", sensor, CAMERAS)], exposure_gain=gain)
    T_world_camera, t_ns = _pose(at, yaw, pitch, time)
    if out.suffix != ".png" or out.is_dir() or not out.parent.is_dir():
        raise InputError(f"--out should be a .png in a folder that exists, got {out}")
    spec = read_scene(catalog.find("scene", scene).path)
    if spec.room and not spec.room.holds(at):
        raise InputError(f"--at should be inside the room ({spec.room.extent}), got {at}")
    built = build(spec, {})
    light = perform(bake_task(spec), cache_folder(), progress=terminal.Bars()) if rendering.needs_bake else None
    with closing(open_renderer(built, rendering, light, white_cd_m2=spec.white_cd_m2)) as renderer:
        radiance = renderer.radiance(lens, still(lens, T_world_camera, t_ns=t_ns), weights=None)
    write_png(out, _exposed(radiance / np.float32(spec.white_cd_m2), chip))
    written = [
        str(path) for path in (out, *(_write_truth(out, built, lens, Shot(T_world_camera, t_ns)) if truth else []))
    ]
    if json:
        terminal.print_json({"files": written})
    else:
        print("\n".join(written))


def _rendering(engine: str, samples: int | None) -> Rendering:
    """The engine. Raises InputError for one that is not known, and for samples that it does not take."""
    try:
        return Rendering(engine=engine, samples=samples)
    except SettingError as error:
        raise InputError(": ".join([*(f"--{key}" for key in error.keys), error.sentence])) from None


def _pose(at_m: Triple, yaw_deg: float, pitch_deg: float, t_s: float) -> tuple[Array, int]:
    """The camera's pose and instant. Raises InputError where one is no number, or a stamp cannot hold the time."""
    for option, value in (("--yaw", yaw_deg), ("--pitch", pitch_deg), ("--time", t_s)):
        if not np.isfinite(value):
            raise InputError(f"{option} should be a finite number, got {value}")
    if abs(t_s) > LATEST_S:
        raise InputError(f"--time should be within {LATEST_S:.0e} s of the start, got {t_s:g}")
    turned = se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), at_m)
    return turned @ looking(pitch_deg=pitch_deg, position_m=(0.0, 0.0, 0.0)), round(t_s * NS_PER_S)


def _exposed(radiance: Radiance, camera: CameraSettings) -> Grey:
    """Red, green and blue (H, W, 3), each on a chip of its own behind a prism."""
    pattern, shot, read = np.random.default_rng(0).spawn(3)
    noise, shape = NoiseStreams(shot, read), (radiance.shape[0], radiance.shape[1])
    chips = [fixed_pattern(shape, camera.chip, own) for own in pattern.spawn(3)]
    channels = zip(np.moveaxis(radiance, -1, 0), chips, strict=True)
    return np.stack([expose(channel, camera, noise, pattern=chip) for channel, chip in channels], -1)


def _write_truth(out: Path, scene: Scene, camera: Camera, shot: Shot) -> Iterator[Path]:
    """Every channel as a picture for people beside `out`, and all values in one .npz."""
    channels = TruthCaster(scene).frame(camera, shot, STILL_CHANNELS).channels()
    for name, values in channels.items():
        path = out.with_suffix(f".{name}.png")
        write_png(path, picture(name, values))
        yield path
    arrays = out.with_suffix(".truth.npz")
    np.savez_compressed(arrays, allow_pickle=False, **channels)
    yield arrays
