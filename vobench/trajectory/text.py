"""Trajectories as TUM text: `t x y z qx qy qz qw`, with t in seconds and kept exact to the nanosecond."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps, Trajectory

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
NORM_TOLERANCE = 1e-3  # 4 printed digits leave a norm off by 1e-4; a file in other units or order by far more
NS_PER_S = 10**9
MAX_NS = 2**63 - 1
# Stricter than float(), which also takes 1_000, nan, infinity and the digits of other scripts.
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
EXACT = Context(prec=64, rounding=ROUND_HALF_EVEN)  # digits of seconds; int64 ns need 19


@dataclass(frozen=True, slots=True)
class _Row:
    """The fields of one line, and where it stands for the error message."""

    place: str
    fields: Sequence[str]


def parse_tum(text: str, *, name: str) -> Trajectory:
    """The trajectory in a TUM file's text; `name` is the file, for messages.

    Comments (#), blank lines, tabs and CRLF pass. Digits beyond the nanosecond are rounded, ties to even.
    Raises TrajectoryError naming file, line and value for what is not 8 finite numbers, for
    quaternions whose norm is not 1, and for stamps that don't increase.
    """
    rows = _rows(text, name)
    t_ns = np.array([_stamp_ns(row) for row in rows], np.int64)
    _require_increasing(t_ns, rows)
    values = np.array([[float(field) for field in row.fields[1:]] for row in rows]).reshape(-1, 7)
    _require_finite(values, rows)
    rotations = se3.from_quaternion(_unit(values[:, 3:], rows))
    return Trajectory(t_ns, se3.transform(rotations, values[:, :3]))


def format_tum(trajectory: Trajectory) -> str:
    """TUM text: stamps with 9 decimals from the integers, values with every digit they have."""
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    values = np.concatenate([trajectory.positions_m, q_xyzw], axis=1).tolist()
    stamps = [seconds(t) for t in trajectory.t_ns.tolist()]
    return "".join(f"{t} {' '.join(map(repr, row))}\n" for t, row in zip(stamps, values, strict=True))


def seconds(t_ns: int) -> str:
    """An instant or duration in ns as seconds with 9 decimals, exact."""
    whole, part = divmod(abs(t_ns), NS_PER_S)
    return f"{'-' if t_ns < 0 else ''}{whole}.{part:09d}"


def _rows(text: str, name: str) -> list[_Row]:
    lines = enumerate(text.removeprefix("\ufeff").split("\n"), 1)
    split = ((number, line.partition("#")[0].split()) for number, line in lines)
    rows = [_Row(f"{name}:{number}", fields) for number, fields in split if fields]
    for row in rows:
        _require_numbers(row)
    return rows


def _require_numbers(row: _Row) -> None:
    if len(row.fields) != len(COLUMNS):
        raise TrajectoryError(
            f"{row.place}: a pose has {len(COLUMNS)} columns ({' '.join(COLUMNS)}), this line has {len(row.fields)}"
        )
    for column, field in zip(COLUMNS, row.fields, strict=True):
        if not NUMBER.fullmatch(field):
            raise TrajectoryError(f"{row.place}: {column} should be a finite number, but is {field!r}")


def _stamp_ns(row: _Row) -> int:
    scaled = Decimal(row.fields[0]).scaleb(9, EXACT)
    if abs(scaled) > MAX_NS:
        raise TrajectoryError(f"{row.place}: t should be seconds below {seconds(MAX_NS)}, but is {row.fields[0]}")
    return int(scaled.to_integral_value(context=EXACT))


def _require_increasing(t_ns: Stamps, rows: Sequence[_Row]) -> None:
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        last, this = rows[late[0]], rows[late[0] + 1]
        raise TrajectoryError(
            f"{this.place}: stamps must increase by 1 ns or more, but {this.fields[0]} follows {last.fields[0]}"
        )


def _require_finite(values: Array, rows: Sequence[_Row]) -> None:
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        row, column = rows[bad[0, 0]], bad[0, 1] + 1
        raise TrajectoryError(
            f"{row.place}: {COLUMNS[column]} should be a finite number, but {row.fields[column]} overflows"
        )


def _unit(q_xyzw: Array, rows: Sequence[_Row]) -> Array:
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(q_xyzw, axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > NORM_TOLERANCE)
    if bad.size:
        row = rows[bad[0]]
        raise TrajectoryError(
            f"{row.place}: the quaternion's norm should be 1 within {NORM_TOLERANCE}, "
            f"but ({', '.join(row.fields[4:])}) has {norm[bad[0]]:.6g}"
        )
    unit: Array = q_xyzw / norm[:, None]
    return unit
