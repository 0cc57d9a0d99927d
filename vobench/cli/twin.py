"""vobench twin: a simulated twin of a recording, and how well both agree."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.recorded_place import RECORDED
from vobench.analysis.recording_twin import (
    MOST_PLACEMENTS,
    PLACEMENTS,
    REAL,
    TWIN,
    TwinReport,
    compare_twin,
    predict_twin,
    read_twin_suite,
    write_twin_suite,
)
from vobench.analysis.twin_prediction import TwinPrediction
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
    place: Annotated[
        str,
        typer.Option(
            help="The recorded place, rebuilt from the images, or the first scene in which the path is tried."
        ),
    ] = RECORDED,
    placements: Annotated[
        int, typer.Option(min=1, max=MOST_PLACEMENTS, help="The largest number of twins, in different places if named.")
    ] = PLACEMENTS,
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
    predict: Annotated[
        bool, typer.Option("--predict", help="Print the prediction, without running estimators on the recording.")
    ] = False,
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
            placements=placements,
            estimators=estimator or (),
            form=recording_options.form,
            options=recording_options.read_options(),
            progress=progress,
        )
    if dry_run:
        print(f"Wrote the suite: {suite.file}")
        return
    run_plan = plan_runner(out=out / "runs", jobs=jobs, finish=_write_reports)
    predicted = predict_twin(suite, run_plan=run_plan)
    if not json:
        _print_prediction(predicted.prediction)
    if predict:
        if json:
            terminal.print_json(predicted.prediction.as_dict())
        return
    compared = compare_twin(suite, run_plan=run_plan, prediction=predicted, progress=progress)
    if json:
        terminal.print_json(compared.as_dict())
    else:
        _print(compared, out)


def _write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    from vobench.report import page

    page.write_reports(folder, scores)


def _print_prediction(prediction: TwinPrediction) -> None:
    """Print the expected errors, the expected order first to last, and on what they rest."""
    console = terminal.console()
    rows = []
    for predicted in prediction.errors:
        low, high = predicted.interval or (None, None)
        interval = "" if low is None else f"{low:.3g} … {high:.3g}"
        rows.append([predicted.estimator, f"{predicted.error:.3g}", interval])
    console.print(terminal.table("predicted segment errors, % of length", ["estimator", "mean", "95 %"], rows))
    for sentence in prediction.sentences():
        console.print(sentence)


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

    covered, counted = facts["prediction"]["in_intervals"]
    if counted:
        console.print(f"{covered} of {counted} errors on the recording are in the intervals that were predicted.")

    rows = [_statistic_row(row) for row in facts["statistics"]]
    console.print(terminal.table("statistics", ["statistic", REAL, TWIN, "unit", "verdict"], rows))
    for name, (real, twin) in facts["also"].items():
        console.print(f"{name}: {real:.3g} in the recording, {twin:.3g} in its twin")

    for place in facts["places"]:
        console.print(
            f"{place['place']} is scaled by {place['scale']:g}; its disparities differ from the recording's by "
            f"{place['misfit']:.0%}, and a tenth of a picture's are {place['nearness']:.2f} times as large at most."
        )
    console.print(f"Everything is in {out}")


def _error_row(row: dict[str, Any]) -> list[str]:
    cells = [row["estimator"]]
    for side in (REAL, TWIN):
        cells += [f"{row[side][key]:.3g}" for key in STATISTICS]
    return cells


def _statistic_row(row: dict[str, Any]) -> list[str]:
    return [row["statistic"], f"{row['against']:.2f}", f"{row['value']:.2f}", row["unit"], row["is"]]
