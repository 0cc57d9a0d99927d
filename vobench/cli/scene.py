"""vobench scene."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.analysis.scene_report import survey_scene
from vobench.cli import terminal
from vobench.cli.option import Json, Trust
from vobench.cli.png_file import require_png
from vobench.cli.progress import Bars


def scene_command(
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help="The name of a scene, or the path of its YAML or of a model.")
    ],
    *,
    out: Annotated[
        Path | None, typer.Option(help="Draw a plan and four views to this PNG, with computed light.")
    ] = None,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Print what is in a scene, where a body can drive, and what looks wrong in its models."""
    del trust  # its callback has the effect
    if out:
        require_png(out)
    report = survey_scene(scene)
    if out:
        report.save_picture(out, progress=Bars())
    if json:
        terminal.print_json(report.as_dict())
    else:
        print("\n".join([*report.lines(), *report.notes, *report.doubts()]))
