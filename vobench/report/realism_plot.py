"""The statistics of recordings as a plot: bands, row errors, spectrum, gradients, tracks and grey values."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.analysis.image_noise import SATURATED_DN
from vobench.analysis.image_statistics import CYCLES
from vobench.analysis.realism import STATISTICS, Realism, Statistic
from vobench.analysis.realism_band import CAR_BANDS
from vobench.analysis.stereo_fit import StereoFit, row_error
from vobench.geometry.se3 import Array
from vobench.report.figure_style import DPI, SETTINGS, check_ending, undated

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito (2008)
BAND = "#c9e4d3"
SIZE_INCHES = (11, 6.6)
MOST_DOTS = 3000
# Limits of the axis that all statistics share: 0 is the low end of a statistic's band, 1 the high end.
SCALE_LOW = -2.0
SCALE_HIGH = 3.0
RECORDING_SPACING = 0.28  # the distance between recordings in the row of a statistic, relative to that between rows
LINE_SAMPLES = 30
LEAST_REACH_PX = 0.3
FIT_QUANTILES = (0.005, 0.995)  # the fit is drawn between these quantiles of the positions of the matches
MADS_SHOWN = 4  # the number of median absolute deviations of the row errors that are shown to each side of 0


def save_realism_plot(path: Path, recordings: Mapping[str, Realism]) -> None:
    """Plot the statistics of recordings, by name, to an SVG, PNG or PDF file.

    Raises InputError for another ending of the file name.
    """
    check_ending(path)
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        panels = figure.subplot_mosaic(
            [
                ["bands", "rows", "side"],
                ["bands", "spectrum", "gradient"],
                ["bands", "tracks", "grey"],
            ],
            width_ratios=[1.25, 1, 1],
        )
        _bands(panels["bands"], recordings)
        _rows(panels["rows"], panels["side"], recordings)
        _curves(panels, recordings)
        figure.savefig(path, dpi=DPI, metadata=undated(path.suffix))


def _bands(axes: "Axes", recordings: Mapping[str, Realism]) -> None:
    """Plot each statistic in a separate row. It is scaled so that the band of real pictures lies between 0 and 1."""
    middle_index = (len(recordings) - 1) / 2
    axes.axvspan(0, 1, color=BAND, lw=0)
    for index, (name, colour) in enumerate(zip(recordings, COLOURS, strict=False)):
        axes.plot([], [], "o", color=colour, ms=6, label=name)
        y_offset = RECORDING_SPACING * (index - middle_index)
        for row, statistic in enumerate(STATISTICS):
            value = recordings[name].values.get(statistic.name)
            if value is not None:
                _band_marker(axes, statistic, value, row + y_offset, colour)

    axes.set_yticks(range(len(STATISTICS)), [_band_label(statistic) for statistic in STATISTICS])
    axes.set(ylim=(len(STATISTICS) - 0.4, -0.6), xlim=(SCALE_LOW - 0.3, SCALE_HIGH + 0.3))
    axes.set_title("statistics in the bands of recordings of cars")
    axes.set_xticks([0, 1], ["low end", "high end"])
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.09), ncols=len(recordings), frameon=False)


def _band_label(statistic: Statistic) -> str:
    band = CAR_BANDS[statistic.name]
    limits = f"{band.low:g} … {band.high:g} {statistic.unit}"
    return f"{statistic.title}\n{limits}".rstrip()


def _band_marker(axes: "Axes", statistic: Statistic, value: float, y: float, colour: str) -> None:
    """Draw a value as a dot. If it is outside the limits of the axis, draw an arrow at the edge."""
    band = CAR_BANDS[statistic.name]
    x = (value - band.low) / (band.high - band.low)
    x_shown = float(np.clip(x, SCALE_LOW, SCALE_HIGH))
    marker = "o"
    if x < SCALE_LOW:
        marker = "<"
    elif x > SCALE_HIGH:
        marker = ">"

    axes.plot([x_shown], [y], marker, color=colour, ms=6)
    axes.annotate(
        f"{value:.2f}",
        (x_shown, y),
        xytext=(0, -13),
        textcoords="offset points",
        ha="center",
        fontsize=7,
        color=colour,
    )


def _rows(across: "Axes", down: "Axes", recordings: Mapping[str, Realism]) -> None:
    """Plot the row errors of stereo matches along the width and along the height of the picture."""
    for realism, colour in zip(recordings.values(), COLOURS, strict=False):
        if realism.pair:
            _row_errors(across, realism.pair, 0, colour)
            _row_errors(down, realism.pair, 1, colour)
    across.set(xlabel="x / f", ylabel="right row − left row (px)", title="row errors, and fit at mid-height")
    down.set(xlabel="y / f", title="row errors, and fit at mid-width")


def _row_errors(axes: "Axes", pair: StereoFit, axis: int, colour: str) -> None:
    """Plot the row errors of a pair along one axis of the picture, and the fit along its middle line."""
    matches = pair.matches
    count = len(matches.row_px)
    sample = np.linspace(0, count - 1, min(MOST_DOTS, count)).astype(int)
    axes.plot(matches.place[sample, axis], matches.row_px[sample], ".", color=colour, ms=1.5, alpha=0.3)

    low, high = np.quantile(matches.place[:, axis], FIT_QUANTILES).tolist()
    coordinates = np.linspace(low, high, LINE_SAMPLES)
    fit_places = np.zeros((LINE_SAMPLES, 2))
    fit_places[:, axis] = coordinates
    fitted_px = row_error(pair.coefficients, fit_places)
    axes.plot(coordinates, fitted_px, color=colour, lw=2)

    # The y axis covers all recordings that are plotted so far.
    is_first = len(axes.lines) == 2
    earlier_reach = 0.0 if is_first else float(axes.get_ylim()[1])
    reach = max(MADS_SHOWN * pair.row_mad_px, LEAST_REACH_PX, earlier_reach)
    axes.set_ylim(-reach, reach)


def _curves(panels: "Mapping[str, Axes]", recordings: Mapping[str, Realism]) -> None:
    """Plot the spectra, gradients, track survival and grey values of all recordings."""
    for realism, colour in zip(recordings.values(), COLOURS, strict=False):
        _spectrum(panels["spectrum"], realism.curves["power"], colour)
        _gradients(panels["gradient"], realism.curves["gradient"], colour)
        _track_survival(panels["tracks"], realism.curves["alive"], colour)
        _grey_values(panels["grey"], realism.curves["grey"], colour)

    for cycles in CYCLES:
        panels["spectrum"].axvline(cycles, color="black", lw=0.6, ls=":")
    panels["grey"].axvline(SATURATED_DN, color="black", lw=0.6, ls=":")

    panels["spectrum"].set(title="power spectrum, slope between the dotted lines", xlabel="cycles in 256 px")
    panels["gradient"].set(title="gradients", xlabel="DN per pixel", ylabel="share of pixels")
    panels["tracks"].set(title="tracks alive", xlabel="images later", ylabel="%", ylim=(0, 103))
    panels["grey"].set(title="grey values", xlabel="DN", ylabel="% of pixels")


def _spectrum(axes: "Axes", log_power: Array, colour: str) -> None:
    cycles = np.arange(1, len(log_power))
    axes.loglog(cycles, 10 ** log_power[1:], color=colour, lw=1.2)


def _gradients(axes: "Axes", counts: Array, colour: str) -> None:
    axes.semilogy(counts / counts.sum(), color=colour, lw=1.2, drawstyle="steps-mid")


def _track_survival(axes: "Axes", surviving: Array, colour: str) -> None:
    axes.plot(100 * surviving, "o-", color=colour, ms=3, lw=1.2)


def _grey_values(axes: "Axes", counts: Array, colour: str) -> None:
    shares_percent = 100 * counts[:SATURATED_DN] / counts.sum()
    axes.fill_between(np.arange(SATURATED_DN), shares_percent, color=colour, alpha=0.4, lw=0, step="mid")
