"""Which form a trajectory's text has, told by its first row and never by the file's name."""

from dataclasses import dataclass

from vobench.errors import TrajectoryError
from vobench.geometry.se3 import Array
from vobench.trajectory import euroc, text, unstamped
from vobench.trajectory.table import Order, Unit, content
from vobench.trajectory.trajectory import Stamps, Trajectory

LFS_POINTER = "version https://git-lfs.github.com/spec/"
TUM, KITTI, TARTANAIR = len(text.COLUMNS), len(unstamped.KITTI_COLUMNS), len(unstamped.TARTANAIR_COLUMNS)
FORMS = f"TUM has {TUM} ({' '.join(text.COLUMNS)}), KITTI {KITTI}, TartanAir {TARTANAIR}, EuRoC {TUM} and commas"


@dataclass(frozen=True, slots=True)
class Parsed:
    """Poses (N, 4, 4) and how they were read; None for stamps, their unit or an order that the form doesn't have.

    `form_unit` is the unit that files of this form should be in.
    """

    t_ns: Stamps | None
    T: Array
    unit: Unit | None = None
    form_unit: Unit | None = None
    order: Order | None = None


@dataclass(frozen=True, slots=True)
class Reading:
    """A trajectory and how it was read: its stamps' unit, its quaternions' order, None where it has none.

    `form_unit` is the unit that such a file should be in; `says_truth`, whether it calls itself ground truth.
    """

    trajectory: Trajectory
    unit: Unit | None = "s"
    form_unit: Unit | None = "s"
    order: Order | None = "xyzw"
    says_truth: bool = False


def parse_any(written: str, *, name: str, unit: Unit | None = None, order: Order | None = None) -> Parsed:
    """The poses in TUM, KITTI, TartanAir or EuRoC text.

    `unit` and `order` override what the form says of stamps and quaternions.
    Raises TrajectoryError where there is no pose, no such form, or a row is wrong.
    """
    first = _first_row(written, name)
    if "," in first:
        found = euroc.layout(written)
        csv = euroc.parse_euroc(written, name=name, unit=unit, order=order)
        return Parsed(csv.t_ns, csv.T_world_frame, unit or found.unit, found.unit, order or found.order)
    columns = len(first.split())
    if columns == KITTI:
        return Parsed(None, unstamped.parse_kitti(written, name=name))
    if columns == TARTANAIR:
        return Parsed(None, unstamped.parse_tartanair(written, name=name, order=order or "xyzw"), order=order or "xyzw")
    tum = text.parse_tum(written, name=name, unit=unit or "s", order=order or "xyzw")
    return Parsed(tum.t_ns, tum.T_world_frame, unit or "s", "s", order or "xyzw")


def _first_row(written: str, name: str) -> str:
    """The first line with something to say. Raises TrajectoryError where it is of none of the forms."""
    start = written.lstrip()
    if start.startswith(LFS_POINTER):
        raise TrajectoryError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")
    number, first = next(iter(content(written)), (0, ""))
    if not first:
        raise TrajectoryError(f"no pose, {'for all lines are comments' if start else 'for the file is empty'}: {name}")
    columns = len(first.split())
    if "," not in first and columns not in (TUM, KITTI, TARTANAIR):
        raise TrajectoryError(f"{name}:{number}: no form of trajectory has {columns} columns: {FORMS}")
    return first
