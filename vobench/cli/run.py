"""vobench run."""

import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vobench.cli import terminal
from vobench.cli.check import print_summary
from vobench.cli.option import Json, SuiteName, Trust, option_group, with_option_groups
from vobench.cli.progress import Bars
from vobench.cli.run_display import TerminalDisplay
from vobench.errors import InputError
from vobench.runner.exposure_doubt import doubts_of_run
from vobench.runner.folder import total_failure, with_sequence
from vobench.runner.key import cache_folder
from vobench.runner.launch import default_jobs, run_plan, typical_seconds
from vobench.runner.motion import cut
from vobench.runner.preflight import summarize
from vobench.runner.store import SilentProgress
from vobench.suite import catalog, yaml_file
from vobench.suite.catalog import hidden_builtins
from vobench.suite.draw import Draws, random_base_seed
from vobench.suite.plan import Plan
from vobench.suite.spread import changes_for_units
from vobench.suite.suite import read_plan
from vobench.suite.suite_spec import Suite

if TYPE_CHECKING:
    from vobench.report.leaderboard import Board
    from vobench.report.threshold import Threshold
    from vobench.report.until_decided import UntilDecided
    from vobench.runner.folder import RunFolder, TrialScore
    from vobench.runner.run import Finish

INCOMPLETE_RUN = 1  # exit codes
BROKEN_LIMIT = 3


@option_group
class Selection:
    """The selection of trials that are run."""

    estimator: Annotated[
        list[str] | None,
        typer.Option("--estimator", "-e", help="Run only this estimator, or those that match; can be repeated."),
    ] = None
    case: Annotated[
        list[str] | None,
        typer.Option("--case", "-c", help="Run only cases that match, as in 'dark*'; can be repeated."),
    ] = None
    scene: Annotated[
        list[str] | None, typer.Option("--scene", "-s", help="Run only scenes that match; can be repeated.")
    ] = None

    def draw(self, suite: str, changes: Mapping[str, str], number: int) -> Plan:
        """The plan of one draw of a suite, restricted to these trials. Raises SuiteError or UnknownNameError."""
        draws = Draws(suite, changes, tuple(self.estimator or ()))
        return draws.plan(number).only(self.case or (), self.scene or ())

    def read_plan(self, suite: str, changes: Mapping[str, str]) -> Plan:
        """The plan of a suite, restricted to these trials. Raises SuiteError or UnknownNameError."""
        plan = read_plan(suite, only_estimators=tuple(self.estimator or ()), changes=changes)
        return plan.only(self.case or (), self.scene or ())


@option_group
class Changes:
    """The changes to the suite."""

    repeats: Annotated[int | None, typer.Option("--repeats", "-n", help="Run each trial this many times.")] = None
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="Replace a value of the suite, as in seed=3; can be repeated.")
    ] = None

    units: Annotated[
        int | None, typer.Option(min=1, help="Spread the suite over this many units, with more seeds of its places.")
    ] = None
    fresh_units: Annotated[
        bool,
        typer.Option("--fresh-units", help="Draw places and drives from unused seeds; the board names the seed."),
    ] = False

    def values(self, suite: str) -> dict[str, str]:
        """The changed values in YAML, by their keys joined by dots. Raises InputError or SuiteError."""
        assignments = list(self.changes or ())
        if self.repeats:
            assignments.append(f"repeats={self.repeats}")
        if self.fresh_units:
            assignments.append(f"base_seed={random_base_seed()}")
        values = _split_assignments(assignments)
        if self.units:
            path = catalog.find("suite", suite).path
            written = yaml_file.read_all(path, Suite, values, kind="suite").source.plain
            values |= changes_for_units(written, self.units)
        return values


@option_group
class Sequential:
    """The options for drawing units until the estimators are decided."""

    until: Annotated[
        Literal["decided"] | None,
        typer.Option(help="Draw fresh units until each pair of estimators is decided, or alike within the ratio."),
    ] = None
    ratio: Annotated[
        float, typer.Option(min=1.01, max=100, help="With --until: the ratio of losses that is of interest.")
    ] = 1.5
    budget: Annotated[
        str | None, typer.Option(help="With --until: the time after which no more units are drawn, as in 40min.")
    ] = None

    def budget_s(self) -> float:
        """The budget in seconds; infinite if there is none. Raises InputError if there is no --until for it."""
        from vobench.report.until_decided import parse_duration_s

        if self.budget is None:
            return inf
        if self.until is None:
            raise InputError("--budget requires --until decided")
        return parse_duration_s(self.budget)


