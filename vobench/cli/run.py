"""vobench run, check and schema."""

import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vobench import stop
from vobench.cli import terminal
from vobench.errors import InputError
from vobench.estimator.manifest import Manifest
from vobench.estimator.program import sandbox_works
from vobench.runner.executor import Dask, Executor, LocalProcesses, Serial
from vobench.runner.key import cache_folder
from vobench.runner.motion import BodyMotion, body_motions, cut
from vobench.runner.store import why_unwritable
from vobench.runner.task import is_done, plan, sequence_tasks
from vobench.suite.scenario import ScenarioFile
from vobench.suite.scene_spec import SceneFile
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Case, Plan, Suite, read_plan
from vobench.suite.yaml_file import json_schema

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording
    from vobench.runner.folder import RunFolder
    from vobench.runner.run import Finish


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
            help="Tasks at once; 1 draws bars. Else one a core, 8 at most.",
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
    trust: terminal.Trust = False,
    json: terminal.Json = False,
) -> None:
    """Run a suite: simulate, estimate, score, and print the leaderboard."""
    del trust  # done by its callback
    from vobench.report.threshold import parse_threshold

    given = [*(changes or ()), *([f"repeats={repeats}"] if repeats else [])]
    limits = [parse_threshold(said) for said in fail_if or ()]
    planned = read_plan(suite, only_estimators=tuple(estimator or ()), changes=_assigned(given))
    planned = planned.only(case or (), scene or ())
    said = {"trial_s": timeout, "memory_mib": memory}
    planned = planned.limited(**{name: value for name, value in said.items() if value is not None})
    terminal.say_hidden(planned.found)
    planned = cut(planned, limit) if limit else planned
    if dry_run:
        _check(planned, as_json=json, is_dry_run=True)
        return
    from vobench.cli.report import print_board
    from vobench.report import page
    from vobench.report.board_table import as_json as board_as_json
    from vobench.runner.run import BESIDE

    _, recordings = _preflight(planned, of_all=fresh)
    if cause := why_unwritable(out):
        raise InputError(f"--out should be a folder that can be written ({cause}): {out}")
    folder = run_plan(
        planned, recordings, out=out, jobs=_jobs(jobs), finish=page.write_reports, scheduler=scheduler, events=events,
        shares_time=share_time, is_fresh=fresh,
    )  # fmt: skip
    scores = folder.scores()
    board = page.board_of(folder, scores)
    broken = [line for limit in limits for line in limit.broken_by(scores)]
    if json:
        print(board_as_json(board), end="")
    else:
        print_board(board)
        if not sandbox_works():
            terminal.console().print("Estimators were not sandboxed: the kernel gives no namespaces (vobench doctor).")
        if share_time or planned.suite.share_time:
            terminal.console().print(f"CPU times of this run were taken {BESIDE}.")
        vobench = "vobench" if shutil.which("vobench") else sys.argv[0]  # where the environment is not activated
        terminal.console().print(f"Everything is in {folder.path}\nLook into it: {vobench} view {folder.path}")
    for line in broken:
        print(f"vobench: {line}", file=sys.stderr)
    if broken:
        raise typer.Exit(FAILED_LIMIT)


def run_plan(
    planned: Plan,
    recordings: "Mapping[str, Recording]",
    *,
    out: Path,
    jobs: int,
    finish: "Finish",
    scheduler: str | None = None,
    events: Path | None = None,
    **options: bool,
) -> "RunFolder":
    """`run_suite` with what happens shown on this terminal; `options` are its own."""
    from vobench.runner.run import run_suite

    work = terminal.Work(events, is_serial=jobs == 1 and not scheduler)
    executor: Executor = Serial(terminal.Bars()) if jobs == 1 else LocalProcesses(jobs)
    executor = Dask(scheduler) if scheduler else executor
    with stop.undone(executor.close), work:
        return run_suite(
            planned, recordings, root=out, store=cache_folder().resolve(), finish=finish, executor=executor,
            heard=work.hear, tell=work.say, **options,
        )  # fmt: skip


FAILED_LIMIT = 3
MOST_JOBS = 8


def _jobs(asked: int | None) -> int:
    return asked or min(len(os.sched_getaffinity(0)), MOST_JOBS)


def _assigned(changes: Sequence[str]) -> dict[str, str]:
    """key=value by key. Raises InputError."""
    for change in changes:
        if "=" not in change:
            raise InputError(f"--set should be key=value, as in rigs.ahead.pitch_deg=20, got {change!r}")
    return dict(change.split("=", 1) for change in changes)


def check_command(suite: terminal.SuiteName, *, trust: terminal.Trust = False, json: terminal.Json = False) -> None:
    """Validate a suite and print its plan; nothing is rendered."""
    del trust  # done by its callback
    _check(read_plan(suite), as_json=json)


