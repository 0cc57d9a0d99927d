"""The command vobench scene, which describes a scene and draws the places that its generator creates."""

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

MOST_SHEET_PLACES = 100  # the largest number of places on a contact sheet


def scene_command(
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help="The name of a scene, or the path of a scene's YAML or of a model.")
    ],
    *,
    out: Annotated[
        Path | None, typer.Option(help="Render a plan and four views with computed light, and write them to this PNG.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, max=MOST_SEED, help="The seed of the place that the scene's generator creates.")
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1, max=MOST_SHEET_PLACES, help="Draw the places with this many seeds to --out, starting at --seed."
        ),
    ] = None,
    lighting: Annotated[
        str,
        typer.Option(
            help=f"The lighting of generated places: {', '.join(LIGHTINGS)}, or drawn: chosen at random by the seed."
        ),
    ] = DRAWN,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Print the contents of a scene, the free space to drive in, and probable faults of its models.

    With --seeds, draw a contact sheet of the places that its generator creates.
    """
    del trust  # the callback of --trust has already recorded the consent
    require_known("lighting", lighting, (*LIGHTINGS, DRAWN))
    if out:
        require_png(out)
    if seeds is not None:
        _draw_places(scene, out, seeds=seeds, seed=seed, lighting=lighting)
        return

    if seed is None and lighting != DRAWN:
        raise InputError("--lighting is for the places of a generator; add --seed")
    report = survey_scene(scene, seed=seed, lighting=lighting)
    if out:
        report.save_picture(out, progress=Bars())
    if json:
        terminal.print_json(report.as_dict())
        return
    description = report.lines()
    probable_faults = report.doubts()
    for line in (*description, *report.notes, *probable_faults):
        print(line)


def _draw_places(scene: str, out: Path | None, *, seeds: int, seed: int | None, lighting: str) -> None:
    """Draw a contact sheet of generated places to a PNG file.

    `seeds` is the number of places.
    `seed` is the seed of the first place; 1 if it is None.
    `lighting` is the lighting of all places.
    Raises InputError if there is no `out`.
    """
    if out is None:
        raise InputError("--seeds draws a sheet; add --out sheet.png")
    first_seed = 1 if seed is None else seed
    save_place_sheet(scene, out, seeds=seeds, first_seed=first_seed, lighting=lighting, progress=Bars())
