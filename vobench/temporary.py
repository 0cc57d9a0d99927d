"""Folders for what is needed for a while: locked while they are in use, and removed by the next vobench otherwise.

They lie in one folder of the user's in TMPDIR, which nobody else can enter. A lock ends with its process, however that
ends, so a folder without a lock is one that a killed process has left.
"""

import array
import fcntl
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path

from vobench import stop

BASE = "vobench"
FOLLOW_NOTHING = os.O_NOFOLLOW | os.O_CLOEXEC
# linux/fs.h: the attributes of a file, and those that keep it from being deleted
GET_FLAGS = 0x80086601
SET_FLAGS = 0x40086602
IMMUTABLE = 0x10
APPEND_ONLY = 0x20


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A new folder for the length of a block; a stopped process removes it, a killed one leaves it to the next."""
    folder, lock = locked_folder()

    def close() -> None:
        remove_below(lock)
        with suppress(OSError):
            folder.rmdir()
        os.close(lock)
        with suppress(OSError):  # others are in use
            folder.parent.rmdir()

    with stop.cleanup_after(close):
        yield folder


def locked_folder() -> tuple[Path, int]:
    """A new folder of this user alone, and the descriptor whose lock ends with this process, however that ends."""
    while True:
        base = _base()
        _sweep_once(base)
        try:
            folder = Path(tempfile.mkdtemp(prefix=f"{os.getpid()}-", dir=base))
        except FileNotFoundError:  # another process has removed the base
            continue
        lock = lock_new_folder(folder)
        if lock is not None:
            return folder, lock


def lock_new_folder(folder: Path) -> int | None:
    """The descriptor that locks a folder made just now; None if another process swept it before it had a lock."""
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)
    except FileNotFoundError:
        return None
    with suppress(OSError):  # a file system without locks has no sweeping either
        fcntl.flock(lock, fcntl.LOCK_EX)
    if folder.is_dir():
        return lock
    os.close(lock)
    return None


def _base() -> Path:
    """The folder of this user's temporary folders, which nobody else can enter."""
    base = _base_path()
    with suppress(FileExistsError):
        base.mkdir(mode=0o700)
    if not os.path.lexists(base):  # another process has removed it
        return _base()
    return base if _is_private(base) else Path(tempfile.mkdtemp(prefix=f"{BASE}-", dir=base.parent))


def _base_path() -> Path:
    return Path(tempfile.gettempdir()).resolve() / f"{BASE}-{os.getuid()}"


def _is_private(base: Path) -> bool:
    """Whether a path is a folder of this user that nobody else can enter."""
    try:
        facts = base.lstat()
    except FileNotFoundError:
        return False
    is_own_folder = stat.S_ISDIR(facts.st_mode) and facts.st_uid == os.getuid()
    is_open_to_others = facts.st_mode & 0o077
    return is_own_folder and not is_open_to_others


def remove_abandoned_folders() -> None:
    """Remove the folders of processes that were killed, and the folder that holds them if no other is in use."""
    base = _base_path()
    if not _is_private(base):
        return
    _sweep(base)
    with suppress(OSError):  # others are in use
        base.rmdir()


@cache
def _sweep_once(base: Path) -> None:
    """Remove the folders of processes that were killed. Once a process."""
    _sweep(base)


def _sweep(base: Path) -> None:
    for folder in base.glob("*-*"):
        remove_if_abandoned(folder)


def remove_if_abandoned(folder: Path) -> None:
    """Remove a folder whose process was killed: a living one holds a lock."""
    with suppress(OSError):
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            remove_below(lock)
            folder.rmdir()
        finally:
            os.close(lock)


def remove_below(folder: int) -> list[str]:
    """Delete all that lies below the folder of a descriptor; returns the names of what could not be deleted.

    Folders in folders are first moved up, so that neither the depth nor the length of a path matters.
    """
    failed = set[str]()
    lifted = 0
    while left := [name for name in names(folder) if name not in failed]:
        for name in left:
            try:
                if not stat.S_ISDIR(os.lstat(name, dir_fd=folder).st_mode):
                    _unlink(name, folder)
                    continue
                lifted = _lift(name, folder, lifted)
                os.rmdir(name, dir_fd=folder)
            except OSError:
                failed.add(name)
    return sorted(failed)


def names(folder: int) -> list[str]:
    """The names in the folder of a descriptor; none where it cannot be read."""
    with suppress(OSError):
        return os.listdir(folder)
    return []


def _lift(name: str, folder: int, lifted: int) -> int:
    """Empty a folder: its files are deleted, its folders moved up beside it. Returns how many were moved so far."""
    _unless_immutable(partial(os.chmod, name, 0o700, dir_fd=folder), name, folder)
    inner = os.open(name, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING, dir_fd=folder)
    try:
        _clear_flags(inner)
        for entry in names(inner):
            if not stat.S_ISDIR(os.lstat(entry, dir_fd=inner).st_mode):
                _unlink(entry, inner)
                continue
            _unless_immutable(partial(os.chmod, entry, 0o700, dir_fd=inner), entry, inner)
            move = partial(os.rename, entry, f".lifted-{os.getpid()}-{lifted}", src_dir_fd=inner, dst_dir_fd=folder)
            _unless_immutable(move, entry, inner)
            lifted += 1
    finally:
        os.close(inner)
    return lifted


def _unlink(name: str, folder: int) -> None:
    _unless_immutable(partial(os.unlink, name, dir_fd=folder), name, folder)


def _unless_immutable(action: Callable[[], object], name: str, folder: int) -> None:
    """Do something to a file, a second time where it was immutable."""
    try:
        action()
    except PermissionError:
        file = os.open(name, os.O_RDONLY | os.O_NONBLOCK | FOLLOW_NOTHING, dir_fd=folder)
        try:
            _clear_flags(file)
        finally:
            os.close(file)
        action()


def _clear_flags(file: int) -> None:
    """Take away the attributes that keep a file or folder from being deleted, where it has them and we may."""
    with suppress(OSError):
        flags = array.array("l", [0])
        fcntl.ioctl(file, GET_FLAGS, flags)
        if flags[0] & (IMMUTABLE | APPEND_ONLY):
            flags[0] &= ~(IMMUTABLE | APPEND_ONLY)
            fcntl.ioctl(file, SET_FLAGS, flags)
