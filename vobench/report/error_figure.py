"""Figures of errors after alignment over time or over the path, and of the share of poses below an error."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vobench.geometry.se3 import Array
from vobench.metric.score import Score
from vobench.report.figure_style import LINE_WIDTH, Abscissa, label_plainly, line_style
from vobench.report.inline_figure import new_figure
from vobench.report.path_figure import LEGEND_INCHES, with_gaps
from vobench.report.scored_case import ScoredCase
from vobench.trajectory.nanoseconds import NS_PER_S

LABELS = {"time": "time (s)", "path": "path length (m)"}
ROW_HEIGHT = 0.42  # of one of the two rows, relative to the width of the figure
LOGARITHMIC_FROM = 20.0  # ratio of the largest to the smallest median error above which the axis is logarithmic
LARGEST_RATIO = 1e6  # of the errors that an axis shows
DECADE = 10.0  # below the smallest median, a logarithmic axis ends
HEADROOM = 1.3  # of a logarithmic axis above the largest error
MM_PER_M = 1e3
MILLIMETRES_BELOW_M = 1.0  # a largest median error below this is shown in mm


def error_figure(case: ScoredCase, width_inches: float, *, over: Abscissa = "time") -> Figure:
    """The position and rotation errors of all estimates of a case over time, or over the true path."""
    with new_figure(width_inches, 2 * ROW_HEIGHT * width_inches + LEGEND_INCHES) as figure:
        position_axes, rotation_axes = figure.subplots(2, 1, sharex=True)
        draw_position_errors(position_axes, case, over=over)
        draw_rotation_errors(rotation_axes, case, over=over)
        for estimate in case.estimates:
            if estimate.score is None:  # such an estimate is only named, in the legend
                position_axes.plot([], [], ls="none", label=estimate.label)
        position_axes.set_xlabel("")
        figure.suptitle(case.name)
        handles, labels = position_axes.get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def draw_position_errors(axes: Axes, case: ScoredCase, *, over: Abscissa = "time") -> None:
    """Draw the position errors of all estimates, in mm or m by their size."""
    errors_m = [score.ate_trans_m for _, score in case.scores]
    scale, unit = _length_unit(errors_m)
    for estimate, score in case.scores:
        x = _abscissa(case, score, over)
        y = with_gaps(scale * score.ate_trans_m, score.gt_frames)
        axes.plot(x, y, lw=LINE_WIDTH, label=estimate.label, **line_style(estimate.index))
    axes.set(xlabel=LABELS[over], ylabel=f"position error ({unit})")
    scale_errors_axis(axes, [scale * error_m for error_m in errors_m])


def draw_rotation_errors(axes: Axes, case: ScoredCase, *, over: Abscissa = "time") -> None:
    """Draw the rotation errors of all estimates in degrees."""
    errors_deg = [score.ate_rot_deg for _, score in case.scores]
    for estimate, score in case.scores:
        x = _abscissa(case, score, over)
        y = with_gaps(score.ate_rot_deg, score.gt_frames)
        axes.plot(x, y, lw=LINE_WIDTH, label=estimate.label, **line_style(estimate.index))
    axes.set(xlabel=LABELS[over], ylabel="rotation error (°)")
    scale_errors_axis(axes, errors_deg)


def _abscissa(case: ScoredCase, score: Score, over: Abscissa) -> Array:
    """The time since the start, or the length of the true path, of each pose, with gaps as in the errors."""
    if over == "time":
        values = (score.gt_t_ns - case.truth.t_ns[0]) / NS_PER_S
    else:
        values = case.truth.distances_m()[score.gt_frames]
    return with_gaps(values, score.gt_frames)


def _length_unit(errors_m: Sequence[Array]) -> tuple[float, str]:
    """The factor from metres to the unit that suits errors, and the unit."""
    medians_m = [float(np.median(error_m)) for error_m in errors_m]
    if max(medians_m, default=0.0) < MILLIMETRES_BELOW_M:
        return MM_PER_M, "mm"
    return 1.0, "m"


def scale_errors_axis(axes: Axes, errors: Sequence[Array]) -> None:
    """Make the vertical axis linear from zero, or logarithmic if the errors (N,) of estimators differ widely.

    They do if the largest median exceeds LOGARITHMIC_FROM times the smallest one. Medians of 0, and such as rounding
    leaves of a single pose, do not count.
    """
    medians = [float(np.median(error)) for error in errors]
    rounding = max(medians, default=0.0) / LARGEST_RATIO
    positive = [median for median in medians if median > rounding]
    if not positive or max(positive) <= LOGARITHMIC_FROM * min(positive):
        axes.set_ylim(bottom=0)
        return
    axes.set_yscale("log")
    lowest = min(positive) / DECADE
    largest = max(float(np.max(error)) for error in errors)
    axes.set_ylim(lowest, largest * HEADROOM)
    label_plainly(axes.yaxis)