@option_group
class TrialLimits:
    """Limits of each trial."""

    limit: Annotated[
        int | None, typer.Option(min=2, help="Use only this many frames of each simulated case, from the first on.")
    ] = None
    timeout: Annotated[float | None, typer.Option(min=0.001, help="Seconds that a whole trial may take.")] = None
    memory: Annotated[int | None, typer.Option(min=1, help="MiB that the processes of an estimator may use.")] = None

    def apply(self, plan: Plan) -> Plan:
        """The plan with these limits."""
        limits = dict[str, Any]()
        if self.timeout is not None:
            limits["trial_s"] = self.timeout
        if self.memory is not None:
            limits["memory_mib"] = self.memory
        limited = plan.limited(**limits)
        return cut(limited, self.limit) if self.limit else limited


@option_group
class Execution:
    """The options for performing tasks."""

    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            "-j",
            min=1,
            envvar="VOBENCH_JOBS",
            help="The number of parallel tasks; by default one per core, at most 8.",
        ),
    ] = None
    scheduler: Annotated[
        str | None, typer.Option(help="Use the workers of a Dask scheduler, as in tcp://host:8786.")
    ] = None
    share_time: Annotated[
        bool,
        typer.Option("--share-time", help="Let estimators run in parallel with other tasks; the board notes this."),
    ] = False
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute everything again, even what is in the cache.")] = False

    @property
    def is_serial(self) -> bool:
        """Whether tasks are performed one by one in this process."""
        return self.jobs == 1 and not self.scheduler


@option_group
class ProgressOptions:
    """The options for showing and logging progress."""

    events: Annotated[
        Path | None, typer.Option(help="Log the events of all tasks to this file, one JSON object a line.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only failures, no progress.")] = False
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print a line for each finished task.")] = False


