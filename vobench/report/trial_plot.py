"""The paths and errors of several estimators on one case, as one figure."""

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

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

# Okabe and Ito (2008): colours that colour-blind readers can distinguish; black is for the ground truth.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
LINES = ("-", "--", "-.", ":")
SIZE_INCHES = (9.0, 3.6)
INLINE_DPI = 110
MARGIN = 1.5  # the side of the plot of paths, relative to the longer side of the ground truth
LEAST_SPAN_M = 0.05  # from the centre of that plot to its edge
LOGARITHMIC_FROM = 20.0  # the ratio of median errors above which their axis is logarithmic
MM_PER_M = 1e3


class InlineFigure(Figure):
    """A figure that Jupyter shows as a picture, whether pyplot has been imported or not."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=INLINE_DPI)
        return buffer.getvalue()


def plot_case(folder: RunFolder, trials: Sequence[TrialScore]) -> Figure:
    """Draw ground truth and aligned estimates in top view, and the position error over time.

    `trials` are of one case. An estimate that cannot be scored is listed in the legend but not drawn. Raises InputError
    if there is no trial.
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
        for index, trial in enumerate(trials):
            colour = COLOURS[index % len(COLOURS)]
            line = LINES[index // len(COLOURS) % len(LINES)]
            scored = _score(folder, trial, truth)
            _draw_trial(path_axes, error_axes, trial, scored, colour=colour, line=line)
        _finish_path(path_axes, truth)
        _finish_errors(error_axes)
    return figure


def _score(folder: RunFolder, trial: TrialScore, truth: "Trajectory") -> "Score | None":
    place = folder.estimate(trial.case, trial.estimator, trial.repeat)
    return score_estimate(read_tum(place / ESTIMATE), truth, trial.claims)


def _draw_truth(axes: "Axes", truth: "Trajectory") -> None:
    x_m, y_m, _ = truth.positions_m.T
    axes.plot(x_m, y_m, color="black", lw=2.2, alpha=0.45, label="ground truth")
    axes.plot(x_m[:1], y_m[:1], "o", color="black", ms=4, label="start")


def _draw_trial(
    path_axes: "Axes",
    error_axes: "Axes",
    trial: TrialScore,
    scored: "Score | None",
    *,
    colour: str,
    line: str,
) -> None:
    if scored is None:
        path_axes.plot([], [], color=colour, ls=line, label=f"{trial.estimator} ({trial.status})")
        return
    name = trial.estimator if trial.status == "ok" else f"{trial.estimator} ({trial.status})"
    x_m, y_m, _ = scored.aligned_positions_m.T
    path_axes.plot(x_m, y_m, color=colour, ls=line, lw=1.2, label=name)
    time_s = scored.gt_t_ns / NS_PER_S
    error_mm = MM_PER_M * scored.ate_trans_m
    error_axes.plot(time_s, error_mm, color=colour, ls=line, lw=1.2, label=name)


def _finish_path(axes: "Axes", truth: "Trajectory") -> None:
    """Show what is near the ground truth: a diverged estimate leaves the plot instead of shrinking the rest."""
    low_m = truth.positions_m[:, :2].min(axis=0)
    high_m = truth.positions_m[:, :2].max(axis=0)
    centre_m = (low_m + high_m) / 2
    longer_side_m = float((high_m - low_m).max())
    half_m = max(longer_side_m * MARGIN / 2, LEAST_SPAN_M)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_xlim(centre_m[0] - half_m, centre_m[0] + half_m)
    axes.set_ylim(centre_m[1] - half_m, centre_m[1] + half_m)
    axes.set_aspect("equal", adjustable="box")
    axes.legend(loc="best")


def _finish_errors(axes: "Axes") -> None:
    """A linear axis from zero, or a logarithmic one if errors differ too much for a linear axis."""
    axes.set(xlabel="time (s)", ylabel="position error (mm)")
    curves_mm = [np.asarray(line.get_ydata(), float) for line in axes.get_lines()]
    medians_mm = [float(np.median(curve_mm)) for curve_mm in curves_mm]
    positive_mm = [median for median in medians_mm if median > 0]
    if positive_mm and max(positive_mm) > LOGARITHMIC_FROM * min(positive_mm):
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
