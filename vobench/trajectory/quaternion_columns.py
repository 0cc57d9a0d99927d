"""Columns of unit quaternions, in either order of their components."""

from typing import Literal

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.text_table import TextTable

QuaternionOrder = Literal["xyzw", "wxyz"]  # in which a file lists the four components of a quaternion

SCALAR_LAST = [1, 2, 3, 0]  # indices that reorder (w, x, y, z) to (x, y, z, w)
SCALAR_FIRST = [3, 0, 1, 2]  # indices that reorder (x, y, z, w) to (w, x, y, z)
NORM_TOLERANCE = 1e-3  # rounding to 4 digits changes the norm of a quaternion by up to 1e-4


def rotations(table: TextTable, q: Array, order: QuaternionOrder) -> Array:
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
