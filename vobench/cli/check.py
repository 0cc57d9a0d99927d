"""The command vobench check, which validates a suite and prints its plan."""

from typing import TYPE_CHECKING, Any

from vobench.cli import terminal
from vobench.cli.option import Json, SuiteName, Trust
from vobench.runner.preflight import PlanSummary, summarize
from vobench.suite.suite import read_plan

if TYPE_CHECKING:
    from rich.console import Console

SHORTEST_IN_MINUTES_S = 600  # shorter durations are printed in seconds


def check_command(suite: SuiteName, *, trust: Trust = False, json: Json = False) -> None:
    """Validate a suite and print its plan; nothing is rendered."""
    del trust  # the callback of --trust has already recorded the consent
    plan = read_plan(suite)
    print_summary(summarize(plan), as_json=json)


def print_summary(summary: PlanSummary, *, as_json: bool) -> None:
    """Print the cases and estimators of a suite; for a dry run also the tasks."""
    if as_json:
        terminal.print_json(summary.as_dict())
        return
    console = terminal.console()
    _print_cases(summary, console)
    _print_estimators(summary, console)
    file_rows = [list(row.values()) for row in summary.found()]
    console.print(terminal.table("files", ["kind", "name", "origin", "path"], file_rows))

    for case in summary.cases:
        for note in case.notes or ():
            console.print(f"{case.case}: {note}")
    for doubt in summary.doubts:
        console.print(doubt, highlight=False)

    is_dry_run = summary.stages is not None
    if is_dry_run:
        _print_stages(summary.tasks(), console)
    counts = f"{len(summary.cases)} cases, {len(summary.estimators())} estimators, {summary.trials} trials"
    console.print(f"{counts}: the suite is valid")


def _print_cases(summary: PlanSummary, console: "Console") -> None:
    """Print a table of the cases. It has a column for the clearance if that of any case is known."""
    has_clearance = any(case.clearance_m is not None for case in summary.cases)
    rows = list[list[str]]()
    for case in summary.cases:
        frames = "" if case.frames is None else str(case.frames)
        seconds = "" if case.duration_s is None else f"{case.duration_s:.1f}"
        row = [case.case, frames, seconds, case.sequence]
        if has_clearance:
            row.append("" if case.clearance_m is None else f"{case.clearance_m:.2f}")
        rows.append(row)
    title = f"{summary.plan.suite.name}: cases"
    headings = ["case", "frames", "seconds", "sequence"]
    if has_clearance:
        headings.append("clearance m")
    console.print(terminal.table(title, headings, rows))


def _print_estimators(summary: PlanSummary, console: "Console") -> None:
    """Print a table of the estimators and the inputs that they need."""
    rows = list[list[str]]()
    for estimator in summary.estimators():
        needs = ", ".join(estimator["needs"]) or "nothing"
        rows.append([estimator["estimator"], estimator["version"], needs])
    console.print(terminal.table("estimators", ["estimator", "version", "needs"], rows))


def _print_stages(stages: list[dict[str, Any]], console: "Console") -> None:
    """Print a table of the tasks of each stage, and the reasons why tasks are not in the cache."""
    rows = list[list[str]]()
    for stage in stages:
        counts = [str(stage[column]) for column in ("tasks", "in the cache", "to do")]
        rows.append([stage["stage"], *counts, _format_duration(stage["seconds"])])
    console.print(terminal.table("tasks", ["stage", "tasks", "in the cache", "to do", "about"], rows))
    for stage in stages:
        for reason, count in stage["reasons"].items():
            console.print(f"{stage['stage']}: {count} to do: {reason}", highlight=False)


def _format_duration(seconds: float | None) -> str:
    """The work of one core in seconds or minutes; empty if it is unknown."""
    if seconds is None:
        return ""
    if seconds < SHORTEST_IN_MINUTES_S:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min"
