"""Trajectories as EuRoC's csv: `t, x, y, z, qw, qx, qy, qz` and any columns more, with t in nanoseconds."""

import re
from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.table import Order, Unit, content
from vobench.trajectory.trajectory import Stamps, Trajectory

COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")
# EuRoC's own names, for what a state may say: the pose, then the velocity in the world, then the biases.
STATE = (
    *("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]", "q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)
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
