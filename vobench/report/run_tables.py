"""A run as pandas tables: one row per estimator, per cell, per trial or per frame."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from vobench.report.board_metric import COSTS, METRICS, lost_aware
from vobench.report.board_records import cell_records, csv_record
from vobench.report.cell import CaseFacts
from vobench.report.leaderboard import Board
from vobench.report.total import Total
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.frames import read_frames

if TYPE_CHECKING:
    import pandas as pd

Record = dict[str, Any]
NO_FACTS: Mapping[str, CaseFacts] = MappingProxyType({})
CSV_DIGITS = 7  # 0.1 µm of an error of 1 m, and losses (1 - score) of 0.001 to 0.01 %
# The columns that a notebook shows if it has room for few.
FIRST_COLUMNS = ("rank", "estimator", "score", "ate_percent", "failed", "trials", "cases")
# The intervals of a total, which are two columns each, and the names of these.
INTERVALS = {"ranks": "rank", "error_interval": "error_ratio"}


def board_frame(board: Board) -> "pd.DataFrame":
    """One row per estimator over all cases, the best first; the column `group` names the division."""
    import pandas as pd

    table = pd.DataFrame(total_records(board))
    if table.empty:
        return table
    others = [name for name in table.columns if name not in FIRST_COLUMNS]
    return table[[*FIRST_COLUMNS, *others]]


def total_records(board: Board) -> list[Record]:
    """The rows of `board_frame`."""
    return [_total_record(total) for total in board.totals]


def _total_record(total: Total) -> Record:
    record: Record = asdict(total)
    record["claims"] = ", ".join(total.claims)
    for interval, name in INTERVALS.items():
        low, high = record.pop(interval) or (None, None)
        record[f"{name}_low"] = low
        record[f"{name}_high"] = high
    return record


def cell_frame(board: Board) -> "pd.DataFrame":
    """One row per case and estimator: the median, minimum and maximum of each metric over the trials."""
    import pandas as pd

    return pd.DataFrame(cell_records(board))


def trial_frame(scores: Iterable[TrialScore], facts: Mapping[str, CaseFacts] = NO_FACTS) -> "pd.DataFrame":
    """One row per trial: its case and the choices that make it, its place and drive, its status, and its metrics.

    `facts` are those of the cases by name.
    """
    import pandas as pd

    return pd.DataFrame(trial_records(scores, facts))


def trial_csv(scores: Iterable[TrialScore], facts: Mapping[str, CaseFacts]) -> str:
    """The rows of `trial_frame` as CSV, with CSV_DIGITS significant digits. The files of scores have all digits."""
    import pandas as pd

    rows = list[Record]()
    for record in trial_records(scores, facts):
        rounded = {name: _rounded(value) for name, value in record.items()}
        rows.append(csv_record(rounded))
    text: str = pd.DataFrame(rows, dtype=object).to_csv(index=False, lineterminator="\n")
    return text


def _rounded(value: Any) -> Any:
    """A number with CSV_DIGITS significant digits; any other value as it is."""
    return float(f"{value:.{CSV_DIGITS}g}") if isinstance(value, float) else value


def trial_records(scores: Iterable[TrialScore], facts: Mapping[str, CaseFacts]) -> list[Record]:
    """The rows of `trial_frame`."""
    return [_trial_record(score, facts.get(score.case, CaseFacts())) for score in scores]


def _trial_record(score: TrialScore, facts: CaseFacts) -> Record:
    record: Record = {
        "case": score.case,
        "estimator": score.estimator,
        "repeat": score.repeat,
        **score.variant,
        "place": facts.place,
        "place_seed": facts.place_seed,
        "drive_seed": facts.drive_seed,
        "lighting": facts.lighting,
        "noise_seed": facts.noise_seed,
        "scenario": facts.scenario,
        "severity": facts.severity,
        "status": score.status,
        "reason": score.reason,
        "coverage": score.coverage,
        "frames": score.frames,
        "path_m": score.path_m,
        "drift_m": score.drift_m,
    }
    for name, metric in METRICS.items():
        if name not in COSTS and name not in record:
            record[name] = metric.read(score)
    record["score"] = lost_aware(score)
    return record


def frames_frame(folder: RunFolder, scores: Iterable[TrialScore]) -> "pd.DataFrame":
    """One row per frame of every trial: status, errors after alignment, tracks, exposure and cost."""
    import pandas as pd

    tables = []
    for score in scores:
        rows = read_frames(folder.estimate(score.case, score.estimator, score.repeat))
        table = pd.DataFrame([asdict(row) for row in rows])
        table.insert(0, "repeat", score.repeat)
        table.insert(0, "estimator", score.estimator)
        table.insert(0, "case", score.case)
        tables.append(table)
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
