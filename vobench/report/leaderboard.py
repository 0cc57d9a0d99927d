"""Scores to ranks: one board over all cases, and one per case.

An estimator's place: how many of its runs failed, then how many are partial, then its mean ATE. So no
crash, loss or divergence can rank before an estimator that survived every case.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from statistics import fmean

from vobench.results.run_folder import STATUSES, SURVIVED, RunScore


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a board; errors are means over the runs that survived, None where none did.

    `coverage` and `ms_per_frame`, which is CPU time, are means over all runs; `status` is the worst of them.
    """

    rank: int
    estimator: str
    status: str
    survived: int
    partial: int
    runs: int
    ate_mm: float | None
    segment_percent: float | None
    rpe_mm: float | None
    rpe_deg: float | None
    coverage: float
    ms_per_frame: float | None
    reason: str


@dataclass(frozen=True, slots=True)
class Board:
    """A ranked table; `title` is a case's name, or says that it is over all of them."""

    title: str
    rows: tuple[Row, ...]


def boards(scores: Iterable[RunScore], cost_ms: dict[tuple[str, str], float]) -> list[Board]:
    """The board over all cases, then one per case; cost_ms is per (case, estimator) and may lack some."""
    every = list(scores)
    cases = sorted({score.case for score in every})
    per_case = [board(case, [s for s in every if s.case == case], cost_ms) for case in cases]
    return [board(f"all {len(cases)} cases", every, cost_ms), *per_case] if len(cases) > 1 else per_case


def board(title: str, scores: list[RunScore], cost_ms: dict[tuple[str, str], float]) -> Board:
    """One ranked table of these runs, one row for each estimator."""

    def name(score: RunScore) -> str:
        return score.estimator

    grouped = [list(group) for _, group in groupby(sorted(scores, key=name), key=name)]
    ranked = sorted((_row(runs, cost_ms) for runs in grouped), key=_place)
    rows = [replace(row, rank=1 + sum(_place(other)[:3] < _place(row)[:3] for other in ranked)) for row in ranked]
    return Board(title, tuple(rows))


def _place(row: Row) -> tuple[int, int, float, str]:
    """What a row is sorted by: failures, partial runs, error, and the name so that ties are stable."""
    return row.runs - row.survived, row.partial, float("inf") if row.ate_mm is None else row.ate_mm, row.estimator


def _row(runs: list[RunScore], cost_ms: dict[tuple[str, str], float]) -> Row:
    survivors = [run for run in runs if run.status in SURVIVED]
    worst = max(runs, key=lambda run: STATUSES.index(run.status))
    costs = [cost_ms[run.case, run.estimator] for run in runs if (run.case, run.estimator) in cost_ms]
    return Row(
        rank=0,
        estimator=runs[0].estimator,
        status=worst.status,
        survived=len(survivors),
        partial=sum(run.status == "partial" for run in runs),
        runs=len(runs),
        ate_mm=_mean(survivors, "ate_trans", "rmse", 1e3),
        segment_percent=_mean(survivors, "kitti_t_rel", "mean", 100),
        rpe_mm=_mean(survivors, "rpe_trans", "rmse", 1e3),
        rpe_deg=_mean(survivors, "rpe_rot", "rmse", 1),
        coverage=fmean(run.coverage for run in runs),
        ms_per_frame=fmean(costs) if costs else None,
        reason=f"{worst.case}: {worst.reason}"
        if worst.reason and len({run.case for run in runs}) > 1
        else worst.reason,
    )


def _mean(runs: list[RunScore], metric: str, statistic: str, scale: float) -> float | None:
    values = [value for run in runs if (value := run.value(metric, statistic)) is not None]
    return scale * fmean(values) if values else None
