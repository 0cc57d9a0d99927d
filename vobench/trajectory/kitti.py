"""Poses and times in the format of KITTI's odometry benchmark."""

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.stamp_text import format_seconds, stamps_ns
from vobench.trajectory.text_table import TextTable, content_lines, read_table
from vobench.trajectory.trajectory import Stamps

# The upper three rows of the pose matrix, row by row.
KITTI_COLUMNS = (
    *("r11", "r12", "r13", "t1"),
    *("r21", "r22", "r23", "t2"),
    *("r31", "r32", "r33", "t3"),
)
NUMBERED_COLUMNS = ("frame", *KITTI_COLUMNS)  # for a trajectory that lacks the poses of some frames
SKEW_TOLERANCE = 1e-3  # for the elements of R^T R - I; they are about 1e-6 in KITTI's files, which have six digits
MAX_FRAME = 10**9


def format_kitti(T: Array) -> str:
    """Poses (N, 4, 4) as KITTI text, with all digits."""
    rows = T[:, :3].reshape(-1, len(KITTI_COLUMNS)).tolist()
    lines = [" ".join(map(repr, row)) + "\n" for row in rows]
    return "".join(lines)


def format_times(t_ns: Stamps) -> str:
    """Stamps (N,) as the text of KITTI's times file: seconds, exact with 9 decimals."""
    return "".join(f"{format_seconds(t)}\n" for t in t_ns.tolist())


def parse_times(text: str, *, name: str) -> Stamps:
    """The stamps (N,) in the text of a times file, one time in seconds per line. Raises TrajectoryError."""
    table = read_table(content_lines(text), name=name, columns=("t",), row="a line of times")
    return stamps_ns(table, "s")


def matrix_poses(table: TextTable) -> Array:
    """The poses (N, 4, 4) in the last 12 columns of a table.

    The rotations are checked, but not normalised. Raises TrajectoryError for a matrix that is not a rotation.
    """
    matrices = table.values[:, -len(KITTI_COLUMNS) :].reshape(-1, 3, 4)
    R = matrices[:, :, :3]
    positions_m = matrices[:, :, 3]
    _require_rotations(table, R)
    return se3.transform(R, positions_m)


def _require_rotations(table: TextTable, R: Array) -> None:
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


def frame_numbers(table: TextTable) -> Stamps:
    """The first column (N,) as frame numbers. Raises TrajectoryError unless they are integers from 0 to MAX_FRAME."""
    numbers = table.values[:, 0]
    is_whole = numbers == np.floor(numbers)
    is_in_range = (numbers >= 0) & (numbers <= MAX_FRAME)
    wrong_rows = np.flatnonzero(~(is_whole & is_in_range))
    if wrong_rows.size:
        row = wrong_rows[0]
        raise TrajectoryError(
            f"{table.place(row)}: the first of 13 columns should be the number of a frame, an integer from 0, "
            f"but is {table.first_fields[row]}"
        )
    return numbers.astype(np.int64)
