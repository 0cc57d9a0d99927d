"""vobench render."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, Trust, option_group, with_option_groups
from vobench.cli.png_file import require_png
from vobench.cli.progress import Bars
from vobench.errors import require_known
from vobench.runner.scene_picture import render_scene
from vobench.setting import Triple
from vobench.suite.scene_entry import DRAWN
from vobench.suite.scene_spec import LIGHTINGS, MOST_SEED


@option_group
class CameraOptions:
    """The camera, its pose and its exposure."""

    camera: Annotated[str, typer.Option(help="A rig preset, whose left camera is used.")] = "paper_blender"
    at: Annotated[Triple, typer.Option(metavar="X Y Z", help="The position of the camera in metres.")] = (0.0, 0.0, 1.2)
    yaw: Annotated[float, typer.Option(help="The yaw of the camera in degrees: 0 along x, 90 along y.")] = 0.0
    pitch: Annotated[float, typer.Option(help="The pitch of the camera in degrees below the horizon.")] = 10.0
    time: Annotated[float, typer.Option(help="The time in seconds, for lights and things that change.")] = 0.0
    sensor: Annotated[str, typer.Option(help="The preset of the image sensor.")] = "clean"
    gain: Annotated[float, typer.Option(min=1e-6, help="A factor of the exposure.")] = 1.0


@option_group
class PlaceOptions:
    """The place, for a scene with a generator."""

    seed: Annotated[
        int | None, typer.Option(min=0, max=MOST_SEED, help="Use the place that the scene's generator creates.")
    ] = None
    lighting: Annotated[
        str, typer.Option(help=f"The lighting of this place: {', '.join(LIGHTINGS)}, or drawn by the seed.")
    ] = DRAWN


@option_group
class EngineOptions:
    """The engine that renders the image."""

    engine: Annotated[
        str, typer.Option(help="raster; path, Mitsuba's path tracer; or pyrender, the stock renderer.")
    ] = "raster"
    samples: Annotated[
        int | None, typer.Option(help="Samples of each pixel: 4 or 16, or light paths with --engine path.")
    ] = None


@with_option_groups
def render_command(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="The name of a scene, or the path of its YAML.")],
    *,
    out: Annotated[Path, typer.Option(help="The image to write.")] = Path("frame.png"),
    place_options: PlaceOptions,
    camera_options: CameraOptions,
    engine_options: EngineOptions,
    truth: Annotated[bool, typer.Option("--truth", help="Write ground truth beside the image.")] = False,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Render one image of a scene, to inspect and debug it."""
    del trust  # its callback has the effect
    require_png(out)
    require_known("lighting", place_options.lighting, (*LIGHTINGS, DRAWN))
    image = render_scene(
        scene,
        seed=place_options.seed,
        lighting=place_options.lighting,
        camera=camera_options.camera,
        at_m=camera_options.at,
        yaw_deg=camera_options.yaw,
        pitch_deg=camera_options.pitch,
        time_s=camera_options.time,
        sensor=camera_options.sensor,
        gain=camera_options.gain,
        engine=engine_options.engine,
        samples=engine_options.samples,
        with_truth=truth,
        progress=Bars(),
    )
    files = [str(path) for path in image.save(out)]
    if json:
        terminal.print_json({"files": files})
    else:
        print("\n".join(files))
