"""Layouts of recordings: what each is known by, how it is read and written, and which of them a path is.

A layout is one module of this room with LAYOUTS, or an entry point of the group `vobench.datasets` that is a Layout.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import iter_modules

from vobench.dataset.picture import listed, require_itself
from vobench.dataset.recording import ReadOptions, Recording
from vobench.dataset.source import ExportSource, Views
from vobench.errors import InputError, unknown
from vobench.geometry.rig import Rig
from vobench.trajectory.trajectory import Stamps, Trajectory

GROUP = "vobench.datasets"
ARCHIVES = {b"PK\x03\x04": "zip", b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"7z\xbc\xaf": "7z", b"\xfd7zXZ": "xz"}
HEAD_BYTES = 512
TAR = slice(257, 262), b"ustar"
MOST_LOOKED_AT = 200  # folders below, for a hint on where the recordings are
LEVELS_ABOVE = 3  # mav0/cam0/data is in one


@dataclass(frozen=True, slots=True)
class Writing:
    """How a layout is written: `write` fills a folder and says what was converted.

    `views` makes the pictures' rig, `stamps` are those of the exported frames, and `path` is the left camera's path
    in the layout (None: as recorded). `topics` are those that Kalibr's files name: left, right, IMU. `keeps` says
    what the layout has besides pictures and truth (`imu`, channels of pixels); None stands for everything.
    """

    write: Callable[[ExportSource, Views, Path], list[str]]
    views: Callable[[Rig], Views] = Views
    stamps: Callable[[ExportSource], Stamps] = lambda source: source.sequence.frame_stamps()
    path: Callable[[ExportSource, Rig, Stamps], Trajectory | None] | None = None
    topics: tuple[str, str, str] = ("/cam0/image_raw", "/cam1/image_raw", "/imu0")
    keeps: tuple[str, ...] | None = ()


@dataclass(frozen=True, slots=True)
class Layout:
    """A form of recordings, how it is told, read and written; `heeds` names the ReadOptions that make a difference."""

    name: str
    known_by: str
    sniff: Callable[[Path], bool]
    read: Callable[[Path, ReadOptions], Recording]
    heeds: frozenset[str] = frozenset()
    writing: Writing | None = None


def layouts() -> dict[str, Layout]:
    """Every layout by its name, those that vobench brings along first. Raises InputError for two of one name."""
    found = {layout.name: layout for layout in _built_in()}
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value)):
        try:
            layout = point.load()
        except Exception as error:  # somebody else's code raises what it likes
            raise InputError(f"the layout {point.value} does not load ({type(error).__name__}: {error})") from error
        if not isinstance(layout, Layout):
            raise InputError(f"{point.value} should be a Layout, but is {type(layout).__name__}")
        if layout.name in found:
            raise InputError(f"two layouts are called '{layout.name}'; one of them is {point.value}: rename it")
        found[layout.name] = layout
    return found


@cache
def _built_in() -> tuple[Layout, ...]:
    room = import_module(__package__ or "")
    modules = [import_module(f"{room.__name__}.{module.name}") for module in iter_modules(room.__path__)]
    return tuple(layout for module in modules for layout in getattr(module, "LAYOUTS", ()))


def writable() -> dict[str, Writing]:
    """The layouts that can be written, by name."""
    return {name: layout.writing for name, layout in layouts().items() if layout.writing}


def sniff(path: Path) -> str:
    """The name of the layout. Raises InputError saying what was looked for and found, and what there is below."""
    if not path.exists():
        raise InputError(f"no file or folder at {path}")
    if path.is_file():
        require_itself(head(path), str(path))
    names = _told(path)
    if not names:
        raise InputError(_sentence(path))
    if len(names) > 1:
        raise InputError(f"both {' and '.join(names)} by what is in it; say the form that is meant: {path}")
    return names[0]


def _told(path: Path) -> list[str]:
    return [name for name, layout in layouts().items() if layout.sniff(path)]


def head(path: Path) -> bytes:
    """The first bytes of a file; none of a folder. Raises InputError where it may not be read."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except IsADirectoryError:
        return b""
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def _sentence(path: Path) -> str:
    if not path.is_dir():
        if packed := _packed(head(path)):
            return f"a {packed} archive; unpack it and name the folder: {path}"
        begins = f"it begins with {head(path)[:8]!r}" if head(path) else "it is empty"
        return f"no recording (MCAP, ROS bag or SQLite), for {begins}: {path}"
    for above in path.resolve().parents[:LEVELS_ABOVE]:
        if names := _told(above):
            return f"a part of a recording ({names[0]}), which is {above}; name that instead of {path}"
    names = listed(path)
    if not names:
        return f"an empty folder: {path}"
    if below := _below(path):
        return f"no recording itself, but there are some below; name one of {', '.join(below)}: {path}"
    some = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    known = "; ".join(layout.known_by for layout in layouts().values())
    return f"none of the forms that are read ({known}). It has {some}: {path}"


def _packed(start: bytes) -> str | None:
    """Which kind of archive a file is by its first bytes; tar says so late."""
    place, magic = TAR
    return "tar" if start[place] == magic else next((ARCHIVES[m] for m in ARCHIVES if start.startswith(m)), None)


def _below(folder: Path) -> list[str]:
    """Recordings one or two levels down, a few of them, as `name (form)`."""
    first = [folder / name for name in listed(folder)[:MOST_LOOKED_AT]]
    second = [inner / name for inner in first if inner.is_dir() for name in listed(inner)[:MOST_LOOKED_AT]]
    found: dict[Path, str] = {}
    for path in [path for path in (*first, *second) if path.exists()][:MOST_LOOKED_AT]:
        if not found.keys() & {path.parent} and (names := _told(path)):
            found[path] = f"{path.relative_to(folder)} ({names[0]})"
    some = list(found.values())
    return some[:5] + ([f"{len(some) - 5} more"] if len(some) > 5 else [])


def read(path: Path, *, form: str | None = None, options: ReadOptions | None = None) -> Recording:
    """The recording at a path, its pictures not yet read, as `form` or by content. Raises VobenchError."""
    options = options or ReadOptions()
    try:
        if form is not None and form not in layouts():
            raise InputError(unknown("form", form, list(layouts())))
        layout = layouts()[sniff(path) if form is None else form]
        _require_heeded(options, layout)
        return layout.read(path, options)
    except OSError as error:  # a folder that may not be looked into
        raise InputError(f"cannot read {error.filename or path}: {error.strerror or error}") from None


def _require_heeded(options: ReadOptions, layout: Layout) -> None:
    plain = ReadOptions()
    said = [field.name for field in fields(ReadOptions) if getattr(options, field.name) != getattr(plain, field.name)]
    idle = [name for name in said if name not in layout.heeds]
    if idle:
        knows = ", ".join(sorted(layout.heeds)) or "none"
        raise InputError(
            f"the option {idle[0]} means nothing to a recording of the form {layout.name}; it heeds: {knows}"
        )
