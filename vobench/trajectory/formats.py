"""Trajectory files in the formats of TUM, KITTI, EuRoC and TartanAir, recognised by their content."""

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
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory

Rows = NDArray[np.intp]
StampUnit = Literal["s", "ms", "us", "ns"]
QuaternionOrder = Literal["xyzw", "wxyz"]  # of a quaternion's four numbers

NORM_TOLERANCE = 1e-3  # 4 printed digits change a norm by 1e-4; other units or another order by far more
DIGITS: dict[StampUnit, int] = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # decimals down to the nanosecond
WORDS: dict[StampUnit, str] = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
MAX_NS = 2**63 - 1
SCALAR_LAST = [1, 2, 3, 0]  # the places of x, y, z, w among w, x, y, z
SCALAR_FIRST = [3, 0, 1, 2]  # the places of w, x, y, z among x, y, z, w
# Stricter than float(), which also takes 1_000, nan, infinity and the digits of other scripts.
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
PLAIN = re.compile(r"([0-9]{1,9}|[0-8][0-9]{9})\.([0-9]{1,9})")  # seconds as nearly every file has them, below MAX_NS
NUMERIC = re.compile(r"[0-9eE+\-., \t\r\n]*")
EXACT = Context(prec=64, rounding=ROUND_HALF_EVEN)  # digits of seconds; int64 ns need 19


@dataclass(frozen=True, slots=True)
class TrajectoryTable:
    """The numbers of a text, (N, columns), with the line number and the text of the first field of each row."""

    name: str
    lines: Sequence[int]
    first: Sequence[str]
    values: Array

    def place(self, row: int) -> str:
        """File and line of a row, for the error message."""
        return f"{self.name}:{self.lines[row]}"


def content(text: str) -> list[tuple[int, str]]:
    """Line numbers and lines with content: no byte order mark, comments, blank lines or CR."""
    rows = []
    lines = text.removeprefix("\ufeff").split("\n")
    for number, line in enumerate(lines, 1):
        body = line.partition("#")[0].strip()
        if body:
            rows.append((number, body))
    return rows


def read_table(
    rows: Sequence[tuple[int, str]],
    *,
    name: str,
    columns: Sequence[str],
    separator: str | None = None,
    row: str = "a pose",
) -> TrajectoryTable:
    """The numbers of `content`, one per column and line; with a `separator` more columns may follow.

    `row` is what a line stands for, for the error message.
    Raises TrajectoryError with file, line and value for a field that is not a finite number.
    """
    numbers = [number for number, _ in rows]
    bodies = [body for _, body in rows]
    first = [body.split(separator, 1)[0].strip() for body in bodies]
    values = _read_fast(bodies, len(columns), separator)
    if values is None:
        values = _read_checked(rows, name, columns, separator, row)
    return TrajectoryTable(name, numbers, first, values)


def stamps_ns(table: TrajectoryTable, unit: StampUnit) -> Stamps:
    """The first column, exact to the nanosecond. Raises TrajectoryError unless it increases within int64."""
    t_ns = _all_ns(table, unit)
    _require_rising(table, t_ns, "stamps must increase by 1 ns or more", least=1)
    return t_ns


def first_of_equal(table: TrajectoryTable, numbers: Stamps, what: str) -> tuple[Stamps, Rows, tuple[str, ...]]:
    """The rows' numbers (N,), such as stamps, without repetitions; their rows (K,); and a note of those left out.

    Raises TrajectoryError for decreasing numbers.
    """
    _require_rising(table, numbers, f"{what}s must increase", least=0)
    rows = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1))
    repeated = np.flatnonzero(np.diff(numbers) == 0) + 1
    if not repeated.size:
        return numbers, rows, ()
    place = table.place(repeated[0])
    note = (
        f"rows that repeat the {what} of the row before were left out: {repeated.size} of {len(numbers)}, "
        f"the first at {place}"
    )
    return numbers[rows], rows, (note,)


