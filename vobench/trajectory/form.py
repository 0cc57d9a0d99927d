"""Which form a trajectory's text has, told by its first row and never by the file's name."""

from dataclasses import dataclass

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory import euroc, text, unstamped
from vobench.trajectory.table import Order, Table, Unit, content, first_stamps_ns, read_table, rotations
from vobench.trajectory.trajectory import Stamps, Trajectory

LFS_POINTER = "version https://git-lfs.github.com/spec/"
TUM, KITTI, TARTANAIR = len(text.COLUMNS), len(unstamped.KITTI_COLUMNS), len(unstamped.TARTANAIR_COLUMNS)
NUMBERED = len(unstamped.NUMBERED_COLUMNS)
FORMS = (
    f"TUM has {TUM} ({' '.join(text.COLUMNS)}), KITTI {KITTI}, or {NUMBERED} with a frame number first, "
    f"TartanAir {TARTANAIR}, EuRoC {TUM} and commas"
)


@dataclass(frozen=True, slots=True)
class Parsed:
    """Poses (N, 4, 4) and how they were read; None for stamps, their unit or an order that the form doesn't have.

    `form_unit` is the unit that files of this form should be in; `frames` (N,) are the numbers that a file without
    stamps gives its poses; `notes` say in sentences what was left out.
    """

    t_ns: Stamps | None
    T: Array
    unit: Unit | None = None
    form_unit: Unit | None = None
    order: Order | None = None
    frames: Stamps | None = None
    notes: tuple[str, ...] = ()

    def stamped_by(self, frames_ns: Stamps) -> Stamps | None:
        """Stamps (N,) for poses that have none, out of those of all frames; None where they do not fit together."""
        if self.frames is None:
            return frames_ns if len(frames_ns) == len(self.T) else None
        return frames_ns[self.frames] if self.frames[-1] < len(frames_ns) else None


@dataclass(frozen=True, slots=True)
class Reading:
    """A trajectory and how it was read: its stamps' unit, its quaternions' order, None where that can't be wrong.

    `form_unit` is the unit that such a file should be in; `says_truth`, whether it calls itself ground truth;
    `is_unit_told`, whether somebody who knows gave the unit.
    """

    trajectory: Trajectory
    unit: Unit | None = "s"
    form_unit: Unit | None = "s"
    order: Order | None = "xyzw"
    says_truth: bool = False
    is_unit_told: bool = False


def parse_any(written: str, *, name: str, unit: Unit | None = None, order: Order | None = None) -> Parsed:
    """The poses in TUM, KITTI, TartanAir or EuRoC text.

    `unit` and `order` override what the form says of stamps and quaternions. Of rows that repeat a stamp the first
    counts. Raises TrajectoryError where there is no pose, no such form, or a row is wrong.
    """
    first = _first_row(written, name)
    if "," in first:
        found = euroc.layout(written)
        table = read_table(found.rows, name=name, columns=euroc.COLUMNS, separator=",")
        return _stamped(table, unit or found.unit, found.unit, order or found.order)
    columns = len(first.split())
    if columns == KITTI:
        return Parsed(None, unstamped.parse_kitti(written, name=name))
    if columns == NUMBERED:
        frames, T, notes = unstamped.parse_numbered_kitti(written, name=name)
        return Parsed(None, T, frames=frames, notes=notes)
    if columns == TARTANAIR:
        return Parsed(None, unstamped.parse_tartanair(written, name=name, order=order or "xyzw"), order=order or "xyzw")
    table = read_table(content(written), name=name, columns=text.COLUMNS)
    return _stamped(table, unit or "s", "s", order or "xyzw")


def _stamped(table: Table, unit: Unit, form_unit: Unit, order: Order) -> Parsed:
    """The poses of rows with a stamp, a position and a quaternion."""
    t_ns, rows, notes = first_stamps_ns(table, unit)
    T = se3.transform(rotations(table, table.values[:, 4:8], order), table.values[:, 1:4])
    return Parsed(t_ns, T[rows], unit, form_unit, order, notes=notes)


def _first_row(written: str, name: str) -> str:
    """The first line with something to say. Raises TrajectoryError where it is of none of the forms."""
    start = written.lstrip()
    if start.startswith(LFS_POINTER):
        raise TrajectoryError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")
    number, first = next(iter(content(written)), (0, ""))
    if not first:
        raise TrajectoryError(f"no pose, {'for all lines are comments' if start else 'for the file is empty'}: {name}")
    columns = len(first.split())
    if "," not in first and columns not in (TUM, KITTI, NUMBERED, TARTANAIR):
        raise TrajectoryError(f"{name}:{number}: no form of trajectory has {columns} columns: {FORMS}")
    return first
