"""vobench view: trials in Rerun."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.report.rerun import PictureForm
from vobench.report.viewer import Recording, open_viewer, save_recordings
from vobench.runner.folder import open_run

FORMS: tuple[PictureForm, ...] = ("jpeg", "png")


def view_command(
    run: terminal.RunPath,
    *,
    case: Annotated[
        str | None, typer.Option(help="The case; the gravest failure or the worst error where left out.")
    ] = None,
    estimator: Annotated[
        str | None, typer.Option(help="The estimator; a failed one where left out, else the best.")
    ] = None,
    compare: Annotated[
        tuple[str, str] | None, typer.Option(metavar="A B", help="Two estimators side by side, at the worst of A.")
    ] = None,
    worst: Annotated[int, typer.Option(min=1, help="So many trials, the gravest failure first.")] = 1,
    frames: Annotated[str | None, typer.Option(metavar="A:B", help="Only these frames, as in 40:80.")] = None,
    pictures: Annotated[str, typer.Option(help="jpeg, small; or png, to the last bit.")] = "jpeg",
    save: Annotated[Path | None, typer.Option(help="Write this .rrd instead of opening the viewer.")] = None,
    web: Annotated[bool, typer.Option("--web", help="Show it in a browser, served on this machine alone.")] = False,
    json: terminal.Json = False,
) -> None:
    """Open one run in Rerun, failures first."""
    form: PictureForm = "png" if terminal.known("form of pictures", pictures, FORMS) == "png" else "jpeg"
    if compare and (estimator or worst > 1):
        raise InputError("--compare names its estimators, of one case; leave out --estimator and --worst")
    recordings = save_recordings(
        open_run(run),
        case=case,
        estimator=estimator,
        compare=compare,
        worst=worst,
        window=_window(frames),
        form=form,
        save=save,
    )
    if json:
        terminal.print_json(_facts(recordings))
        return
    for recording in recordings:
        told = " and ".join(f"{trial.estimator} on {trial.case} ({trial.status})" for trial in recording.trials)
        print(f"{told}: {recording.path}")
    if save is None or web:
        open_viewer([recording.path for recording in recordings], web=web)


def _facts(recordings: list[Recording]) -> dict[str, Any]:
    """The first recording, and all of them, as JSON has them."""
    first = recordings[0]
    trial = first.trials[0]
    rows = [
        {
            "path": str(recording.path),
            "case": recording.trials[0].case,
            "estimators": [trial.estimator for trial in recording.trials],
        }
        for recording in recordings
    ]
    return {
        "case": trial.case,
        "estimator": trial.estimator,
        "repeat": trial.repeat,
        "path": str(first.path),
        "recordings": rows,
    }


def _window(said: str | None) -> slice:
    """Frames as A:B. Raises InputError."""
    first, colon, end = (said or ":").partition(":")
    if not colon or any(part and not part.isdigit() for part in (first, end)):
        raise InputError(f"--frames should be A:B, from one frame to before another, as in 40:80 (got {said!r})")
    return slice(int(first) if first else None, int(end) if end else None)