def rotations(table: TrajectoryTable, q: Array, order: QuaternionOrder) -> Array:
    """Rotations (N, 3, 3) of the rows' quaternions (N, 4). Raises TrajectoryError for a norm other than 1."""
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(q, axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > NORM_TOLERANCE)
    if bad.size:
        row = bad[0]
        values = ", ".join(f"{value:g}" for value in q[row])
        raise TrajectoryError(
            f"{table.place(row)}: the quaternion's norm should be 1 within {NORM_TOLERANCE}, "
            f"but ({values}) has {norm[row]:.6g}"
        )
    q = q / norm[:, None]
    if order == "wxyz":
        q = q[:, SCALAR_LAST]
    return se3.from_quaternion(q)


def _all_ns(table: TrajectoryTable, unit: StampUnit) -> Stamps:
    """The first column in ns."""
    stamps = [_ns(text, unit, table, row) for row, text in enumerate(table.first)]
    return np.array(stamps, np.int64)


def _require_rising(
    table: TrajectoryTable,
    numbers: Stamps,
    demand: str,
    *,
    least: int,
) -> None:
    """Raise TrajectoryError for the first number that is not `least` or more above the one before."""
    late = np.flatnonzero(np.diff(numbers) < least)
    if late.size:
        row = late[0]
        raise TrajectoryError(
            f"{table.place(row + 1)}: {demand}, but {table.first[row + 1]} follows {table.first[row]}"
        )


def _read_fast(bodies: list[str], columns: int, separator: str | None) -> Array | None:
    """The numbers as NumPy reads them at once; None for text that needs a closer look."""
    if not bodies or not all(map(NUMERIC.fullmatch, bodies)):
        return None
    used_columns = range(columns) if separator else None
    try:
        values = np.loadtxt(bodies, comments=None, delimiter=separator, usecols=used_columns, ndmin=2)
    except ValueError:
        return None
    is_valid = values.shape[1] == columns and np.isfinite(values).all()
    return values if is_valid else None


def _read_checked(
    rows: Sequence[tuple[int, str]],
    name: str,
    columns: Sequence[str],
    separator: str | None,
    what: str,
) -> Array:
    """The numbers field by field, with an error message for the first that is wrong."""
    values = np.empty((len(rows), len(columns)))
    for row, (number, body) in enumerate(rows):
        fields = [field.strip() for field in body.split(separator)]
        is_short = len(fields) < len(columns)
        is_long = len(fields) > len(columns) and not separator
        if is_short or is_long:
            is_last = row > 0 and row == len(rows) - 1
            hint = " (the last row: was the file cut off?)" if is_last else ""
            raise TrajectoryError(
                f"{name}:{number}: {what} has {len(columns)} columns ({' '.join(columns)}), "
                f"this line has {len(fields)}{hint}"
            )
        place = f"{name}:{number}"
        values[row] = [_number(field, column, place) for field, column in zip(fields, columns, strict=False)]
    return values


def _number(field: str, column: str, place: str) -> float:
    if not NUMBER.fullmatch(field):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but is {field!r}")
    value = float(field)
    if not np.isfinite(value):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but {field} overflows")
    return value


def _ns(
    text: str,
    unit: StampUnit,
    table: TrajectoryTable,
    row: int,
) -> int:
    """The stamp of a row in ns, rounded to even. Raises TrajectoryError beyond int64."""
    if unit == "s" and (plain := PLAIN.fullmatch(text)):
        whole_s = int(plain[1])
        fraction_ns = int(plain[2].ljust(9, "0"))
        return whole_s * NS_PER_S + fraction_ns
    t_ns = Decimal(text).scaleb(DIGITS[unit], EXACT)
    if abs(t_ns) > MAX_NS:
        limit = Decimal(MAX_NS).scaleb(-DIGITS[unit], EXACT)
        raise TrajectoryError(
            f"{table.place(row)}: t should be {WORDS[unit]} below {limit}, but is {text} (is it in another unit?)"
        )
    return int(t_ns.to_integral_value(context=EXACT))


COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")


