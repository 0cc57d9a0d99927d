"""vobench causes, explain and shrink: why an estimator fails."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from vobench.analysis.causes import Attribution, Cause
from vobench.analysis.explain_trial import TrialExplanation, explain_trial
from vobench.analysis.run_causes import WORST_SEGMENTS, EstimatorCauses, find_causes
from vobench.analysis.shrink_trial import ShrunkTrial, shrink_trial
from vobench.cli import terminal
from vobench.cli.plan_runner import plan_runner

TrialPath = Annotated[
    Path, typer.Argument(metavar="RUN/CASE/ESTIMATOR", help="A trial, as runs/quickstart/latest/room-down/lk_epipolar.")
]
Seeds = Annotated[int, typer.Option("--repeats", "-n", min=1, max=20, help="Seeds for each; few frames take more.")]
Out = Annotated[Path, typer.Option(help="Where the folders of runs go.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, envvar="VOBENCH_JOBS", help="Tasks at once.")]
EstimatorPath = Annotated[
    Path | None, typer.Option("--estimator", help="The estimator's folder, where it is not found by its name.")
]
# A condition is listed where it multiplies the error by more than this.
LEAST_FACTOR = 1.1
MOST_FACTORS = 3


def causes_command(
    run: terminal.RunPath,
    *,
    estimator: Annotated[str | None, typer.Option(help="Only this one.")] = None,
    worst: Annotated[int, typer.Option(min=1, help="How many segments to list.")] = WORST_SEGMENTS,
    json: terminal.Json = False,
) -> None:
    """Say what a run's errors hang on, where each trial went wrong first, and its worst segments."""
    found = find_causes(run, estimator=estimator, progress=terminal.Bars())
    if json:
        terminal.print_json(found.as_dict(worst=worst))
        return
    for each in found.estimators:
        _print_causes(each, worst=worst)


def _print_causes(causes: EstimatorCauses, *, worst: int) -> None:
    console = terminal.console()
    found = causes.attribution
    if found is None:
        console.print(f"{causes.estimator}: too few frames, or frames too alike, to learn causes from")
        return

    title = f"{causes.estimator}: the error is multiplied by, from little to much of"
    rows = [_cause_row(cause) for cause in found.causes]
    console.print(terminal.table(title, ["condition", "factor", "95 % interval", "is"], rows))
    console.print(f"together they explain {found.explained:.0%} of the error's variance (of its logarithm)")
    if any(len(cause.conditions) > 1 for cause in found.causes):
        console.print("conditions joined by + go together in this run: no regression can tell them apart")
    if found.constant:
        console.print(f"the same in every segment, and so not known: {', '.join(found.constant)}")

    headings = ["case", "repeat", "status", "goes wrong at", "is worse than others by"]
    console.print(terminal.table("trials", headings, _trial_rows(causes, found)))
    headings = ["case", "repeat", "frames", "error, of the way", "with"]
    console.print(terminal.table("worst segments", headings, _segment_rows(found, worst)))


def _cause_row(cause: Cause) -> list[str]:
    conditions = " + ".join(cause.conditions)
    interval = f"{cause.low:.2f} to {cause.high:.2f}"
    return [conditions, f"{cause.factor:.2f}", interval, "" if cause.is_sure else "not sure"]


def _trial_rows(causes: EstimatorCauses, found: Attribution) -> list[list[str]]:
    rows = []
    for trial in causes.trials():
        frame = trial["first_divergence_frame"]
        wrong_at = "" if frame is None else str(frame)
        factors = _largest_factors(found.cases[trial["case"]])
        rows.append([trial["case"], str(trial["repeat"]), trial["status"], wrong_at, factors])
    return rows


def _segment_rows(found: Attribution, worst: int) -> list[list[str]]:
    rows = []
    for segment in found.segments[:worst]:
        frames = f"{segment.first} to {segment.end - 1}"
        factors = _largest_factors(segment.factors)
        rows.append([segment.case, str(segment.repeat), frames, f"{segment.loss:.1%}", factors])
    return rows


