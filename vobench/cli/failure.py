"""vobench explain and shrink: why a trial or a recording fails, and the smallest case in which a trial does."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.explain_recording import explain_recording
from vobench.analysis.explain_trial import TrialExplanation, explain_trial
from vobench.analysis.recording_explanation import RecordingExplanation
from vobench.analysis.shrink_trial import ShrunkTrial, shrink_trial
from vobench.cli import terminal
from vobench.cli.option import Jobs, Json, RerunOptions, with_option_groups
from vobench.cli.plan_runner import plan_runner
from vobench.cli.progress import Bars
from vobench.cli.recording_option import FormCommand, RecordingOptions
from vobench.errors import InputError
from vobench.estimator.manifest import MANIFEST_FILE
from vobench.runner.recording import may_be_recording

COMMAND_CLASS = FormCommand
TWIN_HEADINGS = ("without", "error", "difference", "95 % interval", "end well")
CHANGE_HEADINGS = ("change", "error", "difference", "95 % interval", "end well", "verdict")
LEGEND = (
    "Error: before and after the change, of runs with the same seeds. Promising changes are run again with more "
    "seeds, and only those decide."
)

TrialPath = Annotated[
    Path,
    typer.Argument(
        metavar="RUN/CASE/ESTIMATOR", help="A trial, such as runs/quickstart/latest/unlike_eyes-3-room/feature_vo."
    ),
]


@with_option_groups
def explain_command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="TRIAL|RECORDING",
            help="A trial as RUN/CASE/ESTIMATOR, such as runs/quickstart/latest/unlike_eyes-3-room/feature_vo; "
            "or a recording of a stereo pair with ground truth.",
        ),
    ],
    *,
    repeats: Annotated[
        int,
        typer.Option(
            "--repeats", "-n", min=1, max=20, help="The seeds of the first comparison; a random estimator gets more."
        ),
    ] = 3,
    estimate: Annotated[
        Path | None, typer.Option(help="The estimate of the recording, instead of running --estimator on it.")
    ] = None,
    place: Annotated[str, typer.Option(help="The scene or model in which the twin of a recording is.")] = "office",
    twin: Annotated[Path, typer.Option(help="The new folder for the twin of a recording.")] = Path("explained"),
    estimator: Annotated[
        Path | None,
        typer.Option(
            help="The folder of a trial's estimator, if it cannot be found by its name; the name or folder of the "
            "estimator of a recording (lk_epipolar by default)."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="The folder for the runs of a trial.")] = Path("runs"),
    jobs: Jobs = 1,
    recording_options: RecordingOptions,
    json: Json = False,
) -> None:
    """Run a trial again without each difficulty, and print which of them cause the failure.

    Of a recording, the worst five seconds are compared with the rest of it and repeated in a simulated twin.
    """
    if may_be_recording(path):
        found = explain_recording(
            path,
            run_plan=plan_runner(out=twin / "runs", jobs=jobs, has_short_tasks=True),
            estimate=estimate,
            estimator=None if estimator is None else _estimator_name(estimator),
            place=place,
            out=twin,
            repeats=repeats,
            form=recording_options.form,
            options=recording_options.read_options(),
            progress=Bars(),
        )
        if json:
            terminal.print_json(found.as_dict())
        else:
            _print_recording(found)
        return

    if estimate is not None:
        raise InputError(f"--estimate is for recordings, and this is none: {path}")
    result = explain_trial(
        path,
        run_plan=plan_runner(out=out, jobs=jobs),
        repeats=repeats,
        estimator=estimator,
        progress=Bars(),
    )
    if json:
        terminal.print_json(result.as_dict())
    else:
        _print_explanation(result)


def _estimator_name(estimator: Path) -> str:
    """The name of an estimator, or the path of its folder."""
    is_folder = (estimator / MANIFEST_FILE).is_file()
    return str(estimator.resolve() if is_folder else estimator)


def _print_recording(found: RecordingExplanation) -> None:
    console = terminal.console()
    rows = [_twin_row(row) for row in found.rows()]
    if rows:
        console.print(terminal.table("the twin", TWIN_HEADINGS, rows))
    for sentence in found.sentences:
        console.print(sentence, soft_wrap=True)


def _twin_row(row: dict[str, Any]) -> list[str]:
    return [
        " and ".join(row["removed"]),
        f"{row['loss']:.1%}",
        *_effect_cells(row),
    ]


def _effect_cells(row: dict[str, Any]) -> list[str]:
    """The relative difference of the error, its interval, and the runs that end well."""
    return [
        _signed(-row["reduction"]),
        f"{_signed(-row['high'])} to {_signed(-row['low'])}",
        f"{row['survived']} of {row['repeats']}",
    ]


def _signed(share: float) -> str:
    """A share in whole per cent with its sign, and 0 without."""
    per_cent = round(100 * share)
    return f"{per_cent:+d}%" if per_cent else "0%"


def _print_explanation(result: TrialExplanation) -> None:
    console = terminal.console()
    explanation = result.explanation
    title = f"{result.estimator} on {result.case}: {explanation.status}, error {explanation.loss:.1%} of the path"
    console.print(terminal.table(title, CHANGE_HEADINGS, _change_rows(result)))
    console.print(LEGEND, soft_wrap=True)
    if explanation.alone:
        by_loss = sorted(explanation.alone.items(), key=lambda item: -item[1])
        losses = ", ".join(f"{name} {loss:.1%}" for name, loss in by_loss)
        console.print(f"With only one nuisance left, the error is: {losses}.", soft_wrap=True)
    if not explanation.repeats_differ:
        console.print("All repeats are identical, because nothing is random: the intervals are over segments only.")
    for sentence in result.sentences:
        console.print(sentence, soft_wrap=True)


def _change_rows(result: TrialExplanation) -> list[list[str]]:
    everything = result.explanation.everything
    removed = everything.removed if everything is not None else ()
    return [_change_row(row, removed) for row in result.rows()]


def _change_row(row: dict[str, Any], everything: tuple[str, ...]) -> list[str]:
    is_everything = len(everything) > 1 and row["removed"] == everything
    removed = "all of these" if is_everything else " and ".join(row["removed"])
    change = f"{removed} → {row['instead']}" if row["instead"] else f"without {removed}"
    before = "–" if row["before"] is None else f"{row['before']:.1%}"
    error = f"{before} → {row['loss']:.1%}"
    return [change, error, *_effect_cells(row), row["verdict"]]


@with_option_groups
def shrink_command(
    trial: TrialPath,
    *,
    trials: Annotated[int, typer.Option(min=1, help="The largest number of estimates to run.")] = 12,
    save: Annotated[
        Path | None, typer.Option(help="The folder for the smaller case; shrunk/<case> by default.")
    ] = None,
    rerun: RerunOptions,
    json: Json = False,
) -> None:
    """Find the shortest part of a trial that fails in the same way, and save it as a suite."""
    result = shrink_trial(
        trial,
        run_plan=plan_runner(out=rerun.out, jobs=rerun.jobs),
        trials=trials,
        folder=save,
        estimator=rerun.estimator,
        progress=Bars(),
    )
    if json:
        terminal.print_json(result.as_dict())
    else:
        _print_shrunk(result)


def _print_shrunk(result: ShrunkTrial) -> None:
    rows = list[list[str]]()
    for number, (variant, fails) in enumerate(result.found.tried, 1):
        rows.append([str(number), variant, "fails in the same way" if fails else "does not"])
    console = terminal.console()
    console.print(terminal.table(result.summary, ["#", "tried", "result"], rows))

    first, end = result.found.window
    share = (end - first) / result.frame_count
    removed = result.found.removed
    without = f" and without {', '.join(removed)}" if removed else ""
    frames = f"frames {first} to {end - 1} of {result.frame_count} ({share:.0%})"
    console.print(f"It still fails with {frames}{without}.")
    console.print(f"The smaller case: {result.suite}\nRun it: vobench run {result.suite}")
