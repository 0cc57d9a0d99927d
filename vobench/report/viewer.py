"""Trials of a run as Rerun recordings, and the viewer that shows them."""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vobench.errors import InputError, MissingDependencyError
from vobench.report.rerun import PictureForm, save_trial
from vobench.report.trial_choice import pick, ranked
from vobench.report.trial_view import trial_view
from vobench.runner.folder import RunFolder, TrialScore

# Without -P, a rerun.py in the working folder would be run in its place.
RERUN = (sys.executable, "-P", "-m", "rerun")


@dataclass(frozen=True, slots=True)
class Recording:
    """A Rerun file, and the trials that it shows side by side."""

    path: Path
    trials: tuple[TrialScore, ...]


def save_recordings(
    folder: RunFolder,
    *,
    case: str | None = None,
    estimator: str | None = None,
    compare: tuple[str, str] | None = None,
    worst: int = 1,
    window: slice = slice(None),
    form: PictureForm = "jpeg",
    save: Path | None = None,
) -> list[Recording]:
    """Write the trials that were asked for as Rerun files, failures first.

    Without `case` and `estimator` it is the gravest failure, else the worst error. `compare` names two estimators to
    be shown side by side; `worst` is the number of trials, each in a file; `window` the frames. Files go beside their
    estimates, or to `save`. Raises InputError where a file cannot be written there, and UnknownNameError.
    """
    recordings = []
    for trials in _chosen(folder, case=case, estimator=estimator, compare=compare, worst=worst):
        path = _target(save, folder, trials, worst)
        views = [trial_view(folder, trial, window=window) for trial in trials]
        save_trial(path, *views, form=form)
        recordings.append(Recording(path, tuple(trials)))
    return recordings


def open_viewer(paths: Sequence[Path], *, web: bool = False) -> None:
    """Hand files to Rerun's viewer, or with `web` serve them to a browser on this machine until interrupted.

    Raises MissingDependencyError where there is no display.
    """
    if web:
        subprocess.run([*RERUN, "--serve-web", "--bind", "127.0.0.1", *map(str, paths)], check=False)
        return
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not has_display:
        shown = " ".join(map(str, paths))
        raise MissingDependencyError(
            f"no display to open the viewer on; on a machine that has one, run: rerun {shown} "
            "(or give --web and open the page that it names)"
        )
    subprocess.Popen([*RERUN, *map(str, paths)], start_new_session=True)


def _chosen(
    folder: RunFolder, *, case: str | None, estimator: str | None, compare: tuple[str, str] | None, worst: int
) -> list[list[TrialScore]]:
    """The trials of each recording."""
    scores = folder.scores()
    if compare:
        first, *_ = ranked(scores, case=case, estimator=compare[0])
        others = ranked(scores, case=first.case, estimator=compare[1])
        same_repeat = min(others, key=lambda other: other.repeat != first.repeat)
        return [[first, same_repeat]]
    if worst > 1:
        every = ranked(scores, case=case, estimator=estimator)
        return [[trial] for trial in every[:worst]]
    return [[pick(scores, case=case, estimator=estimator)]]


def _target(save: Path | None, folder: RunFolder, trials: Sequence[TrialScore], worst: int) -> Path:
    """The file of a recording. Raises InputError where no file can be written there."""
    chosen = trials[0]
    name = "run.rrd" if len(trials) == 1 else "compare.rrd"
    path = save or folder.estimate(chosen.case, chosen.estimator, chosen.repeat) / name
    if save and worst > 1:
        path = save.with_name(f"{save.stem}_{chosen.case}_{chosen.estimator}_{chosen.repeat}{save.suffix}")
    if path.is_dir():
        raise InputError(f"--save should be a file to write, but this is a folder: {path}")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"--save should be a file to write, but this is in a folder that cannot be written: {path}")
    return path
