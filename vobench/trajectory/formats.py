"""Reads and writes trajectories in the formats of TUM, KITTI, EuRoC and TartanAir."""

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
QuaternionOrder = Literal["xyzw", "wxyz"]  # in which a file lists the four components of a quaternion

NORM_TOLERANCE = 1e-3  # rounding to 4 digits changes the norm of a quaternion by up to 1e-4
DIGITS: dict[StampUnit, int] = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # decimal places needed to resolve 1 ns
WORDS: dict[StampUnit, str] = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
MAX_NS = 2**63 - 1
SCALAR_LAST = [1, 2, 3, 0]  # indices that reorder (w, x, y, z) to (x, y, z, w)
SCALAR_FIRST = [3, 0, 1, 2]  # indices that reorder (x, y, z, w) to (w, x, y, z)
# Stricter than float(), which also accepts 1_000, nan, infinity and the digits of other scripts.
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
# Seconds with one to nine decimals, as in most files. The integer part is limited so that the stamp is below MAX_NS.
PLAIN = re.compile(r"([0-9]{1,9}|[0-8][0-9]{9})\.([0-9]{1,9})")
NUMERIC = re.compile(r"[0-9eE+\-., \t\r\n]*")  # a line in which only numbers and separators can occur
EXACT = Context(prec=64, rounding=ROUND_HALF_EVEN)  # int64 nanoseconds need only 19 digits


@dataclass(frozen=True, slots=True)
class TrajectoryTable:
    """The numbers in the rows of a text file, and the line number of each row.

    `name` is the file's name, for messages.
    `lines` are the N line numbers, from 1.
    `first` are the first fields of the N rows as text, because a stamp can have more digits than a float.
    `values` are the numbers (N, columns).
    """

    name: str
    lines: Sequence[int]
    first: Sequence[str]
    values: Array

    def place(self, row: int) -> str:
        """The file and line of a row, for messages."""
        return f"{self.name}:{self.lines[row]}"


def content(text: str) -> list[tuple[int, str]]:
    """The number and the text of each line that has content.

    The byte order mark, comments, blank lines and carriage returns are removed.
    """
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
    """The numbers in rows of `content`, one row per line.

    A line must have one field per column. With a `separator`, additional fields are ignored.
    `row` is the noun for one row in error messages.
    Raises TrajectoryError with file, line and value for a field that is not a finite number.
    """
    line_numbers = [number for number, _ in rows]
    bodies = [body for _, body in rows]
    first_fields = [body.split(separator, 1)[0].strip() for body in bodies]
    values = _read_fast(bodies, len(columns), separator)
    if values is None:
        values = _read_checked(rows, name, columns, separator, row)
    return TrajectoryTable(name, line_numbers, first_fields, values)


def stamps_ns(table: TrajectoryTable, unit: StampUnit) -> Stamps:
    """The stamps (N,) in the first column, exact to the nanosecond.

    Raises TrajectoryError if a stamp is not greater than the one before it, or if it exceeds int64.
    """
    t_ns = _first_column_ns(table, unit)
    _require_steps(table, t_ns, least_step=1, demand="stamps must increase by 1 ns or more")
    return t_ns


@dataclass(frozen=True, slots=True)
class _DistinctRows:
    """The rows of a table after repeated stamps or frame numbers have been removed.

    `numbers` (K,) are the stamps or frame numbers of the remaining rows.
    `rows` (K,) are the indices of the remaining rows in the table.
    `notes` has a sentence about the removed rows; it is empty if no row was removed.
    """

    numbers: Stamps
    rows: Rows
    notes: tuple[str, ...]


def _distinct_rows(table: TrajectoryTable, numbers: Stamps, noun: str) -> _DistinctRows:
    """The first row of each run of rows with the same number, given the number (N,) of each row.

    `noun` is the name of these numbers in messages.
    Raises TrajectoryError if a number is smaller than the one before it.
    """
    _require_steps(table, numbers, least_step=0, demand=f"{noun}s must increase")
    repeated = np.flatnonzero(np.diff(numbers) == 0) + 1
    if not repeated.size:
        return _DistinctRows(numbers, np.arange(len(numbers)), ())

    rows = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1))
    note = (
        f"rows that repeat the {noun} of the row before were left out: {repeated.size} of {len(numbers)}, "
        f"the first at {table.place(repeated[0])}"
    )
    return _DistinctRows(numbers[rows], rows, (note,))


