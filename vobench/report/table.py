"""A board as text: for a terminal, Markdown, CSV, LaTeX or JSON."""

import json
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

from vobench.report.leaderboard import Board, Row

if TYPE_CHECKING:
    import pandas as pd


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


# Heading and cell of each column, as people read them.
COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("#", lambda row: str(row.rank)),
    ("estimator", lambda row: row.estimator),
    ("status", lambda row: row.status),
    ("survived", lambda row: f"{row.survived}/{row.runs}"),
    ("ATE mm", lambda row: _number(row.ate_mm, 2)),
    ("segments %", lambda row: _number(row.segment_percent, 3)),
    ("RPE mm/frame", lambda row: _number(row.rpe_mm, 3)),
    ("RPE °/frame", lambda row: _number(row.rpe_deg, 4)),
    ("coverage", lambda row: _number(row.coverage, 3)),
    ("CPU ms/frame", lambda row: _number(row.ms_per_frame, 1)),
)
HEADINGS = tuple(heading for heading, _ in COLUMNS)
LEGEND = (
    "ATE: RMSE of position after SE(3) alignment; segments: mean drift over 0.5 to 2 m "
    "(5 to 40 m on paths from 40 m on, 100 to 800 m from 300 m on); "
    "RPE: RMSE from frame to frame. Errors are means over the runs that survived, of cases that move."
)


def cells(row: Row) -> list[str]:
    """The cells of one line, in the order of HEADINGS."""
    return [cell(row) for _, cell in COLUMNS]


def notes(row: Row) -> list[str]:
    """What a line's numbers don't say: how it failed, how far it drifted standing still, what its frames lacked."""
    said = [f"{row.status}: {row.reason}"] if row.reason else []
    if row.drift_mm is not None:
        said.append(f"stood still: drift {row.drift_mm:.1f} mm")
    if row.frame_reason:
        frames = "1 frame" if row.frame_reason_count == 1 else f"{row.frame_reason_count} frames"
        over = f" of {row.runs} runs" if row.runs > 1 else ""
        said.append(f'{frames}{over} "{row.frame_reason}", first at frame {row.frame_reason_first}')
    return [f"{row.estimator}: {sentence}" for sentence in said]


def markdown(boards: list[Board]) -> str:
    """All boards as Markdown tables, with what went wrong below each."""
    return "\n".join(_markdown_board(board) for board in boards) + f"\n{LEGEND}\n"


def _markdown_board(board: Board) -> str:
    lines = [f"## {board.title}", "", "| " + " | ".join(HEADINGS) + " |", "|" + "---|" * len(HEADINGS)]
    lines += ["| " + " | ".join(cells(row)) + " |" for row in board.rows]
    below = [f"- {note}" for row in board.rows for note in notes(row)]
    return "\n".join([*lines, "", *below, *([""] if below else [])])


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

    table = pd.DataFrame([cells(row) for row in boards[0].rows], columns=[h.replace("%", "\\%") for h in HEADINGS])
    escaped = table.replace({"_": r"\_"}, regex=True).rename(columns={"#": r"\#", "RPE °/frame": r"RPE $^\circ$/frame"})
    text: str = escaped.style.hide(axis="index").to_latex(hrules=True)
    return text


def data_frame(boards: list[Board]) -> "pd.DataFrame":
    """All boards as a pandas table, numbers in full, one row per board and estimator."""
    import pandas as pd

    return pd.DataFrame([{"board": board.title, **asdict(row)} for board in boards for row in board.rows])


FORMATS: dict[str, Callable[[list[Board]], str]] = {"md": markdown, "json": as_json, "csv": csv, "latex": latex}
