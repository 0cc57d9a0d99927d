"""The matrix of cases and estimators as a heat map."""

from math import inf, log10
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.report.board_metric import METRICS
from vobench.report.cell import Cell
from vobench.report.figure_style import NEUTRAL, label_plainly
from vobench.report.inline_figure import new_figure
from vobench.report.leaderboard import Board

ROW_INCHES = 0.19
HEAD_INCHES = 1.1  # for the names of estimators and the colour bar
COLOURS_NAME = "cividis"  # even in lightness, also for colour-blind readers
DARK_BELOW = 0.5  # of the range of colours, on which text is white
TEXT_STYLE: Any = {"ha": "center", "va": "center", "fontsize": 6.5}
RANGE_FACTOR = 1.2  # by which the range of colours exceeds a single value


def matrix_figure(board: Board, metric: str, width_inches: float) -> Figure:
    """The median of a metric for each case and estimator. A cell in which all trials failed has its status.

    Raises InputError if no cell has a value above 0.
    """
    cases = board.cases
    estimators = board.estimators
    values = _values(board, metric)
    positive = values[np.isfinite(values) & (values > 0)]
    if not len(positive):
        raise InputError(f"no cell of this run has a value of {metric}")
    least = float(positive.min()) / RANGE_FACTOR
    largest = float(positive.max()) * RANGE_FACTOR
    higher_is_better = METRICS[metric].higher_is_better
    colours = colormaps[COLOURS_NAME if higher_is_better else f"{COLOURS_NAME}_r"]
    with new_figure(width_inches, ROW_INCHES * len(cases) + HEAD_INCHES) as figure:
        axes = figure.subplots()
        drawn = np.where(np.isfinite(values) & (values > 0), values, np.nan)
        image = axes.imshow(drawn, cmap=colours, norm=LogNorm(least, largest), aspect="auto")
        for row, case in enumerate(cases):
            for column, estimator in enumerate(estimators):
                value = float(values[row, column])
                if value == inf:
                    _write_status(axes, board.cell(case, estimator), column, row)
                elif not np.isnan(value):
                    share = _share(value, least, largest)
                    is_dark = share < DARK_BELOW if higher_is_better else share > DARK_BELOW
                    colour = "white" if is_dark else "black"
                    axes.text(column, row, f"{value:.2g}", color=colour, **TEXT_STYLE)
        axes.set_xticks(range(len(estimators)), estimators, rotation=30, ha="left", rotation_mode="anchor")
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(cases)), cases)
        axes.tick_params(length=0)
        axes.grid(visible=False)
        bar = figure.colorbar(image, ax=axes, location="bottom", label=METRICS[metric].heading, shrink=0.6, aspect=40)
        label_plainly(bar.ax.xaxis)
    return figure


def _values(board: Board, metric: str) -> Array:
    """The medians (cases, estimators) of a metric; NaN if there is none, infinite if all trials failed."""
    values = np.full((len(board.cases), len(board.estimators)), np.nan)
    for row, case in enumerate(board.cases):
        for column, estimator in enumerate(board.estimators):
            cell = board.cell(case, estimator)
            if cell is None:
                continue
            spread = cell.spread(metric)
            if spread is not None:
                values[row, column] = spread[0]
            elif cell.failed:
                values[row, column] = inf
    return values


def _share(value: float, least: float, largest: float) -> float:
    """Where a value lies in the logarithmic range of colours, from 0 to 1; 0 for a value without a colour."""
    if not 0 < value < inf:
        return 0.0
    return (log10(value) - log10(least)) / (log10(largest) - log10(least))


def _write_status(axes: Axes, cell: Cell | None, column: int, row: int) -> None:
    """Hatch a cell in which all trials failed, and write its status."""
    hatched = Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor="none", hatch="////", edgecolor=NEUTRAL, lw=0)
    axes.add_patch(hatched)
    status = cell.status if cell else ""
    axes.text(column, row, status, color="black", **TEXT_STYLE)