def rotations(table: TrajectoryTable, q: Array, order: QuaternionOrder) -> Array:
    """The rotations (N, 3, 3) of quaternions q (N, 4), one per row of the table.

    Raises TrajectoryError for a quaternion whose norm is not 1.
    """
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(q, axis=1)
    wrong_rows = np.flatnonzero(np.abs(norms - 1) > NORM_TOLERANCE)
    if wrong_rows.size:
        row = wrong_rows[0]
        components = ", ".join(f"{value:g}" for value in q[row])
        raise TrajectoryError(
            f"{table.place(row)}: the quaternion's norm should be 1 within {NORM_TOLERANCE}, "
            f"but ({components}) has {norms[row]:.6g}"
        )
    unit_q = q / norms[:, None]
    if order == "wxyz":
        unit_q = unit_q[:, SCALAR_LAST]
    return se3.from_quaternion(unit_q)


def _first_column_ns(table: TrajectoryTable, unit: StampUnit) -> Stamps:
    """The stamps (N,) of the first column."""
    stamps = [_stamp_ns(text, unit, table, row) for row, text in enumerate(table.first)]
    return np.array(stamps, np.int64)


def _require_steps(table: TrajectoryTable, numbers: Stamps, *, least_step: int, demand: str) -> None:
    """Raise TrajectoryError unless each of the numbers (N,) exceeds the one before it by at least `least_step`.

    `demand` is the part of the message that states this requirement.
    """
    wrong_rows = np.flatnonzero(np.diff(numbers) < least_step) + 1
    if wrong_rows.size:
        row = wrong_rows[0]
        raise TrajectoryError(f"{table.place(row)}: {demand}, but {table.first[row]} follows {table.first[row - 1]}")


def _read_fast(bodies: list[str], columns: int, separator: str | None) -> Array | None:
    """The numbers (N, columns), read by NumPy in one call; None if a line has another format or a number overflows."""
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
    noun: str,
) -> Array:
    """The numbers (N, columns), read field by field. Raises TrajectoryError for the first wrong line or field."""
    values = np.empty((len(rows), len(columns)))
    for row, (number, body) in enumerate(rows):
        fields = [field.strip() for field in body.split(separator)]
        is_short = len(fields) < len(columns)
        is_long = len(fields) > len(columns) and not separator
        if is_short or is_long:
            is_last = row > 0 and row == len(rows) - 1
            hint = " (the last row: was the file cut off?)" if is_last else ""
            raise TrajectoryError(
                f"{name}:{number}: {noun} has {len(columns)} columns ({' '.join(columns)}), "
                f"this line has {len(fields)}{hint}"
            )
        place = f"{name}:{number}"
        values[row] = [_number(field, column, place) for field, column in zip(fields, columns, strict=False)]
    return values


def _number(field: str, column: str, place: str) -> float:
    """The number in a field. Raises TrajectoryError if it is not finite."""
    if not NUMBER.fullmatch(field):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but is {field!r}")
    value = float(field)
    if not np.isfinite(value):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but {field} overflows")
    return value


def _stamp_ns(
    text: str,
    unit: StampUnit,
    table: TrajectoryTable,
    row: int,
) -> int:
    """The stamp of a row, rounded to the nanosecond with ties to even. Raises TrajectoryError if it exceeds int64."""
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
    """The trajectory in the text of a TUM file; `name` is the file's name, for messages.

    Comments (#), blank lines, tabs and CRLF are accepted. Stamps are rounded to the nanosecond, ties to even.
    Raises TrajectoryError with file, line and value if a line does not consist of 8 finite numbers, if a quaternion's
    norm is not 1, or if stamps do not increase.
    """
    table = read_table(content(text), name=name, columns=COLUMNS)
    R = rotations(table, table.values[:, 4:], "xyzw")
    t_ns = stamps_ns(table, "s")
    return Trajectory(t_ns, se3.transform(R, table.values[:, 1:4]))


