"""The statistics of recordings as a plot: bands, row errors, spectrum, gradients, tracks and grey values."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.analysis.image_noise import SATURATED_DN
from vobench.analysis.image_statistics import CYCLES
from vobench.analysis.realism import STATISTICS, Realism, Statistic
from vobench.analysis.stereo_fit import StereoFit, row_error
from vobench.geometry.se3 import Array
from vobench.report.drive_plot import DPI, SETTINGS, check_ending, undated

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito (2008)
BAND = "#c9e4d3"
SIZE_INCHES = (11, 6.6)
MOST_DOTS = 3000
# The part of each statistic's scale that is shown, from the low end of its band (0) to the high end (1).
SCALE_LOW = -2.0
SCALE_HIGH = 3.0
RECORDING_SPACING = 0.28  # between recordings on the row of a statistic
LINE_SAMPLES = 30
LEAST_REACH_PX = 0.3


def save_realism_plot(path: Path, recordings: Mapping[str, Realism]) -> None:
    """Plot recordings by their names side by side, as SVG, PNG or PDF. Raises InputError for another ending."""
    check_ending(path)
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        panels = figure.subplot_mosaic(
            [["bands", "rows", "side"], ["bands", "spectrum", "gradient"], ["bands", "tracks", "grey"]],
            width_ratios=[1.25, 1, 1],
        )
        _bands(panels["bands"], recordings)
        _rows(panels["rows"], panels["side"], recordings)
        _curves(panels, recordings)
        figure.savefig(path, dpi=DPI, metadata=undated(path.suffix))


def _bands(axes: "Axes", recordings: Mapping[str, Realism]) -> None:
    """Each statistic on a scale of its own, from the low end of its band (0) to the high end (1)."""
    axes.axvspan(0, 1, color=BAND, lw=0)
    for index, (name, colour) in enumerate(zip(recordings, COLOURS, strict=False)):
        axes.plot([], [], "o", color=colour, ms=6, label=name)
        offset = RECORDING_SPACING * (index - (len(recordings) - 1) / 2)
        for row, statistic in enumerate(STATISTICS):
            value = recordings[name].values.get(statistic.name)
            if value is not None:
                _band_marker(axes, statistic, value, row + offset, colour)
    labels = [f"{each.title}\n{each.low:g} … {each.high:g} {each.unit}".rstrip() for each in STATISTICS]
    axes.set_yticks(range(len(STATISTICS)), labels)
    axes.set(ylim=(len(STATISTICS) - 0.4, -0.6), xlim=(SCALE_LOW - 0.3, SCALE_HIGH + 0.3))
    axes.set_title("statistics in the bands of real pictures")
    axes.set_xticks([0, 1], ["low end", "high end"])
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.09), ncols=len(recordings), frameon=False)


def _band_marker(axes: "Axes", statistic: Statistic, value: float, y: float, colour: str) -> None:
    """The marker of a value: a dot, or an arrow at the edge if the value is outside of the scale."""
    place = (value - statistic.low) / (statistic.high - statistic.low)
    shown = float(np.clip(place, SCALE_LOW, SCALE_HIGH))
    marker = "o"
    if place < SCALE_LOW:
        marker = "<"
    elif place > SCALE_HIGH:
        marker = ">"
    axes.plot([shown], [y], marker, color=colour, ms=6)
    axes.annotate(
        f"{value:.2f}",
        (shown, y),
        xytext=(0, -13),
        textcoords="offset points",
        ha="center",
        fontsize=7,
        color=colour,
    )


def _rows(across: "Axes", down: "Axes", recordings: Mapping[str, Realism]) -> None:
    """Row errors of stereo matches along the width and along the height of the picture."""
    for realism, colour in zip(recordings.values(), COLOURS, strict=False):
        if realism.pair:
            _row_errors(across, realism.pair, 0, colour)
            _row_errors(down, realism.pair, 1, colour)
    across.set(xlabel="x / f", ylabel="right row − left row (px)", title="row errors, and fit at mid-height")
    down.set(xlabel="y / f", title="row errors, and fit at mid-width")


def _row_errors(axes: "Axes", pair: StereoFit, axis: int, colour: str) -> None:
    """The row errors of a pair along one axis of the picture, and their fit through the picture's centre."""
    matches = pair.matches
    count = len(matches.row_px)
    dots = np.linspace(0, count - 1, min(MOST_DOTS, count)).astype(int)
    axes.plot(matches.place[dots, axis], matches.row_px[dots], ".", color=colour, ms=1.5, alpha=0.3)
    low, high = np.quantile(matches.place[:, axis], [0.005, 0.995]).tolist()
    coordinates = np.linspace(low, high, LINE_SAMPLES)
    places = np.zeros((LINE_SAMPLES, 2))
    places[:, axis] = coordinates
    axes.plot(coordinates, row_error(pair.coefficients, places), color=colour, lw=2)

    # The range of both recordings, not only of this one.
    is_first = len(axes.lines) == 2
    earlier_reach = 0.0 if is_first else float(axes.get_ylim()[1])
    reach = max(4 * pair.row_mad_px, LEAST_REACH_PX, earlier_reach)
    axes.set_ylim(-reach, reach)


def _curves(panels: "Mapping[str, Axes]", recordings: Mapping[str, Realism]) -> None:
    for realism, colour in zip(recordings.values(), COLOURS, strict=False):
        _spectrum(panels["spectrum"], realism.curves["power"], colour)
        gradient = realism.curves["gradient"]
        panels["gradient"].semilogy(gradient / gradient.sum(), color=colour, lw=1.2, drawstyle="steps-mid")
        panels["tracks"].plot(100 * realism.curves["alive"], "o-", color=colour, ms=3, lw=1.2)
        _grey_values(panels["grey"], realism.curves["grey"], colour)
    for cycles in CYCLES:
        panels["spectrum"].axvline(cycles, color="black", lw=0.6, ls=":")
    panels["spectrum"].set(title="power spectrum, slope between the dotted lines", xlabel="cycles in 256 px")
    panels["gradient"].set(title="gradients", xlabel="DN per pixel", ylabel="share of pixels")
    panels["tracks"].set(title="tracks alive", xlabel="pictures later", ylabel="%", ylim=(0, 103))
    panels["grey"].axvline(SATURATED_DN, color="black", lw=0.6, ls=":")
    panels["grey"].set(title="grey values", xlabel="DN", ylabel="% of pixels")


def _spectrum(axes: "Axes", log_power: Array, colour: str) -> None:
    cycles = np.arange(1, len(log_power))
    axes.loglog(cycles, 10 ** log_power[1:], color=colour, lw=1.2)


def _grey_values(axes: "Axes", counts: Array, colour: str) -> None:
    shares_percent = 100 * counts[:SATURATED_DN] / counts.sum()
    axes.fill_between(np.arange(SATURATED_DN), shares_percent, color=colour, alpha=0.4, lw=0, step="mid")
