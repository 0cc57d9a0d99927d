"""Figures of trajectories: from above, and as x, y and z over time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vobench.geometry.se3 import Array
from vobench.report.figure_style import LINE_WIDTH, line_style
from vobench.report.inline_figure import new_figure
from vobench.report.scored_case import ScoredCase, ScoredEstimate
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory

RELATIVE_SIZE = 1.5  # the side of the square view from above, relative to the longer side of the ground truth
LEAST_HALF_SIDE_M = 0.05  # the smallest half side of that square, which a stationary robot has
LEGEND_INCHES = 0.5  # the height of a legend below the axes
ROW_HEIGHT = 0.32  # the height of the axes of one coordinate, relative to the width of the figure
RELATIVE_MARGIN = 0.25  # the margin around a coordinate over time, relative to its range in the ground truth
LEAST_MARGIN = 0.05  # the smallest margin, relative to the largest range of the three coordinates
LEAST_RANGE_M = 0.1  # the smallest range that is assumed, which a stationary robot has
TRUTH_STYLE: Any = {"color": "black", "lw": 2.2, "alpha": 0.45}


def path_figure(case: ScoredCase, width_inches: float) -> Figure:
    """The ground truth and the aligned estimates of a case from above."""
    with new_figure(width_inches, width_inches + LEGEND_INCHES) as figure:
        axes = figure.subplots()
        draw_paths(axes, case)
        figure.suptitle(case.name)
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def draw_paths(axes: Axes, case: ScoredCase) -> None:
    """Draw a case from above. An estimate without a score appears only in the legend, without a line.

    The view is limited to a square around the ground truth, so that a diverged estimate cannot shrink the other paths.
    The legend says which estimates leave it.
    """
    _limit_to_truth(axes, case.truth)
    x_m, y_m, _ = case.truth.positions_m.T
    axes.plot(x_m, y_m, **TRUTH_STYLE, label="ground truth")
    axes.plot(x_m[:1], y_m[:1], "o", color="black", ms=4, label="start")
    for estimate in case.estimates:
        estimate_m = _positions_with_gaps(estimate)
        leaves = _exceeds(estimate_m[:, 0], axes.get_xlim()) or _exceeds(estimate_m[:, 1], axes.get_ylim())
        axes.plot(*estimate_m[:, :2].T, **_estimate_style(estimate, leaves_view=leaves))
        _mark_end(axes, estimate)
    axes.set(xlabel="x (m)", ylabel="y (m)")


def _exceeds(values: Array, limits: tuple[float, float]) -> bool:
    """Whether any of some values (N,), or NaN, is outside of limits."""
    low, high = limits
    return bool(np.any((values < low) | (values > high)))


def _estimate_style(estimate: ScoredEstimate, *, leaves_view: bool) -> dict[str, Any]:
    """The line of an estimate and its label. Without a score, there is a label only."""
    style = {"lw": LINE_WIDTH, **line_style(estimate.index)}
    if estimate.score is None:
        style["ls"] = "none"
    label = f"{estimate.label}, leaves the view" if leaves_view else estimate.label
    return {**style, "label": label}


def _mark_end(axes: Axes, estimate: ScoredEstimate) -> None:
    """Mark the last pose of an estimate that ends before the ground truth does."""
    score = estimate.score
    if score is None or not score.coverage.ends_lost:
        return
    x_m, y_m, _ = score.aligned_positions_m[-1]
    colour = line_style(estimate.index)["color"]
    axes.plot([x_m], [y_m], "x", color=colour, ms=6, mew=1.6)


def _limit_to_truth(axes: Axes, truth: Trajectory) -> None:
    """Limit the axes to a square around the ground truth."""
    low_m = truth.positions_m[:, :2].min(axis=0)  # (2,)
    high_m = truth.positions_m[:, :2].max(axis=0)
    centre_x_m, centre_y_m = (low_m + high_m) / 2
    longer_side_m = float((high_m - low_m).max())
    half_side_m = max(longer_side_m * RELATIVE_SIZE / 2, LEAST_HALF_SIDE_M)
    axes.set_xlim(centre_x_m - half_side_m, centre_x_m + half_side_m)
    axes.set_ylim(centre_y_m - half_side_m, centre_y_m + half_side_m)
    axes.set_aspect("equal", adjustable="box")


def axes_figure(case: ScoredCase, width_inches: float) -> Figure:
    """The x, y and z of the ground truth and of the aligned estimates of a case over time."""
    row_height_inches = ROW_HEIGHT * width_inches
    height_inches = 3 * row_height_inches + LEGEND_INCHES
    with new_figure(width_inches, height_inches) as figure:
        rows = figure.subplots(3, 1, sharex=True)
        for axis, axes in enumerate(rows):
            _draw_coordinate(axes, case, axis)
        rows[-1].set_xlabel("time (s)")
        figure.suptitle(case.name)
        handles, labels = rows[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def _draw_coordinate(axes: Axes, case: ScoredCase, axis: int) -> None:
    """Draw one coordinate over time. The view is limited to the range of the ground truth and a margin around it."""
    axes.set_ylim(_limits_m(case.truth, axis))
    start_ns = case.truth.t_ns[0]
    truth_s = (case.truth.t_ns - start_ns) / NS_PER_S
    truth_m = case.truth.positions_m[:, axis]
    axes.plot(truth_s, truth_m, **TRUTH_STYLE, label="ground truth")
    for estimate in case.estimates:
        coordinate_m = _positions_with_gaps(estimate)[:, axis]
        time_s = _times_with_gaps_s(estimate, start_ns)
        style = _estimate_style(estimate, leaves_view=_leaves_a_view(estimate, case.truth))
        axes.plot(time_s, coordinate_m, **style)
    axes.set_ylabel(f"{'xyz'[axis]} (m)")


def _leaves_a_view(estimate: ScoredEstimate, truth: Trajectory) -> bool:
    """Whether any coordinate of an estimate is outside of the limits of its axes."""
    positions_m = _positions_with_gaps(estimate)  # (N, 3)
    return any(_exceeds(positions_m[:, axis], _limits_m(truth, axis)) for axis in range(3))


def _limits_m(truth: Trajectory, axis: int) -> tuple[float, float]:
    """The limits of one coordinate over time: the range of the ground truth, and a margin around it."""
    coordinate_m = truth.positions_m[:, axis]
    low_m = float(coordinate_m.min())
    high_m = float(coordinate_m.max())
    ranges_m = np.ptp(truth.positions_m, axis=0)  # (3,)
    largest_range_m = max(float(ranges_m.max()), LEAST_RANGE_M)
    margin_m = max(RELATIVE_MARGIN * (high_m - low_m), LEAST_MARGIN * largest_range_m)
    return low_m - margin_m, high_m + margin_m


def _positions_with_gaps(estimate: ScoredEstimate) -> Array:
    """The aligned positions (N, 3) of an estimate, with a row of NaN where frames have no pose.

    The array is empty if the estimate has no score.
    """
    if estimate.score is None:
        return np.zeros((0, 3))
    return with_gaps(estimate.score.aligned_positions_m, estimate.score.gt_frames)


def _times_with_gaps_s(estimate: ScoredEstimate, start_ns: int) -> Array:
    """The times (N,) of these positions in seconds since the start of the case."""
    if estimate.score is None:
        return np.zeros(0)
    time_s = (estimate.score.gt_t_ns - start_ns) / NS_PER_S
    return with_gaps(time_s, estimate.score.gt_frames)


def with_gaps(values: Array, frames: Stamps) -> Array:
    """Values (K, ...) of frames (K,), with a row of NaN where frames are missing, so that a line has gaps there."""
    after_gap = np.flatnonzero(np.diff(frames) > 1) + 1
    interrupted: Array = np.insert(np.asarray(values, float), after_gap, np.nan, axis=0)
    return interrupted
