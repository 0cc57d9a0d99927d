"""Runs draws of a suite until each pair of estimators is decided or alike, and writes the reports of the whole run."""

from collections.abc import Callable
from pathlib import Path

from vobench.report import page
from vobench.report.until_decided import Say, UntilDecided, record, run_until_decided
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.run import Finish
from vobench.suite.plan import Plan
from vobench.temporary import temporary_folder

# Runs a plan in a parent folder, and finishes the run.
RunIn = Callable[[Plan, Path, Finish], RunFolder]


def run_draws(
    draw: Callable[[int], Plan], run: RunIn, *, out: Path, ratio: float, budget_s: float, tell: Say
) -> UntilDecided:
    """Run draws of a suite as `run_until_decided` does; only the run with all units is kept, in the folder `out`.

    Raises SuiteError if the suite has no places that can be drawn, or fewer than two estimators to compare.
    """

    def write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
        record(folder, ratio=ratio)
        page.write_reports(folder, scores)

    with temporary_folder() as looks:
        return run_until_decided(
            draw,
            look=lambda plan: run(plan, looks, _no_reports),
            finish=lambda plan: run(plan, out, write_reports),
            ratio=ratio,
            budget_s=budget_s,
            tell=tell,
        )


def _no_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    """A look at the scores of one draw needs no reports."""
    del folder, scores
