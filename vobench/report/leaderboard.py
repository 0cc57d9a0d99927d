"""Scores to ranked boards, and boards as text for a terminal, Markdown, CSV, LaTeX or JSON."""

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby, pairwise
from statistics import fmean
from typing import TYPE_CHECKING, Any

from vobench.run.consistency import Consistency
from vobench.run.estimate import DROPPED
from vobench.run.folder import STATUSES, SURVIVED, TrialScore, value_of
from vobench.run.frames import FrameRow

if TYPE_CHECKING:
    import pandas as pd

NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a board, over one or more trials (`runs` of them): errors are means over those that survived.

    `coverage` and `ms_per_frame`, which is CPU time, are means over all trials; `status` is the worst of them.
    A case that stands still has no errors but `drift_mm`, the largest of its trials; `frame_reason` is the
    commonest that an estimator gave for single frames of a case, as it first stood, at `frame_reason_first`.
    `claims` are the manifest's; `consistency` says what stated covariances are worth, and `revised_…` are errors of
    the poses that came after the last frame; these and `scale_drift_…` are means over survivors that have them.
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
    claims: tuple[str, ...] = ()
    scale_gap: float | None = None
    covered_90: float | None = None
    consistency: str = ""
    revised_ate_mm: float | None = None
    revised_segment_percent: float | None = None
    scale_drift_percent_per_m: float | None = None
    memory_mib: float | None = None
    frames: int = 0
    frames_dropped: int = 0
    deadlines_missed: int = 0


@dataclass(frozen=True, slots=True)
class Board:
    """A ranked table; `title` is a case's name, or says that it is over all of them."""

    title: str
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class EstimatorStatistics:
    """What an estimator answered on a case: mean CPU time of a frame, and its commonest reason for single frames.

    Its processes held `memory_mib` at most.
    Of all frames so many were `dropped`, as `late` answers came after the next frame.
    """

    ms_per_frame: float | None = None
    reason: str = ""
    count: int = 0
    first: int | None = None
    memory_mib: float | None = None
    frames: int = 0
    dropped: int = 0
    late: int = 0


Answered = Mapping[tuple[str, str], EstimatorStatistics]


def answers(trials: Sequence[list[FrameRow]]) -> EstimatorStatistics:
    """What the frames of all trials of one estimator on one case come to.

    Reasons that differ in numbers alone, as `too few tracks (7)` and `(5)`, are one.
    """
    rows = [row for trial in trials for row in trial]
    costs_ms, given = [row.cpu_ms for row in rows if row.cpu_ms is not None], [row for row in rows if row.reason]
    cost_ms = fmean(costs_ms) if costs_ms else None
    statuses = [[row.status for row in trial] for trial in trials]
    late = sum(now == DROPPED != before for each in statuses for before, now in pairwise(each))
    memory_mib = max((row.memory_mib for row in rows if row.memory_mib), default=None)
    pace: dict[str, Any] = {
        "memory_mib": memory_mib,
        "frames": len(rows),
        "dropped": sum(row.status == DROPPED for row in rows),
        "late": late,
    }
    if not given:
        return EstimatorStatistics(cost_ms, **pace)
    kinds = Counter(NUMBER.sub("0", row.reason) for row in given)
    kind, count = min(kinds.items(), key=lambda item: (-item[1], item[0]))
    first = min((row for row in given if NUMBER.sub("0", row.reason) == kind), key=lambda row: row.frame)
    return EstimatorStatistics(cost_ms, first.reason, count, first.frame, **pace)


def boards(scores: Iterable[TrialScore], answered: Answered) -> list[Board]:
    """The board over all cases, then one per case; `answered` is per (case, estimator) and may lack some."""
    every, by_case = list(scores), dict[str, list[TrialScore]]()
    for score in every:
        by_case.setdefault(score.case, []).append(score)
    per_case = [board(case, of_case, answered) for case, of_case in sorted(by_case.items())]
    return [board(f"all {len(by_case)} cases", every, answered), *per_case] if len(by_case) > 1 else per_case


