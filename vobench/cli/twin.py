"""vobench twin: a simulated twin of a recording, and how well both agree."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.recording_twin import REAL, TWIN, TwinReport, compare_twin, read_twin_suite, write_twin_suite
from vobench.cli import terminal
from vobench.cli.option import Jobs, Json, with_option_groups
from vobench.cli.plan_runner import plan_runner
from vobench.cli.progress import Bars
from vobench.cli.recording_option import FormCommand, RecordingOptions
from vobench.errors import InputError
from vobench.runner.folder import RunFolder, TrialScore

COMMAND_CLASS = FormCommand
STATISTICS = {"mean": "mean", "p10": "10 %", "p50": "50 %", "p90": "90 %"}


@with_option_groups
def twin_command(
    path: Annotated[
        Path | None,
        typer.Argument(metavar="RECORDING", help="A recording with ground truth, or the case of a run."),
    ] = None,
    *,
    report: Annotated[
        Path | None,
        typer.Option(help="Run the suite in the folder of a twin, such as one that was edited, and write its report."),
    ] = None,
    place: Annotated[str, typer.Option(help="The scene or model in which the path is simulated.")] = "office",
    out: Annotated[Path, typer.Option(help="The new folder for the suite, its runs and the report.")] = Path("twin"),
    estimator: Annotated[
        list[str] | None,
        typer.Option(
            "--estimator",
            "-e",
            help="Run this estimator instead of the usual seven: a name, a label of these, or an entry of a suite such "
            "as '{name: stereo_pnp, label: wide, params: {window_px: 21}}'; can be repeated.",
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Write the suite, and stop.")] = False,
    jobs: Jobs = 1,
    recording_options: RecordingOptions,
    json: Json = False,
) -> None:
    """Simulate a twin of a recording, run the same estimators on both, and print how well they agree."""
    progress = Bars()
    if report is not None:
        if path is not None:
            raise InputError("--report takes the folder of a twin in place of a recording; leave one of them out")
        out = report
        suite = read_twin_suite(report, progress=progress)
    elif path is None:
        raise InputError("name a recording, or with --report the folder of a twin")
    else:
        suite = write_twin_suite(
            path,
            out=out,
            place=place,
            estimators=estimator or (),
            form=recording_options.form,
            options=recording_options.read_options(),
            progress=progress,
        )
    if dry_run:
        print(f"Wrote the suite: {suite.file}")
        return
    run_plan = plan_runner(out=out / "runs", jobs=jobs, finish=_write_reports)
    compared = compare_twin(suite, run_plan=run_plan, progress=progress)
    if json:
        terminal.print_json(compared.as_dict())
    else:
        _print(compared, out)


def _write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    from vobench.report import page

    page.write_reports(folder, scores)


def _print(report: TwinReport, out: Path) -> None:
    """Print the errors of the estimators, the agreement of their orders, and the statistics side by side."""
    facts = report.as_dict()
    console = terminal.console()

    headings = ["estimator"]
    headings += [f"{REAL} {title}" for title in STATISTICS.values()]
    headings += [f"{TWIN} {title}" for title in STATISTICS.values()]
    rows = [_error_row(row) for row in facts["estimators"]]
    console.print(terminal.table("segment errors, % of length", headings, rows))
    low, high = facts["interval"]
    console.print(f"Kendall's tau between both rankings: {facts['tau']:.2f} (95 % CI {low:.2f} … {high:.2f})")

    rows = [_statistic_row(row) for row in facts["statistics"]]
    console.print(terminal.table("statistics", ["statistic", REAL, TWIN, "unit", "verdict"], rows))
    for name, (real, twin) in facts["also"].items():
        console.print(f"{name}: {real:.3g} in the recording, {twin:.3g} in its twin")

    place = facts["place"]
    if place is not None:
        scale = f"scaled by {place['scale']:g}"
        console.print(f"The scene is {scale}; its disparities differ from the recording's by {place['misfit']:.0%}.")
    console.print(f"Everything is in {out}")


def _error_row(row: dict[str, Any]) -> list[str]:
    cells = [row["estimator"]]
    for side in (REAL, TWIN):
        cells += [f"{row[side][key]:.3g}" for key in STATISTICS]
    return cells


def _statistic_row(row: dict[str, Any]) -> list[str]:
    return [row["statistic"], f"{row['against']:.2f}", f"{row['value']:.2f}", row["unit"], row["is"]]
