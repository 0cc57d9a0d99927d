"""vobench view: trials in Rerun."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import InputError, MissingDependencyError
from vobench.report.rerun import PictureForm, pick, ranked, save_trial, trial_view
from vobench.runner.folder import RunFolder, TrialScore, open_run

FORMS: tuple[PictureForm, ...] = ("jpeg", "png")
RERUN = (sys.executable, "-P", "-m", "rerun")  # without -P, a rerun.py in the working folder would be run in its place


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
    folder, window = open_run(run), _window(frames)
    form: PictureForm = "png" if terminal.known("form of pictures", pictures, FORMS) == "png" else "jpeg"
    if compare and (estimator or worst > 1):
        raise InputError("--compare names its estimators, of one case; leave out --estimator and --worst")
    made = []
    for trials in _chosen(folder, case=case, estimator=estimator, compare=compare, worst=worst):
        path = _path(save, folder, trials, worst)
        save_trial(path, *(trial_view(folder, trial, window=window) for trial in trials), form=form)
        made.append((path, trials))
    if json:
        first, trial = made[0][0], made[0][1][0]
        named = {"case": trial.case, "estimator": trial.estimator, "repeat": trial.repeat}
        rows = [{"path": str(path), "case": t[0].case, "estimators": [s.estimator for s in t]} for path, t in made]
        terminal.print_json({**named, "path": str(first), "recordings": rows})
        return
    for path, trials in made:
        told = " and ".join(f"{trial.estimator} on {trial.case} ({trial.status})" for trial in trials)
        print(f"{told}: {path}")
    if save is None or web:
        _open([path for path, _ in made], web=web)


def _window(said: str | None) -> slice:
    """Frames as A:B. Raises InputError."""
    first, colon, end = (said or ":").partition(":")
    if not colon or any(part and not part.isdigit() for part in (first, end)):
        raise InputError(f"--frames should be A:B, from one frame to before another, as in 40:80 (got {said!r})")
    return slice(int(first) if first else None, int(end) if end else None)


def _chosen(
    folder: RunFolder, *, case: str | None, estimator: str | None, compare: tuple[str, str] | None, worst: int
) -> list[list[TrialScore]]:
    """The trials of each recording."""
    scores = folder.scores()
    if not compare:
        every = ranked(scores, case=case, estimator=estimator)[:worst]
        return [[trial] for trial in every] if worst > 1 else [[pick(scores, case=case, estimator=estimator)]]
    first, *_ = ranked(scores, case=case, estimator=compare[0])
    others = ranked(scores, case=first.case, estimator=compare[1])
    return [[first, min(others, key=lambda other: other.repeat != first.repeat)]]


def _path(save: Path | None, folder: RunFolder, trials: list[TrialScore], worst: int) -> Path:
    """Where a recording goes. Raises InputError where no file can be written there."""
    chosen = trials[0]
    name = "run.rrd" if len(trials) == 1 else "compare.rrd"
    path = save or folder.estimate(chosen.case, chosen.estimator, chosen.repeat) / name
    if save and worst > 1:
        path = save.with_name(f"{save.stem}_{chosen.case}_{chosen.estimator}_{chosen.repeat}{save.suffix}")
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        wrong = "is a folder" if path.is_dir() else "is in a folder that cannot be written"
        raise InputError(f"--save should be a file to write, but this {wrong}: {path}")
    return path


def _open(paths: list[Path], *, web: bool) -> None:
    """Hand the files to Rerun's viewer, which needs a display, or serve them to a browser until Ctrl-C."""
    if web:
        subprocess.run([*RERUN, "--serve-web", "--bind", "127.0.0.1", *map(str, paths)], check=False)
        return
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        shown = " ".join(map(str, paths))
        raise MissingDependencyError(
            f"no display to open the viewer on; on a machine that has one, run: rerun {shown} "
            "(or give --web and open the page that it names)"
        )
    subprocess.Popen([*RERUN, *map(str, paths)], start_new_session=True)
