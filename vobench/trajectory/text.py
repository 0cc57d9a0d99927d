"""Trajectories as TUM text: `t x y z qx qy qz qw`, with t in seconds and kept exact to the nanosecond."""

from vobench.geometry import se3
from vobench.trajectory.table import Order, Unit, content, read_table, rotations, stamps_ns
from vobench.trajectory.trajectory import Trajectory

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
NS_PER_S = 10**9


def parse_tum(text: str, *, name: str, unit: Unit = "s", order: Order = "xyzw") -> Trajectory:
    """The trajectory in a TUM file's text; `name` is the file, for messages.

    Comments (#), blank lines, tabs and CRLF pass. Digits beyond the nanosecond are rounded, ties to even.
    Raises TrajectoryError naming file, line and value for what is not 8 finite numbers, for
    quaternions whose norm is not 1, and for stamps that don't increase.
    """
    table = read_table(content(text), name=name, columns=COLUMNS)
    R = rotations(table, table.values[:, 4:], order)
    return Trajectory(stamps_ns(table, unit), se3.transform(R, table.values[:, 1:4]))


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
