"""How commands that run variants of a case or a twin have them run: as `vobench run` does."""

from pathlib import Path
from typing import TYPE_CHECKING

from vobench.cli.run import run_plan
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.plan_runner import PlanRunner
from vobench.suite.suite import Plan

if TYPE_CHECKING:
    from vobench.runner.run import Finish


def plan_runner(*, out: Path, jobs: int, finish: "Finish | None" = None) -> PlanRunner:
    """Return what runs a plan in a new folder below `out`, `jobs` tasks at once, and shows its progress.

    `finish` adds reports to the folder of the run; by default there are none.
    """

    def run(plan: Plan, /) -> RunFolder:
        from vobench.runner.import_recording import read_all

        return run_plan(plan, read_all(plan), out=out, jobs=jobs, finish=finish or _no_reports)

    return run


def _no_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    del folder, scores