def board(title: str, scores: list[TrialScore], answered: Answered) -> Board:
    """One ranked table of these trials, one row for each estimator."""

    def name(score: TrialScore) -> str:
        return score.estimator

    grouped = [list(group) for _, group in groupby(sorted(scores, key=name), key=name)]
    ranked = sorted((_row(trials, answered) for trials in grouped), key=_place)
    first: dict[tuple[int, int, float], int] = {}
    for number, row in enumerate(ranked, 1):
        first.setdefault(_place(row)[:3], number)
    return Board(title, tuple(replace(row, rank=first[_place(row)[:3]]) for row in ranked))


def _place(row: Row) -> tuple[int, int, float, str]:
    """What a row is sorted by: failures, partial trials, error, and the name so that ties are stable."""
    return row.runs - row.survived, row.partial, float("inf") if row.ate_mm is None else row.ate_mm, row.estimator


def _row(trials: list[TrialScore], answered: Answered) -> Row:
    survivors = [trial for trial in trials if trial.status in SURVIVED]
    moving = [trial for trial in survivors if trial.drift_m is None]
    worst = max(trials, key=lambda trial: STATUSES.index(trial.status))
    found = [answered.get((trial.case, trial.estimator), EstimatorStatistics()) for trial in trials]
    by_case = {trial.case: each for trial, each in zip(trials, found, strict=True)}.values()
    costs_ms = [each.ms_per_frame for each in found if each.ms_per_frame is not None]
    is_one_case = len({trial.case for trial in trials}) == 1
    drifts = [1e3 * trial.drift_m for trial in trials if trial.drift_m is not None and is_one_case]
    said = found[0] if is_one_case else EstimatorStatistics()
    return Row(
        rank=0,
        estimator=trials[0].estimator,
        status=worst.status,
        survived=len(survivors),
        partial=sum(trial.status == "partial" for trial in trials),
        runs=len(trials),
        ate_mm=_mean(moving, "ate_trans", "rmse", 1e3),
        segment_percent=_mean(moving, "kitti_t_rel", "mean", 100),
        rpe_mm=_mean(moving, "rpe_trans", "rmse", 1e3),
        rpe_deg=_mean(moving, "rpe_rot", "rmse", 1),
        coverage=fmean(trial.coverage for trial in trials),
        ms_per_frame=fmean(costs_ms) if costs_ms else None,
        reason=worst.reason if is_one_case or not worst.reason else f"{worst.case}: {worst.reason}",
        drift_mm=max(drifts, default=None),
        frame_reason=said.reason,
        frame_reason_count=said.count,
        frame_reason_first=said.first,
        claims=trials[0].claims,
        memory_mib=max((each.memory_mib for each in by_case if each.memory_mib), default=None),
        frames=sum(each.frames for each in by_case),
        frames_dropped=sum(each.dropped for each in by_case),
        deadlines_missed=sum(each.late for each in by_case),
        scale_drift_percent_per_m=_mean(moving, "scale_drift", "mean", 100),
        revised_ate_mm=_mean(moving, "ate_trans", "rmse", 1e3, revised=True),
        revised_segment_percent=_mean(moving, "kitti_t_rel", "mean", 100, revised=True),
        **_consistency([trial.consistency for trial in survivors if trial.consistency]),
    )


def _consistency(found: list[Consistency]) -> dict[str, Any]:
    """What the covariances of these trials are worth together: the median trial's, for errors of one path go along."""
    if not found:
        return {}
    middle = sorted(found, key=lambda each: each.scale_gap)[len(found) // 2]
    return {"scale_gap": middle.scale_gap, "covered_90": middle.covered_90, "consistency": middle.sentence}


def _mean(
    trials: list[TrialScore], metric: str, statistic: str, scale: float, *, revised: bool = False
) -> float | None:
    scores = [trial.revised if revised else trial.score for trial in trials]
    values = [value for score in scores if (value := value_of(score, metric, statistic)) is not None]
    return scale * fmean(values) if values else None


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


COST, MEMORY = "CPU ms/frame", "MiB"
# Heading and cell of each column, as people read them.
COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("#", lambda row: str(row.rank)),
    ("estimator", lambda row: f"{row.estimator} [{', '.join(row.claims)}]" if row.claims else row.estimator),
    ("status", lambda row: row.status),
    ("survived", lambda row: f"{row.survived}/{row.runs}"),
    ("ATE mm", lambda row: _number(row.ate_mm, 2)),
    ("segments %", lambda row: _number(row.segment_percent, 3)),
    ("RPE mm/frame", lambda row: _number(row.rpe_mm, 3)),
    ("RPE °/frame", lambda row: _number(row.rpe_deg, 4)),
    ("coverage", lambda row: _number(row.coverage, 3)),
    (COST, lambda row: _number(row.ms_per_frame, 1)),
    (MEMORY, lambda row: _number(row.memory_mib, 0)),
)
HEADINGS = tuple(heading for heading, _ in COLUMNS)
LEGEND = (
    "ATE: RMSE of position after SE(3) alignment, Sim(3) for those marked so; segments: mean drift over 0.5 to 2 m "
    "(5 to 40 m on paths from 40 m on, 100 to 800 m from 300 m on); "
    "RPE: RMSE from frame to frame. Errors are means over the trials that survived, of cases that move."
)


