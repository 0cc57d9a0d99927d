"""The figure of breakdown curves: the lost-aware score of each estimator as a scenario grows more severe."""

from collections.abc import Iterable, Mapping
from math import ceil
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

LEAST_PANEL_INCHES = 1.6  # the smallest width of the panel of a scenario
PANEL_HEIGHT_INCHES = 1.35
MOST_COLUMNS = 5
BAND_ALPHA = 0.15
SCORE_LIMITS = (-0.05, 1.05)  # of the axis, so that a marker at 0 or 1 is not cut

Scenario = tuple[str, str]  # the group of the cases, and the scenario


def breakdown_figure(cells: Iterable[Cell], index_of: Mapping[str, int], width_inches: float) -> Figure:
    """The median score over severity, with one panel for each scenario. Bands span the scores of all trials.

    Raises InputError if no scenario has two severities.
    """
    curves = _curves_by_scenario(scores_by_severity(cells))
    if not curves:
        raise InputError("no scenario of this run has two severities")
    panels_per_row = max(1, int(width_inches / LEAST_PANEL_INCHES))
    columns = min(len(curves), MOST_COLUMNS, panels_per_row)
    rows = ceil(len(curves) / columns)
    height_inches = rows * PANEL_HEIGHT_INCHES + LEGEND_INCHES

    with new_figure(width_inches, height_inches) as figure:
        grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
        panels = list(grid.flat)
        for axes, (scenario, scores_by_estimator) in zip(panels, curves.items(), strict=False):
            _draw_panel(axes, scenario, scores_by_estimator, index_of)
        for unused_axes in panels[len(curves) :]:
            unused_axes.set_axis_off()

        for axes in panels[max(0, len(curves) - columns) : len(curves)]:
            axes.set_xlabel("severity")
        figure.supylabel("lost-aware score", fontsize=8)
        handle_of_label = _handle_of_label(panels)
        handles = list(handle_of_label.values())
        labels = list(handle_of_label)
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _draw_panel(
    axes: Axes,
    scenario: Scenario,
    scores_by_estimator: Mapping[str, Mapping[int, list[float]]],
    index_of: Mapping[str, int],
) -> None:
    """Draw the curves of all estimators for one scenario."""
    for estimator, scores in scores_by_estimator.items():
        _draw_curve(axes, scores, index_of[estimator], estimator)
    axes.axhline(BREAKDOWN_SCORE, color=NEUTRAL, lw=0.8, ls=":")
    title = ", ".join(filter(None, scenario))
    axes.set_title(title, fontsize=8)
    axes.set_ylim(*SCORE_LIMITS)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _handle_of_label(panels: Iterable[Axes]) -> dict[str, Artist]:
    """The first legend handle of each label in the panels."""
    handle_of_label: dict[str, Artist] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        for handle, label in zip(handles, labels, strict=True):
            handle_of_label.setdefault(label, handle)
    return handle_of_label


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
