"""The table of the frames of a trial: the answer of the estimator, the error of its pose, and the exposure."""

import csv
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from pydantic import TypeAdapter, ValidationError

from vobench.errors import InputError
from vobench.spreadsheet import cell, value_in

if TYPE_CHECKING:
    from vobench.metric.score import Score

FRAMES = "frames.csv"
TIMES = "times.csv"
# The tables in the store that `write_frames` joins. The first belongs to a sequence, the second to an estimate.
EXPOSURES = "exposures.csv"
ANSWERS = "answers.csv"
GROUND_TRUTH = "ground_truth.tum"
EXPOSURE_COLUMNS = ("frame", "t_ns", "exposure_s", "gain_db")
ANSWER_COLUMNS = ("frame", "status", "reason", "tracks", "inliers", "stats")
COST_COLUMNS = ("wall_ms", "cpu_ms", "memory_mib")
TIME_COLUMNS = ("frame", *COST_COLUMNS)
ERROR_COLUMNS = ("position_error_m", "rotation_error_deg")


@dataclass(frozen=True, slots=True)
class FrameRow:
    """One frame of a trial. Unknown values are None.

    `status` is empty if the estimator did not answer.
    Errors are relative to the truth after the alignment of the score.
    `tracks` and `inliers` are numbers of tracked points.
    `stats` is a JSON object with other numbers of the estimator.
    `wall_ms` and `cpu_ms` are the cost of the answer.
    `memory_mib` is the peak memory of the estimator so far.
    """

    frame: int
    t_ns: int
    status: str
    reason: str
    position_error_m: float | None
    rotation_error_deg: float | None
    tracks: int | None
    inliers: int | None
    exposure_s: float | None
    gain_db: float | None
    stats: str
    wall_ms: float | None
    cpu_ms: float | None
    memory_mib: float | None = None


FRAME_FIELDS = tuple(field.name for field in fields(FrameRow))
COLUMNS = tuple(name for name in FRAME_FIELDS if name not in COST_COLUMNS)


def write_frames(sequence: Path, estimate: Path, scored: "Score | None", folder: Path) -> None:
    """Join the exposures of a sequence, the answers of an estimator and the errors of its poses to one table."""
    answers = {row["frame"]: row for row in read_table(estimate / ANSWERS)}
    errors = _errors(scored) if scored else {}
    with new_table(folder / FRAMES, COLUMNS) as table:
        for row in read_table(sequence / EXPOSURES):
            answer = answers.get(row["frame"], {})
            error = errors.get(row["t_ns"], {})
            table.writerow({**row, **answer, **error})


def _errors(scored: "Score") -> Mapping[str, Mapping[str, float]]:
    """The cells of ERROR_COLUMNS of each pose, by the stamp of its frame as it is written in the tables."""
    stamps_ns = scored.gt_t_ns.tolist()
    position_errors_m = scored.ate_trans_m.tolist()
    rotation_errors_deg = scored.ate_rot_deg.tolist()

    errors = {}
    for t_ns, *pose_errors in zip(stamps_ns, position_errors_m, rotation_errors_deg, strict=True):
        errors[str(t_ns)] = dict(zip(ERROR_COLUMNS, pose_errors, strict=True))
    return errors


def read_frames(folder: Path) -> list[FrameRow]:
    """The rows of all frames of a trial, joined with the times in the file beside them.

    Raises InputError if the run has no such tables.
    """
    if not (folder / TIMES).is_file():
        raise InputError(f"a run of an older vobench, without a table of times; run the suite again: {folder}")
    times = {row.get("frame", ""): row for row in read_table(folder / TIMES)}
    rows = []
    for row in read_table(folder / FRAMES):
        cost = times.get(row.get("frame", ""), {})
        rows.append(_known_cells({**cost, **row}))
    try:
        return _adapter().validate_python(rows)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(f"not a table of frames as vobench writes it ({place}: {first['msg']}): {folder}") from None


def _known_cells(row: Mapping[str, str]) -> dict[str, str | None]:
    """The cells of a row by column. Empty and missing cells are None, or "" in a column of text."""
    cells: dict[str, str | None] = {}
    for column in fields(FrameRow):
        empty = "" if column.type is str else None
        cells[column.name] = row.get(column.name) or empty
    return cells


@cache
def _adapter() -> TypeAdapter[list[FrameRow]]:
    return TypeAdapter(list[FrameRow])


class TableWriter:
    """Writes the rows of an open CSV file. No spreadsheet executes a cell as a formula."""

    def __init__(self, file: TextIO, columns: Iterable[str]) -> None:
        self._table = csv.DictWriter(file, tuple(columns), lineterminator="\n")
        self._table.writeheader()

    def writerow(self, row: Mapping[str, object]) -> None:
        """Write a row that maps columns to values. Missing cells are empty."""
        self._table.writerow({column: cell(value) for column, value in row.items()})


@contextmanager
def new_table(path: Path, columns: Iterable[str]) -> Iterator[TableWriter]:
    """A writer of a new CSV file."""
    with path.open("w", newline="", encoding="utf-8") as file:
        yield TableWriter(file, columns)


def read_table(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file, which map columns to values."""
    with path.open(newline="", encoding="utf-8") as file:
        return [_values(row) for row in csv.DictReader(file)]


def _values(row: Mapping[str, str]) -> dict[str, str]:
    """The values in the cells of a row.

    The reader adds None or a list to a row that is too short or too long. Such cells are returned as they are.
    """
    return {column: value_in(text) if isinstance(text, str) else text for column, text in row.items()}
