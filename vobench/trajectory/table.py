"""Rows of numbers in text: tolerant of layout, strict about numbers, and every complaint has its line."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps

Rows = NDArray[np.intp]
Unit = Literal["s", "ms", "us", "ns"]
Order = Literal["xyzw", "wxyz"]  # of a quaternion's four numbers

NORM_TOLERANCE = 1e-3  # 4 printed digits leave a norm off by 1e-4; a file in other units or order by far more
DIGITS: dict[Unit, int] = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # decimals down to the nanosecond
WORDS: dict[Unit, str] = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
MAX_NS = 2**63 - 1
SCALAR_FIRST = [1, 2, 3, 0]  # where x, y, z, w stand among w, x, y, z
# Stricter than float(), which also takes 1_000, nan, infinity and the digits of other scripts.
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
PLAIN = re.compile(r"([0-9]{1,9}|[0-8][0-9]{9})\.([0-9]{1,9})")  # seconds as nearly every file has them, below MAX_NS
NUMERIC = re.compile(r"[0-9eE+\-., \t\r\n]*")
EXACT = Context(prec=64, rounding=ROUND_HALF_EVEN)  # digits of seconds; int64 ns need 19


@dataclass(frozen=True, slots=True)
class Table:
    """The numbers of a text, (N, columns), with each row's line number and its first field as it stands."""

    name: str
    lines: Sequence[int]
    first: Sequence[str]
    values: Array

    def place(self, row: int) -> str:
        """File and line of a row, for the error message."""
        return f"{self.name}:{self.lines[row]}"


def content(text: str) -> list[tuple[int, str]]:
    """Line numbers and lines that say something: no byte order mark, comments, blank lines or CR."""
    lines = enumerate(text.removeprefix("\ufeff").split("\n"), 1)
    return [(number, body) for number, line in lines if (body := line.partition("#")[0].strip())]


def read_table(
    rows: Sequence[tuple[int, str]],
    *,
    name: str,
    columns: Sequence[str],
    separator: str | None = None,
    row: str = "a pose",
) -> Table:
    """The numbers of `content`, one per column and line; with a `separator` more columns may follow.

    `row` is what a line stands for, for the error message.
    Raises TrajectoryError naming file, line and value for what is no finite number.
    """
    bodies = [body for _, body in rows]
    values = _read_fast(bodies, len(columns), separator)
    if values is None:
        values = _read_checked(rows, name, columns, separator, row)
    first = [body.split(separator, 1)[0].strip() for body in bodies]
    return Table(name, [number for number, _ in rows], first, values)


def stamps_ns(table: Table, unit: Unit) -> Stamps:
    """The first column, exact to the nanosecond. Raises TrajectoryError unless it increases within int64."""
    t_ns = _all_ns(table, unit)
    _require_rising(table, t_ns, "stamps must increase by 1 ns or more", least=1)
    return t_ns


def first_stamps_ns(table: Table, unit: Unit) -> tuple[Stamps, Rows, tuple[str, ...]]:
    """The stamps, the rows (K,) that they are of, and a note where rows with the stamp of the one before are left out.

    Raises TrajectoryError where stamps go back or leave int64.
    """
    return first_of_equal(table, _all_ns(table, unit), "stamp")


def first_of_equal(table: Table, numbers: Stamps, what: str) -> tuple[Stamps, Rows, tuple[str, ...]]:
    """Of the rows' numbers (N,), such as stamps, the first of those that repeat; rows and note as `first_stamps_ns`."""
    _require_rising(table, numbers, f"{what}s must increase", least=0)
    rows = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1))
    again = np.flatnonzero(np.diff(numbers) == 0) + 1
    if not again.size:
        return numbers, rows, ()
    place = f"the first at {table.place(again[0])}"
    note = f"rows that repeat the {what} of the row before were left out: {again.size} of {len(numbers)}, {place}"
    return numbers[rows], rows, (note,)


def rotations(table: Table, q: Array, order: Order) -> Array:
    """Rotations (N, 3, 3) of the rows' quaternions (N, 4). Raises TrajectoryError where a norm is not 1."""
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(q, axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > NORM_TOLERANCE)
    if bad.size:
        stated = ", ".join(f"{value:g}" for value in q[bad[0]])
        raise TrajectoryError(
            f"{table.place(bad[0])}: the quaternion's norm should be 1 within {NORM_TOLERANCE}, "
            f"but ({stated}) has {norm[bad[0]]:.6g}"
        )
    unit = q / norm[:, None]
    return se3.from_quaternion(unit[:, SCALAR_FIRST] if order == "wxyz" else unit)


def _all_ns(table: Table, unit: Unit) -> Stamps:
    return np.array([_ns(text, unit, table, row) for row, text in enumerate(table.first)], np.int64)


def _require_rising(table: Table, numbers: Stamps, demand: str, *, least: int) -> None:
    late = np.flatnonzero(np.diff(numbers) < least)
    if late.size:
        last, this = (table.first[late[0] + i] for i in (0, 1))
        raise TrajectoryError(f"{table.place(late[0] + 1)}: {demand}, but {this} follows {last}")


def _read_fast(bodies: list[str], columns: int, separator: str | None) -> Array | None:
    """What NumPy reads in one go, None where anything is odd and wants a sentence."""
    if not bodies or not all(map(NUMERIC.fullmatch, bodies)):
        return None
    try:
        wanted = range(columns) if separator else None
        values = np.loadtxt(bodies, comments=None, delimiter=separator, usecols=wanted, ndmin=2)
    except ValueError:
        return None
    return values if values.shape[1] == columns and np.isfinite(values).all() else None


def _read_checked(
    rows: Sequence[tuple[int, str]], name: str, columns: Sequence[str], separator: str | None, what: str
) -> Array:
    values = np.empty((len(rows), len(columns)))
    for row, (number, body) in enumerate(rows):
        fields = [field.strip() for field in body.split(separator)]
        end = " (the last row: was the file cut off?)" if row == len(rows) - 1 and row else ""
        if len(fields) < len(columns) or (len(fields) > len(columns) and not separator):
            raise TrajectoryError(
                f"{name}:{number}: {what} has {len(columns)} columns ({' '.join(columns)}), "
                f"this line has {len(fields)}{end}"
            )
        values[row] = _numbers(fields, f"{name}:{number}", columns)
    return values


def _numbers(fields: list[str], place: str, columns: Sequence[str]) -> list[float]:
    return [_number(field, column, place) for field, column in zip(fields, columns, strict=False)]


def _number(field: str, column: str, place: str) -> float:
    if not NUMBER.fullmatch(field):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but is {field!r}")
    value = float(field)
    if not np.isfinite(value):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but {field} overflows")
    return value


def _ns(text: str, unit: Unit, table: Table, row: int) -> int:
    if unit == "s" and (plain := PLAIN.fullmatch(text)):
        return int(plain[1]) * 10**9 + int(plain[2].ljust(9, "0"))
    scaled = Decimal(text).scaleb(DIGITS[unit], EXACT)
    if abs(scaled) > MAX_NS:
        most = Decimal(MAX_NS).scaleb(-DIGITS[unit], EXACT)
        raise TrajectoryError(
            f"{table.place(row)}: t should be {WORDS[unit]} below {most}, but is {text} (is it in another unit?)"
        )
    return int(scaled.to_integral_value(context=EXACT))
