"""vobench run, check and schema."""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.estimator.manifest import Manifest
from vobench.runner.folder import total_failure
from vobench.runner.launch import run_plan
from vobench.runner.motion import cut
from vobench.runner.preflight import PlanSummary, summarize
from vobench.runner.store import SilentProgress
from vobench.suite.scenario import ScenarioFile
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite import Suite, read_plan
from vobench.suite.yaml_file import json_schema

if TYPE_CHECKING:
    from rich.console import Console

FAILED_LIMIT = 3  # exit code where a limit of --fail-if is broken


def run_command(
    suite: terminal.SuiteName,
    *,
    estimator: Annotated[
        list[str] | None,
        typer.Option("--estimator", "-e", help="Run only this one, or those that match; may be given several times."),
    ] = None,
    case: Annotated[
        list[str] | None, typer.Option("--case", "-c", help="Only cases that match, as in 'dark*'.")
    ] = None,
    scene: Annotated[list[str] | None, typer.Option("--scene", "-s", help="Only scenes that match.")] = None,
    repeats: Annotated[int | None, typer.Option("--repeats", "-n", help="Run each trial so often.")] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="Put a value in place of the suite's, as in seed=3.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Where the folders of runs go.")] = Path("runs"),
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            "-j",
            min=1,
            envvar="VOBENCH_JOBS",
            help="Tasks at once; one a core by default, 8 at most.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Let the workers of a Dask scheduler do it, as in tcp://host:8786.")
    ] = None,
    share_time: Annotated[
        bool, typer.Option("--share-time", help="Let estimators run beside other tasks; the board says so.")
    ] = False,
    events: Annotated[
        Path | None, typer.Option(help="Write what happens to each task here, a JSON object a line.")
    ] = None,
    fail_if: Annotated[
        list[str] | None, typer.Option("--fail-if", help="End with code 3 if so, as in 'ate_trans.rmse > 0.2'.")
    ] = None,
    limit: Annotated[int | None, typer.Option(min=2, help="Frames of each simulated case, from its first on.")] = None,
    timeout: Annotated[float | None, typer.Option(min=0.001, help="Seconds that a whole trial may take.")] = None,
    memory: Annotated[int | None, typer.Option(min=1, help="MiB that an estimator's processes may hold.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Make everything anew, whatever the cache holds.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be run, and stop.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress, only failures.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print a line for each finished task.")] = False,
    trust: terminal.Trust = False,
    json: terminal.Json = False,
) -> None:
    """Run a suite: simulate, estimate, score, and print the leaderboard."""
    del trust  # done by its callback
    from vobench.report.threshold import parse_threshold

    assignments = [*(changes or ()), *([f"repeats={repeats}"] if repeats else [])]
    thresholds = [parse_threshold(text) for text in fail_if or ()]
    planned = read_plan(suite, only_estimators=tuple(estimator or ()), changes=_assigned(assignments))
    planned = planned.only(case or (), scene or ())
    limits = {"trial_s": timeout, "memory_mib": memory}
    planned = planned.limited(**{name: value for name, value in limits.items() if value is not None})
    terminal.say_hidden(planned.found)
    if limit:
        planned = cut(planned, limit)
    if dry_run:
        _print_summary(summarize(planned, with_stages=True), as_json=json)
        return

    from vobench.cli.report import print_board
    from vobench.report import page
    from vobench.report.board_table import as_json as board_as_json
    from vobench.runner.run import BESIDE

    is_serial = jobs == 1 and not scheduler
    folder = run_plan(
        planned,
        out=out,
        finish=page.write_reports,
        display=terminal.TerminalDisplay(events, is_serial=is_serial, is_quiet=quiet, is_verbose=verbose),
        jobs=jobs,
        scheduler=scheduler,
        task_progress=SilentProgress() if quiet else terminal.Bars(),
        shares_time=share_time,
        is_fresh=fresh,
    )
    scores = folder.scores()
    board = page.board_of(folder, scores)
    broken = [line for threshold in thresholds for line in threshold.broken_by(scores)]
    if json:
        print(board_as_json(board), end="")
    else:
        print_board(board)
        if share_time or planned.suite.share_time:
            terminal.console().print(f"CPU times of this run were taken {BESIDE}.")
        vobench = "vobench" if shutil.which("vobench") else sys.argv[0]  # where the environment is not activated
        terminal.console().print(f"Everything is in {folder.path}\nLook into it: {vobench} view {folder.path}")
    for line in broken:
        print(f"vobench: {line}", file=sys.stderr)
    failure = total_failure(scores)
    if failure:
        print(f"vobench: {failure}", file=sys.stderr)
    if board.unmade or failure:  # the run is incomplete, whatever the thresholds say
        raise typer.Exit(1)
    if broken:
        raise typer.Exit(FAILED_LIMIT)