def format_tum(trajectory: Trajectory) -> str:
    """A trajectory as TUM text: exact stamps with 9 decimals, and values with all digits."""
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    rows = np.hstack([trajectory.positions_m, q_xyzw]).tolist()
    lines = []
    for t_ns, row in zip(trajectory.t_ns.tolist(), rows, strict=True):
        lines.append(f"{seconds(t_ns)} {' '.join(map(repr, row))}\n")
    return "".join(lines)


def seconds(t_ns: int) -> str:
    """A time in nanoseconds as text in seconds, exact with 9 decimals."""
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
# EuRoC's names for the columns of a state: pose, velocity in the world frame, gyroscope bias, accelerometer bias.
STATE = (
    *POSE_STATE,
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)
IN_SECONDS = re.compile(r"\[\s*s(?:ec(?:onds?)?)?\s*\]")
WORD = re.compile(r"[a-df-z]", re.IGNORECASE)  # without e, which also occurs in numbers


@dataclass(frozen=True, slots=True)
class _CsvLayout:
    """The rows below the header of a csv file, the unit of their stamps and the order of their quaternions."""

    rows: list[tuple[int, str]]
    unit: StampUnit
    order: QuaternionOrder


def _csv_layout(text: str) -> _CsvLayout:
    """The layout of a csv file, inferred from its header and from its stamps. The header is optional."""
    first_line = text.removeprefix("\ufeff").lstrip().partition("\n")[0]
    rows = content(text)
    top_row = rows[0][1]
    is_note = first_line.startswith("#") and first_line.count(",") < top_row.count(",")
    has_numbers = any(NUMBER.fullmatch(cell.strip()) for cell in top_row.split(","))
    if is_note and not has_numbers:
        first_line = top_row  # the header is below the comment
    title = first_line.lstrip("#")
    if not WORD.search(title):
        return _CsvLayout(rows, _stamp_unit("", rows), "wxyz")

    header_cells = [cell.strip().lower() for cell in title.split(",")]
    is_comment = first_line.startswith("#")
    if not is_comment:  # `content` has removed a header that is a comment
        rows = rows[1:]
    return _CsvLayout(rows, _stamp_unit(header_cells[0], rows), _quaternion_order(header_cells))


def _quaternion_order(header_cells: list[str]) -> QuaternionOrder:
    """The order xyzw if the names of columns 4 to 7 end in x, y, z and w; otherwise wxyz, as in EuRoC."""
    names = [cell.partition("[")[0].strip() for cell in header_cells[4:8]]
    last_letters = [name[-1:] for name in names]
    return "xyzw" if last_letters == ["x", "y", "z", "w"] else "wxyz"


def _stamp_unit(header_cell: str, rows: list[tuple[int, str]]) -> StampUnit:
    """The unit of stamps: seconds if their header says so or a stamp has a decimal point, otherwise nanoseconds."""
    if "[ns]" in header_cell.replace(" ", ""):
        return "ns"
    has_decimal_point = any("." in body.partition(",")[0] for _, body in rows)
    is_in_seconds = has_decimal_point or IN_SECONDS.search(header_cell)
    return "s" if is_in_seconds else "ns"


def format_euroc(trajectory: Trajectory, more: Array | None = None) -> str:
    """A trajectory as EuRoC's csv text: stamps in nanoseconds, and values with all digits.

    `more` (N, 3) adds columns for the velocity in the world frame (m/s). `more` (N, 9) also adds columns for the biases
    of the gyroscope (rad/s) and of the accelerometer (m/s^2).
    """
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    columns = [trajectory.positions_m, q_xyzw[:, SCALAR_FIRST]]
    if more is not None:
        columns.append(more)
    values = np.hstack(columns)
    header = ", ".join(STATE[: values.shape[1]])
    return f"#timestamp [ns], {header}\n" + csv_rows(trajectory.t_ns, values)


