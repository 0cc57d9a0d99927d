"""A board as records, which are flat rows of unrounded numbers, and as a pandas table, CSV and JSON."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from vobench import spreadsheet
from vobench.report.board_metric import METRICS
from vobench.report.board_table import remarks
from vobench.report.cell import Cell
from vobench.report.leaderboard import Board
from vobench.report.total import Total
from vobench.runner.folder import NO_SEQUENCE, TRUTH_COPY

if TYPE_CHECKING:
    import pandas as pd

Record = dict[str, Any]
ALL_CASES = "all"
# Fields of a total that its record omits. Intervals and the ATE have other columns; claims and cases have none.
NOT_IN_RECORD = ("claims", "ranks", "error_interval", "ate_percent", "cases")


def as_json(board: Board) -> str:
    """The whole board as one JSON object, with unrounded numbers. Infinite values are null."""
    return json.dumps(json_content(board), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def json_content(board: Board) -> Record:
    """The object of `as_json`."""
    environment = board.environment
    return {
        "title": board.title,
        "cells": cell_records(board),
        "totals": [asdict(total) for total in board.totals],
        "curves": [asdict(curve) for curve in board.curves],
        "remarks": remarks(board),
        "visible": board.visible,
        "unmade": [asdict(group) for group in board.unmade],
        "environment": asdict(environment) if environment else None,
    }


def as_csv(board: Board) -> str:
    """The rows of `records` as the text of a CSV file, with unrounded numbers."""
    import pandas as pd

    # With another dtype than object, pandas would turn the integers of a column with missing values into floats.
    csv_records = [csv_record(record) for record in records(board)]
    table = pd.DataFrame(csv_records, dtype=object)
    text: str = table.to_csv(index=False, lineterminator="\n")
    return text


def csv_record(record: Record) -> Record:
    """A record as cells of a CSV file, in which no text can be executed as a formula by a spreadsheet."""
    return {name: spreadsheet.cell(value) for name, value in record.items()}


def data_frame(board: Board) -> "pd.DataFrame":
    """The rows of `records` as a pandas table."""
    import pandas as pd

    return pd.DataFrame(records(board))


def records(board: Board) -> list[Record]:
    """One flat row per cell, then one per total with the case `all`, then one per case without a sequence.

    Each row ends with the facts about the environment in which the run was made.
    """
    rows = cell_records(board)
    rows += [_total_record(total) for total in board.totals]
    for group in board.unmade:
        for case in group.cases:
            rows.append({"case": case, "status": NO_SEQUENCE, "reason": group.cause})
    environment_facts = board.environment.facts() if board.environment else {}
    return [{**row, **environment_facts} for row in rows]


def cell_records(board: Board) -> list[Record]:
    """One flat row per cell. It has the median, minimum and maximum of each metric."""
    return [_cell_record(cell) for cell in board.cells]


def _cell_record(cell: Cell) -> Record:
    """The row of a cell, with statistics of its trials and of the frames of all trials."""
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
