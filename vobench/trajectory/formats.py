"""Trajectory files: TUM, KITTI, EuRoC, TartanAir, told apart by their content."""

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
from vobench.trajectory.trajectory import Stamps, Trajectory

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


def first_of_equal(table: Table, numbers: Stamps, what: str) -> tuple[Stamps, Rows, tuple[str, ...]]:
    """Of the rows' numbers (N,), such as stamps, the first of those that repeat, their rows (K,), and a note of others.

    Raises TrajectoryError where numbers go back.
    """
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
        values[row] = [_number(*pair, f"{name}:{number}") for pair in zip(fields, columns, strict=False)]
    return values


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


COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
NS_PER_S = 10**9


def parse_tum(text: str, *, name: str) -> Trajectory:
    """The trajectory in a TUM file's text; `name` is the file, for messages.

    Comments (#), blank lines, tabs and CRLF pass. Digits beyond the nanosecond are rounded, ties to even.
    Raises TrajectoryError naming file, line and value for what is not 8 finite numbers, for
    quaternions whose norm is not 1, and for stamps that don't increase.
    """
    table = read_table(content(text), name=name, columns=COLUMNS)
    R = rotations(table, table.values[:, 4:], "xyzw")
    return Trajectory(stamps_ns(table, "s"), se3.transform(R, table.values[:, 1:4]))


def format_tum(trajectory: Trajectory) -> str:
    """TUM text: stamps with 9 decimals from the integers, values with every digit they have."""
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    positions_m = trajectory.T_world_frame[:, :3, 3]
    rows = zip(trajectory.t_ns.tolist(), positions_m.tolist(), q_xyzw.tolist(), strict=True)
    return "".join(f"{seconds(t)} {' '.join(map(repr, p + q))}\n" for t, p, q in rows)


def seconds(t_ns: int) -> str:
    """An instant or duration in ns as seconds with 9 decimals, exact."""
    whole, part = divmod(abs(t_ns), NS_PER_S)
    return f"{'-' if t_ns < 0 else ''}{whole}.{part:09d}"