def _preflight(planned: Plan, *, of_all: bool = True) -> "tuple[dict[str, BodyMotion], dict[str, Recording]]":
    """Where bodies go, of all cases or those to simulate, and what recordings hold.

    Raises SuiteError with all that cannot be.
    """
    travels, wrong = dict[str, BodyMotion](), planned.mistakes()
    recordings: dict[str, Recording] = {}
    with wrong.at():
        simulated = (case for case in planned.simulated if of_all or not _is_there(case, {}))
        travels = body_motions(replace(planned, simulated=tuple(simulated)))
    with wrong.at():
        if planned.recorded:
            from vobench.runner.import_recording import read_all

            recordings = read_all(planned)
    wrong.require_none()
    return travels, recordings


def _check(planned: Plan, *, as_json: bool, is_dry_run: bool = False) -> None:
    """Validate a suite and print what it comes to; of a dry run also what is to be done for it."""
    travels, recordings = _preflight(planned)
    cases = [_facts(case, travels, recordings) for case in planned.cases]
    entrants = [
        {"estimator": e.label, "version": e.manifest.version, "needs": list(e.manifest.needs), "path": str(e.folder)}
        for e in planned.entrants
    ]
    found = [{"kind": e.kind, "name": e.name, "origin": e.origin, "path": str(e.path)} for e in planned.found]
    trials = sum(len(planned.trials(case)) for case in planned.cases)
    to_do = _to_do(planned, recordings) if is_dry_run else []
    if as_json:
        said = {"suite": planned.suite.name, "cases": cases, "estimators": entrants, "trials": trials, "found": found}
        terminal.print_json({**said, **({"tasks": to_do} if is_dry_run else {})})
        return
    rows = [[f["case"], str(f["frames"]), f"{f['duration_s']:.1f}", f["sequence"]] for f in cases]
    out = terminal.console()
    out.print(terminal.table(f"{planned.suite.name}: cases", ["case", "frames", "seconds", "sequence"], rows))
    lines = [[e.label, e.manifest.version, ", ".join(e.manifest.needs) or "nothing"] for e in planned.entrants]
    out.print(terminal.table("estimators", ["estimator", "version", "needs"], lines))
    out.print(terminal.table("found", ["kind", "name", "origin", "path"], [[*each.values()] for each in found]))
    for case in cases:
        for note in case.get("notes", []):
            out.print(f"{case['case']}: {note}")
    if is_dry_run:
        rows = [[row["stage"], *(str(row[name]) for name in ("tasks", "in the cache", "to do")), _spell(row["seconds"])]
                for row in to_do]  # fmt: skip
        out.print(terminal.table("tasks", ["stage", "tasks", "in the cache", "to do", "about"], rows))
        for row in to_do:
            for reason, count in row["reasons"].items():
                out.print(f"{row['stage']}: {count} to do: {reason}", highlight=False)
    out.print(f"{len(cases)} cases, {len(entrants)} estimators, {trials} trials: the suite is valid")


def _to_do(planned: Plan, recordings: "Mapping[str, Recording]") -> list[dict[str, Any]]:
    """By stage, how many tasks there are, how many of them are done, why the rest is not, and how long it takes."""
    from vobench.runner.dry_run import to_do

    found = to_do(plan(planned, recordings), cache_folder())
    counts = [{"in the cache": each.tasks - each.to_do, "to do": each.to_do} for each in found]
    return [asdict(each) | count for each, count in zip(found, counts, strict=True)]


def _spell(seconds: float | None) -> str:
    """So many seconds of one core's work; empty where nothing is known."""
    return "" if seconds is None else f"{seconds:.0f} s" if seconds < 600 else f"{seconds / 60:.0f} min"


def _is_there(case: Case | RecordedCase, recordings: "Mapping[str, Recording]") -> bool:
    return is_done(sequence_tasks(case, recordings)[-1], cache_folder())


def _facts(
    case: Case | RecordedCase, travels: Mapping[str, BodyMotion], recordings: "Mapping[str, Recording]"
) -> dict[str, Any]:
    """What is known of a case before it is made; a recording's pictures are not read yet."""
    is_there = _is_there(case, recordings)
    notes = dict[str, list[str]]()
    if isinstance(case, RecordedCase):
        recording, to_make = recordings[case.name], f"to import from {case.source.path}"
        t_ns, notes = recording.t_ns, {"notes": list(recording.notes)}
    else:
        t_ns, to_make = travels[case.variant["trajectory"]].t_ns, "to simulate"
    return {
        "case": case.name,
        "frames": len(t_ns),
        "duration_s": float(t_ns[-1] - t_ns[0]) / 1e9,
        "simulated": is_there and not isinstance(case, RecordedCase),
        "sequence": "in the cache" if is_there else to_make,
        **notes,
    }


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
