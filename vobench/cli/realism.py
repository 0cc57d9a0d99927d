"""How real pictures are: vobench realism."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.realism import OFFSET_BAND_PX, Realism, residual
from vobench.analysis.realism_report import RealismReport, measure_realism
from vobench.cli import terminal
from vobench.cli.sequence import Calibration, Form, FormCommand, Rate, TopicOf, Truth, topics_of
from vobench.dataset.recording import ReadOptions

COMMAND_CLASS = FormCommand


def realism_command(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A sequence, a run's case, a dataset's folder, or a bag.")
    ],
    *,
    against: Annotated[
        Path | None, typer.Option(help="Put this recording in the bands' place; its form is told by content.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the statistics to this .png, .svg or .pdf.")] = None,
    form: Form = None,
    calibration: Calibration = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: terminal.Json = False,
) -> None:
    """Say how real pictures are, how far the pair is off from its calibration, and which knob moves what."""
    options = ReadOptions(calibration=calibration, truth=truth, rate_hz=rate, topics=topics_of(topic))
    report = measure_realism(path, against=against, form=form, options=options)
    if plot:
        _save_plot(plot, report)
    if json:
        terminal.print_json(report.as_dict())
    else:
        _print(report)


def _save_plot(file: Path, report: RealismReport) -> None:
    from vobench.report.realism_plot import save_plot

    drawn = {report.path.name: report.found}
    if report.against_path and report.against:
        drawn[report.against_path.name] = report.against
    save_plot(file, drawn)


def _print(report: RealismReport) -> None:
    found = report.found
    console = terminal.console()
    in_bands = f"{found.inside} of {len(found.values)} statistics in their bands"
    title = f"{report.path}: {in_bands}, by {found.pictures} pictures"
    headings = ["statistic", "value", "unit", "against" if report.against else "real ones", "is", "moved by"]
    console.print(terminal.table(title, headings, [_row(row) for row in report.rows()]))
    for line in _more(found):
        console.print(line)
    for sentence in report.sentences():
        console.print(sentence)
    error = residual(found.pair) if found.pair else {}
    if error:
        entries = ", ".join(f"{name}: {value:g}" for name, value in error.items())
        console.print(f"A rig with this error: calibration_error: {{{entries}}}")


def _row(row: dict[str, Any]) -> list[str]:
    return [row["statistic"], f"{row['value']:.2f}", row["unit"], _band(row), row["is"], row["knob"]]


def _band(row: dict[str, Any]) -> str:
    """The band of a statistic, or its value in the other recording."""
    if "against" not in row:
        return f"{row['low']:g} … {row['high']:g}"
    return "" if row["against"] is None else f"{row['against']:.2f}"


def _more(found: Realism) -> list[str]:
    """What else is measured of the pictures and of the pair, a line each."""
    lines = [
        f"noise where flat: {found.also['noise_dn']:.2f} DN",
        f"sharpest edges: {found.also['edge_px']:.1f} px",
        f"flow: {found.also['flow_px']:.1f} px a picture",
    ]
    pair = found.pair
    if pair is None:
        return lines
    disparities = ", ".join(f"{each:.1f}" for each in pair.disparity_px)
    lines.append(f"disparity: {disparities} px (a tenth, half and nine tenths of the matches are below)")
    lines.append(f"gain of the right eye: {pair.gain:.3f}")
    if pair.offset_px:
        low, high = OFFSET_BAND_PX
        offset = f"{pair.offset_px.value:+.2f} ± {pair.offset_px.sigma:.2f} px"
        lines.append(f"offset of disparity: {offset} (real pairs: {low:g} … {high:g} either way)")
    return lines
