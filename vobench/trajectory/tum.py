"""Trajectories in the format of the TUM RGB-D benchmark."""

import numpy as np

from vobench.geometry import se3
from vobench.trajectory.quaternion_columns import rotations
from vobench.trajectory.stamp_text import format_seconds, stamps_ns
from vobench.trajectory.text_table import content_lines, read_table
from vobench.trajectory.trajectory import Trajectory

TUM_COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")


def parse_tum(text: str, *, name: str) -> Trajectory:
    """The trajectory in the text of a TUM file; `name` is the file's name, for messages.

    Comments (#), blank lines, tabs and CRLF are accepted. Stamps are rounded to the nanosecond, ties to even.
    Raises TrajectoryError with file, line and value if a line does not consist of 8 finite numbers, if a quaternion's
    norm is not 1, or if stamps do not increase.
    """
    table = read_table(content_lines(text), name=name, columns=TUM_COLUMNS)
    R = rotations(table, table.values[:, 4:], "xyzw")
    t_ns = stamps_ns(table, "s")
    return Trajectory(t_ns, se3.transform(R, table.values[:, 1:4]))


def format_tum(trajectory: Trajectory) -> str:
    """A trajectory as TUM text: exact stamps with 9 decimals, and values with all digits."""
    q_xyzw = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])
    rows = np.hstack([trajectory.positions_m, q_xyzw]).tolist()
    lines = []
    for t_ns, row in zip(trajectory.t_ns.tolist(), rows, strict=True):
        lines.append(f"{format_seconds(t_ns)} {' '.join(map(repr, row))}\n")
    return "".join(lines)
