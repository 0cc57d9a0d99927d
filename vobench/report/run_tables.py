"""A run as pandas tables: one row per estimator, per cell, per trial or per frame."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from vobench.report import board_table
from vobench.report.leaderboard import COSTS, METRICS, Board, lost_aware
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.frames import read_frames

if TYPE_CHECKING:
    import pandas as pd

# What a reader looks at first, in a notebook that shows a few columns.
FIRST_COLUMNS = ("place", "estimator", "score", "ate_percent", "failed", "trials", "cases")
# Of a total, what a table holds as two columns each.
INTERVALS = {"places": "place", "ratio_interval": "loss_ratio"}


def board_frame(board: Board) -> "pd.DataFrame":
    """One row per estimator over all cases, the best first; `group` tells calibrations apart where there are some."""
    import pandas as pd

    rows = []
    for total in board.totals:
        row: dict[str, Any] = asdict(total)
        row["claims"] = ", ".join(total.claims)
        for name, of in INTERVALS.items():
            low, high = row.pop(name) or (None, None)
            row[f"{of}_low"] = low
            row[f"{of}_high"] = high
        rows.append(row)
    table = pd.DataFrame(rows)
    others = [name for name in table.columns if name not in FIRST_COLUMNS]
    return table[[*FIRST_COLUMNS, *others]] if rows else table


def cell_frame(board: Board) -> "pd.DataFrame":
    """One row per case and estimator: of each metric the median, the least and the largest over its trials."""
    import pandas as pd

    return pd.DataFrame(board_table.cell_rows(board))


def trial_frame(scores: Iterable[TrialScore]) -> "pd.DataFrame":
    """One row per trial: its case and the choices that make it, its status, and its metrics."""
    import pandas as pd

    rows = []
    for score in scores:
        row: dict[str, Any] = {
            "case": score.case,
            "estimator": score.estimator,
            "repeat": score.repeat,
            **score.variant,
            "status": score.status,
            "reason": score.reason,
            "coverage": score.coverage,
            "frames": score.frames,
            "path_m": score.path_m,
            "drift_m": score.drift_m,
        }
        for name, metric in METRICS.items():
            if name not in COSTS and name not in row:
                row[name] = metric.of(score)
        row["score"] = lost_aware(score)
        rows.append(row)
    return pd.DataFrame(rows)


def frames_frame(folder: RunFolder, scores: Iterable[TrialScore]) -> "pd.DataFrame":
    """One row per frame of every trial: status, errors after alignment, tracks, exposure, cost."""
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