def _largest_factors(factors: Sequence[tuple[Cause, float]]) -> str:
    """The conditions that multiply the error most, with their factors."""
    texts = []
    for cause, factor in factors[:MOST_FACTORS]:
        if factor > LEAST_FACTOR:
            texts.append(f"{' + '.join(cause.conditions)} ×{factor:.2g}")
    return ", ".join(texts)


def explain_command(
    trial: TrialPath,
    *,
    repeats: Seeds = 3,
    estimator: EstimatorPath = None,
    out: Out = Path("runs"),
    jobs: Jobs = 1,
    json: terminal.Json = False,
) -> None:
    """Run a trial again without each thing that makes it hard, and say which of them it fails for."""
    found = explain_trial(
        trial,
        run_plan=plan_runner(out=out, jobs=jobs),
        repeats=repeats,
        estimator=estimator,
        progress=terminal.Bars(),
    )
    if json:
        terminal.print_json(found.as_dict())
    else:
        _print_explanation(found)


def _print_explanation(found: TrialExplanation) -> None:
    console = terminal.console()
    why = found.explanation
    title = f"{found.estimator} on {found.case}: {why.status}, {why.loss:.1%} of the way wrong"
    headings = ["without", "instead", "error", "less", "95 % interval", "survived", "is"]
    console.print(terminal.table(title, headings, _change_rows(found)))
    if why.alone:
        by_loss = sorted(why.alone.items(), key=lambda item: -item[1])
        losses = ", ".join(f"{name} {loss:.1%}" for name, loss in by_loss)
        console.print(f"no single one mends it; with only one of them left the error is: {losses}")
    if not why.repeats_differ:
        console.print("the repeats are alike, for nothing is random here: the intervals are over segments alone")
    if found.named:
        console.print(f"It fails for {' and '.join(found.named)}.")
    else:
        console.print("None of these explains it: it is the estimator, its path or what it sees.")


def _change_rows(found: TrialExplanation) -> list[list[str]]:
    everything = found.explanation.everything.removed
    rows = []
    for row in found.rows():
        is_everything = len(everything) > 1 and row["removed"] == everything
        rows.append(
            [
                "all of these" if is_everything else " and ".join(row["removed"]),
                row["instead"],
                f"{row['loss']:.1%}",
                f"{row['mended']:.0%}",
                f"{row['low']:.0%} to {row['high']:.0%}",
                f"{row['survived']} of {row['repeats']}",
                row["verdict"],
            ]
        )
    return rows


def shrink_command(
    trial: TrialPath,
    *,
    trials: Annotated[int, typer.Option(min=1, help="Estimates to run at most.")] = 12,
    save: Annotated[
        Path | None, typer.Option(help="The folder of the smaller case; shrunk/<case> where left out.")
    ] = None,
    estimator: EstimatorPath = None,
    out: Out = Path("runs"),
    jobs: Jobs = 1,
    json: terminal.Json = False,
) -> None:
    """Find the shortest part of a trial that fails in the same way, and save it as a suite of its own."""
    found = shrink_trial(
        trial,
        run_plan=plan_runner(out=out, jobs=jobs),
        trials=trials,
        folder=save,
        estimator=estimator,
        progress=terminal.Bars(),
    )
    if json:
        terminal.print_json(found.as_dict())
    else:
        _print_shrunk(found)


def _print_shrunk(found: ShrunkTrial) -> None:
    rows = []
    for number, (tried, fails) in enumerate(found.found.tried, 1):
        rows.append([str(number), tried, "fails the same way" if fails else "does not"])
    console = terminal.console()
    console.print(terminal.table(found.summary, ["#", "tried", "result"], rows))

    first, end = found.found.window
    share = (end - first) / found.frame_count
    removed = found.found.removed
    without = f" and without {', '.join(removed)}" if removed else ""
    console.print(f"It still fails with frames {first} to {end - 1} of {found.frame_count} ({share:.0%}){without}.")
    console.print(f"The smaller case: {found.suite}\nRun it: vobench run {found.suite}")
