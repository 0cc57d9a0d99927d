"""The commands vobench import and vobench export."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, with_option_groups
from vobench.cli.recording_option import FormCommand, ImuFile, RecordingOptions, RecordingPath
from vobench.dataset.export import export, export_trajectory
from vobench.dataset.layout import read, writable
from vobench.dataset.picture import read_text, require_free
from vobench.errors import InputError
from vobench.runner.import_recording import import_recording
from vobench.runner.store import sweep, unfinished
from vobench.sequence import Sequence
from vobench.sequence.recording import is_recording, read_poses
from vobench.trajectory.formats import parse_any
from vobench.trajectory.trajectory import Trajectory

COMMAND_CLASS = FormCommand
SENSORS_FILE = "sensors.mcap"


@with_option_groups
def import_command(
    path: RecordingPath,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the new sequence.")],
    *,
    recording_options: RecordingOptions,
    imu: ImuFile = None,
    json: Json = False,
) -> None:
    """Convert a dataset's folder or a bag to a sequence, and print what was assumed or left out."""
    require_free(out)
    recording = read(path, form=recording_options.form, options=recording_options.read_options(imu))
    sweep(out.resolve().parent)
    with unfinished(out.resolve().parent) as folder:
        import_recording(recording, folder)
        if out.is_dir():
            out.rmdir()
        folder.rename(out)

    frame_count = len(Sequence.open(out))
    if json:
        content = {"form": recording.form, "path": str(out), "frames": frame_count, "notes": recording.notes}
        terminal.print_json(content)
        return
    for note in recording.notes:
        print(f"- {note}")
    noun = "frame" if frame_count == 1 else "frames"
    print(f"imported {frame_count} {noun} of a recording of the form '{recording.form}': {out}")


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """The number of files that an export wrote, and notes on what was lost."""

    file_count: int
    notes: tuple[str, ...]


def export_command(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="The folder of a sequence, or a trajectory file.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder or file to write; it must not exist.")],
    *,
    form: Annotated[str, typer.Option(help="The form to write")],
    json: Json = False,
) -> None:
    """Write a sequence in another layout, or a trajectory in another form, and print what was lost."""
    path = source.parent if source.name == SENSORS_FILE else source
    write = _export_trajectory if path.is_file() else _export_sequence
    exported = write(path, out, form)
    if json:
        content = {"form": form, "path": str(out), "files": exported.file_count, "notes": exported.notes}
        terminal.print_json(content)
        return
    for note in exported.notes:
        print(f"- {note}")
    noun = "file" if exported.file_count == 1 else "files"
    print(f"exported {exported.file_count} {noun} of the form '{form}': {out}")


def _export_sequence(folder: Path, out: Path, form: str) -> WrittenFiles:
    """Write a sequence in another layout.

    Raises VobenchError if the folder is not a sequence, or the form is unknown.
    """
    is_other_folder = folder.is_dir() and not (folder / SENSORS_FILE).is_file()
    if form in writable() and is_other_folder:
        raise InputError(f"not a vobench sequence (it has no {SENSORS_FILE}); vobench import creates one: {folder}")
    exported = export(folder, out, form)
    return WrittenFiles(len(exported.files), exported.notes)


def _export_trajectory(path: Path, out: Path, form: str) -> WrittenFiles:
    """Write a trajectory in another form. Raises VobenchError if it cannot be read, or the form is unknown."""
    files = export_trajectory(_read_trajectory(path), out, form)
    stamp_files = files[1:]  # only KITTI's form has one
    notes = tuple(f"Poses in KITTI's form have no stamps; the stamps are in {file.name}." for file in stamp_files)
    return WrittenFiles(len(files), notes)


def _read_trajectory(path: Path) -> Trajectory:
    """The poses of a text file in any form, or the only ones of a recording. Raises InputError."""
    if is_recording(path):
        return read_poses(path, None)
    parsed = parse_any(read_text(path), name=str(path))
    if parsed.t_ns is None:
        raise InputError(f"the poses have no stamps, which the other forms need: {path}")
    return Trajectory(parsed.t_ns, parsed.T)