def parse_tum(text: str, *, name: str) -> Trajectory:
    """The trajectory in a TUM file's text; `name` is the file, for messages.

    Comments (#), blank lines, tabs and CRLF are accepted. Digits beyond the nanosecond are rounded, ties to even.
    Raises TrajectoryError with file, line and value for a line other than 8 finite numbers, for
    quaternions whose norm is not 1, and for stamps that don't increase.
    """
    table = read_table(content(text), name=name, columns=COLUMNS)
    R = rotations(table, table.values[:, 4:], "xyzw")
    t_ns = stamps_ns(table, "s")
    return Trajectory(t_ns, se3.transform(R, table.values[:, 1:4]))


def format_tum(trajectory: Trajectory) -> str:
    """TUM text: stamps with 9 decimals, exact, and values with all their digits."""
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    rows = np.hstack([trajectory.positions_m, q_xyzw]).tolist()
    lines = []
    for t_ns, row in zip(trajectory.t_ns.tolist(), rows, strict=True):
        lines.append(f"{seconds(t_ns)} {' '.join(map(repr, row))}\n")
    return "".join(lines)


def seconds(t_ns: int) -> str:
    """An instant or duration in ns as seconds with 9 decimals, exact."""
    whole_s, fraction_ns = divmod(abs(t_ns), NS_PER_S)
    sign = "-" if t_ns < 0 else ""
    return f"{sign}{whole_s}.{fraction_ns:09d}"


EUROC_COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")
POSE_STATE = (
    "p_RS_R_x [m]",
    "p_RS_R_y [m]",
    "p_RS_R_z [m]",
    "q_RS_w []",
    "q_RS_x []",
    "q_RS_y []",
    "q_RS_z []",
)
# EuRoC's names for the columns of a state: the pose, then the velocity in the world, then the biases.
STATE = (
    *POSE_STATE,
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)
IN_SECONDS = re.compile(r"\[\s*s(?:ec(?:onds?)?)?\s*\]")
WORD = re.compile(r"[a-df-z]", re.IGNORECASE)  # an e may be an exponent's


def csv_layout(text: str) -> tuple[list[tuple[int, str]], StampUnit, QuaternionOrder]:
    """The rows below a csv's header, the unit of its stamps and the order of its quaternions.

    They follow a header that names w last, or seconds; stamps with a decimal point are seconds.
    """
    first_line = text.removeprefix("\ufeff").lstrip().partition("\n")[0]
    rows = content(text)
    top_row = rows[0][1]
    is_note = first_line.startswith("#") and first_line.count(",") < top_row.count(",")
    if is_note and not any(NUMBER.fullmatch(cell.strip()) for cell in top_row.split(",")):
        first_line = top_row  # the header is not a comment, but stands below one
    title = first_line.lstrip("#")
    header = [""]
    if WORD.search(title):
        header = [cell.strip().lower() for cell in title.split(",")]
        is_comment = first_line.startswith("#")
        rows = rows if is_comment else rows[1:]

    quaternion_names = [cell.partition("[")[0].strip() for cell in header[4:8]]
    last_letters = [name[-1:] for name in quaternion_names]
    order: QuaternionOrder = "xyzw" if last_letters == ["x", "y", "z", "w"] else "wxyz"
    return rows, _unit(header[0], rows), order


def format_euroc(trajectory: Trajectory, more: Array | None = None) -> str:
    """EuRoC's csv, stamps in ns and values with all their digits.

    `more` (N, 3) or (N, 9): velocities in the world, then the biases of gyroscope and accelerometer.
    """
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    columns = [trajectory.positions_m, q_xyzw[:, SCALAR_FIRST]]
    if more is not None:
        columns.append(more)
    values = np.hstack(columns)
    header = ", ".join(STATE[: values.shape[1]])
    return f"#timestamp [ns], {header}\n" + csv_rows(trajectory.t_ns, values)


