"""The layouts of recordings: how each one is recognised, read and written.

A layout is an element of LAYOUTS in a module of this package, or an entry point of the group `vobench.datasets`.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from pkgutil import iter_modules

from vobench.dataset.frame_range import with_frames
from vobench.dataset.picture import listed, refuse_lfs_pointer
from vobench.dataset.recording import ReadOptions, Recording
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource
from vobench.errors import InputError, enumerated, unknown_name_sentence
from vobench.geometry.rig import Rig
from vobench.trajectory.trajectory import Stamps, Trajectory

GROUP = "vobench.datasets"
OF_ALL_LAYOUTS = {"frames"}  # options that no reader needs to know
ARCHIVES = {b"PK\x03\x04": "zip", b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"7z\xbc\xaf": "7z", b"\xfd7zXZ": "xz"}
HEAD_BYTES = 512
MAGIC_BYTES_SHOWN = 8
TAR_MAGIC = b"ustar"
TAR_MAGIC_PLACE = slice(257, 262)
MOST_SEARCHED = 200  # the number of files and folders that are searched for recordings to suggest
MOST_SUGGESTED = 5  # the largest number of suggested recordings
MOST_NAMES_SHOWN = 8
LEVELS_ABOVE = 3  # the folder mav0/cam0/data is three levels below its recording


def _frame_stamps(source: ExportSource) -> Stamps:
    return source.sequence.frame_stamps()


@dataclass(frozen=True, slots=True)
class Writing:
    """How a layout is written.

    `write` fills a folder, and returns notes on what was converted.
    `views` returns the rig of the exported pictures.
    `stamps` returns the stamps of the exported frames.
    `path` returns the trajectory of the left camera in the layout; None means the recorded one.
    `topics` are the topics of the left camera, the right camera and the IMU in Kalibr's files.
    `keeps` lists what the layout can represent besides pictures and truth: `imu`, and channels of per-pixel ground
    truth. None means everything.
    """

    write: Callable[[ExportSource, Views, Path], list[str]]
    views: Callable[[Rig], Views] = Views
    stamps: Callable[[ExportSource], Stamps] = _frame_stamps
    path: Callable[[ExportSource, Rig, Stamps], Trajectory | None] | None = None
    topics: tuple[str, str, str] = ("/cam0/image_raw", "/cam1/image_raw", "/imu0")
    keeps: tuple[str, ...] | None = ()


@dataclass(frozen=True, slots=True)
class Layout:
    """A layout of recordings: how it is recognised, read and written.

    `name` is the name of the layout, as in `vobench import --form`.
    `known_by` describes how a user recognises the layout, for messages.
    `sniff` returns whether a folder or file has this layout.
    `read` reads a recording with the given options.
    `heeds` are the names of the ReadOptions that `read` uses.
    `writing` is how recordings are written; None if the layout can only be read.
    `truth` is a regular expression for its files and folders with ground truth, as `folder/name`. The sandbox hides
    them from estimators.
    """

    name: str
    known_by: str
    sniff: Callable[[Path], bool]
    read: Callable[[Path, ReadOptions], Recording]
    heeds: frozenset[str] = frozenset()
    writing: Writing | None = None
    truth: str = ""


def layouts() -> dict[str, Layout]:
    """All layouts by name, those of vobench first. Raises InputError if two have the same name."""
    by_name = {layout.name: layout for layout in _built_in()}
    points = sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value))
    for point in points:
        layout = _loaded(point)
        if layout.name in by_name:
            raise InputError(f"two layouts are called '{layout.name}'; one of them is {point.value}: rename it")
        by_name[layout.name] = layout
    return by_name


def _loaded(point: EntryPoint) -> Layout:
    try:
        layout = point.load()
    except Exception as error:  # a plugin may raise anything
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"the layout {point.value} does not load ({reason})") from error
    if not isinstance(layout, Layout):
        raise InputError(f"{point.value} should be a Layout, but is {type(layout).__name__}")
    return layout


@cache
def _built_in() -> tuple[Layout, ...]:
    room = import_module(__package__ or "")
    built_in: list[Layout] = []
    for info in iter_modules(room.__path__):
        module = import_module(f"{room.__name__}.{info.name}")
        built_in += getattr(module, "LAYOUTS", ())
    return tuple(built_in)


def writable() -> dict[str, Writing]:
    """The layouts that can be written, by name."""
    return {name: layout.writing for name, layout in layouts().items() if layout.writing}


def sniff(path: Path) -> str:
    """The name of the layout of a path.

    Raises InputError if no layout fits, with the known layouts and the content of the path, or if several fit.
    """
    if not path.exists():
        raise InputError(f"no file or folder at {path}")
    if path.is_file():
        refuse_lfs_pointer(head(path), str(path))
    names = _matching(path)
    if not names:
        raise InputError(_unrecognised(path))
    if len(names) > 1:
        raise InputError(f"the content fits more than one form, {' and '.join(names)}; name the one to use: {path}")
    return names[0]


def _matching(path: Path) -> list[str]:
    return [name for name, layout in layouts().items() if layout.sniff(path)]


def head(path: Path) -> bytes:
    """The first bytes of a file; empty for a folder. Raises InputError if the file cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except IsADirectoryError:
        return b""
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def _unrecognised(path: Path) -> str:
    """A sentence about a path that is not a recording, and about recordings near it."""
    if not path.is_dir():
        return _unrecognised_file(path)
    for parent in path.resolve().parents[:LEVELS_ABOVE]:
        names = _matching(parent)
        if names:
            return f"a part of a recording ({names[0]}), which is {parent}; name that instead of {path}"
    names = listed(path)
    if not names:
        return f"an empty folder: {path}"
    recordings = _recordings_below(path)
    if recordings:
        suggested = enumerated(recordings, MOST_SUGGESTED)
        return f"not a recording itself, but some lie below it; name one of {suggested}: {path}"
    content = enumerated(names, MOST_NAMES_SHOWN)
    known = "; ".join(layout.known_by for layout in layouts().values())
    return f"none of the forms that are read ({known}). The folder has {content}: {path}"