@with_option_groups
def run_command(
    suite: SuiteName,
    *,
    selection: Selection,
    changes: Changes,
    sequential: Sequential,
    limits: TrialLimits,
    execution: Execution,
    progress: ProgressOptions,
    out: Annotated[Path, typer.Option(help="The folder for the runs.")] = Path("runs"),
    fail_if: Annotated[
        list[str] | None,
        typer.Option("--fail-if", help="Exit with code 3 if this holds, as in 'ate_trans.rmse > 0.2'."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would be run, and stop.")] = False,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Run a suite: simulate, estimate, score, and print the leaderboard."""
    del trust  # its callback has the effect
    from vobench.report.threshold import parse_threshold

    thresholds = [parse_threshold(text) for text in fail_if or ()]
    budget_s = sequential.budget_s()
    values = changes.values(suite)
    plan = selection.read_plan(suite, values)
    for sentence in hidden_builtins(plan.found):
        terminal.warn(sentence)
    plan = limits.apply(plan)
    if dry_run:
        print_summary(summarize(plan, with_stages=True), as_json=json)
        return

    from vobench.report import page

    ended = None
    if sequential.until:
        ended = _run_until_decided(
            lambda number: limits.apply(selection.draw(suite, values, number)),
            out,
            execution,
            progress,
            ratio=sequential.ratio,
            budget_s=budget_s,
        )
        folder = ended.folder
    else:
        folder = _run(plan, out, execution, progress)

    scores = folder.scores()
    board = page.run_board(folder, scores)
    _print_board(board, as_json=json)
    if not json:
        _print_remarks(folder, scores, shares_time=execution.share_time or plan.suite.share_time)
        for doubt in doubts_of_run(plan, folder):
            terminal.warn(doubt)
        cost = _cost_of_deciding(board, plan, execution) if ended is None else _cost_so_far(ended, plan, changes)
        if cost:
            terminal.console().print(cost)
    _exit_if_failed(scores, board, thresholds)


def _cost_of_deciding(board: "Board", plan: Plan, execution: Execution) -> str:
    """What it would cost to decide between the estimators that the board cannot tell apart; empty if it can."""
    from vobench.report.advice import cost_of_deciding

    jobs = execution.jobs or default_jobs()
    return cost_of_deciding(board.totals, plan, typical_seconds(cache_folder()), jobs=jobs)


def _cost_so_far(ended: "UntilDecided", plan: Plan, changes: Changes) -> str:
    """What it has cost to decide between estimators and, if that has not ended, how to resume."""
    if ended.has_ended:
        return ended.cost
    seeds = f", with --set base_seed={plan.suite.base_seed} for --fresh-units" if changes.fresh_units else ""
    return f"{ended.cost}\nTo resume, run the same command again{seeds}"


def _exit_if_failed(scores: "Sequence[TrialScore]", board: "Board", thresholds: "Sequence[Threshold]") -> None:
    """Warn about broken thresholds, and exit with an error code if there are any or if the run is incomplete."""
    broken_limits = list[str]()
    for threshold in thresholds:
        broken_limits += threshold.broken_by(scores, board)
    for sentence in broken_limits:
        terminal.warn(sentence)
    failure = total_failure(scores)
    if failure:
        terminal.warn(failure)
    if board.unmade or failure:  # an incomplete run fails, whatever the thresholds are
        raise typer.Exit(INCOMPLETE_RUN)
    if broken_limits:
        raise typer.Exit(BROKEN_LIMIT)


def _run_until_decided(
    draw: Callable[[int], Plan],
    out: Path,
    execution: Execution,
    progress: ProgressOptions,
    *,
    ratio: float,
    budget_s: float,
) -> "UntilDecided":
    """Run draws of a suite with progress on the terminal until each pair of estimators is decided or alike."""
    from vobench.report.until_decided_run import run_draws

    def say(sentence: str) -> None:
        if not progress.quiet:
            terminal.warn(sentence)

    def run(plan: Plan, parent: Path, finish: "Finish") -> "RunFolder":
        return _run(plan, parent, execution, progress, finish=finish)

    return run_draws(draw, run, out=out, ratio=ratio, budget_s=budget_s, tell=say)


def _run(
    plan: Plan, out: Path, execution: Execution, progress: ProgressOptions, *, finish: "Finish | None" = None
) -> "RunFolder":
    """Run a plan with progress on the terminal; return the folder of the run. `finish` replaces the usual reports."""
    from vobench.report import page

    display = TerminalDisplay(
        progress.events,
        is_serial=execution.is_serial,
        is_quiet=progress.quiet,
        is_verbose=progress.verbose,
    )
    return run_plan(
        plan,
        out=out,
        finish=finish or page.write_reports,
        display=display,
        jobs=execution.jobs,
        scheduler=execution.scheduler,
        task_progress=SilentProgress() if progress.quiet else Bars(),
        shares_time=execution.share_time,
        is_fresh=execution.fresh,
    )


def _print_board(board: "Board", *, as_json: bool) -> None:
    if as_json:
        from vobench.report.board_records import as_json as board_as_json

        print(board_as_json(board), end="")
    else:
        from vobench.cli.board import print_board

        print_board(board)


def _print_remarks(folder: "RunFolder", scores: "Sequence[TrialScore]", *, shares_time: bool) -> None:
    """Print where the results of a run are, what affects its CPU times, and which trial to look at."""
    from vobench.report.case_facts import case_facts
    from vobench.report.trial_choice import pick, story
    from vobench.runner.folder import SEQUENCE
    from vobench.runner.run import BESIDE

    console = terminal.console()
    if shares_time:
        console.print(f"CPU times of this run were measured {BESIDE}.")
    is_on_path = shutil.which("vobench") is not None
    command = "vobench" if is_on_path else sys.argv[0]
    console.print(f"Everything is in {folder.path}")
    if with_sequence(scores):
        trial = pick(scores, case=None, estimator=None)
        name = f"{folder.path}/{trial.case}/{trial.estimator}"
        is_simulated = "scene" in trial.variant
        recording = f"{folder.case(trial.case) / SEQUENCE} --estimator {trial.estimator}"
        lines = [
            f"{story(trial, case_facts(folder, trial.case))}:",
            f"  see it (`{command} view {name}`),",
            f"  ask why (`{command} explain {name if is_simulated else recording}`)",
        ]
        console.print("\n".join(lines), soft_wrap=True)  # a command can be copied however wide the terminal is


def _split_assignments(assignments: Sequence[str]) -> dict[str, str]:
    """The values of key=value by key. Raises InputError."""
    value_by_key = dict[str, str]()
    for assignment in assignments:
        key, equals_sign, value = assignment.partition("=")
        if not equals_sign:
            raise InputError(f"--set should be key=value, as in rigs.ahead.pitch_deg=20, got {assignment!r}")
        value_by_key[key] = value
    return value_by_key