def csv_rows(t_ns: Stamps, values: Array) -> str:
    """Rows `t,...` of stamps (N,) in ns and values (N, K) with all their digits."""
    lines = []
    for t, row in zip(t_ns.tolist(), values.tolist(), strict=True):
        lines.append(f"{t},{','.join(map(repr, row))}\n")
    return "".join(lines)


def _unit(header: str, rows: list[tuple[int, str]]) -> StampUnit:
    """The unit of the stamps below a header."""
    if "[ns]" in header.replace(" ", ""):
        return "ns"
    has_decimal_point = any("." in body.partition(",")[0] for _, body in rows)
    is_in_seconds = has_decimal_point or IN_SECONDS.search(header)
    return "s" if is_in_seconds else "ns"


KITTI_COLUMNS = (
    *("r11", "r12", "r13", "t1"),
    *("r21", "r22", "r23", "t2"),
    *("r31", "r32", "r33", "t3"),
)
NUMBERED_COLUMNS = ("frame", *KITTI_COLUMNS)
TARTANAIR_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
# KITTI prints six digits, so its matrices are 1e-6 off a rotation; no intended rotation is this far off.
SKEW_TOLERANCE = 1e-3
MAX_FRAME = 10**9


def format_kitti(T: Array) -> str:
    """KITTI text of poses (N, 4, 4) with all their digits."""
    rows = T[:, :3].reshape(-1, len(KITTI_COLUMNS)).tolist()
    lines = [" ".join(map(repr, row)) + "\n" for row in rows]
    return "".join(lines)


def format_times(t_ns: Stamps) -> str:
    """KITTI's file of times (N,): seconds with 9 decimals, exact."""
    return "".join(f"{seconds(t)}\n" for t in t_ns.tolist())


def parse_times(text: str, *, name: str) -> Stamps:
    """Stamps (N,) of a file with one time in seconds per line. Raises TrajectoryError."""
    table = read_table(content(text), name=name, columns=("t",), row="a line of times")
    return stamps_ns(table, "s")


def _require_rotations(table: TrajectoryTable, R: Array) -> None:
    """Raise TrajectoryError for the first matrix (N, 3, 3) that is no rotation."""
    with np.errstate(over="ignore", invalid="ignore"):
        residual = se3.transposed(R) @ R - np.eye(3)
    skew = np.abs(residual).max(axis=(1, 2), initial=0.0)
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
FORMS_WITHOUT_COMMAS = (COLUMNS, KITTI_COLUMNS, NUMBERED_COLUMNS, TARTANAIR_COLUMNS)
FORMS_BY_COLUMNS = {len(columns): columns for columns in FORMS_WITHOUT_COMMAS}
FORMS = (
    f"TUM has {TUM} ({' '.join(COLUMNS)}), KITTI {KITTI}, or {NUMBERED} with a frame number first, "
    f"TartanAir {TARTANAIR}, EuRoC {TUM} and commas"
)


@dataclass(frozen=True, slots=True)
class ParsedTrajectory:
    """Poses (N, 4, 4) and how they were read; stamps, unit and order are None for a format without them.

    `form_unit` is the unit of the format; `frames` (N,) are the frame numbers of poses in a file without stamps;
    `notes` are sentences about rows that were left out.
    """

    t_ns: Stamps | None
    T: Array
    unit: StampUnit | None = None
    form_unit: StampUnit | None = None
    order: QuaternionOrder | None = None
    frames: Stamps | None = None
    notes: tuple[str, ...] = ()

    def stamped_by(self, frames_ns: Stamps) -> Stamps | None:
        """Stamps (N,) for poses without any, from the stamps of all frames; None if their numbers do not match."""
        if self.frames is None:
            has_all = len(frames_ns) == len(self.T)
            return frames_ns if has_all else None
        is_covered = self.frames[-1] < len(frames_ns)
        return frames_ns[self.frames] if is_covered else None