def csv_rows(t_ns: Stamps, values: Array) -> str:
    """The csv lines of stamps (N,) in nanoseconds and values (N, K), with all digits."""
    lines = []
    for t, row in zip(t_ns.tolist(), values.tolist(), strict=True):
        lines.append(f"{t},{','.join(map(repr, row))}\n")
    return "".join(lines)


KITTI_COLUMNS = (
    *("r11", "r12", "r13", "t1"),
    *("r21", "r22", "r23", "t2"),
    *("r31", "r32", "r33", "t3"),
)
NUMBERED_COLUMNS = ("frame", *KITTI_COLUMNS)
TARTANAIR_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
SKEW_TOLERANCE = 1e-3  # for the elements of R^T R - I; they are about 1e-6 in KITTI's files, which have six digits
MAX_FRAME = 10**9


def format_kitti(T: Array) -> str:
    """Poses (N, 4, 4) as KITTI text, with all digits."""
    rows = T[:, :3].reshape(-1, len(KITTI_COLUMNS)).tolist()
    lines = [" ".join(map(repr, row)) + "\n" for row in rows]
    return "".join(lines)


def format_times(t_ns: Stamps) -> str:
    """Stamps (N,) as the text of KITTI's times file: seconds, exact with 9 decimals."""
    return "".join(f"{seconds(t)}\n" for t in t_ns.tolist())


def parse_times(text: str, *, name: str) -> Stamps:
    """The stamps (N,) in the text of a times file, one time in seconds per line. Raises TrajectoryError."""
    table = read_table(content(text), name=name, columns=("t",), row="a line of times")
    return stamps_ns(table, "s")


