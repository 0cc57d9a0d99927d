"""Trials of a run as Rerun recordings, and the viewer that opens them."""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vobench.errors import InputError, MissingDependencyError
from vobench.report.estimator_order import estimator_positions
from vobench.report.rerun import PictureForm, save_trial
from vobench.report.trial_choice import pick, ranked
from vobench.report.trial_view import trial_view
from vobench.runner.folder import RunFolder, TrialScore

# Without -P, Python would import a rerun.py in the working folder.
RERUN = (sys.executable, "-P", "-m", "rerun")


@dataclass(frozen=True, slots=True)
class TrialRecording:
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
) -> list[TrialRecording]:
    """Write trials of a run as Rerun files, failures first.

    If `case` and `estimator` are not given, the most severe failure is chosen. If no trial failed, the trial with the
    largest error is chosen.

    `compare` names two estimators that are shown side by side.
    `worst` is the number of trials. Each of them is written to a separate file.
    `window` selects frames.
    `form` is the format of the pictures.
    `save` is the file to write. If it is None, files are written next to the estimates.

    Raises InputError if a file cannot be written, and UnknownNameError for an unknown case or estimator.
    """
    estimators = [score.estimator for score in folder.scores()]
    positions = estimator_positions(folder.estimator_labels(), estimators)
    recordings = []
    for trials in _chosen(folder, case=case, estimator=estimator, compare=compare, worst=worst):
        path = _target(save, folder, trials, worst)
        views = []
        for trial in trials:
            position = positions[trial.estimator]
            views.append(trial_view(folder, trial, window=window, position=position))
        save_trial(path, *views, form=form)
        recordings.append(TrialRecording(path, tuple(trials)))
    return recordings


def open_viewer(paths: Sequence[Path], *, web: bool = False) -> None:
    """Open files in Rerun's viewer. With `web`, serve them to a browser on this machine until interrupted instead.

    Raises MissingDependencyError if there is no display.
    """
    if web:
        subprocess.run([*RERUN, "--serve-web", "--bind", "127.0.0.1", *map(str, paths)], check=False)
        return
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not has_display:
        files = " ".join(map(str, paths))
        raise MissingDependencyError(
            f"there is no display to open the viewer on; on a machine with a display, run: rerun {files} "
            "(or use --web, and open the address that it prints)"
        )
    subprocess.Popen([*RERUN, *map(str, paths)], start_new_session=True)


def _chosen(
    folder: RunFolder, *, case: str | None, estimator: str | None, compare: tuple[str, str] | None, worst: int
) -> list[list[TrialScore]]:
    """The trials that each recording shows."""
    scores = folder.scores()
    if compare:
        first_estimator, second_estimator = compare
        first = ranked(scores, case=case, estimator=first_estimator)[0]
        candidates = ranked(scores, case=first.case, estimator=second_estimator)
        same_repeat = [trial for trial in candidates if trial.repeat == first.repeat]
        second = (same_repeat or candidates)[0]
        return [[first, second]]
    if worst > 1:
        by_rank = ranked(scores, case=case, estimator=estimator)
        return [[trial] for trial in by_rank[:worst]]
    return [[pick(scores, case=case, estimator=estimator)]]


def _target(save: Path | None, folder: RunFolder, trials: Sequence[TrialScore], worst: int) -> Path:
    """The file of a recording. Raises InputError if no file can be written there."""
    first = trials[0]
    if save is None:
        name = "run.rrd" if len(trials) == 1 else "compare.rrd"
        path = folder.estimate(first.case, first.estimator, first.repeat) / name
    elif worst > 1:
        path = save.with_name(f"{save.stem}_{first.case}_{first.estimator}_{first.repeat}{save.suffix}")
    else:
        path = save
    if path.is_dir():
        raise InputError(f"--save should name a file, but this is a folder: {path}")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"--save should name a file in a folder that can be written to, got {path}")
    return path
