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

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from vobench.metric.score import Score
    from vobench.trajectory.trajectory import Trajectory

# Okabe and Ito (2008): colours that colour-blind readers tell apart; black is the ground truth's.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
LINES = ("-", "--", "-.", ":")
SIZE_INCHES = (9.0, 3.6)
NS_PER_S = 1e9
INLINE_DPI = 110
MARGIN = 1.5  # the side of the picture of paths, against the longer side of the ground truth
LEAST_SPAN_M = 0.05  # from the centre of that picture to its edge
LOGARITHMIC_FROM = 20.0  # the ratio of median errors from which on their axis is logarithmic


class InlineFigure(Figure):
    """A figure that Jupyter shows as a picture, whether pyplot has been imported or not."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=INLINE_DPI)
        return buffer.getvalue()


def plot_case(folder: RunFolder, trials: Sequence[TrialScore]) -> Figure:
    """Draw ground truth and aligned estimates from above, and the position error over time.

    `trials` are of one case. An estimate that cannot be scored is named in the legend and not drawn. Raises InputError
    without a trial.
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
    error_axes.plot(time_s, 1e3 * scored.ate_trans_m, color=colour, ls=line, lw=1.2, label=name)


def _finish_path(axes: "Axes", truth: "Trajectory") -> None:
    """Show what is around the ground truth: an estimate that diverged leaves the picture instead of shrinking it."""
    low_m = truth.positions_m[:, :2].min(axis=0)
    high_m = truth.positions_m[:, :2].max(axis=0)
    centre_m = (low_m + high_m) / 2
    half_m = max(float((high_m - low_m).max()) * MARGIN / 2, LEAST_SPAN_M)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_xlim(centre_m[0] - half_m, centre_m[0] + half_m)
    axes.set_ylim(centre_m[1] - half_m, centre_m[1] + half_m)
    axes.set_aspect("equal", adjustable="box")
    axes.legend(loc="best")


def _finish_errors(axes: "Axes") -> None:
    """A linear axis from zero, or a logarithmic one where errors differ too much to be seen on it."""
    axes.set(xlabel="time (s)", ylabel="position error (mm)")
    medians_mm = [float(np.median(np.asarray(line.get_ydata(), float))) for line in axes.get_lines()]
    positive_mm = [median for median in medians_mm if median > 0]
    if positive_mm and max(positive_mm) > LOGARITHMIC_FROM * min(positive_mm):
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
