"""Look a scene or a model over: vobench scene."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.analysis.scene_report import survey_scene
from vobench.cli import terminal
from vobench.errors import InputError


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
    report = survey_scene(scene)
    if out:
        report.save_picture(out, progress=terminal.Bars())
    if json:
        terminal.print_json(report.as_dict())
    else:
        print("\n".join([*report.lines(), *report.notes]))
