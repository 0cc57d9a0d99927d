"""Trajectories as EuRoC's csv: `t, x, y, z, qw, qx, qy, qz` and any columns more, with t in nanoseconds."""

import re
from dataclasses import dataclass

from vobench.geometry import se3
from vobench.trajectory.table import Order, Unit, content, read_table, rotations, stamps_ns
from vobench.trajectory.trajectory import Trajectory

COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")
IN_SECONDS = re.compile(r"\[\s*s(?:ec(?:onds?)?)?\s*\]")
WORD = re.compile(r"[a-df-z]", re.IGNORECASE)  # an e may be an exponent's


@dataclass(frozen=True, slots=True)
class Layout:
    """What a csv says of itself: the rows below its header, the stamps' unit, the quaternions' order."""

    rows: tuple[tuple[int, str], ...]
    unit: Unit
    order: Order


def layout(text: str) -> Layout:
    """A header that names w last, or seconds, is believed; stamps with a decimal point are seconds."""
    first = text.removeprefix("\ufeff").lstrip().partition("\n")[0]
    rows, header = content(text), [""]
    if WORD.search(first.lstrip("#")):
        header = [cell.strip().lower() for cell in first.lstrip("#").split(",")]
        rows = rows if first.startswith("#") else rows[1:]
    names = [cell.partition("[")[0].strip() for cell in header[4:8]]
    order: Order = "xyzw" if [name[-1:] for name in names] == ["x", "y", "z", "w"] else "wxyz"
    return Layout(tuple(rows), _unit(header[0], rows), order)


def parse_euroc(text: str, *, name: str, unit: Unit | None = None, order: Order | None = None) -> Trajectory:
    """The trajectory in a csv, read as `layout` says where `unit` and `order` don't.

    Raises TrajectoryError as `parse_tum` does.
    """
    found = layout(text)
    table = read_table(found.rows, name=name, columns=COLUMNS, separator=",")
    R = rotations(table, table.values[:, 4:8], order or found.order)
    return Trajectory(stamps_ns(table, unit or found.unit), se3.transform(R, table.values[:, 1:4]))


def _unit(header: str, rows: list[tuple[int, str]]) -> Unit:
    if "[ns]" in header.replace(" ", ""):
        return "ns"
    has_point = any("." in body.partition(",")[0] for _, body in rows)
    return "s" if has_point or IN_SECONDS.search(header) else "ns"
