"""The command vobench compare, which lists the scores that differ between two runs."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json
from vobench.report.compare import SAME, ScoreChange
from vobench.report.run_comparison import compare_runs

EXIT_REGRESSED = 3  # the exit code if a score became worse or a trial fails that did not fail before
HEADINGS = ("estimator", "verdict", "old", "new", "ratio", "p")
RATIO_EXPLANATION = "ratio: new loss / old loss, where the loss is 1 - lost-aware score"


def compare_command(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="A run or a bundle.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Another run or bundle of the same suite.")],
    *,
    at_most: Annotated[
        float | None,
        typer.Option(help="The largest ratio of new to old losses that does not count as worse."),
    ] = None,
    json: Json = False,
) -> None:
    """Print the scores that differ between two runs; exit code 3 if one is worse or a trial newly fails."""
    comparison = compare_runs(old, new, terminal.warn, at_most=at_most)
    if json:
        content = {
            "worse": len(comparison.regressions),
            "changes": [asdict(change) for change in comparison.changes],
            "environment": comparison.environment_differences,
        }
        terminal.print_json(content)
    else:
        _print_changes(comparison.changes, comparison.environment_differences)
    if comparison.regressions:
        raise SystemExit(EXIT_REGRESSED)


def _print_changes(changes: Sequence[ScoreChange], environment_differences: Sequence[str]) -> None:
    """Print the scores over all cases, the cells that changed, and the differences between the environments."""
    console = terminal.console()
    # A cell is one estimator on one case. The change of a score over all cases has an empty case.
    totals = [change for change in changes if not change.case]
    cells = [change for change in changes if change.case]
    changed_cells = [cell for cell in cells if cell.verdict != SAME]

    _print_tables(totals, changed_cells)
    same_count = len(cells) - len(changed_cells)
    console.print(f"{same_count} of {len(cells)} cells are the same to the last digit")
    if environment_differences:
        console.print(f"The runs differ in settings that can change scores: {'; '.join(environment_differences)}")


def _print_tables(totals: Sequence[ScoreChange], changed_cells: Sequence[ScoreChange]) -> None:
    """Print a table of the scores over all cases and one of the changed cells, with an explanation of their ratios."""
    console = terminal.console()
    if totals:
        total_rows = [_row(total) for total in totals]
        console.print(terminal.table("lost-aware score over all cases", HEADINGS, total_rows))
    if changed_cells:
        cell_rows = [[cell.case, *_row(cell)] for cell in changed_cells]
        console.print(terminal.table("ATE (% of path length)", ["case", *HEADINGS], cell_rows))
    if totals or changed_cells:
        console.print(RATIO_EXPLANATION)


def _row(change: ScoreChange) -> list[str]:
    """The cells of a change in the columns HEADINGS."""
    p_value = "" if change.p is None else f"{change.p:.2g}"
    return [change.estimator, change.verdict, change.old, change.new, _format_ratio(change), p_value]


def _format_ratio(change: ScoreChange) -> str:
    """The ratio of the new loss to the old one, and its confidence interval if there is one."""
    if change.ratio is None:
        return ""
    if not change.interval:
        return f"{change.ratio:.3g}"
    low, high = change.interval
    return f"{change.ratio:.3g} [{low:.3g}, {high:.3g}]"
