"""Draw one picture of a scene: vobench render."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.runner.scene_picture import render_scene
from vobench.setting import Triple


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
    if out.suffix != ".png" or out.is_dir() or not out.parent.is_dir():
        raise InputError(f"--out should be a .png in a folder that exists, got {out}")
    drawn = render_scene(
        scene,
        camera=camera,
        at_m=at,
        yaw_deg=yaw,
        pitch_deg=pitch,
        time_s=time,
        sensor=sensor,
        gain=gain,
        engine=engine,
        samples=samples,
        with_truth=truth,
        progress=terminal.Bars(),
    )
    written = [str(path) for path in drawn.save(out)]
    if json:
        terminal.print_json({"files": written})
    else:
        print("\n".join(written))
