"""A board as records: flat rows of numbers in full, and the same as a pandas table, CSV and JSON."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from vobench.report.board_metric import METRICS
from vobench.report.board_table import remarks
from vobench.report.cell import Cell
from vobench.report.leaderboard import Board
from vobench.report.total import Total
from vobench.runner.folder import NO_SEQUENCE, TRUTH_COPY
from vobench.spreadsheet import cell

if TYPE_CHECKING:
    import pandas as pd

Record = dict[str, Any]
ALL_CASES = "all"
# Fields of a total that its record has in another form, or that only the board of all records can tell.
NOT_IN_RECORD = ("claims", "ranks", "error_interval", "ate_percent", "cases")


def as_json(board: Board) -> str:
    """The whole board as one JSON object, with numbers in full; infinite values are null."""
    environment = board.environment
    content = {
        "title": board.title,
        "cells": cell_records(board),
        "totals": [asdict(total) for total in board.totals],
        "curves": [asdict(curve) for curve in board.curves],
        "remarks": remarks(board),
        "visible": board.visible,
        "unmade": [asdict(group) for group in board.unmade],
        "environment": asdict(environment) if environment else None,
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def as_csv(board: Board) -> str:
    """One row per cell and per total, with numbers in full."""
    import pandas as pd

    # Objects stay as they are: a column with a gap would otherwise turn whole numbers into floats.
    table = pd.DataFrame([csv_record(record) for record in records(board)], dtype=object)
    text: str = table.to_csv(index=False, lineterminator="\n")
    return text


def csv_record(record: Record) -> Record:
    """A record whose text no spreadsheet takes for a formula."""
    return {name: cell(value) for name, value in record.items()}


def data_frame(board: Board) -> "pd.DataFrame":
    """The rows of `records` as a pandas table."""
    import pandas as pd

    return pd.DataFrame(records(board))


def records(board: Board) -> list[Record]:
    """One flat row per cell, then one per total with the case `all`, then one per case without a sequence."""
    rows = cell_records(board)
    rows += [_total_record(total) for total in board.totals]
    for group in board.unmade:
        for case in group.cases:
            rows.append({"case": case, "status": NO_SEQUENCE, "reason": group.cause})
    origin = board.environment.facts() if board.environment else {}
    return [{**row, **origin} for row in rows]


def cell_records(board: Board) -> list[Record]:
    """One flat row per cell: of each metric the median, minimum and maximum."""
    return [_cell_record(cell) for cell in board.cells]


def _cell_record(cell: Cell) -> Record:
    frames = cell.answered
    return {
        "case": cell.case,
        "estimator": cell.estimator,
        **asdict(cell.facts),
        "trials": cell.trials,
        "failed": cell.failed,
        **_metric_record(cell),
        "status": cell.status,
        "reason": cell.reason,
        "saw": cell.saw,
        "equals_truth": TRUTH_COPY in cell.claims,
        "drift_mm": cell.drift_mm,
        "scale_gap": cell.scale_gap,
        "consistency": cell.consistency,
        "frame_reason": frames.reason,
        "frame_reason_count": frames.count,
        "frame_reason_first": frames.first,
        "frames": frames.frames,
        "frames_dropped": frames.dropped,
        "deadlines_missed": frames.late,
        "revised_ate_mm": cell.revised_ate_mm,
        "revised_segment_percent": cell.revised_segment_percent,
        "scale_drift_percent_per_m": cell.scale_drift_percent_per_m,
    }


def _metric_record(cell: Cell) -> Record:
    """The median, minimum and maximum of every metric."""
    record: Record = {}
    for name in METRICS:
        median, lowest, highest = cell.spread(name) or (None, None, None)
        record[name] = median
        record[f"{name}_min"] = lowest
        record[f"{name}_max"] = highest
    return record


def _total_record(total: Total) -> Record:
    """A total with the columns of a cell where they mean the same, and each interval as two columns."""
    record = {**asdict(total), "case": ALL_CASES, "ate": total.ate_percent}
    record["rank_min"], record["rank_max"] = total.ranks or (None, None)
    record["ratio_min"], record["ratio_max"] = total.error_interval or (None, None)
    return {name: value for name, value in record.items() if name not in NOT_IN_RECORD}