def _unrecognised_file(path: Path) -> str:
    start = head(path)
    archive = _archive_kind(start)
    if archive:
        return f"a {archive} archive; unpack it and name the folder: {path}"
    begins = f"it begins with {start[:MAGIC_BYTES_SHOWN]!r}" if start else "it is empty"
    return f"not a recording (MCAP, ROS bag or SQLite): {begins}: {path}"


def _archive_kind(start: bytes) -> str | None:
    """The kind of archive that has these first bytes; None for another file."""
    if start[TAR_MAGIC_PLACE] == TAR_MAGIC:
        return "tar"
    for magic, kind in ARCHIVES.items():
        if start.startswith(magic):
            return kind
    return None


def _recordings_below(folder: Path) -> list[str]:
    """The recordings one or two levels below a folder, as `name (form)`."""
    first_level = _children(folder)
    second_level: list[Path] = []
    for child in first_level:
        if child.is_dir():
            second_level += _children(child)

    searched = [path for path in (*first_level, *second_level) if path.exists()]
    recordings: dict[Path, str] = {}
    for path in searched[:MOST_SEARCHED]:
        is_part = path.parent in recordings
        names = [] if is_part else _matching(path)
        if names:
            recordings[path] = f"{path.relative_to(folder)} ({names[0]})"
    return list(recordings.values())


def _children(folder: Path) -> list[Path]:
    return [folder / name for name in listed(folder)[:MOST_SEARCHED]]


def read(
    path: Path,
    *,
    form: str | None = None,
    options: ReadOptions | None = None,
) -> Recording:
    """The recording at a path. Without `form`, its layout is recognised by its content. Raises VobenchError.

    Its pictures are read when they are iterated.
    """
    options = options or ReadOptions()
    try:
        known = layouts()
        if form is not None and form not in known:
            raise InputError(unknown_name_sentence("form", form, list(known)))
        layout = known[sniff(path) if form is None else form]
        _require_heeded(options, layout)
        recording = layout.read(path, options)
        return with_frames(recording, options.frames) if options.frames else recording
    except OSError as error:  # for example, a folder without permission
        raise InputError(f"cannot read {error.filename or path}: {error.strerror or error}") from None


def _require_heeded(options: ReadOptions, layout: Layout) -> None:
    """Raise InputError for an option that the layout does not use."""
    defaults = ReadOptions()
    for field in fields(ReadOptions):
        if field.name in OF_ALL_LAYOUTS:
            continue
        is_set = getattr(options, field.name) != getattr(defaults, field.name)
        if is_set and field.name not in layout.heeds:
            used = ", ".join(sorted(layout.heeds)) or "none"
            raise InputError(
                f"the option {field.name} does not apply to a recording of the form {layout.name}; "
                f"the options that apply: {used}"
            )