def _require_rotations(table: TrajectoryTable, R: Array) -> None:
    """Raise TrajectoryError for the first of the matrices (N, 3, 3) that is not a rotation."""
    with np.errstate(over="ignore", invalid="ignore"):
        residuals = se3.transposed(R) @ R - np.eye(3)
    deviations = np.abs(residuals).max(axis=(1, 2), initial=0.0)
    skewed_rows = np.flatnonzero(~(deviations <= SKEW_TOLERANCE))  # includes NaN
    if skewed_rows.size:
        row = skewed_rows[0]
        raise TrajectoryError(
            f"{table.place(row)}: the first three columns of the matrix should be a rotation "
            f"within {SKEW_TOLERANCE}, but R^T R is {deviations[row]:.3g} off the identity"
        )
    mirrored_rows = np.flatnonzero(np.linalg.det(R) < 0)
    if mirrored_rows.size:
        raise TrajectoryError(
            f"{table.place(mirrored_rows[0])}: the rotation is mirrored (its determinant is -1): "
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
    """The poses in a file, and how they were read.

    `t_ns` (N,) are the stamps, None for a format without stamps.
    `T` (N, 4, 4) are the poses.
    `unit` is the unit in which the stamps were read.
    `form_unit` is the default unit of the format.
    `order` is the order in which quaternions were read, None for a format without quaternions.
    `frames` (N,) are the frame numbers, if the file has them instead of stamps.
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
        """The stamps (N,) of the poses in a file without stamps, given the stamps (F,) of all frames.

        The poses are assigned to frames by their frame numbers. If the file has none, they are assigned in order, and
        there must be as many poses as frames. None if a frame number is too large, or if the counts differ.
        """
        if self.frames is None:
            has_equal_counts = len(frames_ns) == len(self.T)
            return frames_ns if has_equal_counts else None
        has_every_frame = self.frames[-1] < len(frames_ns)
        return frames_ns[self.frames] if has_every_frame else None


@dataclass(frozen=True, slots=True)
class TrajectoryReading:
    """A trajectory, and how its file was read.

    `unit` is the unit in which the stamps were read, None if the file has no stamps.
    `form_unit` is the default unit of the file's format, None for a format without stamps.
    `order` is the order in which quaternions were read, None if the file has none.
    `says_truth` is whether the file's name or a comment in it mentions ground truth.
    `is_unit_told` is whether the user specified the unit.
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
    """The poses in the text of a TUM, KITTI, TartanAir or EuRoC file. The format is detected from the first row.

    `written` is the text of the file.
    `name` is the file's name, for messages.
    `unit` and `order` override the detected unit of stamps and order of quaternion components.
    If several rows have the same stamp, only the first of them is used.
    Raises TrajectoryError for a text without poses, an unknown format or a wrong row.
    """
    first_row = _first_row(written, name)
    if "," in first_row:
        layout = _csv_layout(written)
        table = read_table(layout.rows, name=name, columns=EUROC_COLUMNS, separator=",")
        return _parse_stamped(table, unit or layout.unit, layout.unit, order or layout.order)

    columns = FORMS_BY_COLUMNS[len(first_row.split())]
    table = read_table(content(written), name=name, columns=columns)
    order = order or "xyzw"
    if columns is TARTANAIR_COLUMNS:
        return _parse_unstamped(table, order)
    if columns is COLUMNS:
        return _parse_stamped(table, unit or "s", "s", order)
    if columns is NUMBERED_COLUMNS:
        return _parse_numbered_matrices(table)
    return ParsedTrajectory(None, _matrix_poses(table))


def _parse_unstamped(table: TrajectoryTable, order: QuaternionOrder) -> ParsedTrajectory:
    """The poses of rows with a position and a quaternion."""
    R = rotations(table, table.values[:, 3:], order)
    T = se3.transform(R, table.values[:, :3])
    return ParsedTrajectory(None, T, order=order)


def _parse_numbered_matrices(table: TrajectoryTable) -> ParsedTrajectory:
    """The poses of rows with a frame number and a matrix."""
    distinct = _distinct_rows(table, _frame_numbers(table), "frame number")
    T = _matrix_poses(table)[distinct.rows]
    return ParsedTrajectory(None, T, frames=distinct.numbers, notes=distinct.notes)


def _matrix_poses(table: TrajectoryTable) -> Array:
    """The poses (N, 4, 4) in the last 12 columns, which are the upper three rows of the pose matrix, row by row.

    The rotations are checked, but not normalised.
    """
    matrices = table.values[:, -KITTI:].reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    positions_m = matrices[:, :, 3]
    _require_rotations(table, R)
    return se3.transform(R, positions_m)


def _frame_numbers(table: TrajectoryTable) -> Stamps:
    """The first column (N,) as frame numbers. Raises TrajectoryError unless they are integers from 0 to MAX_FRAME."""
    numbers = table.values[:, 0]
    is_whole = numbers == np.floor(numbers)
    is_in_range = (numbers >= 0) & (numbers <= MAX_FRAME)
    wrong_rows = np.flatnonzero(~(is_whole & is_in_range))
    if wrong_rows.size:
        row = wrong_rows[0]
        raise TrajectoryError(
            f"{table.place(row)}: the first of 13 columns should be the number of a frame, an integer from 0, "
            f"but is {table.first[row]}"
        )
    return numbers.astype(np.int64)


def _parse_stamped(
    table: TrajectoryTable,
    unit: StampUnit,
    form_unit: StampUnit,
    order: QuaternionOrder,
) -> ParsedTrajectory:
    """The poses of rows with a stamp, a position and a quaternion."""
    distinct = _distinct_rows(table, _first_column_ns(table, unit), "stamp")
    R = rotations(table, table.values[:, 4:8], order)
    T = se3.transform(R, table.values[:, 1:4])
    return ParsedTrajectory(distinct.numbers, T[distinct.rows], unit, form_unit, order, notes=distinct.notes)


def _first_row(written: str, name: str) -> str:
    """The first line that has content. Raises TrajectoryError if there is none, or if its format is unknown."""
    start = written.lstrip()
    if start.startswith(LFS_POINTER):
        raise TrajectoryError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")
    rows = content(written)
    if not rows:
        reason = "all lines are comments" if start else "the file is empty"
        raise TrajectoryError(f"no pose, because {reason}: {name}")
    line_number, first_row = rows[0]
    columns = len(first_row.split())
    is_csv = "," in first_row
    if not is_csv and columns not in FORMS_BY_COLUMNS:
        raise TrajectoryError(f"{name}:{line_number}: no form of trajectory has {columns} columns: {FORMS}")
    return first_row