def lines_of(board: Board) -> list[list[str]]:
    """The headings, then the cells of each row; the columns of costs are left out where no row has one."""
    is_timed = any(row.ms_per_frame is not None for row in board.rows)
    shown = [(heading, cell) for heading, cell in COLUMNS if is_timed or heading not in (COST, MEMORY)]
    return [[heading for heading, _ in shown], *([cell(row) for _, cell in shown] for row in board.rows)]


def notes(row: Row) -> list[str]:
    """What a line's numbers don't say: how it failed, how far it drifted standing still, what its frames lacked."""
    said = [f"{row.status}: {row.reason}"] if row.reason else []
    if row.drift_mm is not None:
        said.append(f"stood still: drift {row.drift_mm:.1f} mm")
    if row.frames_dropped:
        missed = f"{row.deadlines_missed} deadline{'' if row.deadlines_missed == 1 else 's'} missed"
        said.append(f"real time: {missed}, {row.frames_dropped} of {row.frames} frames dropped")
    if row.revised_ate_mm is not None:
        drift = _number(row.revised_segment_percent, 3)
        said.append(f"after the fact: ATE {row.revised_ate_mm:.2f} mm, segments {drift} %")
    if row.scale_drift_percent_per_m is not None:
        said.append(f"aligned with a scale, which drifts by {row.scale_drift_percent_per_m:+.2g} % a metre")
    if row.consistency:
        said.append(row.consistency)
    if row.frame_reason:
        frames = "1 frame" if row.frame_reason_count == 1 else f"{row.frame_reason_count} frames"
        over = f" of {row.runs} trials" if row.runs > 1 else ""
        said.append(f'{frames}{over} "{row.frame_reason}", first at frame {row.frame_reason_first}')
    return [f"{row.estimator}: {sentence}" for sentence in said]


def markdown(boards: list[Board]) -> str:
    """All boards as Markdown tables, with what went wrong below each."""
    lines = list[str]()
    for board in boards:
        headings, *rows = ["| " + " | ".join(cells) + " |" for cells in lines_of(board)]
        below = [f"- {note}" for row in board.rows for note in notes(row)]
        lines += [f"## {board.title}", "", headings, "|" + "---|" * (headings.count("|") - 1), *rows, "", *below]
        lines += [""] if below else []
    return "\n".join([*lines, LEGEND, ""])


def as_json(boards: list[Board]) -> str:
    """All boards as one JSON object, numbers in full."""
    content = {"boards": [{"title": b.title, "rows": [asdict(row) for row in b.rows]} for b in boards]}
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def csv(boards: list[Board]) -> str:
    """All boards as one CSV table, with the board's title in front."""
    text: str = data_frame(boards).to_csv(index=False)
    return text


def latex(boards: list[Board]) -> str:
    """The first board as a LaTeX table with booktabs rules."""
    import pandas as pd

    headings, *rows = lines_of(boards[0])
    table = pd.DataFrame(rows, columns=[heading.replace("%", "\\%") for heading in headings])
    escaped = table.replace({"_": r"\_"}, regex=True).rename(columns={"#": r"\#", "RPE °/frame": r"RPE $^\circ$/frame"})
    text: str = escaped.style.hide(axis="index").to_latex(hrules=True)
    return text


def data_frame(boards: list[Board]) -> "pd.DataFrame":
    """All boards as a pandas table, numbers in full, one row per board and estimator."""
    import pandas as pd

    return pd.DataFrame([{"board": board.title, **asdict(row)} for board in boards for row in board.rows])


FORMATS: dict[str, Callable[[list[Board]], str]] = {"md": markdown, "json": as_json, "csv": csv, "latex": latex}
