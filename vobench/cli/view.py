"""vobench view."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, RunPath, option_group, with_option_groups
from vobench.dataset.frame_range import frame_slice
from vobench.errors import InputError, require_known
from vobench.report.rerun import PictureForm
from vobench.report.viewer import TrialRecording, open_viewer, save_recordings
from vobench.runner.folder import open_run

IMAGE_FORMS: dict[str, PictureForm] = {"jpeg": "jpeg", "png": "png"}


@option_group
class TrialSelection:
    """Options that select the trials of a run, and the frames of them, that are shown."""

    case: Annotated[
        str | None, typer.Option(help="The case; by default the one with the worst failure or the largest error.")
    ] = None
    estimator: Annotated[
        str | None, typer.Option(help="The estimator; by default one that failed, otherwise the best one.")
    ] = None
    compare: Annotated[
        tuple[str, str] | None,
        typer.Option(metavar="A B", help="Show two estimators side by side, on the worst case of A."),
    ] = None
    worst: Annotated[int, typer.Option(min=1, help="The number of trials to show, the worst failure first.")] = 1
    frames: Annotated[
        str | None, typer.Option(metavar="A:B", help="Show only the frames from A to B - 1, as in 40:80.")
    ] = None

    def require_consistent(self) -> None:
        """Raise InputError if --compare is combined with options that it replaces."""
        if self.compare and (self.estimator or self.worst > 1):
            raise InputError("--compare names two estimators on one case; remove --estimator and --worst")

    def window(self) -> slice:
        """The frames that are shown. Raises InputError if --frames is not A:B."""
        if not self.frames:
            return slice(None)
        return frame_slice(self.frames, name="--frames")


@with_option_groups
def view_command(
    run: RunPath,
    *,
    selection: TrialSelection,
    pictures: Annotated[str, typer.Option(help="The format of the images: jpeg (smaller) or png (lossless).")] = "jpeg",
    save: Annotated[Path | None, typer.Option(help="Write to this .rrd instead of opening the viewer.")] = None,
    web: Annotated[bool, typer.Option("--web", help="Show it in a browser, which must be on this machine.")] = False,
    json: Json = False,
) -> None:
    """Show trials of a run in Rerun, failures first."""
    form = IMAGE_FORMS[require_known("form of images", pictures, IMAGE_FORMS)]
    selection.require_consistent()
    recordings = save_recordings(
        open_run(run),
        case=selection.case,
        estimator=selection.estimator,
        compare=selection.compare,
        worst=selection.worst,
        window=selection.window(),
        form=form,
        save=save,
    )
    if json:
        terminal.print_json(_facts(recordings))
        return
    for recording in recordings:
        print(f"{_trial_names(recording)}: {recording.path}")
    opens_viewer = save is None or web
    if opens_viewer:
        open_viewer([recording.path for recording in recordings], web=web)


def _trial_names(recording: TrialRecording) -> str:
    """The estimator, case and status of each trial in a recording."""
    names = [f"{trial.estimator} on {trial.case} ({trial.status})" for trial in recording.trials]
    return " and ".join(names)


def _facts(recordings: Sequence[TrialRecording]) -> dict[str, Any]:
    """The facts about the recordings for the JSON output. Those about the first one are also at the top level."""
    first = recordings[0]
    first_trial = first.trials[0]
    return {
        "case": first_trial.case,
        "estimator": first_trial.estimator,
        "repeat": first_trial.repeat,
        "path": str(first.path),
        "recordings": [_recording_facts(recording) for recording in recordings],
    }


def _recording_facts(recording: TrialRecording) -> dict[str, Any]:
    return {
        "path": str(recording.path),
        "case": recording.trials[0].case,
        "estimators": [trial.estimator for trial in recording.trials],
    }
