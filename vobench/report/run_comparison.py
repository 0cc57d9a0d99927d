"""Scores two runs again and compares them."""

from dataclasses import dataclass
from pathlib import Path

from vobench.report import compare, page
from vobench.report.compare import ScoreChange
from vobench.report.leaderboard import Board
from vobench.runner.bundle import opened, require_same_cases
from vobench.runner.folder import RunFolder
from vobench.runner.rescore import check, wrong_truths
from vobench.runner.store import Tell


@dataclass(frozen=True, slots=True)
class RunComparison:
    """The changes from one run to another, and the differences between their environments that can change scores."""

    changes: list[ScoreChange]
    environment_differences: list[str]

    @property
    def regressions(self) -> list[ScoreChange]:
        """The changes for the worse: a larger loss, or a trial that fails and did not fail before."""
        return [change for change in self.changes if change.verdict in compare.REGRESSIONS]


def compare_runs(old: Path, new: Path, tell: Tell, *, at_most: float | None = None) -> RunComparison:
    """Compare two runs or bundles, after scoring their trials again from estimates and ground truths.

    A ratio of losses above `at_most` counts as worse. `tell` receives a sentence for each stored score that differs.
    Raises InputError if the runs have nothing in common, or have different cases with the same name.
    """
    with opened(old, tell) as old_folder, opened(new, tell) as new_folder:
        require_same_cases(old_folder, new_folder)
        old_board = _rescored_board(old_folder, old, tell)
        new_board = _rescored_board(new_folder, new, tell)
    changes = compare.compare(old_board, new_board, at_most=at_most)
    return RunComparison(changes, compare.environment_differences(old_board, new_board))


def _rescored_board(folder: RunFolder, path: Path, tell: Tell) -> Board:
    """The leaderboard of a run whose scores are computed again. The truth of a bundle is checked, too."""
    is_bundle = path.is_file()
    wrong_truth_by_case = wrong_truths(folder) if is_bundle else {}
    checked = check(folder, wrong_truth_by_case)
    for note in checked.notes:
        tell(f"{path.name}: {note}")
    return page.run_board(folder, checked.scores)
