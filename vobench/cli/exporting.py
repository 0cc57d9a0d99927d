"""vobench export."""

from pathlib import Path

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.trajectory.trajectory import Trajectory

SENSORS_FILE = "sensors.mcap"


def show(source: Path, out: Path, *, form: str, as_json: bool) -> None:
    """Write a sequence in another layout, or a trajectory in another form, and print what was converted or lost."""
    path = source.parent if source.name == SENSORS_FILE else source
    notes, files = _trajectory(path, out, form) if path.is_file() else _sequence(path, out, form)
    if as_json:
        terminal.print_json({"form": form, "path": str(out), "files": files, "notes": notes})
        return
    for note in notes:
        print(f"- {note}")
    print(f"{files} {'file' if files == 1 else 'files'} in the form '{form}': {out}")


def _sequence(folder: Path, out: Path, form: str) -> tuple[tuple[str, ...], int]:
    from vobench.dataset.export import FORMS, export

    if form in FORMS and folder.is_dir() and not (folder / SENSORS_FILE).is_file():
        raise InputError(f"no sequence of ours (it has no {SENSORS_FILE}); vobench import makes one: {folder}")
    exported = export(folder, out, form)
    return exported.notes, len(exported.files)


def _trajectory(path: Path, out: Path, form: str) -> tuple[tuple[str, ...], int]:
    from vobench.dataset.export_trajectory import export_trajectory

    files = export_trajectory(_read(path), out, form)
    return tuple(f"KITTI's poses have no stamps: those are in {file.name}." for file in files[1:]), len(files)


def _read(path: Path) -> Trajectory:
    """The poses of a text in any form, or the only ones of a recording."""
    from vobench.dataset.files import read_text
    from vobench.sequence.pose_topic import is_recording, read_poses
    from vobench.trajectory.form import parse_any

    if is_recording(path):
        return read_poses(path, None)
    parsed = parse_any(read_text(path), name=str(path))
    if parsed.t_ns is None:
        raise InputError(f"poses without stamps, which the other forms need: {path}")
    return Trajectory(parsed.t_ns, parsed.T)
