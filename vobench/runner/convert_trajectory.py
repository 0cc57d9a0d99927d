"""Converts trajectory files of any format: their poses can be merged, shifted in time and reduced."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vobench.dataset.export import FORMS_WITHOUT_STAMPS, export_trajectory
from vobench.errors import TrajectoryError, counted
from vobench.runner.trajectory_pair import TrajectorySource, read_one
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.part import between, downsampled, merged, shifted


@dataclass(frozen=True, slots=True)
class TrajectoryEdit:
    """How a trajectory is changed, in this order: its stamps are shifted, it is cut, and it is downsampled.

    `first_ns` and `last_ns` are stamps after the shift. None means no limit.
    """

    offset_ns: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    count: int | None = None

    @property
    def needs_stamps(self) -> bool:
        """Whether it depends on the stamps of poses."""
        return bool(self.offset_ns) or self.first_ns is not None or self.last_ns is not None


@dataclass(frozen=True, slots=True)
class ConvertedTrajectory:
    """The files that were written, the number of poses in them, and notes on what was left out."""

    files: tuple[Path, ...]
    pose_count: int
    notes: tuple[str, ...]


def convert_trajectories(
    sources: Sequence[TrajectorySource],
    out: Path,
    form: str,
    *,
    times: Sequence[Path] = (),
    edit: TrajectoryEdit = TrajectoryEdit(),
) -> ConvertedTrajectory:
    """Write the poses of one or more files as one file of another format.

    Several files are merged in order of time. `times` are files of stamps for files without (KITTI, TartanAir). They
    are not needed for a single file if neither the edit nor the new format needs stamps.

    Raises:
        InputError: a file cannot be read or exists, the format is unknown, or no pose is left.
    """
    needs_stamps = len(sources) > 1 or edit.needs_stamps or form not in FORMS_WITHOUT_STAMPS
    readings = [read_one(source, times=times, needs_stamps=needs_stamps) for source in sources]
    has_stamps = all(reading.unit is not None for reading in readings)
    whole = merged([reading.trajectory for reading in readings])
    moved = shifted(whole.trajectory, edit.offset_ns)
    trajectory = between(moved, edit.first_ns, edit.last_ns)
    if not len(trajectory):
        t_s = moved.t_ns / NS_PER_S
        raise TrajectoryError(f"no pose is left; the stamps are from {t_s[0]:.9f} s to {t_s[-1]:.9f} s")
    if edit.count is not None:
        trajectory = downsampled(trajectory, edit.count)
    files = export_trajectory(trajectory, out, form, has_stamps=has_stamps)

    notes = list[str]()
    if whole.repeated:
        notes.append(f"{counted(whole.repeated, 'pose')} left out, whose stamps an earlier file has, too.")
    stamp_files = [file for file in files if file != out]
    notes += [f"Poses in this format have no stamps; the stamps are in {file.name}." for file in stamp_files]
    return ConvertedTrajectory(files, len(trajectory), tuple(notes))
