"""Pose files without stamps, one row a frame: KITTI's 12 or 13 columns, TartanAir's 7, and KITTI's file of times."""

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.table import Order, Table, content, first_of_equal, read_table, rotations, stamps_ns
from vobench.trajectory.text import seconds
from vobench.trajectory.trajectory import Stamps

KITTI_COLUMNS = tuple(f"{part}{row}" for row in (1, 2, 3) for part in ("r1", "r2", "r3", "t"))
NUMBERED_COLUMNS = ("frame", *KITTI_COLUMNS)
TARTANAIR_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
# KITTI prints six digits, so its matrices are 1e-6 off a rotation; nothing that means to be one is this far off.
SKEW_TOLERANCE = 1e-3
MAX_FRAME = 10**9


def parse_kitti(text: str, *, name: str) -> Array:
    """Poses (N, 4, 4) of a KITTI file, the first three rows of each matrix; kept as given, not orthonormalised.

    Raises TrajectoryError naming file and line for what is not 12 finite numbers or no rotation.
    """
    table = read_table(content(text), name=name, columns=KITTI_COLUMNS)
    matrices = table.values.reshape(-1, 3, 4)
    _require_rotations(table, matrices[:, :, :3])
    return se3.transform(matrices[:, :, :3], matrices[:, :, 3])


def parse_numbered_kitti(text: str, *, name: str) -> tuple[Stamps, Array, tuple[str, ...]]:
    """Frame numbers (N,), their poses (N, 4, 4) as `parse_kitti` reads them, and a note where frames repeat.

    Raises TrajectoryError as it does, and where a frame is no whole number from 0 on or comes after a later one.
    """
    table = read_table(content(text), name=name, columns=NUMBERED_COLUMNS)
    stated = table.values[:, 0]
    bad = np.flatnonzero((stated != np.floor(stated)) | (stated < 0) | (stated > MAX_FRAME))
    if bad.size:
        raise TrajectoryError(
            f"{table.place(bad[0])}: the first of 13 columns should be the number of a frame, whole and from 0 on, "
            f"but is {table.first[bad[0]]}"
        )
    frames, rows, notes = first_of_equal(table, stated.astype(np.int64), "frame number")
    matrices = table.values[:, 1:].reshape(-1, 3, 4)
    _require_rotations(table, matrices[:, :, :3])
    return frames, se3.transform(matrices[rows, :, :3], matrices[rows, :, 3]), notes


def format_kitti(T: Array) -> str:
    """KITTI text of poses (N, 4, 4), every digit of them."""
    rows = T[:, :3].reshape(-1, len(KITTI_COLUMNS)).tolist()
    return "".join(f"{' '.join(map(repr, row))}\n" for row in rows)


def format_times(t_ns: Stamps) -> str:
    """KITTI's file of times (N,): seconds with 9 decimals, exact."""
    return "".join(f"{seconds(t)}\n" for t in t_ns.tolist())


def parse_tartanair(text: str, *, name: str, order: Order = "xyzw") -> Array:
    """Poses (N, 4, 4) of a file with x y z qx qy qz qw, which is TartanAir's. Raises TrajectoryError."""
    table = read_table(content(text), name=name, columns=TARTANAIR_COLUMNS)
    return se3.transform(rotations(table, table.values[:, 3:], order), table.values[:, :3])


def parse_times(text: str, *, name: str) -> Stamps:
    """Stamps (N,) of a file with one time in seconds a line. Raises TrajectoryError."""
    return stamps_ns(read_table(content(text), name=name, columns=("t",), row="a line of times"), "s")


def _require_rotations(table: Table, R: Array) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
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
