"""Runs the plans of `vobench twin`, `explain` and `shrink` with the display of `vobench run`."""

from pathlib import Path
from typing import TYPE_CHECKING

from vobench.cli.progress import Bars
from vobench.cli.run_display import TerminalDisplay
from vobench.runner import launch
from vobench.runner.plan_runner import PlanRunner

if TYPE_CHECKING:
    from vobench.runner.run import Finish


def plan_runner(*, out: Path, jobs: int, finish: "Finish | None" = None, has_short_tasks: bool = False) -> PlanRunner:
    """A function that runs a plan in a new folder below `out` with `jobs` parallel tasks, and shows its progress.

    `finish` adds reports to the folder of the run; by default there are none. Of many short tasks, their number is
    shown, and not the progress within each.
    """
    shows_each_task = jobs == 1 and not has_short_tasks
    return launch.plan_runner(
        out=out,
        jobs=jobs,
        make_display=lambda: TerminalDisplay(is_serial=shows_each_task),
        finish=finish,
        task_progress=Bars() if shows_each_task else None,
    )
