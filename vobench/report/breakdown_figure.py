"""The figure of breakdown curves: the lost-aware score of each estimator as a scenario grows more severe."""

from collections.abc import Iterable, Mapping
from statistics import median

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vobench.errors import InputError
from vobench.report.breakdown import BREAKDOWN_SCORE, CurveKey, scores_by_severity
from vobench.report.cell import Cell
from vobench.report.figure_style import LINE_WIDTH, NEUTRAL, line_style, marker_style
from vobench.report.inline_figure import new_figure
from vobench.report.path_figure import LEGEND_INCHES

LEAST_PANEL_INCHES = 1.6  # the width of the curves of one scenario
PANEL_HEIGHT_INCHES = 1.35
MOST_COLUMNS = 5
BAND_ALPHA = 0.15

Scenario = tuple[str, str]  # the group of the cases, and the scenario


def breakdown_figure(cells: Iterable[Cell], index_of: Mapping[str, int], width_inches: float) -> Figure:
    """The median score over severity, one panel for each scenario; bands span all trials.

    Raises InputError if no scenario has two severities.
    """
    curves = _curves_by_scenario(scores_by_severity(cells))
    if not curves:
        raise InputError("no scenario of this run has two severities")
    columns = min(len(curves), MOST_COLUMNS, max(1, int(width_inches / LEAST_PANEL_INCHES)))
    rows = -(-len(curves) // columns)
    with new_figure(width_inches, rows * PANEL_HEIGHT_INCHES + LEGEND_INCHES) as figure:
        grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
        panels = list(grid.flat)
        handle_of: dict[str, Artist] = {}
        for axes, (scenario, scores_by_estimator) in zip(panels, curves.items(), strict=False):
            for estimator, scores in scores_by_estimator.items():
                _draw_curve(axes, scores, index_of[estimator], estimator)
            axes.axhline(BREAKDOWN_SCORE, color=NEUTRAL, lw=0.8, ls=":")
            axes.set_title(", ".join(filter(None, scenario)), fontsize=8)
            axes.set_ylim(0, 1.03)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handle_of.setdefault(label, handle)
        for axes in panels[len(curves) :]:
            axes.set_axis_off()
        figure.supxlabel("severity", fontsize=8)
        figure.supylabel("lost-aware score", fontsize=8)
        figure.legend(list(handle_of.values()), list(handle_of), loc="outside lower center", ncols=3)
    return figure


def _curves_by_scenario(
    scores: Mapping[CurveKey, Mapping[int, list[float]]],
) -> dict[Scenario, dict[str, Mapping[int, list[float]]]]:
    """The scores by severity of each estimator, for each scenario with at least two severities."""
    curves: dict[Scenario, dict[str, Mapping[int, list[float]]]] = {}
    for key, by_severity in scores.items():
        known = {severity: values for severity, values in by_severity.items() if values}
        if len(known) > 1:
            curves.setdefault((key.group, key.scenario), {})[key.estimator] = known
    return curves


def _draw_curve(axes: Axes, scores: Mapping[int, list[float]], index: int, label: str) -> None:
    """Draw the medians as a line, and the range of all trials as a band."""
    severities = list(scores)
    medians = [median(values) for values in scores.values()]
    lowest = [min(values) for values in scores.values()]
    highest = [max(values) for values in scores.values()]
    style = line_style(index) | marker_style(index)
    axes.plot(severities, medians, lw=LINE_WIDTH, ms=3, label=label, **style)
    axes.fill_between(severities, lowest, highest, color=style["color"], alpha=BAND_ALPHA, lw=0)
