"""The table of a trial's frames: what the estimator said of each, how wrong its pose is, and how it was exposed."""

import csv
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from vobench.errors import InputError

if TYPE_CHECKING:
    from vobench.metric.score import Score

FRAMES = "frames.csv"
TIMES = "times.csv"
# What these are made of: tables in the store, one of a sequence and one of an estimate.
EXPOSURES = "exposures.csv"
ANSWERS = "answers.csv"
GROUND_TRUTH = "ground_truth.tum"
EXPOSURE_COLUMNS = ("frame", "t_ns", "exposure_s", "gain_db")
ANSWER_COLUMNS = ("frame", "status", "reason", "tracks", "inliers", "stats")
TIME_COLUMNS = ("frame", "wall_ms", "cpu_ms", "memory_mib")
ERROR_COLUMNS = ("position_error_m", "rotation_error_deg")


@dataclass(frozen=True, slots=True)
class FrameRow:
    """One frame of a trial; what is not known of it is None.

    `status` is empty where the estimator never answered. The errors are against the truth after the score's
    alignment; `tracks` and `inliers` count the points that were followed; `stats` is a JSON object of what else the
    estimator said. `wall_ms` and `cpu_ms` are what the answer cost, `memory_mib` the most
    that the estimator's processes held so far.
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


COLUMNS = tuple(field.name for field in fields(FrameRow) if field.name not in TIME_COLUMNS[1:])


def write_frames(sequence: Path, estimate: Path, scored: "Score | None", folder: Path) -> None:
    """Join what the store holds of a sequence and of an estimate on it, and the score's errors, in one table."""
    answers = {row["frame"]: row for row in read_table(estimate / ANSWERS)}
    errors = _errors(scored) if scored else {}
    with new_table(folder / FRAMES, COLUMNS) as table:
        for row in read_table(sequence / EXPOSURES):
            table.writerow({**row, **answers.get(row["frame"], {}), **errors.get(row["t_ns"], {})})


def _errors(scored: "Score") -> Mapping[str, Mapping[str, float]]:
    rows = zip(scored.gt_t_ns.tolist(), scored.ate_trans_m.tolist(), scored.ate_rot_deg.tolist(), strict=True)
    return {str(t_ns): dict(zip(ERROR_COLUMNS, errors, strict=True)) for t_ns, *errors in rows}


def read_frames(folder: Path) -> list[FrameRow]:
    """One row for each frame of a trial's sequence, joined with the times in the file beside it.

    Raises InputError where a run has no such tables.
    """
    if not (folder / TIMES).is_file():
        raise InputError(f"a run of an older vobench, without a table of times; run the suite again: {folder}")
    times = {row.get("frame", ""): row for row in read_table(folder / TIMES)}
    nothing = {field.name: "" if field.type is str else None for field in fields(FrameRow)}
    untimed = dict.fromkeys(TIME_COLUMNS, "")
    rows = [{**untimed, **times.get(row.get("frame", ""), {}), **row} for row in read_table(folder / FRAMES)]
    known = [{name: row.get(name) or empty for name, empty in nothing.items()} for row in rows]
    try:
        return _adapter().validate_python(known)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(f"not a table of frames as vobench writes it ({place}: {first['msg']}): {folder}") from None


@cache
def _adapter() -> TypeAdapter[list[FrameRow]]:
    return TypeAdapter(list[FrameRow])


@contextmanager
def new_table(path: Path, columns: Iterable[str]) -> Iterator["csv.DictWriter[str]"]:
    """A CSV file to write rows to, each a cell by its column; a cell that is not given is empty."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, tuple(columns), lineterminator="\n")
        table.writeheader()
        yield table


def read_table(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file, each its cells by their columns."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
