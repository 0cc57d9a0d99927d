"""The figure of accuracy against cost: the error of each estimator over the CPU time that it takes per frame."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vobench.errors import InputError
from vobench.report.figure_style import NEUTRAL, label_plainly, marker_style
from vobench.report.inline_figure import new_figure
from vobench.report.path_figure import LEGEND_INCHES
from vobench.report.total import Total

ERROR_LABEL = "median ATE (% of the path)"
RELATIVE_HEIGHT = 0.7  # the height of a single panel relative to its width
RELATIVE_HEIGHT_OF_MANY = 0.42  # the height of each of several panels relative to its width


def cost_figure(totals: Sequence[Total], index_of: Mapping[str, int], width_inches: float) -> Figure:
    """The median ATE over CPU time per frame, with one panel for each group of the board.

    A line joins the efficient estimators, which have a smaller error than all cheaper estimators. Estimators without a
    rank, such as oracles, are omitted.

    Raises InputError if no estimator has both numbers.
    """
    points_by_group: dict[str, list[_Point]] = {}
    for point in _points(totals):
        points_by_group.setdefault(point.total.group, []).append(point)
    if not points_by_group:
        raise InputError("no ranked estimator has both an error and a CPU time")
    rows = len(points_by_group)
    relative_height = RELATIVE_HEIGHT if rows == 1 else RELATIVE_HEIGHT_OF_MANY
    panel_height_inches = relative_height * width_inches
    height_inches = rows * panel_height_inches + LEGEND_INCHES
    with new_figure(width_inches, height_inches) as figure:
        panels = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
        for axes, (group, points) in zip(panels, points_by_group.items(), strict=True):
            _draw_points(axes, points, index_of)
            if rows > 1:
                axes.set_title(group)
        if rows > 1:
            figure.supylabel(ERROR_LABEL, fontsize="medium")
        else:
            panels[0].set_ylabel(ERROR_LABEL)
        panels[-1].set_xlabel("CPU time (ms per frame)")
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def _draw_points(axes: Axes, points: Sequence["_Point"], index_of: Mapping[str, int]) -> None:
    """Draw the estimators of one group, and the line of the efficient ones."""
    front = _efficient(points)
    if len(front) > 1:
        times_ms = [point.cpu_ms for point in front]
        errors_percent = [point.ate_percent for point in front]
        axes.plot(times_ms, errors_percent, color=NEUTRAL, lw=0.8, ls="--", drawstyle="steps-post")
    for point in points:
        style = marker_style(index_of[point.total.estimator])
        axes.plot(point.cpu_ms, point.ate_percent, ls="none", ms=6, label=_label(point.total), **style)
    axes.set(xscale="log", yscale="log")
    axes.margins(0.15)
    label_plainly(axes.xaxis)
    label_plainly(axes.yaxis)


@dataclass(frozen=True, slots=True)
class _Point:
    """An estimator that has both a CPU time and an error."""

    total: Total
    cpu_ms: float
    ate_percent: float


def _points(totals: Sequence[Total]) -> Iterator[_Point]:
    """The ranked estimators that have both a CPU time and an error."""
    for total in totals:
        if total.rank is not None and total.cpu_ms and total.ate_percent:
            yield _Point(total, total.cpu_ms, total.ate_percent)


def _label(total: Total) -> str:
    """The name of an estimator, followed by the number of its failed trials if any failed."""
    if not total.failed:
        return total.estimator
    return f"{total.estimator} ({total.failed} of {total.trials} failed)"


def _efficient(points: Sequence[_Point]) -> list[_Point]:
    """The points with a smaller error than all cheaper ones, the cheapest first."""
    efficient = list[_Point]()
    for point in sorted(points, key=lambda point: (point.cpu_ms, point.ate_percent)):
        if not efficient or point.ate_percent < efficient[-1].ate_percent:
            efficient.append(point)
    return efficient
