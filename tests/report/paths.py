"""Cases with estimates whose errors are known, for figures."""

import numpy as np

from vobench.metric.score import score
from vobench.report.scored_case import ScoredCase, ScoredEstimate
from vobench.trajectory.trajectory import Trajectory

COUNT = 50
T_S = np.linspace(0, 2, COUNT)
PATH_M = 2.2  # roughly


def path(error_m=0.0, *, start_ns=0):
    """A curved path of 2 m, with an error that grows to `error_m` and cannot be aligned away."""
    T = np.tile(np.eye(4), (COUNT, 1, 1))
    T[:, 0, 3] = T_S
    T[:, 1, 3] = T_S**2 / 4 + error_m * np.sin(9 * T_S)
    return Trajectory((T_S * 1e9).astype(np.int64) + start_ns, T)


def without(trajectory, frames):
    """A trajectory without some of its frames."""
    kept = np.setdiff1d(np.arange(len(trajectory)), frames)
    return Trajectory(trajectory.t_ns[kept], trajectory.T_world_frame[kept])


def case_of(*estimates, truth=None, statuses=None):
    """A case named `bend` with estimates e0, e1, …; None for one without a pose."""
    truth = truth or path()
    statuses = statuses or ["ok"] * len(estimates)
    scored = []
    for index, (estimate, status) in enumerate(zip(estimates, statuses, strict=True)):
        score_of = None if estimate is None else score(truth, estimate)
        scored.append(ScoredEstimate(f"e{index}", index, score_of, status))
    return ScoredCase("bend", truth, tuple(scored))


def labels(axes):
    """The labels of the lines of axes, in order."""
    return [line.get_label() for line in axes.get_lines()]


def line_of(axes, label):
    """The line of axes with a label."""
    return next(line for line in axes.get_lines() if line.get_label() == label)