def _assigned(changes: Sequence[str]) -> dict[str, str]:
    """key=value by key. Raises InputError."""
    for change in changes:
        if "=" not in change:
            raise InputError(f"--set should be key=value, as in rigs.ahead.pitch_deg=20, got {change!r}")
    return dict(change.split("=", 1) for change in changes)


def check_command(suite: terminal.SuiteName, *, trust: terminal.Trust = False, json: terminal.Json = False) -> None:
    """Validate a suite and print its plan; nothing is rendered."""
    del trust  # done by its callback
    _print_summary(summarize(read_plan(suite)), as_json=json)


def _print_summary(summary: PlanSummary, *, as_json: bool) -> None:
    """Print what a suite comes to; after a dry run also what is to be done for it."""
    if as_json:
        terminal.print_json(summary.as_dict())
        return
    out = terminal.console()
    suite = summary.plan.suite.name
    cases = [[case.case, str(case.frames), f"{case.duration_s:.1f}", case.sequence] for case in summary.cases]
    out.print(terminal.table(f"{suite}: cases", ["case", "frames", "seconds", "sequence"], cases))
    estimators = [
        [row["estimator"], row["version"], ", ".join(row["needs"]) or "nothing"] for row in summary.estimators()
    ]
    out.print(terminal.table("estimators", ["estimator", "version", "needs"], estimators))
    found = [list(row.values()) for row in summary.found()]
    out.print(terminal.table("found", ["kind", "name", "origin", "path"], found))
    for case in summary.cases:
        for note in case.notes or ():
            out.print(f"{case.case}: {note}")
    if summary.stages is not None:
        _print_stages(summary.tasks(), out)
    out.print(f"{len(cases)} cases, {len(estimators)} estimators, {summary.trials} trials: the suite is valid")


def _print_stages(stages: list[dict[str, Any]], out: "Console") -> None:
    rows = [
        [row["stage"], str(row["tasks"]), str(row["in the cache"]), str(row["to do"]), _spell_seconds(row["seconds"])]
        for row in stages
    ]
    out.print(terminal.table("tasks", ["stage", "tasks", "in the cache", "to do", "about"], rows))
    for row in stages:
        for reason, count in row["reasons"].items():
            out.print(f"{row['stage']}: {count} to do: {reason}", highlight=False)


def _spell_seconds(seconds: float | None) -> str:
    """So many seconds of one core's work; empty where nothing is known."""
    if seconds is None:
        return ""
    return f"{seconds:.0f} s" if seconds < SHORT_S else f"{seconds / 60:.0f} min"


SHORT_S = 600  # spelled in seconds below, in minutes from there on


FILES = {"suite": Suite, "scenario": ScenarioFile, "scene": SceneFile, "estimator": Manifest}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_command(
    kind: Annotated[str, typer.Argument(metavar="[suite|scenario|scene|estimator]", help="Kind of file.")] = "suite",
    *,
    json: Annotated[bool, typer.Option("--json", help="It is JSON in any case.")] = False,
) -> None:
    """Print the JSON Schema of a suite's, scenario's, scene's or estimator's YAML, for editors and other programs."""
    del json
    terminal.print_json({"$schema": DIALECT, **json_schema(FILES[terminal.known("schema", kind, FILES)])})
