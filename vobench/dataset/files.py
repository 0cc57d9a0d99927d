"""A dataset's files: there, of a bearable size, themselves and no Git-LFS pointers, and inside their folder."""

from pathlib import Path, PurePosixPath, PureWindowsPath

from vobench.errors import InputError
from vobench.trajectory.form import LFS_POINTER

MOST_NAME = 1024  # characters of a file's name in a list, folders and all
MOST_BYTES = 1 << 30  # an hour of IMU readings is a tenth of it


def read_bytes(path: Path) -> bytes:
    """A file's bytes. Raises InputError where there is no file, it is huge, or a Git-LFS pointer stands for it."""
    try:
        if not path.is_file():
            raise InputError(f"{'not a file' if path.exists() else 'no such file'}: {path}")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{size} bytes, and {MOST_BYTES} is the most that is read at once: {path}")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from None
    require_itself(data, str(path))
    return data


def read_text(path: Path) -> str:
    """A text file in UTF-8. Raises InputError as `read_bytes` does, and where it is no text."""
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"not a text file in UTF-8 (byte {error.start} is {data[error.start]:#04x}): {path}") from None
    if "\0" in text:
        raise InputError(f"not a text file (it has a zero byte): {path}")
    return text


def require_itself(data: bytes, name: str) -> None:
    """Raise InputError for a Git-LFS pointer."""
    if data.startswith(LFS_POINTER.encode()):
        raise InputError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")


def require_themselves(folder: Path) -> None:
    """Raise InputError for the first file of a folder that is a Git-LFS pointer."""
    for name in listed(folder):
        if (folder / name).is_file():
            with (folder / name).open("rb") as file:
                require_itself(file.read(len(LFS_POINTER)), str(folder / name))


def inside(folder: Path, name: str, place: str) -> Path:
    """The file that a list names, below `folder`; links on the disk are the owner's and are followed.

    Raises InputError for a name that is absolute or climbs out; `place` is where the list has it.
    """
    parts = PurePosixPath(name.replace("\\", "/"))
    if not 0 < len(name) <= MOST_NAME or parts.is_absolute() or PureWindowsPath(name).drive or ".." in parts.parts:
        raise InputError(f"{place}: a file's name should stay inside {folder}, but is {name[:200]!r}")
    return folder.joinpath(*parts.parts)


def listed(folder: Path) -> list[str]:
    """The names in a folder, sorted; none where there is no such folder."""
    try:
        return sorted(entry.name for entry in folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def require_free(out: Path) -> None:
    """Raise InputError unless a folder may be made there."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"should be a new or empty folder, but there is something: {out}")


def unread(folder: Path, *used: str) -> tuple[str, ...]:
    """The sentence on what lies in a folder and was not read, where there is something."""
    others = [name for name in listed(folder) if name not in used and not name.startswith(".")]
    some = ", ".join(others[:12]) + (f" and {len(others) - 12} more" if len(others) > 12 else "")
    return (f"Not read: {some}.",) if others else ()
