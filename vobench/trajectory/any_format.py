"""Reads a trajectory whose format (TUM, KITTI, TartanAir or EuRoC) is detected from its first row."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.csv_layout import csv_layout
from vobench.trajectory.euroc import EUROC_COLUMNS
from vobench.trajectory.increasing_column import increasing_rows
from vobench.trajectory.kitti import KITTI_COLUMNS, NUMBERED_COLUMNS, frame_numbers, matrix_poses
from vobench.trajectory.quaternion_columns import QuaternionOrder, rotations
from vobench.trajectory.stamp_text import StampUnit, unchecked_stamps_ns
from vobench.trajectory.tartanair import TARTANAIR_COLUMNS
from vobench.trajectory.text_table import TextTable, content_lines, read_table
from vobench.trajectory.trajectory import Stamps
from vobench.trajectory.tum import TUM_COLUMNS

FrameNumbers = NDArray[np.int64]

LFS_POINTER = "version https://git-lfs.github.com/spec/"
FORMATS_WITHOUT_COMMAS = (TUM_COLUMNS, KITTI_COLUMNS, NUMBERED_COLUMNS, TARTANAIR_COLUMNS)
COLUMNS_BY_COUNT = {len(columns): columns for columns in FORMATS_WITHOUT_COMMAS}
KNOWN_FORMATS = (
    f"TUM has {len(TUM_COLUMNS)} columns ({' '.join(TUM_COLUMNS)}); KITTI has {len(KITTI_COLUMNS)}, "
    f"or {len(NUMBERED_COLUMNS)} with a frame number in front; TartanAir has {len(TARTANAIR_COLUMNS)}; "
    f"EuRoC has {len(EUROC_COLUMNS)}, separated by commas"
)


@dataclass(frozen=True, slots=True)
class ParsedTrajectory:
    """The poses in a file, and how they were read.

    `t_ns` (N,) are the stamps, None for a format without stamps.
    `T` (N, 4, 4) are the poses.
    `unit` is the unit in which the stamps were read.
    `format_unit` is the default unit of the format.
    `order` is the order in which quaternions were read, None for a format without quaternions.
    `frames` (N,) are the frame numbers, from 0, if the file has them instead of stamps.
    `notes` are sentences about rows that were left out.
    """

    t_ns: Stamps | None
    T: Array
    unit: StampUnit | None = None
    format_unit: StampUnit | None = None
    order: QuaternionOrder | None = None
    frames: FrameNumbers | None = None
    notes: tuple[str, ...] = ()

    def stamped_by(self, frames_ns: Stamps) -> Stamps | None:
        """The stamps (N,) of the poses in a file without stamps, given the stamps (F,) of all frames.

        The poses are assigned to frames by their frame numbers. If the file has none, they are assigned in order, and
        there must be as many poses as frames. None if a frame number is too large, or if the counts differ.
        """
        if self.frames is None:
            has_equal_counts = len(frames_ns) == len(self.T)
            return frames_ns if has_equal_counts else None
        are_frames_known = self.frames[-1] < len(frames_ns)
        return frames_ns[self.frames] if are_frames_known else None


def parse_any(
    text: str,
    *,
    name: str,
    unit: StampUnit | None = None,
    order: QuaternionOrder | None = None,
) -> ParsedTrajectory:
    """The poses in the text of a TUM, KITTI, TartanAir or EuRoC file.

    `name` is the file's name, for messages.
    `unit` and `order` override the detected unit of stamps and order of quaternion components.
    If several rows have the same stamp, only the first of them is used.
    Raises TrajectoryError for a text without poses, an unknown format or a wrong row.
    """
    first_row = _first_row(text, name)
    if "," in first_row:
        layout = csv_layout(text)
        table = read_table(layout.lines, name=name, columns=EUROC_COLUMNS, separator=",")
        return _parse_stamped(table, unit=unit, format_unit=layout.unit, order=order or layout.order)

    columns = COLUMNS_BY_COUNT[len(first_row.split())]
    table = read_table(content_lines(text), name=name, columns=columns)
    if columns == TUM_COLUMNS:
        return _parse_stamped(table, unit=unit, format_unit="s", order=order or "xyzw")
    if columns == TARTANAIR_COLUMNS:
        return _parse_unstamped(table, order or "xyzw")
    if columns == NUMBERED_COLUMNS:
        return _parse_numbered_matrices(table)
    return _parse_matrices(table)


def _first_row(text: str, name: str) -> str:
    """The first line that has content. Raises TrajectoryError if there is none, or if its format is unknown."""
    start = text.lstrip()
    if start.startswith(LFS_POINTER):
        raise TrajectoryError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")
    lines = content_lines(text)
    if not lines:
        reason = "all lines are comments" if start else "the file is empty"
        raise TrajectoryError(f"no pose, because {reason}: {name}")
    first_line = lines[0]
    column_count = len(first_line.text.split())
    is_csv = "," in first_line.text
    if not is_csv and column_count not in COLUMNS_BY_COUNT:
        raise TrajectoryError(
            f"{name}:{first_line.number}: no format of trajectories has {column_count} columns: {KNOWN_FORMATS}"
        )
    return first_line.text


def _parse_stamped(
    table: TextTable,
    *,
    unit: StampUnit | None,
    format_unit: StampUnit,
    order: QuaternionOrder,
) -> ParsedTrajectory:
    """The poses of rows with a stamp, a position and a quaternion. `unit` overrides the unit of the format."""
    used_unit = unit or format_unit
    distinct = increasing_rows(table, unchecked_stamps_ns(table, used_unit), "stamp")
    R = rotations(table, table.values[:, 4:8], order)
    T = se3.transform(R, table.values[:, 1:4])
    return ParsedTrajectory(
        t_ns=distinct.numbers,
        T=T[distinct.rows],
        unit=used_unit,
        format_unit=format_unit,
        order=order,
        notes=distinct.notes,
    )


def _parse_unstamped(table: TextTable, order: QuaternionOrder) -> ParsedTrajectory:
    """The poses of rows with a position and a quaternion."""
    R = rotations(table, table.values[:, 3:], order)
    T = se3.transform(R, table.values[:, :3])
    return ParsedTrajectory(t_ns=None, T=T, order=order)


def _parse_matrices(table: TextTable) -> ParsedTrajectory:
    """The poses of rows with a matrix, as in KITTI."""
    return ParsedTrajectory(t_ns=None, T=matrix_poses(table))


def _parse_numbered_matrices(table: TextTable) -> ParsedTrajectory:
    """The poses of rows with a frame number and a matrix."""
    distinct = increasing_rows(table, frame_numbers(table), "frame number")
    T = matrix_poses(table)[distinct.rows]
    return ParsedTrajectory(t_ns=None, T=T, frames=distinct.numbers, notes=distinct.notes)
