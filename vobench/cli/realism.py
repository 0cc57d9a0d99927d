"""How real pictures are, and how far a simulation can be trusted for a recording: vobench realism and twin."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.analysis.realism import OFFSET_BAND_PX, STATISTICS, Realism, Statistic, measure, residual, says, shots_of
from vobench.analysis.stereo_fit import Uncertain
from vobench.cli import terminal
from vobench.cli.sequence import Calibration, Form, FormCommand, Rate, TopicOf, Truth, topics_of
from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.runner.folder import SEQUENCE

COMMAND_CLASS = FormCommand
ALIKE = 0.25  # values that differ by a smaller share are taken for equal


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
    recording = recording_at(path, form, ReadOptions(calibration, None, truth, rate, topics=topics_of(topic)))
    other = against and recording_at(against, None, ReadOptions())
    found = measure(shots_of(recording), recording.rig)
    beside = measure(shots_of(other), other.rig) if other else None
    if plot:
        from vobench.report.realism_plot import save_plot

        save_plot(plot, {path.name: found} | ({against.name: beside} if against and beside else {}))
    if json:
        terminal.print_json(facts_of(found, beside))
    else:
        _print(path, found, beside)


def recording_at(path: Path, form: str | None, options: ReadOptions) -> Recording:
    """What is at a path; of a run's case its sequence."""
    linked = path / SEQUENCE
    if not linked.is_dir() and linked.is_symlink():
        raise InputError(f"this case's sequence is not in the cache any more; run the suite again: {path}")
    return read(linked if linked.is_dir() else path, form=form, options=options)


def rows_of(found: Realism, beside: Realism | None) -> list[dict[str, Any]]:
    """Each statistic with its band, or another recording in its place, and what would move it."""
    return [_row(statistic, found, beside) for statistic in STATISTICS if statistic.name in found.values]


def _row(statistic: Statistic, found: Realism, beside: Realism | None) -> dict[str, Any]:
    value = found.values[statistic.name]
    other = beside.values.get(statistic.name) if beside else None
    if other is not None:
        width = ALIKE * abs(other)
        statistic = replace(statistic, low=other - width, high=other + width)
    row = {"statistic": statistic.title, "name": statistic.name, "unit": statistic.unit, "value": value}
    row |= {"against": other} if beside else {"low": statistic.low, "high": statistic.high}
    return {**row, "is": statistic.verdict(value), "knob": statistic.knob(value)}


def facts_of(found: Realism, beside: Realism | None) -> dict[str, Any]:
    """All that is known of a recording, and of each statistic beside another one or the bands."""
    pair = found.pair
    fit: dict[str, Any] | None = None
    if pair:
        turns: dict[str, Uncertain | None] = {
            "yaw_deg": pair.yaw_deg,
            "roll_deg": pair.roll_deg,
            "pitch_deg": pair.pitch_deg,
        }
        turns |= {"offset_px": pair.offset_px, "xy_px": pair.xy_px}
        fit = {name: turn and {"value": turn.value, "sigma": turn.sigma} for name, turn in turns.items()}
        fit |= {"row_noise_px": pair.row_noise_px, "gain": pair.gain, "disparity_px": pair.disparity_px}
        fit |= {"yaw_from": pair.yaw_from, "calibration_error": residual(pair)}
    return {
        "pictures": found.pictures,
        "inside": found.inside,
        "statistics": rows_of(found, beside),
        "also": dict(found.also),
        "pair": fit,
        "says": says(found),
    }


def _print(path: Path, found: Realism, beside: Realism | None) -> None:
    out, rows = terminal.console(), []
    for row in rows_of(found, beside):
        band = f"{row['against']:.2f}" if beside and row["against"] is not None else ""
        band = band if beside else f"{row['low']:g} … {row['high']:g}"
        rows.append([row["statistic"], f"{row['value']:.2f}", row["unit"], band, row["is"], row["knob"]])
    title = f"{path}: {found.inside} of {len(found.values)} statistics in their bands, by {found.pictures} pictures"
    against = "against" if beside else "real ones"
    out.print(terminal.table(title, ["statistic", "value", "unit", against, "is", "moved by"], rows))
    for name, (value, unit, note) in _also(found).items():
        out.print(f"{name}: {value} {unit}{f' ({note})' if note else ''}".rstrip())
    for sentence in says(found):
        out.print(sentence)
    if found.pair and (error := residual(found.pair)):
        said = ", ".join(f"{name}: {value:g}" for name, value in error.items())
        out.print(f"A rig with this error: calibration_error: {{{said}}}")


def _also(found: Realism) -> dict[str, tuple[str, str, str]]:
    also = {
        "noise where flat": (f"{found.also['noise_dn']:.2f}", "DN", ""),
        "sharpest edges": (f"{found.also['edge_px']:.1f}", "px", ""),
        "flow": (f"{found.also['flow_px']:.1f}", "px a picture", ""),
    }
    if pair := found.pair:
        disparities = ", ".join(f"{each:.1f}" for each in pair.disparity_px)
        also["disparity"] = (disparities, "px", "a tenth, half and nine tenths of the matches are below")
        also["gain of the right eye"] = (f"{pair.gain:.3f}", "", "")
        if pair.offset_px:
            low, high = OFFSET_BAND_PX
            value = f"{pair.offset_px.value:+.2f} ± {pair.offset_px.sigma:.2f}"
            also["offset of disparity"] = (value, "px", f"real pairs: {low:g} … {high:g} either way")
    return also
