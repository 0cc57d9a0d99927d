"""vobench realism: how realistic images are."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.realism import Realism, residual, side_effects
from vobench.analysis.realism_band import CAR, OFFSET_BAND_PX
from vobench.analysis.realism_report import RealismReport, measure_realism
from vobench.cli import terminal
from vobench.cli.option import Json, with_option_groups
from vobench.cli.recording_option import FormCommand, RecordingOptions

COMMAND_CLASS = FormCommand


@with_option_groups
def realism_command(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A sequence, the case of a run, the folder of a dataset, or a bag.")
    ],
    *,
    against: Annotated[
        Path | None,
        typer.Option(help="Compare with this recording instead of the bands of real ones; detected from content."),
    ] = None,
    domain: Annotated[
        str, typer.Option(help="What carries the camera: car, drone, hand or robot. Only car has bands so far.")
    ] = CAR,
    plot: Annotated[Path | None, typer.Option(help="Plot the statistics to this .png, .svg or .pdf.")] = None,
    recording_options: RecordingOptions,
    json: Json = False,
) -> None:
    """Measure how realistic images are, how large the calibration error is, and which settings change what."""
    options = recording_options.read_options()
    report = measure_realism(path, against=against, domain=domain, form=recording_options.form, options=options)
    if plot:
        _save_plot(plot, report)
    if json:
        terminal.print_json(report.as_dict())
    else:
        _print(report)


def _save_plot(file: Path, report: RealismReport) -> None:
    from vobench.report.realism_plot import save_realism_plot

    realism_by_name = {report.path.name: report.found}
    if report.against_path and report.against:
        realism_by_name[report.against_path.name] = report.against
    save_realism_plot(file, realism_by_name)


def _print(report: RealismReport) -> None:
    realism = report.found
    console = terminal.console()

    has_verdicts = bool(report.against or report.domain.bands)
    band_count = f"{report.inside} of {len(realism.values)} statistics in their bands, " if has_verdicts else ""
    title = f"{report.path}: {band_count}measured on {realism.pictures} images"
    reference = "against" if report.against else "real ones"
    headings = ["statistic", "value", "unit", reference, "verdict", "changed by"]
    rows = [_row(row) for row in report.rows()]
    console.print(terminal.table(title, headings, rows))
    for sentence in side_effects(row["knob"] for row in report.rows()):
        console.print(sentence, soft_wrap=True)
    for line in _other_measurements(realism):
        console.print(line)
    for sentence in report.sentences():
        console.print(sentence)

    error = residual(realism.pair) if realism.pair else {}
    if error:
        entries = ", ".join(f"{name}: {value:g}" for name, value in error.items())
        console.print(f"To give a rig this error: calibration_error: {{{entries}}}")


def _row(row: dict[str, Any]) -> list[str]:
    return [row["statistic"], f"{row['value']:.2f}", row["unit"], _reference(row), row["is"], row["knob"]]


def _reference(row: dict[str, Any]) -> str:
    """The band of a statistic, or its value in the other recording."""
    if "against" not in row:
        return "" if row["low"] is None else f"{row['low']:g} … {row['high']:g}"
    return "" if row["against"] is None else f"{row['against']:.2f}"


def _other_measurements(realism: Realism) -> list[str]:
    """Measurements of the images and of the stereo pair that have no band, a line each."""
    lines = [
        f"noise in uniform areas: {realism.also['noise_dn']:.2f} DN",
        f"sharpest edges: {realism.also['edge_px']:.1f} px",
        f"flow: {realism.also['flow_px']:.1f} px per image",
    ]
    pair = realism.pair
    if pair is None:
        return lines
    disparities = ", ".join(f"{disparity_px:.1f}" for disparity_px in pair.disparity_px)
    lines.append(f"disparity: {disparities} px (10th, 50th and 90th percentile)")
    lines.append(f"gain of the right camera: {pair.gain:.3f}")
    if pair.offset_px:
        low, high = OFFSET_BAND_PX
        offset = f"{pair.offset_px.value:+.2f} ± {pair.offset_px.sigma:.2f} px"
        lines.append(f"disparity offset: {offset} (four real pairs: magnitude {low:g} … {high:g} px)")
    return lines
