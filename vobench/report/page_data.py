"""What the script of a page draws, as JSON values."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from vobench import stop
from vobench.geometry.se3 import Array
from vobench.report.board_metric import COSTS, METRICS
from vobench.report.board_table import ShownCell
from vobench.report.case_facts import case_facts
from vobench.report.cell import Cell, trials_by_cell
from vobench.report.cell_notes import notes
from vobench.report.frame_moment import FrameMoment, worst_moments
from vobench.report.leaderboard import Board
from vobench.report.plot_points import path_points, peak_indices, spread_indices
from vobench.report.thumbnail import Thumbnails
from vobench.runner.estimate import ESTIMATE, LOG
from vobench.runner.folder import SCORE, SURVIVED, RunFolder, TrialScore, read_tum, with_sequence
from vobench.runner.frames import FRAMES, GROUND_TRUTH, FrameRow, read_frames
from vobench.trajectory.align import Alignment
from vobench.trajectory.nanoseconds import NS_PER_S

MOST_DETAILS = 200  # cells that a page can open, the worst of all
THUMBNAIL_WIDTH_PX = 176
FILES = (SCORE, FRAMES, ESTIMATE, LOG, "run.rrd")
MM_PER_M = 1e3
JsonObject = dict[str, Any]
Matrix = Sequence[tuple[str, Sequence[ShownCell]]]


def page_data(
    folder: RunFolder,
    scores: Sequence[TrialScore],
    board: Board,
    matrices: Mapping[str, Matrix],
    *,
    thumbnails: Thumbnails,
    beside: Path | None,
) -> JsonObject:
    """All that the script of a page draws; `matrices` are those of the metrics that it can show.

    `beside` is that of `board_page`.
    """
    details = _Details(folder, board, thumbnails, beside)
    details.add_worst(scores)
    return {
        "cases": board.cases,
        "estimators": board.estimators,
        "metrics": {name: _metric(board, name, matrix) for name, matrix in matrices.items()},
        "details": details.by_cell,
        "truths": details.truth_by_case,
        "accuracy_and_cost": _accuracy_and_cost(board),
        "curves": [asdict(curve) for curve in board.curves],
    }


def _metric(board: Board, name: str, matrix: Matrix) -> JsonObject:
    """The cells of a metric's matrix as text and as numbers."""
    texts = []
    values = []
    for case, shown in matrix:
        texts.append([[cell.text, cell.range, cell.mark, int(cell.failed)] for cell in shown])
        values.append([_median(board.cell(case, estimator), name) for estimator in board.estimators])
    return {
        "higher": METRICS[name].higher_is_better,
        "cost": name in COSTS,
        "text": texts,
        "value": values,
    }


def _median(cell: Cell | None, metric: str) -> float | None:
    """The median of a metric in a cell, None if the cell has none or all of its trials failed."""
    if cell is None:
        return None
    spread = cell.spread(metric)
    has_failed = cell.failed == cell.trials and metric not in COSTS
    if spread is None or has_failed:
        return None
    return spread[0]


def _accuracy_and_cost(board: Board) -> list[JsonObject]:
    """The points of the charts of accuracy against CPU time: estimators with a rank only."""
    return [
        {
            "name": total.estimator,
            "group": total.group,
            "cpu": None if total.machine else total.cpu_ms,  # times of different processors are not drawn together
            "loss": 1 - total.score,
            "on": total.is_efficient,
        }
        for total in board.totals
        if total.rank is not None
    ]


