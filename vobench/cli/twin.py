"""A suite that repeats a recording in simulation, and how far both agree: vobench twin."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.recording_twin import REAL, TWIN, TwinReport, compare_twin, write_twin_suite
from vobench.cli import terminal
from vobench.cli.plan_runner import plan_runner
from vobench.cli.sequence import Calibration, Form, FormCommand, Rate, TopicOf, Truth, topics_of
from vobench.dataset.recording import ReadOptions
from vobench.runner.folder import RunFolder, TrialScore

COMMAND_CLASS = FormCommand
SPREAD = {"mean": "mean", "p10": "10 %", "p50": "50 %", "p90": "90 %"}


def twin_command(
    path: Annotated[Path, typer.Argument(metavar="RECORDING", help="A recording with truth, or a run's case.")],
    *,
    place: Annotated[str, typer.Option(help="The scene or model that the path is laid into.")] = "office",
    out: Annotated[Path, typer.Option(help="The new folder for the suite, its runs and the report.")] = Path("twin"),
    estimator: Annotated[
        list[str] | None,
        typer.Option("--estimator", "-e", help="Run this one in place of the usual seven; repeatable."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Write the suite, and stop.")] = False,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, envvar="VOBENCH_JOBS", help="Tasks at once.")] = 1,
    form: Form = None,
    calibration: Calibration = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: terminal.Json = False,
) -> None:
    """Repeat a recording in simulation, run the same estimators on both, and say how far they agree."""
    suite = write_twin_suite(
        path,
        out=out,
        place=place,
        estimators=estimator or (),
        form=form,
        options=ReadOptions(calibration=calibration, truth=truth, rate_hz=rate, topics=topics_of(topic)),
        progress=terminal.Bars(),
    )
    if dry_run:
        print(f"The suite is {suite.file}")
        return
    report = compare_twin(suite, run_plan=plan_runner(out=out / "runs", jobs=jobs, finish=_write_reports))
    if json:
        terminal.print_json(report.as_dict())
    else:
        _print(report, out)


def _write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    from vobench.report import page

    page.write_reports(folder, scores)


def _print(report: TwinReport, out: Path) -> None:
    """The order of the estimators, their errors, and the statistics side by side."""
    facts = report.as_dict()
    console = terminal.console()

    headings = ["estimator"]
    headings += [f"{REAL} {title}" for title in SPREAD.values()]
    headings += [f"{TWIN} {title}" for title in SPREAD.values()]
    rows = [_error_row(row) for row in facts["estimators"]]
    console.print(terminal.table("errors of segments, % of their length", headings, rows))
    low, high = facts["interval"]
    console.print(f"Kendall's tau between both orders: {facts['tau']:.2f} (95 %: {low:.2f} … {high:.2f})")

    rows = [_statistic_row(row) for row in facts["statistics"]]
    console.print(terminal.table("statistics", ["statistic", REAL, TWIN, "unit", "is"], rows))
    for name, (real, twin) in facts["also"].items():
        console.print(f"{name}: {real:.3g} in the recording, {twin:.3g} in its twin")

    place = facts["place"]
    times = f"{place['scale']:g} times its own size"
    console.print(f"The place is {times}; disparities differ by {place['misfit']:.0%} there.")
    console.print(f"Everything is in {out}")


def _error_row(row: dict[str, Any]) -> list[str]:
    cells = [row["estimator"]]
    for side in (REAL, TWIN):
        cells += [f"{row[side][key]:.3g}" for key in SPREAD]
    return cells


def _statistic_row(row: dict[str, Any]) -> list[str]:
    return [row["statistic"], f"{row['against']:.2f}", f"{row['value']:.2f}", row["unit"], row["is"]]
