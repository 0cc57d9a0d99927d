"""The matrix of cases and estimators as a heat map."""

from math import inf, log10, radians, sin
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.report.board_metric import METRICS
from vobench.report.cell import Cell
from vobench.report.figure_style import NEUTRAL, label_plainly
from vobench.report.inline_figure import new_figure
from vobench.report.leaderboard import Board
from vobench.runner.folder import NOT_APPLICABLE

ROW_INCHES = 0.19
BAR_INCHES = 0.75  # the height of the colour bar with its label
BAR_GAP_INCHES = 0.08  # above the colour bar
CHARACTER_INCHES = 0.065  # the width of a character of a name
COLOURS_NAME = "cividis"  # even in lightness, also for colour-blind readers
DARK_BELOW = 0.5  # of the range of colours, on which text is white
TEXT_STYLE: Any = {"ha": "center", "va": "center", "fontsize": 6.5}
NAMES_ANGLE_DEG = 45.0  # at which names of estimators need little width
WITHOUT_DECIMALS_FROM = 9.95  # which would be 10.0 with one decimal
WITH_TWO_DECIMALS_FROM = 0.01
RANGE_FACTOR = 1.2  # by which the range of colours exceeds a single value


def matrix_figure(board: Board, metric: str, width_inches: float) -> Figure:
    """The median of a metric for each case and estimator. A cell in which all trials failed has its status.

    A status is omitted if its cell is too narrow for it, and all numbers if one of them does not fit.

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
    names_inches = max(map(len, estimators)) * CHARACTER_INCHES * sin(radians(NAMES_ANGLE_DEG))
    height_inches = ROW_INCHES * len(cases) + names_inches + BAR_INCHES
    with new_figure(width_inches, height_inches) as figure:
        axes = figure.subplots()
        drawn = np.where(np.isfinite(values) & (values > 0), values, np.nan)
        image = axes.imshow(drawn, cmap=colours, norm=LogNorm(least, largest), aspect="auto")
        numbers = list[Text]()
        statuses = list[Text]()
        for row, case in enumerate(cases):
            for column, estimator in enumerate(estimators):
                value = float(values[row, column])
                if value == inf:
                    statuses.append(_write_status(axes, board.cell(case, estimator), column, row))
                elif not np.isnan(value):
                    is_dark = _is_dark(value, least, largest, higher_is_better=higher_is_better)
                    colour = "white" if is_dark else "black"
                    numbers.append(axes.text(column, row, _number_text(value), color=colour, **TEXT_STYLE))
        axes.set_xticks(range(len(estimators)), estimators, rotation=NAMES_ANGLE_DEG, ha="left", rotation_mode="anchor")
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(cases)), cases)
        axes.tick_params(length=0)
        axes.grid(visible=False)
        gap = BAR_GAP_INCHES / height_inches
        bar = figure.colorbar(image, ax=axes, location="bottom", pad=gap, shrink=0.6, aspect=40)
        bar.set_label(METRICS[metric].heading)
        label_plainly(bar.ax.xaxis)

        figure.draw_without_rendering()  # computes the widths of cells and texts
        cell_width_px = axes.get_window_extent().width / len(estimators)
        for status in statuses:
            status.set_visible(_fits(status, cell_width_px))
        numbers_fit = all(_fits(number, cell_width_px) for number in numbers)
        for number in numbers:
            number.set_visible(numbers_fit)
    return figure


def _fits(text: Text, cell_width_px: float) -> bool:
    return float(text.get_window_extent().width) <= cell_width_px


def _number_text(value: float) -> str:
    """A number with two significant digits and at most two decimals, or with one digit if it is smaller than that."""
    if value >= WITHOUT_DECIMALS_FROM:
        return f"{value:.0f}"
    if value >= 1:
        return f"{value:.1f}"
    return f"{value:.2f}" if value >= WITH_TWO_DECIMALS_FROM else f"{value:.1g}"


def _values(board: Board, metric: str) -> Array:
    """The medians (cases, estimators) of a metric; NaN if there is none, infinite if all trials failed.

    An estimator that lacks a sensor in a case has no value there.
    """
    values = np.full((len(board.cases), len(board.estimators)), np.nan)
    for row, case in enumerate(board.cases):
        for column, estimator in enumerate(board.estimators):
            cell = board.cell(case, estimator)
            if cell is None or cell.status == NOT_APPLICABLE:
                continue
            spread = cell.spread(metric)
            if spread is not None:
                values[row, column] = spread[0]
            elif cell.failed:
                values[row, column] = inf
    return values


def _is_dark(value: float, least: float, largest: float, *, higher_is_better: bool) -> bool:
    """Whether the colour of a value in a logarithmic range is dark. A value of 0 has no colour, and is on white."""
    if value <= 0:
        return False
    share = (log10(value) - log10(least)) / (log10(largest) - log10(least))
    return share < DARK_BELOW if higher_is_better else share > DARK_BELOW


def _write_status(axes: Axes, cell: Cell | None, column: int, row: int) -> Text:
    """Hatch a cell in which all trials failed, and write its status."""
    hatched = Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor="none", hatch="////", edgecolor=NEUTRAL, lw=0)
    axes.add_patch(hatched)
    status = cell.status if cell else ""
    background = {"facecolor": "white", "edgecolor": "none", "pad": 1}  # the hatching would cross the letters
    return axes.text(column, row, status, color="black", bbox=background, **TEXT_STYLE)
