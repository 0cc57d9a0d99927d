"""vobench view."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import InputError, MissingDependencyError
from vobench.report import save_trial
from vobench.report.rerun import pick, trial_view
from vobench.run.folder import open_run


def _open(path: Path) -> None:
    """Hand the file to Rerun's viewer, which needs a display."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise MissingDependencyError(f"no display to open the viewer on; on a machine that has one, run: rerun {path}")
    # Without -P, a rerun.py in the working folder would be run in its place.
    subprocess.Popen([sys.executable, "-P", "-m", "rerun", str(path)], start_new_session=True)


def view_command(
    run: terminal.RunPath,
    *,
    case: Annotated[
        str | None, typer.Option(help="The case; the gravest failure or the worst error where left out.")
    ] = None,
    estimator: Annotated[
        str | None, typer.Option(help="The estimator; a failed one where left out, else the best.")
    ] = None,
    save: Annotated[Path | None, typer.Option(help="Write this .rrd instead of opening the viewer.")] = None,
    json: terminal.Json = False,
) -> None:
    """Open one run in Rerun, failures first."""
    folder = open_run(run)
    chosen = pick(folder.scores(), case=case, estimator=estimator)
    path = save or folder.estimate(chosen.case, chosen.estimator, chosen.repeat) / "run.rrd"
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        wrong = "is a folder" if path.is_dir() else "is in a folder that cannot be written"
        raise InputError(f"--save should be a file to write, but this {wrong}: {path}")
    save_trial(path, trial_view(folder, chosen))
    if json:
        named = {"case": chosen.case, "estimator": chosen.estimator, "repeat": chosen.repeat}
        terminal.print_json({**named, "path": str(path)})
        return
    print(f"{chosen.estimator} on {chosen.case} ({chosen.status}): {path}")
    if save is None:
        _open(path)
