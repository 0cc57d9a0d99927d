"""The statistics of recordings as a picture: bands, rows, spectrum, gradients, tracks and grey values."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.analysis.image_noise import SATURATED_DN
from vobench.analysis.image_statistics import CYCLES
from vobench.analysis.realism import STATISTICS, Realism
from vobench.analysis.stereo_fit import StereoFit, row_error
from vobench.report.drive_plot import SETTINGS, check_ending, undated

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito (2008)
BAND = "#c9e4d3"
MOST_DOTS = 3000


def save_plot(path: Path, found: Mapping[str, Realism]) -> None:
    """Draw recordings by their names beside each other, as SVG, PNG or PDF. Raises InputError for another ending."""
    check_ending(path)
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(11, 6.6), layout="constrained")
        panels = figure.subplot_mosaic(
            [["bands", "rows", "side"], ["bands", "spectrum", "gradient"], ["bands", "tracks", "grey"]],
            width_ratios=[1.25, 1, 1],
        )
        _bands(panels["bands"], found)
        _rows(panels["rows"], panels["side"], found)
        _curves(panels, found)
        figure.savefig(path, dpi=110, metadata=undated(path.suffix))


def _bands(axes: "Axes", found: Mapping[str, Realism]) -> None:
    """Each statistic on a scale of its own, from its band's low end (0) to the high one (1)."""
    axes.axvspan(0, 1, color=BAND, lw=0)
    for shift, (name, colour) in enumerate(zip(found, COLOURS, strict=False)):
        axes.plot([], [], "o", color=colour, ms=6, label=name)
        for row, statistic in enumerate(STATISTICS):
            if (value := found[name].values.get(statistic.name)) is None:
                continue
            place = (value - statistic.low) / (statistic.high - statistic.low)
            shown = float(np.clip(place, -2, 3))
            outside = "<" if place < 0 else ">"
            marker = "o" if -2 <= place <= 3 else outside
            at = row + 0.28 * (shift - (len(found) - 1) / 2)
            axes.plot([shown], [at], marker, color=colour, ms=6)
            axes.annotate(
                f"{value:.2f}",
                (shown, at),
                xytext=(0, -13),
                textcoords="offset points",
                ha="center",
                fontsize=7,
                color=colour,
            )
    labels = [f"{s.title}\n{s.low:g} … {s.high:g} {s.unit}".rstrip() for s in STATISTICS]
    axes.set_yticks(range(len(STATISTICS)), labels)
    axes.set(ylim=(len(STATISTICS) - 0.4, -0.6), xlim=(-2.3, 3.3), title="statistics in bands of real pictures")
    axes.set_xticks([0, 1], ["low end", "high end"])
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.09), ncols=len(found), frameon=False)


def _rows(across: "Axes", down: "Axes", found: Mapping[str, Realism]) -> None:
    for each, colour in zip(found.values(), COLOURS, strict=False):
        if each.pair:
            _row_error(across, down, each.pair, colour)
    across.set(xlabel="x over f", ylabel="right row − left row (px)", title="rows, and the fit in mid-height")
    down.set(xlabel="y over f", title="rows, and the fit in mid-width")


def _row_error(across: "Axes", down: "Axes", pair: StereoFit, colour: str) -> None:
    matches = pair.matches
    some = np.linspace(0, len(matches.row_px) - 1, min(MOST_DOTS, len(matches.row_px))).astype(int)
    limit = max(4 * pair.row_mad_px, 0.3)
    for axis, axes in enumerate((across, down)):
        axes.plot(matches.place[some, axis], matches.row_px[some], ".", color=colour, ms=1.5, alpha=0.3)
        low, high = np.quantile(matches.place[:, axis], [0.005, 0.995]).tolist()
        ends = np.linspace(low, high, 30)
        along = np.zeros((len(ends), 2))
        along[:, axis] = ends
        axes.plot(ends, row_error(pair.coefficients, along), color=colour, lw=2)
        reach = max(limit, float(axes.get_ylim()[1]) if len(axes.lines) > 2 else 0.0)
        axes.set_ylim(-reach, reach)


def _curves(panels: "Mapping[str, Axes]", found: Mapping[str, Realism]) -> None:
    for each, colour in zip(found.values(), COLOURS, strict=False):
        power, gradient, alive, grey = (each.curves[key] for key in ("power", "gradient", "alive", "grey"))
        cycles = np.arange(1, len(power))
        panels["spectrum"].loglog(cycles, 10 ** power[1:], color=colour, lw=1.2)
        panels["gradient"].semilogy(gradient / gradient.sum(), color=colour, lw=1.2, drawstyle="steps-mid")
        panels["tracks"].plot(100 * alive, "o-", color=colour, ms=3, lw=1.2)
        shares = 100 * grey[:SATURATED_DN] / grey.sum()
        panels["grey"].fill_between(np.arange(SATURATED_DN), shares, color=colour, alpha=0.4, lw=0, step="mid")
    for end in CYCLES:
        panels["spectrum"].axvline(end, color="black", lw=0.6, ls=":")
    panels["spectrum"].set(title="power spectrum, slope between dots", xlabel="cycles in 256 px")
    panels["gradient"].set(title="gradients", xlabel="DN a pixel", ylabel="share of pixels")
    panels["tracks"].set(title="tracks alive", xlabel="pictures later", ylabel="%", ylim=(0, 103))
    panels["grey"].axvline(SATURATED_DN, color="black", lw=0.6, ls=":")
    panels["grey"].set(title="grey values", xlabel="DN", ylabel="% of pixels")
