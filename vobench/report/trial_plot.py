"""The paths and errors of several estimators on one case, as one figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from vobench.errors import InputError
from vobench.report.drive_plot import SETTINGS
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.score import score_estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vobench.metric.score import Score
    from vobench.trajectory.trajectory import Trajectory

# Okabe and Ito (2008): colours that colour-blind readers tell apart; black is the ground truth's.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
LINES = ("-", "--", "-.", ":")
SIZE_INCHES = (9.0, 3.6)
NS_PER_S = 1e9


def plot_case(folder: RunFolder, trials: Sequence[TrialScore]) -> "Figure":
    """Draw ground truth and aligned estimates from above, and the position error over time.

    `trials` are of one case. An estimate that cannot be scored is named in the legend and not drawn. Raises InputError
    without a trial.
    """
    if not trials:
        raise InputError("there is no trial to plot")
    import matplotlib as mpl
    from matplotlib.figure import Figure

    case = trials[0].case
    truth = read_tum(folder.case(case) / GROUND_TRUTH)
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        path_axes, error_axes = figure.subplots(1, 2, width_ratios=[1, 1.25])
        figure.suptitle(case, fontweight="bold", x=0.01, ha="left")
        _draw_truth(path_axes, truth)
        for index, trial in enumerate(trials):
            colour = COLOURS[index % len(COLOURS)]
            line = LINES[index // len(COLOURS) % len(LINES)]
            scored = _score(folder, trial, truth)
            _draw_trial(path_axes, error_axes, trial, scored, colour=colour, line=line)
        _finish(path_axes, error_axes)
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


def _finish(path_axes: "Axes", error_axes: "Axes") -> None:
    path_axes.set(xlabel="x (m)", ylabel="y (m)")
    path_axes.set_aspect("equal", adjustable="datalim")
    path_axes.margins(0.1)
    path_axes.legend(loc="best")
    error_axes.set(xlabel="time (s)", ylabel="position error (mm)")
    error_axes.set_ylim(bottom=0)