EUROC_COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")
# EuRoC's own names, for what a state may say: the pose, then the velocity in the world, then the biases.
STATE = (
    *("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]", "q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)
IN_SECONDS = re.compile(r"\[\s*s(?:ec(?:onds?)?)?\s*\]")
WORD = re.compile(r"[a-df-z]", re.IGNORECASE)  # an e may be an exponent's


def csv_layout(text: str) -> tuple[list[tuple[int, str]], Unit, Order]:
    """The rows below a csv's header, the unit of its stamps and the order of its quaternions.

    A header that names w last, or seconds, is believed; stamps with a decimal point are seconds.
    """
    first = text.removeprefix("\ufeff").lstrip().partition("\n")[0]
    rows = content(text)
    header = [""]
    if WORD.search(first.lstrip("#")):
        header = [cell.strip().lower() for cell in first.lstrip("#").split(",")]
        rows = rows if first.startswith("#") else rows[1:]
    names = [cell.partition("[")[0].strip() for cell in header[4:8]]
    order: Order = "xyzw" if [name[-1:] for name in names] == ["x", "y", "z", "w"] else "wxyz"
    return rows, _unit(header[0], rows), order


def format_euroc(trajectory: Trajectory, more: Array | None = None) -> str:
    """EuRoC's csv, stamps in ns, every digit of the values.

    `more` (N, 3) or (N, 9): velocities in the world, then the biases of gyroscope and accelerometer.
    """
    T = trajectory.T_world_frame
    q_xyzw = se3.to_quaternion(T[:, :3, :3])
    values = np.hstack([T[:, :3, 3], q_xyzw[:, [3, 0, 1, 2]], *([] if more is None else [more])])
    header = ", ".join(STATE[: values.shape[1]])
    return f"#timestamp [ns], {header}\n" + csv_rows(trajectory.t_ns, values)


def csv_rows(t_ns: Stamps, values: Array) -> str:
    """Rows `t,...` of stamps (N,) in ns and values (N, K), every digit of them."""
    rows = zip(t_ns.tolist(), values.tolist(), strict=True)
    return "".join(f"{t},{','.join(map(repr, row))}\n" for t, row in rows)


def _unit(header: str, rows: list[tuple[int, str]]) -> Unit:
    if "[ns]" in header.replace(" ", ""):
        return "ns"
    has_point = any("." in body.partition(",")[0] for _, body in rows)
    return "s" if has_point or IN_SECONDS.search(header) else "ns"


KITTI_COLUMNS = tuple(f"{part}{row}" for row in (1, 2, 3) for part in ("r1", "r2", "r3", "t"))
NUMBERED_COLUMNS = ("frame", *KITTI_COLUMNS)
TARTANAIR_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
# KITTI prints six digits, so its matrices are 1e-6 off a rotation; nothing that means to be one is this far off.
SKEW_TOLERANCE = 1e-3
MAX_FRAME = 10**9


def format_kitti(T: Array) -> str:
    """KITTI text of poses (N, 4, 4), every digit of them."""
    rows = T[:, :3].reshape(-1, len(KITTI_COLUMNS)).tolist()
    return "".join(f"{' '.join(map(repr, row))}\n" for row in rows)


def format_times(t_ns: Stamps) -> str:
    """KITTI's file of times (N,): seconds with 9 decimals, exact."""
    return "".join(f"{seconds(t)}\n" for t in t_ns.tolist())


def parse_times(text: str, *, name: str) -> Stamps:
    """Stamps (N,) of a file with one time in seconds a line. Raises TrajectoryError."""
    return stamps_ns(read_table(content(text), name=name, columns=("t",), row="a line of times"), "s")


def _require_rotations(table: Table, R: Array) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
    bad = np.flatnonzero(~(skew <= SKEW_TOLERANCE))
    if bad.size:
        raise TrajectoryError(
            f"{table.place(bad[0])}: the first three columns of the matrix should be a rotation "
            f"within {SKEW_TOLERANCE}, but R^T R is {skew[bad[0]]:.3g} off the identity"
        )
    mirrored = np.flatnonzero(np.linalg.det(R) < 0)
    if mirrored.size:
        raise TrajectoryError(
            f"{table.place(mirrored[0])}: the rotation is mirrored (its determinant is -1): "
            f"these axes are left-handed, a pose's are right-handed"
        )


LFS_POINTER = "version https://git-lfs.github.com/spec/"
TUM = len(COLUMNS)
KITTI = len(KITTI_COLUMNS)
TARTANAIR = len(TARTANAIR_COLUMNS)
NUMBERED = len(NUMBERED_COLUMNS)
FORMS_BY_COLUMNS = {len(form): form for form in (COLUMNS, KITTI_COLUMNS, NUMBERED_COLUMNS, TARTANAIR_COLUMNS)}
FORMS = (
    f"TUM has {TUM} ({' '.join(COLUMNS)}), KITTI {KITTI}, or {NUMBERED} with a frame number first, "
    f"TartanAir {TARTANAIR}, EuRoC {TUM} and commas"
)


@dataclass(frozen=True, slots=True)
class Parsed:
    """Poses (N, 4, 4) and how they were read; None for stamps, their unit or an order that the form doesn't have.

    `form_unit` is the unit that files of this form should be in; `frames` (N,) are the numbers that a file without
    stamps gives its poses; `notes` say in sentences what was left out.
    """

    t_ns: Stamps | None
    T: Array
    unit: Unit | None = None
    form_unit: Unit | None = None
    order: Order | None = None
    frames: Stamps | None = None
    notes: tuple[str, ...] = ()

    def stamped_by(self, frames_ns: Stamps) -> Stamps | None:
        """Stamps (N,) for poses that have none, out of those of all frames; None where they do not fit together."""
        if self.frames is None:
            return frames_ns if len(frames_ns) == len(self.T) else None
        return frames_ns[self.frames] if self.frames[-1] < len(frames_ns) else None


@dataclass(frozen=True, slots=True)
class Reading:
    """A trajectory and how it was read: its stamps' unit, its quaternions' order, None where that can't be wrong.

    `form_unit` is the unit that such a file should be in; `says_truth`, whether it calls itself ground truth;
    `is_unit_told`, whether somebody who knows gave the unit.
    """

    trajectory: Trajectory
    unit: Unit | None = "s"
    form_unit: Unit | None = "s"
    order: Order | None = "xyzw"
    says_truth: bool = False
    is_unit_told: bool = False


def parse_any(written: str, *, name: str, unit: Unit | None = None, order: Order | None = None) -> Parsed:
    """The poses in TUM, KITTI, TartanAir or EuRoC text.

    `unit` and `order` override what the form says of stamps and quaternions. Of rows that repeat a stamp the first
    counts. Raises TrajectoryError where there is no pose, no such form, or a row is wrong.
    """
    first = _first_row(written, name)
    if "," in first:
        rows, found_unit, found_order = csv_layout(written)
        table = read_table(rows, name=name, columns=EUROC_COLUMNS, separator=",")
        return _stamped(table, unit or found_unit, found_unit, order or found_order)
    columns = FORMS_BY_COLUMNS[len(first.split())]
    table = read_table(content(written), name=name, columns=columns)
    order = order or "xyzw"
    if columns is TARTANAIR_COLUMNS:
        T = se3.transform(rotations(table, table.values[:, 3:], order), table.values[:, :3])
        return Parsed(None, T, order=order)
    return _stamped(table, unit or "s", "s", order) if columns is COLUMNS else _matrices(table)


def _matrices(table: Table) -> Parsed:
    """KITTI's poses, the first three rows of each matrix, kept as given; the frame's number may come first."""
    frames = None
    rows = np.arange(len(table.values))
    notes = tuple[str, ...]()
    if table.values.shape[1] == NUMBERED:
        stated = table.values[:, 0]
        bad = np.flatnonzero((stated != np.floor(stated)) | (stated < 0) | (stated > MAX_FRAME))
        if bad.size:
            raise TrajectoryError(
                f"{table.place(bad[0])}: the first of 13 columns should be the number of a frame, whole and from 0 on, "
                f"but is {table.first[bad[0]]}"
            )
        frames, rows, notes = first_of_equal(table, stated.astype(np.int64), "frame number")
    matrices = table.values[:, -KITTI:].reshape(-1, 3, 4)
    _require_rotations(table, matrices[:, :, :3])
    T = se3.transform(matrices[rows, :, :3], matrices[rows, :, 3])
    return Parsed(None, T, frames=frames, notes=notes)


def _stamped(table: Table, unit: Unit, form_unit: Unit, order: Order) -> Parsed:
    """The poses of rows with a stamp, a position and a quaternion."""
    t_ns, rows, notes = first_of_equal(table, _all_ns(table, unit), "stamp")
    T = se3.transform(rotations(table, table.values[:, 4:8], order), table.values[:, 1:4])
    return Parsed(t_ns, T[rows], unit, form_unit, order, notes=notes)


def _first_row(written: str, name: str) -> str:
    """The first line with something to say. Raises TrajectoryError where it is of none of the forms."""
    start = written.lstrip()
    if start.startswith(LFS_POINTER):
        raise TrajectoryError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")
    number, first = next(iter(content(written)), (0, ""))
    if not first:
        raise TrajectoryError(f"no pose, {'for all lines are comments' if start else 'for the file is empty'}: {name}")
    columns = len(first.split())
    if "," not in first and columns not in FORMS_BY_COLUMNS:
        raise TrajectoryError(f"{name}:{number}: no form of trajectory has {columns} columns: {FORMS}")
    return first
