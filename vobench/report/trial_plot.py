"""A figure of the paths and position errors of several estimators on one case."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vobench.errors import InputError
from vobench.report.drive_plot import SETTINGS
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.score import score_estimate
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from vobench.metric.score import Score
    from vobench.trajectory.trajectory import Trajectory

# Okabe and Ito (2008): colours that colour-blind readers can distinguish. Their black is used for the ground truth.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
LINES = ("-", "--", "-.", ":")
SIZE_INCHES = (9.0, 3.6)
INLINE_DPI = 110
RELATIVE_PATH_SIZE = 1.5  # side of the square path plot, relative to the longer side of the ground truth
LEAST_HALF_SIDE_M = 0.05  # of the path plot, for a stationary robot
LOGARITHMIC_FROM = 20.0  # ratio of the largest to the smallest median error above which the axis is logarithmic
LINE_WIDTH = 1.2  # points
MM_PER_M = 1e3


class InlineFigure(Figure):
    """A figure that Jupyter displays as a picture, even if pyplot has not been imported."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=INLINE_DPI)
        return buffer.getvalue()


def plot_case(folder: RunFolder, trials: Sequence[TrialScore]) -> Figure:
    """Plot the ground truth and the aligned estimates from above, and the position errors over time.

    `trials` belong to one case. An estimate that cannot be scored appears only in the legend.
    Raises InputError if there are no trials.
    """
    if not trials:
        raise InputError("there is no trial to plot")
    case = trials[0].case
    truth = read_tum(folder.case(case) / GROUND_TRUTH)
    with mpl.rc_context(SETTINGS):
        figure = InlineFigure(figsize=SIZE_INCHES, layout="constrained")
        path_axes, error_axes = figure.subplots(1, 2, width_ratios=[1, 1.25])
        figure.suptitle(case, fontweight="bold", x=0.01, ha="left")
        _draw_truth(path_axes, truth)
        errors_mm = []
        for index, trial in enumerate(trials):
            style = _style(index)
            scored = _score(folder, trial, truth)
            label = _label(trial, is_scored=scored is not None)
            if scored is None:
                _add_to_legend(path_axes, style, label)
                continue
            _draw_path(path_axes, scored, style, label)
            _draw_error(error_axes, scored, style, label)
            errors_mm.append(_errors_mm(scored))
        _finish_path(path_axes, truth)
        _finish_errors(error_axes, errors_mm)
    return figure


def _style(index: int) -> dict[str, Any]:
    """The colour and line style of a trial; the line style changes once all colours are used."""
    colour = COLOURS[index % len(COLOURS)]
    line = LINES[index // len(COLOURS) % len(LINES)]
    return {"color": colour, "ls": line}


def _label(trial: TrialScore, *, is_scored: bool) -> str:
    """The name of the estimator, followed by the status of a trial that did not succeed or has no score."""
    if trial.status == "ok" and is_scored:
        return trial.estimator
    return f"{trial.estimator} ({trial.status})"


def _score(folder: RunFolder, trial: TrialScore, truth: "Trajectory") -> "Score | None":
    """The score of a trial's estimate; None if it cannot be scored."""
    place = folder.estimate(trial.case, trial.estimator, trial.repeat)
    return score_estimate(read_tum(place / ESTIMATE), truth, trial.claims)


def _draw_truth(axes: "Axes", truth: "Trajectory") -> None:
    """Draw the true path from above, and a dot at its start."""
    x_m, y_m, _ = truth.positions_m.T
    axes.plot(x_m, y_m, color="black", lw=2.2, alpha=0.45, label="ground truth")
    axes.plot(x_m[:1], y_m[:1], "o", color="black", ms=4, label="start")


def _add_to_legend(axes: "Axes", style: Mapping[str, Any], label: str) -> None:
    """Add a line to the legend that is not in the plot."""
    axes.plot([], [], **style, label=label)


def _draw_path(axes: "Axes", scored: "Score", style: Mapping[str, Any], label: str) -> None:
    """Draw an aligned estimate from above."""
    x_m, y_m, _ = scored.aligned_positions_m.T
    axes.plot(x_m, y_m, lw=LINE_WIDTH, label=label, **style)


def _draw_error(axes: "Axes", scored: "Score", style: Mapping[str, Any], label: str) -> None:
    """Draw the position error of an estimate over time."""
    time_s = scored.gt_t_ns / NS_PER_S
    axes.plot(time_s, _errors_mm(scored), lw=LINE_WIDTH, label=label, **style)


def _errors_mm(scored: "Score") -> NDArray[np.float64]:
    """The position errors (N,) after alignment."""
    return MM_PER_M * scored.ate_trans_m


def _finish_path(axes: "Axes", truth: "Trajectory") -> None:
    """Label the axes, and limit them to a square around the ground truth.

    A diverged estimate leaves the square instead of shrinking the other paths.
    """
    low_m = truth.positions_m[:, :2].min(axis=0)  # (2,)
    high_m = truth.positions_m[:, :2].max(axis=0)
    center_x_m, center_y_m = (low_m + high_m) / 2
    longer_side_m = float((high_m - low_m).max())
    half_side_m = max(longer_side_m * RELATIVE_PATH_SIZE / 2, LEAST_HALF_SIDE_M)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_xlim(center_x_m - half_side_m, center_x_m + half_side_m)
    axes.set_ylim(center_y_m - half_side_m, center_y_m + half_side_m)
    axes.set_aspect("equal", adjustable="box")
    axes.legend(loc="best")


def _finish_errors(axes: "Axes", errors_mm: Sequence[NDArray[np.float64]]) -> None:
    """Label the axes, and make the axis of errors linear from zero, or logarithmic if the curves differ widely."""
    axes.set(xlabel="time (s)", ylabel="position error (mm)")
    if _differ_widely(errors_mm):
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)


def _differ_widely(curves_mm: Sequence[NDArray[np.float64]]) -> bool:
    """Whether the largest median of the curves exceeds LOGARITHMIC_FROM times the smallest one above 0."""
    medians_mm = [float(np.median(curve_mm)) for curve_mm in curves_mm]
    positive_mm = [median_mm for median_mm in medians_mm if median_mm > 0]
    if not positive_mm:
        return False
    return max(positive_mm) > LOGARITHMIC_FROM * min(positive_mm)
