"""Exports a sequence or a trajectory file, whichever a path is, to another form."""

from dataclasses import dataclass
from pathlib import Path

from vobench.dataset.export import export, export_trajectory
from vobench.dataset.layout import writable
from vobench.dataset.picture import read_text
from vobench.errors import InputError
from vobench.sequence.recording import is_recording, read_poses
from vobench.sequence.topic import SENSORS_FILE
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Conversion:
    """The number of files that an export wrote, and notes on what was lost."""

    file_count: int
    notes: tuple[str, ...]


def convert(source: Path, out: Path, form: str) -> Conversion:
    """Write a sequence in another layout, or a trajectory in another form.

    `source` is the folder of a sequence, one of the files in it, or a trajectory file. Raises VobenchError if it cannot
    be read, the form is unknown, or `out` exists.
    """
    path = source.parent if source.name == SENSORS_FILE else source
    if path.is_file():
        return _convert_trajectory(path, out, form)
    return _convert_sequence(path, out, form)


def _convert_sequence(folder: Path, out: Path, form: str) -> Conversion:
    is_other_folder = folder.is_dir() and not (folder / SENSORS_FILE).is_file()
    if form in writable() and is_other_folder:
        raise InputError(f"not a vobench sequence (it has no {SENSORS_FILE}); vobench import creates one: {folder}")
    exported = export(folder, out, form)
    return Conversion(len(exported.files), exported.notes)


def _convert_trajectory(path: Path, out: Path, form: str) -> Conversion:
    files = export_trajectory(_read_trajectory(path), out, form)
    stamp_files = [file for file in files if file != out]  # only KITTI's form has one
    notes = tuple(f"Poses in KITTI's form have no stamps; the stamps are in {file.name}." for file in stamp_files)
    return Conversion(len(files), notes)


def _read_trajectory(path: Path) -> Trajectory:
    """The poses of a text file in any form, or those of a recording that has one topic of poses. Raises InputError."""
    if is_recording(path):
        return read_poses(path, None)
    parsed = parse_any(read_text(path), name=str(path))
    if parsed.t_ns is None:
        raise InputError(f"the poses have no stamps, which the other forms need: {path}")
    return Trajectory(parsed.t_ns, parsed.T)
