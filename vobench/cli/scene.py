"""Look a scene or a model over: vobench scene."""

from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vobench.analysis.scene import SceneSurvey, sheet, strength, survey
from vobench.asset import MODEL_SUFFIXES
from vobench.cli import terminal
from vobench.errors import InputError
from vobench.runner.key import cache_folder
from vobench.runner.simulate import open_renderer
from vobench.runner.task import bake_task, perform
from vobench.scene.scene import Scene
from vobench.sequence.picture import write_png
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.suite import Rendering


def scene_command(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name, a path to it, or a model's file.")],
    *,
    out: Annotated[Path | None, typer.Option(help="Draw a plan and four views to this PNG; light is computed.")] = None,
    trust: terminal.Trust = False,
    json: terminal.Json = False,
) -> None:
    """Say what is in a scene, where a body can drive, and what is doubtful in its models."""
    del trust  # done by its callback
    if out and (out.suffix != ".png" or out.is_dir() or not out.parent.is_dir()):
        raise InputError(f"--out should be a .png in a folder that exists, got {out}")
    path = catalog.find("scene", scene).path
    spec = read_scene(path)
    built = build(spec, {})
    found, notes = survey(built), _notes([Path(model.file) for model in spec.meshes])
    if out:
        light = perform(bake_task(spec), cache_folder(), progress=terminal.Bars())
        with closing(open_renderer(built, Rendering(), light)) as renderer:
            write_png(out, sheet(built, found, renderer, spec.white_cd_m2, _lines(spec.name, built, found)))
    if json:
        terminal.print_json({**asdict(found), "notes": notes, "white_cd_m2": spec.white_cd_m2})
        return
    print("\n".join([*_lines(spec.name, built, found), *notes]))


def _notes(models: list[Path]) -> list[str]:
    """What reading the models changed or doubted."""
    from vobench.asset.model import read_model

    found = []
    for path in models:
        if path.suffix.lower() in MODEL_SUFFIXES:
            model = read_model(path)
            found += [f"{path.name}: {note}" for note in model.notes]
            found += [f"{path.name}: {model.dropped} faces without area were dropped"] if model.dropped else []
    return found


def _lines(name: str, scene: Scene, found: SceneSurvey) -> list[str]:
    size = " x ".join(f"{high - low:.2f}" for low, high in zip(found.low_m, found.high_m, strict=True))
    free = found.free
    circle = (
        f"{free.radius_m:.1f} m around ({free.x_m:.1f}, {free.y_m:.1f}), floor at {free.floor_m:.2f} m"
        if free
        else "none"
    )
    return [
        f"{name}: {found.things} things, {found.faces:,} faces, {found.materials} materials",
        f"size: {size} m",
        f"textures: {found.textures_mb:.0f} MB",
        f"open edges: {found.open_edges:,}; faces on a face: {found.twins:,}",
        f"backs seen: {found.backs:.1%}",
        f"free circle: {circle}",
        *(f"light: {light}, {strength(scene, light)}" for light in found.lights),
    ]
