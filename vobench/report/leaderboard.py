"""Scores to ranks: one board over all cases, and one per case.

An estimator's place: how many of its runs failed, then how many are partial, then its mean ATE. So no
crash, loss or divergence can rank before an estimator that survived every case.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from statistics import fmean

from vobench.results.estimate_file import FrameRow
from vobench.results.run_folder import STATUSES, SURVIVED, RunScore

NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a board; errors are means over the runs that survived, None where none did.

    `coverage` and `ms_per_frame`, which is CPU time, are means over all runs; `status` is the worst of them.
    A case that stands still has no errors but `drift_mm`, the largest of its runs; `frame_reason` is the
    commonest that an estimator gave for single frames of a case, as it first stood, at `frame_reason_first`.
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
    drift_mm: float | None
    frame_reason: str
    frame_reason_count: int
    frame_reason_first: int | None


@dataclass(frozen=True, slots=True)
class Board:
    """A ranked table; `title` is a case's name, or says that it is over all of them."""

    title: str
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Answers:
    """What an estimator answered on a case: mean CPU time of a frame, and its commonest reason for single frames."""

    ms_per_frame: float
    reason: str = ""
    count: int = 0
    first: int | None = None


Answered = Mapping[tuple[str, str], Answers]


def answers(runs: Iterable[list[FrameRow]]) -> Answers | None:
    """What the frames of all runs of one estimator on one case come to; None where it answered none.

    Reasons that differ in numbers alone, as `too few tracks (7)` and `(5)`, are one.
    """
    rows = [row for run in runs for row in run]
    if not rows:
        return None
    cost_ms, given = fmean(row.cpu_ms for row in rows), [row for row in rows if row.reason]
    if not given:
        return Answers(cost_ms)
    kinds = Counter(NUMBER.sub("0", row.reason) for row in given)
    kind, count = min(kinds.items(), key=lambda item: (-item[1], item[0]))
    first = min((row for row in given if NUMBER.sub("0", row.reason) == kind), key=lambda row: row.frame)
    return Answers(cost_ms, first.reason, count, first.frame)


def boards(scores: Iterable[RunScore], answered: Answered) -> list[Board]:
    """The board over all cases, then one per case; `answered` is per (case, estimator) and may lack some."""
    every = list(scores)
    cases = sorted({score.case for score in every})
    per_case = [board(case, [s for s in every if s.case == case], answered) for case in cases]
    return [board(f"all {len(cases)} cases", every, answered), *per_case] if len(cases) > 1 else per_case


def board(title: str, scores: list[RunScore], answered: Answered) -> Board:
    """One ranked table of these runs, one row for each estimator."""

    def name(score: RunScore) -> str:
        return score.estimator

    grouped = [list(group) for _, group in groupby(sorted(scores, key=name), key=name)]
    ranked = sorted((_row(runs, answered) for runs in grouped), key=_place)
    rows = [replace(row, rank=1 + sum(_place(other)[:3] < _place(row)[:3] for other in ranked)) for row in ranked]
    return Board(title, tuple(rows))


def _place(row: Row) -> tuple[int, int, float, str]:
    """What a row is sorted by: failures, partial runs, error, and the name so that ties are stable."""
    return row.runs - row.survived, row.partial, float("inf") if row.ate_mm is None else row.ate_mm, row.estimator


def _row(runs: list[RunScore], answered: Answered) -> Row:
    survivors = [run for run in runs if run.status in SURVIVED]
    moving = [run for run in survivors if run.drift_m is None]
    worst = max(runs, key=lambda run: STATUSES.index(run.status))
    found = [answered[run.case, run.estimator] for run in runs if (run.case, run.estimator) in answered]
    is_one_case = len({run.case for run in runs}) == 1
    drifts = [1e3 * run.drift_m for run in runs if run.drift_m is not None and is_one_case]
    said = found[0] if found and is_one_case else Answers(0.0)
    return Row(
        rank=0,
        estimator=runs[0].estimator,
        status=worst.status,
        survived=len(survivors),
        partial=sum(run.status == "partial" for run in runs),
        runs=len(runs),
        ate_mm=_mean(moving, "ate_trans", "rmse", 1e3),
        segment_percent=_mean(moving, "kitti_t_rel", "mean", 100),
        rpe_mm=_mean(moving, "rpe_trans", "rmse", 1e3),
        rpe_deg=_mean(moving, "rpe_rot", "rmse", 1),
        coverage=fmean(run.coverage for run in runs),
        ms_per_frame=fmean(each.ms_per_frame for each in found) if found else None,
        reason=worst.reason if is_one_case or not worst.reason else f"{worst.case}: {worst.reason}",
        drift_mm=max(drifts, default=None),
        frame_reason=said.reason,
        frame_reason_count=said.count,
        frame_reason_first=said.first,
    )


def _mean(runs: list[RunScore], metric: str, statistic: str, scale: float) -> float | None:
    values = [value for run in runs if (value := run.value(metric, statistic)) is not None]
    return scale * fmean(values) if values else None
