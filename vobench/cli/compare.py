"""The command vobench compare, which lists the scores that differ between two runs."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json
from vobench.report import compare, page
from vobench.report.leaderboard import Board
from vobench.runner.bundle import merged, opened
from vobench.runner.folder import RunFolder
from vobench.runner.rescore import check, wrong_truths

REGRESSED = 3  # the exit code if a score became worse or a trial fails that did not fail before
HEADINGS = ("estimator", "verdict", "old", "new", "ratio", "p")
RATIO_EXPLANATION = "ratio: new loss / old loss, where the loss is 1 - lost-aware score"


def compare_command(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="A run or a bundle.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Another run or bundle of the same suite.")],
    *,
    at_most: Annotated[
        float | None,
        typer.Option(help="The largest ratio between old and new errors that still counts as alike."),
    ] = None,
    json: Json = False,
) -> None:
    """Print the scores that differ between two runs; exit code 3 if one is worse or a trial fails that did not."""
    with (
        opened(old, terminal.warn) as old_folder,
        opened(new, terminal.warn) as new_folder,
        merged([old_folder, new_folder], ["old", "new"]),
    ):
        old_board = _checked_board(old_folder, old)
        new_board = _checked_board(new_folder, new)
    changes = compare.compare(old_board, new_board, at_most=at_most)
    regressions = [change for change in changes if change.verdict in compare.REGRESSIONS]
    differences = compare.environment_differences(old_board, new_board)
    if json:
        rows = [asdict(change) for change in changes]
        terminal.print_json({"worse": len(regressions), "changes": rows, "environment": differences})
    else:
        _print_changes(changes, differences)
    if regressions:
        raise SystemExit(REGRESSED)


def _checked_board(folder: RunFolder, path: Path) -> Board:
    """Recompute the scores of a run, warn about stored scores that differ, and return the leaderboard."""
    is_bundle = path.is_file()
    wrong_truth_by_case = wrong_truths(folder) if is_bundle else {}
    checked = check(folder, wrong_truth_by_case)
    for note in checked.notes:
        terminal.warn(f"{path.name}: {note}")
    return page.run_board(folder, checked.scores)


def _print_changes(changes: Sequence[compare.ScoreChange], environment_differences: Sequence[str]) -> None:
    """Print the scores over all cases, the cells that changed, and the differences between the environments."""
    console = terminal.console()
    totals = [change for change in changes if not change.case]  # over all cases
    cells = [change for change in changes if change.case]
    changed_cells = [cell for cell in cells if cell.verdict != compare.SAME]

    if totals:
        rows = [_row(change) for change in totals]
        console.print(terminal.table("lost-aware score over all cases", HEADINGS, rows))
    if changed_cells:
        rows = [[cell.case, *_row(cell)] for cell in changed_cells]
        console.print(terminal.table("ATE % of path", ["case", *HEADINGS], rows))
    same_count = len(cells) - len(changed_cells)
    console.print(f"{same_count} of {len(cells)} cells are the same to the last digit; {RATIO_EXPLANATION}")
    if environment_differences:
        console.print(f"The runs differ in what can change scores: {'; '.join(environment_differences)}")


def _row(change: compare.ScoreChange) -> list[str]:
    """The row of the table for a change, with the columns HEADINGS."""
    p_value = "" if change.p is None else f"{change.p:.2g}"
    return [change.estimator, change.verdict, change.old, change.new, _format_ratio(change), p_value]


def _format_ratio(change: compare.ScoreChange) -> str:
    """The ratio of the new loss to the old one, and its confidence interval if there is one."""
    if change.ratio is None:
        return ""
    if not change.interval:
        return f"{change.ratio:.3g}"
    low, high = change.interval
    return f"{change.ratio:.3g} [{low:.3g}, {high:.3g}]"
