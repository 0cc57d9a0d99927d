"""Cumulative error curves: the share of trials, or of poses, whose error is below a threshold.

The curves over trials are those of the ETH3D SLAM benchmark (Schöps et al., 2019): a failed trial never counts.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.report.cell import Cell
from vobench.report.figure_style import LINE_WIDTH, label_plainly, line_style
from vobench.report.inline_figure import new_figure
from vobench.report.path_figure import LEGEND_INCHES
from vobench.report.scored_case import ScoredCase

HEIGHT = 0.62  # of the axes, relative to the width of the figure


@dataclass(frozen=True, slots=True)
class ErrorDistribution:
    """The errors (N,) of what an estimator answered, and the number of all trials or poses, answered or not."""

    estimator: str
    index: int
    errors: Array
    count: int


def trial_distributions(cells: Iterable[Cell], index_of: Mapping[str, int]) -> list[ErrorDistribution]:
    """The distribution of ATE in percent of the path over all trials of each estimator."""
    values_by_estimator: dict[str, list[float]] = {}
    for cell in cells:
        # A stationary case has no such error. A failed trial has an infinite one.
        known = [value for value in cell.values["ate"] if value is not None]
        values_by_estimator.setdefault(cell.estimator, []).extend(known)

    distributions = []
    for estimator in sorted(values_by_estimator, key=index_of.__getitem__):
        values = values_by_estimator[estimator]
        finite = np.array([value for value in values if value < inf])
        distributions.append(ErrorDistribution(estimator, index_of[estimator], finite, len(values)))
    return distributions


def pose_distributions(case: ScoredCase) -> list[ErrorDistribution]:
    """The distribution of the position errors in m over all true poses of a case."""
    distributions = []
    for estimate in case.estimates:
        errors_m = estimate.score.ate_trans_m if estimate.score else np.zeros(0)
        distributions.append(ErrorDistribution(estimate.label, estimate.index, errors_m, len(case.truth)))
    return distributions


def cumulative_figure(distributions: Sequence[ErrorDistribution], width_inches: float, *, over_trials: bool) -> Figure:
    """The share of trials or poses with at most an error, over the error. Raises InputError if there is no error."""
    errors = np.concatenate([distribution.errors for distribution in distributions] or [np.zeros(0)])
    positive = errors[errors > 0]
    if not len(positive):
        raise InputError("no trial has an error to plot")
    with new_figure(width_inches, HEIGHT * width_inches + LEGEND_INCHES) as figure:
        axes = figure.subplots()
        for distribution in distributions:
            _draw_steps(axes, distribution, float(positive.min()), float(positive.max()))
        axes.set_xscale("log")
        axes.set_ylim(0, 1.02)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        label_plainly(axes.xaxis)
        if over_trials:
            axes.set(xlabel="ATE, at most (% of the path)", ylabel="trials")
        else:
            axes.set(xlabel="position error, at most (m)", ylabel="poses")
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def _draw_steps(axes: Axes, distribution: ErrorDistribution, least: float, largest: float) -> None:
    """Draw a curve that rises by one trial at each error, from the least to the largest error of all estimators."""
    ordered = np.sort(distribution.errors)
    shares = np.arange(1, len(ordered) + 1) / max(distribution.count, 1)
    last_share = shares[-1] if len(shares) else 0.0
    x = np.concatenate([[least], ordered, [largest]])
    y = np.concatenate([[0.0], shares, [last_share]])
    style = line_style(distribution.index)
    axes.plot(x, y, drawstyle="steps-post", lw=LINE_WIDTH, label=distribution.estimator, **style)
