"""vobench causes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from vobench.analysis.causes import MIN_EXPLAINED, Attribution, Cause
from vobench.analysis.run_causes import WORST_SEGMENTS, EstimatorCauses, find_causes
from vobench.cli import terminal
from vobench.cli.option import Json, RunPath
from vobench.cli.progress import Bars

if TYPE_CHECKING:
    from rich.console import Console

# A condition is listed for a trial or a segment if it multiplies the error by more than this.
LEAST_FACTOR = 1.1
MOST_FACTORS = 3
CAUSE_HEADINGS = ("condition", "factor", "95 % interval", "verdict")
TRIAL_HEADINGS = ("case", "repeat", "status", "diverges at frame", "contributing conditions")
SEGMENT_HEADINGS = ("case", "repeat", "frames", "error per path", "with")


def causes_command(
    run: RunPath,
    *,
    estimator: Annotated[str | None, typer.Option(help="Only this estimator.")] = None,
    worst: Annotated[int, typer.Option(min=1, help="The number of segments to list.")] = WORST_SEGMENTS,
    json: Json = False,
) -> None:
    """Print which conditions the errors of a run depend on, where each trial diverges, and its worst segments."""
    result = find_causes(run, estimator=estimator, progress=Bars())
    if json:
        terminal.print_json(result.as_dict(worst=worst))
        return
    for causes in result.estimators:
        _print_causes(causes, worst=worst)


def _print_causes(causes: EstimatorCauses, *, worst: int) -> None:
    console = terminal.console()
    attribution = causes.attribution
    if attribution is None:
        console.print(f"{causes.estimator}: no answer. {causes.reason}", soft_wrap=True)
        return
    _print_attribution(causes.estimator, attribution, console)
    for symptom in causes.symptoms:
        console.print(f"symptom, besides these: {' + '.join(symptom.conditions)} ×{symptom.factor:.2g}")
    if causes.has_one_drive:
        console.print("all cases share one drive: what recurs on it is named only if no other time on it fits as well")
    console.print(terminal.table("trials", TRIAL_HEADINGS, _trial_rows(causes, attribution)))
    console.print(terminal.table("worst segments", SEGMENT_HEADINGS, _segment_rows(attribution, worst)))


def _print_attribution(estimator: str, attribution: Attribution, console: "Console") -> None:
    """Print the factor of each condition, and how much of the error the conditions explain."""
    title = f"{estimator}: factor of the error from a low to a high level of each condition"
    rows = [_cause_row(cause) for cause in attribution.causes]
    console.print(terminal.table(title, CAUSE_HEADINGS, rows))
    console.print(f"together they explain {attribution.explained:.0%} of the variance of the error's logarithm")
    if attribution.is_mostly_unexplained:
        console.print(
            f"Most of the error has a cause that is not in this list (they would explain {MIN_EXPLAINED:.0%} or more).",
            soft_wrap=True,
        )
    else:
        named = ", ".join(" + ".join(cause.conditions) for cause in attribution.named)
        console.print(f"Significant: {named or 'none of these'}.", soft_wrap=True)
    if any(len(cause.conditions) > 1 for cause in attribution.causes):
        console.print("conditions joined by + vary together in this run, so a regression cannot separate them")
    if attribution.constant:
        console.print(f"unknown, because constant in all segments: {', '.join(attribution.constant)}")


def _cause_row(cause: Cause) -> list[str]:
    conditions = " + ".join(cause.conditions)
    interval = f"{cause.low:.2f} to {cause.high:.2f}"
    verdict = "significant" if cause.is_sure else "not significant"
    return [conditions, f"{cause.factor:.2f}", interval, verdict]


def _trial_rows(causes: EstimatorCauses, attribution: Attribution) -> list[list[str]]:
    rows = list[list[str]]()
    for trial in causes.trials():
        frame = trial["first_divergence_frame"]
        divergence = "" if frame is None else str(frame)
        factors = _largest_factors(attribution.cases[trial["case"]])
        rows.append([trial["case"], str(trial["repeat"]), trial["status"], divergence, factors])
    return rows


def _segment_rows(attribution: Attribution, worst: int) -> list[list[str]]:
    rows = list[list[str]]()
    for segment in attribution.segments[:worst]:
        frames = f"{segment.first} to {segment.end - 1}"
        factors = _largest_factors(segment.factors)
        rows.append([segment.case, str(segment.repeat), frames, f"{segment.loss:.1%}", factors])
    return rows


def _largest_factors(factors: Sequence[tuple[Cause, float]]) -> str:
    """The conditions that multiply the error most, with their factors."""
    texts = list[str]()
    for cause, factor in factors[:MOST_FACTORS]:
        if factor > LEAST_FACTOR:
            texts.append(f"{' + '.join(cause.conditions)} ×{factor:.2g}")
    return ", ".join(texts)