@dataclass(frozen=True, slots=True)
class TrajectoryReading:
    """A trajectory and how it was read: the unit of its stamps and the order of its quaternions, if they have one.

    `form_unit` is the unit of the format; `says_truth`, whether the file is named as ground truth;
    `is_unit_told`, whether the user gave the unit.
    """

    trajectory: Trajectory
    unit: StampUnit | None = "s"
    form_unit: StampUnit | None = "s"
    order: QuaternionOrder | None = "xyzw"
    says_truth: bool = False
    is_unit_told: bool = False


def parse_any(
    written: str,
    *,
    name: str,
    unit: StampUnit | None = None,
    order: QuaternionOrder | None = None,
) -> ParsedTrajectory:
    """The poses in TUM, KITTI, TartanAir or EuRoC text.

    `unit` and `order` override those of the format for stamps and quaternions. Of rows that repeat a stamp the first
    counts. Raises TrajectoryError for a text without poses, an unknown format, or a wrong row.
    """
    first = _first_row(written, name)
    if "," in first:
        rows, header_unit, header_order = csv_layout(written)
        table = read_table(rows, name=name, columns=EUROC_COLUMNS, separator=",")
        return _stamped(table, unit or header_unit, header_unit, order or header_order)

    columns = FORMS_BY_COLUMNS[len(first.split())]
    table = read_table(content(written), name=name, columns=columns)
    order = order or "xyzw"
    if columns is TARTANAIR_COLUMNS:
        R = rotations(table, table.values[:, 3:], order)
        T = se3.transform(R, table.values[:, :3])
        return ParsedTrajectory(None, T, order=order)
    if columns is COLUMNS:
        return _stamped(table, unit or "s", "s", order)
    return _matrices(table)


def _matrices(table: TrajectoryTable) -> ParsedTrajectory:
    """KITTI's poses, the first three rows of each matrix, kept as given; the frame's number may come first."""
    frames = None
    rows = np.arange(len(table.values))
    notes = tuple[str, ...]()
    if table.values.shape[1] == NUMBERED:
        frames, rows, notes = first_of_equal(table, _frame_numbers(table), "frame number")
    matrices = table.values[:, -KITTI:].reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    positions_m = matrices[:, :, 3]
    _require_rotations(table, R)
    T = se3.transform(R[rows], positions_m[rows])
    return ParsedTrajectory(None, T, frames=frames, notes=notes)


def _frame_numbers(table: TrajectoryTable) -> Stamps:
    """The first column (N,) as numbers of frames. Raises TrajectoryError for other numbers."""
    numbers = table.values[:, 0]
    is_whole = numbers == np.floor(numbers)
    is_in_range = (numbers >= 0) & (numbers <= MAX_FRAME)
    bad = np.flatnonzero(~(is_whole & is_in_range))
    if bad.size:
        raise TrajectoryError(
            f"{table.place(bad[0])}: the first of 13 columns should be the number of a frame, whole and from 0 on, "
            f"but is {table.first[bad[0]]}"
        )
    return numbers.astype(np.int64)


def _stamped(
    table: TrajectoryTable,
    unit: StampUnit,
    form_unit: StampUnit,
    order: QuaternionOrder,
) -> ParsedTrajectory:
    """The poses of rows with a stamp, a position and a quaternion."""
    t_ns, rows, notes = first_of_equal(table, _all_ns(table, unit), "stamp")
    R = rotations(table, table.values[:, 4:8], order)
    T = se3.transform(R, table.values[:, 1:4])
    return ParsedTrajectory(t_ns, T[rows], unit, form_unit, order, notes=notes)


def _first_row(written: str, name: str) -> str:
    """The first line with content. Raises TrajectoryError if it has none of the formats."""
    start = written.lstrip()
    if start.startswith(LFS_POINTER):
        raise TrajectoryError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")
    rows = content(written)
    if not rows:
        reason = "all lines are comments" if start else "the file is empty"
        raise TrajectoryError(f"no pose, for {reason}: {name}")
    number, first = rows[0]
    columns = len(first.split())
    if "," not in first and columns not in FORMS_BY_COLUMNS:
        raise TrajectoryError(f"{name}:{number}: no form of trajectory has {columns} columns: {FORMS}")
    return first
