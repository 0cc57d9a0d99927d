"""vobench causes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from vobench.analysis.causes import MIN_EXPLAINED, Attribution, Cause
from vobench.analysis.conditions import CONDITIONS
from vobench.analysis.run_causes import WORST_SEGMENTS, EstimatorCauses, find_causes
from vobench.cli import terminal
from vobench.cli.option import Json, RunPath
from vobench.cli.progress import Bars

if TYPE_CHECKING:
    from rich.console import Console

# A condition is listed for a trial or a segment if it multiplies the error by more than this.
LEAST_FACTOR = 1.1
MOST_FACTORS = 3
MOST_NAMES = 2  # of conditions that vary together are named for a trial or a segment
CAUSE_HEADINGS = ("condition", "factor", "95 % interval", "verdict")
TRIAL_HEADINGS = ("trial", "status", "first bad frame", "contributing conditions")
SEGMENT_HEADINGS = ("trial", "frames", "error per path", "with")


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
        console.print(f"{causes.estimator}: no answer. {causes.reason}\n", soft_wrap=True)
        return
    _print_attribution(causes.estimator, attribution, console)
    for symptom in causes.symptoms:
        factor = _with_factor(symptom, symptom.factor)
        console.print(f"Symptom, besides these: {factor}.", soft_wrap=True)
    if causes.has_one_drive:
        console.print(
            "All cases follow one trajectory: a condition that is the same in all of them is significant only if it "
            "agrees with the errors in each half of the trajectory.",
            soft_wrap=True,
        )
    console.print()
    console.print(terminal.table(f"{causes.estimator}: trials", TRIAL_HEADINGS, _trial_rows(causes, attribution)))
    segments = _segment_rows(attribution, worst)
    console.print(terminal.table(f"{causes.estimator}: worst segments", SEGMENT_HEADINGS, segments))


def _print_attribution(estimator: str, attribution: Attribution, console: "Console") -> None:
    """Print what the error depends on in one sentence, then the factor of each condition."""
    console.print(f"{estimator}: {_answer(attribution)}", soft_wrap=True)
    for name in dict.fromkeys(name for cause in attribution.named for name in cause.conditions):
        _, meaning = CONDITIONS[name]
        console.print(f"- {name}: {meaning}", soft_wrap=True)
    console.print()
    title = "Factor of the error from a low to a high level of each condition"
    rows = [_cause_row(cause) for cause in attribution.causes]
    console.print(terminal.table(title, CAUSE_HEADINGS, rows))
    if any(len(cause.conditions) > 1 for cause in attribution.causes):
        console.print(
            "Conditions joined by + vary together in this run, so a regression cannot separate them.", soft_wrap=True
        )
    if attribution.constant:
        console.print(f"Unknown, because constant in all segments: {', '.join(attribution.constant)}.", soft_wrap=True)


def _answer(attribution: Attribution) -> str:
    """Which conditions the error depends on, and how much of it all conditions explain."""
    explained = f"{attribution.explained:.0%}"
    if attribution.is_mostly_unexplained:
        return (
            "most of the error has a cause that is not among the conditions; they explain "
            f"{explained} of the variance of its logarithm, and nothing is named below {MIN_EXPLAINED:.0%}."
        )
    named = ", ".join(_with_interval(cause) for cause in attribution.named)
    answer = f"the error depends on {named}" if named else "the error depends significantly on none of the conditions"
    return f"{answer}. All conditions explain {explained} of the variance of its logarithm."


def _cause_row(cause: Cause) -> list[str]:
    conditions = " + ".join(cause.conditions)
    return [conditions, _two_digits(cause.factor), _interval(cause), _verdict(cause)]


def _verdict(cause: Cause) -> str:
    if cause.is_sure:
        return "significant"
    if not cause.recurs:
        return "not in each half"
    return "not significant"


def _trial_rows(causes: EstimatorCauses, attribution: Attribution) -> list[list[str]]:
    rows = list[list[str]]()
    for trial in causes.trials():
        frame = trial["first_divergence_frame"]
        divergence = "" if frame is None else str(frame)
        factors = _largest_factors(attribution.cases[trial["case"]])
        rows.append([_trial_name(trial["case"], trial["repeat"]), trial["status"], divergence, factors])
    return rows


def _segment_rows(attribution: Attribution, worst: int) -> list[list[str]]:
    rows = list[list[str]]()
    for segment in attribution.segments[:worst]:
        frames = f"{segment.first} to {segment.end - 1}"
        factors = _largest_factors(segment.factors)
        rows.append([_trial_name(segment.case, segment.repeat), frames, f"{segment.loss:.1%}", factors])
    return rows


def _trial_name(case: str, repeat: int) -> str:
    """The name of a case, and the repeat if it is not the first, as in paths of trials."""
    return case if repeat == 0 else f"{case}/{repeat}"


def _largest_factors(factors: Sequence[tuple[Cause, float]]) -> str:
    """The conditions that multiply the error most, with their factors."""
    texts = list[str]()
    for cause, factor in factors[:MOST_FACTORS]:
        if factor > LEAST_FACTOR:
            texts.append(_with_factor(cause, factor))
    return ", ".join(texts)


def _with_interval(cause: Cause) -> str:
    """The conditions, their factor and its interval."""
    return f"{_with_factor(cause, cause.factor)} (95 % interval {_interval(cause)})"


def _interval(cause: Cause) -> str:
    return f"{_two_digits(cause.low)} to {_two_digits(cause.high)}"


def _with_factor(cause: Cause, factor: float) -> str:
    """The first names of the conditions that vary together, and a factor."""
    names = " + ".join(cause.conditions[:MOST_NAMES])
    further = len(cause.conditions) - MOST_NAMES
    if further > 0:
        names = f"{names} + {further} more"
    return f"{names} ×{_two_digits(factor)}"


def _two_digits(factor: float) -> str:
    """A factor with two significant digits, or all digits of its integer part."""
    return f"{factor:.0f}" if factor >= 100 else f"{factor:.2g}"
