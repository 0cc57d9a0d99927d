"""vobench explain and shrink: why a trial fails, and the smallest case in which it does."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.explain_trial import TrialExplanation, explain_trial
from vobench.analysis.shrink_trial import ShrunkTrial, shrink_trial
from vobench.cli import terminal
from vobench.cli.option import Json, RerunOptions, with_option_groups
from vobench.cli.plan_runner import plan_runner
from vobench.cli.progress import Bars

CHANGE_HEADINGS = ("without", "instead", "error", "less", "95 % interval", "survived", "is")

TrialPath = Annotated[
    Path,
    typer.Argument(
        metavar="RUN/CASE/ESTIMATOR", help="A trial, such as runs/quickstart/latest/unlike_eyes-3-room/feature_vo."
    ),
]


@with_option_groups
def explain_command(
    trial: TrialPath,
    *,
    repeats: Annotated[
        int,
        typer.Option(
            "--repeats", "-n", min=1, max=20, help="The seeds of the first comparison; a random estimator gets more."
        ),
    ] = 3,
    rerun: RerunOptions,
    json: Json = False,
) -> None:
    """Run a trial again without each difficulty, and print which of them cause the failure."""
    result = explain_trial(
        trial,
        run_plan=plan_runner(out=rerun.out, jobs=rerun.jobs),
        repeats=repeats,
        estimator=rerun.estimator,
        progress=Bars(),
    )
    if json:
        terminal.print_json(result.as_dict())
    else:
        _print_explanation(result)


def _print_explanation(result: TrialExplanation) -> None:
    console = terminal.console()
    explanation = result.explanation
    title = f"{result.estimator} on {result.case}: {explanation.status}, error {explanation.loss:.1%} of the path"
    console.print(terminal.table(title, CHANGE_HEADINGS, _change_rows(result)))
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
    return [
        "all of these" if is_everything else " and ".join(row["removed"]),
        row["instead"],
        f"{row['loss']:.1%}",
        f"{row['reduction']:.0%}",
        f"{row['low']:.0%} to {row['high']:.0%}",
        f"{row['survived']} of {row['repeats']}",
        row["verdict"],
    ]


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
