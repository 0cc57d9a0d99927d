"""vobench scene."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.analysis.place_sheet import save_place_sheet
from vobench.analysis.scene_report import survey_scene
from vobench.cli import terminal
from vobench.cli.option import Json, Trust
from vobench.cli.png_file import require_png
from vobench.cli.progress import Bars
from vobench.errors import InputError, require_known
from vobench.suite.scene_entry import DRAWN
from vobench.suite.scene_spec import LIGHTINGS, MOST_SEED

MOST_CELLS = 100  # of a contact sheet


def scene_command(
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help="The name of a scene, or the path of its YAML or of a model.")
    ],
    *,
    out: Annotated[
        Path | None, typer.Option(help="Draw a plan and four views to this PNG, with computed light.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, max=MOST_SEED, help="Use the place that the scene's generator creates.")
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_CELLS, help="Draw this many places of the generator to --out, from --seed on."),
    ] = None,
    lighting: Annotated[
        str, typer.Option(help=f"The lighting of these places: {', '.join(LIGHTINGS)}, or drawn by the seed.")
    ] = DRAWN,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Print what is in a scene, where a body can drive, and what looks wrong in its models.

    With --seeds, draw a contact sheet of the places that its generator creates.
    """
    del trust  # its callback has the effect
    require_known("lighting", lighting, (*LIGHTINGS, DRAWN))
    if out:
        require_png(out)
    if seeds is not None:
        if out is None:
            raise InputError("--seeds draws a sheet; add --out sheet.png")
        save_place_sheet(
            scene, out, seeds=seeds, first_seed=1 if seed is None else seed, lighting=lighting, progress=Bars()
        )
        return
    if seed is None and lighting != DRAWN:
        raise InputError("--lighting is for the places of a generator; add --seed")
    report = survey_scene(scene, seed=seed, lighting=lighting)
    if out:
        report.save_picture(out, progress=Bars())
    if json:
        terminal.print_json(report.as_dict())
    else:
        print("\n".join([*report.lines(), *report.notes, *report.doubts()]))
