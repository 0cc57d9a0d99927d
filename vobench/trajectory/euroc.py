"""Trajectories as csv in the format of the EuRoC MAV dataset."""

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.quaternion_columns import SCALAR_FIRST
from vobench.trajectory.trajectory import Stamps, Trajectory

EUROC_COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")
# EuRoC's names for the columns of a state: pose, velocity in the world frame, gyroscope bias, accelerometer bias.
STATE_COLUMNS = (
    *("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]"),
    *("q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)


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
    header = ", ".join(STATE_COLUMNS[: values.shape[1]])
    return f"#timestamp [ns], {header}\n" + csv_rows(trajectory.t_ns, values)


def csv_rows(t_ns: Stamps, values: Array) -> str:
    """The csv lines of stamps (N,) in nanoseconds and values (N, K), with all digits."""
    lines = []
    for t, row in zip(t_ns.tolist(), values.tolist(), strict=True):
        lines.append(f"{t},{','.join(map(repr, row))}\n")
    return "".join(lines)
