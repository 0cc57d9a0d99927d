"""Runs a plan on this machine or on the workers of a Dask scheduler, for the command line and for Python."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from vobench import stop
from vobench.errors import InputError
from vobench.runner.executor import Dask, Executor, LocalProcesses, Serial, perform_all
from vobench.runner.key import cache_folder
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.preflight import preflight
from vobench.runner.progress import RunDisplay
from vobench.runner.store import Progress, Store, why_unwritable
from vobench.runner.task import KINDS, Task, missing
from vobench.suite.plan import Plan

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vobench.dataset.recording import Recording
    from vobench.runner.folder import RunFolder, TrialScore
    from vobench.runner.run import Finish

MOST_JOBS = 8


def default_jobs() -> int:
    """The number of tasks at once: $VOBENCH_JOBS, or the number of cores of this process, at most 8."""
    stated = os.environ.get("VOBENCH_JOBS", "")
    if stated:
        if not stated.isdecimal() or int(stated) < 1:
            raise InputError(f"VOBENCH_JOBS should be a number of tasks, 1 or more, got {stated!r}")
        return int(stated)
    return min(len(os.sched_getaffinity(0)), MOST_JOBS)


def run_plan(
    planned: Plan,
    *,
    out: Path,
    finish: "Finish",
    display: RunDisplay,
    recordings: "Mapping[str, Recording] | None" = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    task_progress: Progress | None = None,
    shares_time: bool = False,
    is_fresh: bool = False,
    require_all: bool = False,
) -> "RunFolder":
    """Perform all tasks of a plan that are not cached, and write the folder of the run below `out`.

    `recordings` are those of its recorded cases. They are read if they are not given.
    `finish` writes the reports.
    `jobs` is the number of tasks at once, by default `default_jobs()`.
    `scheduler` is the address of a Dask scheduler whose workers perform the tasks instead.
    `task_progress` shows the progress within a task if `jobs` is 1. Without it, the display shows a task's messages.

    Raises SuiteError if the plan is not valid, InputError if `out` cannot be written, NoSequenceError if no case could
    be simulated or imported, or with `require_all` if any could not, MissingDependencyError if this machine lacks a
    library, and Stopped.
    """
    from vobench.runner.run import run_suite

    if recordings is None:
        recordings = preflight(planned, only_missing=not is_fresh, runs_generators=False).recordings
    if cause := why_unwritable(out):
        raise InputError(f"out should be a folder that can be written ({cause}): {out}")

    store = cache_folder().resolve()

    def begin(tasks: "Sequence[Task]") -> None:
        display.begin(tasks, typical_seconds(store))

    executor = make_executor(jobs, scheduler, task_progress)
    with stop.cleanup_after(executor.close), display:
        return run_suite(
            planned,
            recordings,
            root=out,
            store=store,
            finish=finish,
            executor=executor,
            begin=begin,
            on_event=display.hear,
            tell=display.say,
            shares_time=shares_time,
            is_fresh=is_fresh,
            require_all=require_all,
        )


def plan_runner(
    *,
    out: Path,
    jobs: int | None,
    make_display: Callable[[], RunDisplay],
    finish: "Finish | None" = None,
    task_progress: Progress | None = None,
) -> PlanRunner:
    """A function that runs a plan in a new folder below `out` and shows its progress on a new display.

    `finish` writes reports to the folder of each run. Without it, there are no reports.
    """

    def run(planned: Plan, /) -> "RunFolder":
        return run_plan(
            planned,
            out=out,
            finish=finish or _no_reports,
            display=make_display(),
            jobs=jobs,
            task_progress=task_progress,
            require_all=True,
        )

    return run


def _no_reports(folder: "RunFolder", scores: "list[TrialScore]") -> None:
    del folder, scores


def perform_tasks(tasks: "Sequence[Task]", *, display: RunDisplay, jobs: int | None = None) -> Path:
    """Perform the tasks that are not cached, and return the folder of the last task's result.

    Raises InputError with the cause if one of them fails, and Stopped.
    """
    store = cache_folder().resolve()
    kept = Store(store)
    executor = make_executor(jobs, None, None)
    with stop.cleanup_after(executor.close), display, kept.in_use(display.say):
        to_make = missing(tasks, store)
        if to_make:
            kept.require_writable()
        display.begin(to_make, typical_seconds(store))
        failures = perform_all(to_make, store, executor, on_event=display.hear)
    for task in tasks:
        if task.key in failures:
            raise InputError(f"{task.stage} {task.name} failed: {failures[task.key].reason}")
    return store / tasks[-1].key


def make_executor(jobs: int | None, scheduler: str | None, task_progress: Progress | None) -> Executor:
    """The requested executor: the workers of Dask, this process for one job, or processes of this machine."""
    if scheduler:
        return Dask(scheduler)
    count = jobs or default_jobs()
    if count == 1:
        return Serial(task_progress)
    return LocalProcesses(count)


def typical_seconds(store: Path) -> dict[str, float]:
    """The median duration in s of recent tasks of each stage, for stages with recent tasks."""
    noted = Store(store)
    typical: dict[str, float] = {}
    for stage in KINDS:
        seconds = noted.seconds(stage)
        if seconds:
            typical[stage] = median(seconds)
    return typical