class _Details:
    """What a page shows of its worst cells, by 'row|column', and the true paths of the trials shown, by case."""

    def __init__(self, folder: RunFolder, board: Board, thumbnails: Thumbnails, beside: Path | None) -> None:
        self.by_cell: JsonObject = {}
        self.truth_by_case: JsonObject = {}
        self._folder = folder
        self._board = board
        self._thumbnails = thumbnails
        self._beside = beside

    def add_worst(self, scores: Sequence[TrialScore]) -> None:
        """Add the MOST_DETAILS worst cells, case by case."""
        row_of = {case: row for row, case in enumerate(self._board.cases)}
        column_of = {name: column for column, name in enumerate(self._board.estimators)}
        facts = {score.case: case_facts(self._folder, score.case) for score in scores}
        trials_of = trials_by_cell(with_sequence(scores), facts)

        worst_first = sorted(self._board.cells, key=_by_failures_and_loss)
        for cell in sorted(worst_first[:MOST_DETAILS], key=lambda cell: row_of[cell.case]):
            stop.check()
            trial = _worst_trial(trials_of[cell.case, cell.estimator], cell.losses)
            self._add_truth(trial.case)
            self.by_cell[f"{row_of[cell.case]}|{column_of[cell.estimator]}"] = self._detail(cell, trial)

    def _add_truth(self, case: str) -> None:
        truth = self._folder.case(case) / GROUND_TRUTH
        if case not in self.truth_by_case and truth.is_file():
            self.truth_by_case[case] = path_points(read_tum(truth).positions_m[:, :2])

    def _links(self, place: Path) -> list[list[str]]:
        """The name of each file in the folder of a trial, and the link to it."""
        if self._beside is None:
            return []
        link = quote(os.path.relpath(place, self._beside))
        return [[name, f"{link}/{name}"] for name in FILES if (place / name).is_file()]

    def _detail(self, cell: Cell, trial: TrialScore) -> JsonObject:
        """The error of a trial over time, its path, its worst moments and its files."""
        place = self._folder.estimate(trial.case, trial.estimator, trial.repeat)
        frames = read_frames(place)
        t_s = np.array([row.t_ns for row in frames]) / NS_PER_S
        # (N,), infinite for a frame without a pose
        errors_m = np.array([_error_m(row) for row in frames])
        drawn = peak_indices(np.where(np.isinf(errors_m), -1.0, errors_m))
        path_m = _aligned_path(place, trial)
        return {
            "case": trial.case,
            "trial": trial.repeat,
            "notes": notes(cell),
            "t": [round(float(t_s[index] - t_s[0]), 3) for index in drawn],
            "e": [_error_mm(errors_m[index]) for index in drawn],
            "path": path_points(path_m),
            "pathe": _errors_along_path(errors_m, len(path_m)),
            "thumbs": self._moments(trial.case, worst_moments(frames, errors_m)),
            "files": self._links(place),
            "view": ["--case", trial.case, "--estimator", trial.estimator],
        }

    def _moments(self, case: str, moments: Sequence[FrameMoment]) -> list[JsonObject]:
        """The moments of which there is a picture."""
        shown = []
        for moment in moments:
            picture = self._thumbnails.get(case, moment.frame, THUMBNAIL_WIDTH_PX)
            if picture:
                shown.append({**asdict(moment), "src": picture})
        return shown


def _error_m(row: FrameRow) -> float:
    return inf if row.position_error_m is None else row.position_error_m


def _by_failures_and_loss(cell: Cell) -> tuple[float, float]:
    """A key that sorts the worst cell first."""
    largest_loss = float(np.nanmax([0.0, *cell.losses]))
    return -cell.failed / cell.trials, -largest_loss


def _worst_trial(trials: Sequence[TrialScore], losses: Sequence[float]) -> TrialScore:
    """The trial with the largest loss, of those that failed if there are any; `losses` are in the order of trials."""
    with_losses = list(zip(trials, np.nan_to_num(losses), strict=True))
    failed = [(trial, loss) for trial, loss in with_losses if trial.status not in SURVIVED]
    worst, _ = max(failed or with_losses, key=lambda pair: pair[1])
    return worst


def _aligned_path(place: Path, trial: TrialScore) -> Array:
    """The horizontal positions (N, 2) of an estimate, after the alignment that its score states."""
    if not trial.score or not (place / ESTIMATE).is_file():
        return np.zeros((0, 2))
    alignment = Alignment.from_dict(trial.score["alignment"])
    T_world_frame = alignment.apply(read_tum(place / ESTIMATE).T_world_frame)
    positions_m: Array = T_world_frame[:, :2, 3]
    return positions_m


def _errors_along_path(errors_m: Array, count: int) -> list[float | None]:
    """The error at each drawn point of a path of `count` poses, empty if errors and poses do not correspond."""
    known_m = errors_m[np.isfinite(errors_m)]
    if len(known_m) != count:
        return []
    return [_error_mm(known_m[index]) for index in spread_indices(count)]


def _error_mm(error_m: float) -> float | None:
    """An error with four significant digits, None if it is infinite."""
    return None if np.isinf(error_m) else float(f"{MM_PER_M * error_m:.4g}")
