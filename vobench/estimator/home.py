"""The folder that a program works in: made, read and removed without following what the program has put there.

Homes lie in one folder of the user's in TMPDIR. Each is locked while vobench uses it; what a killed vobench has left is
removed by the next.
"""

import array
import fcntl
import os
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Self

from vobench import stop

BASE = "vobench-homes"
HOME = "home"
DEEPEST = 256  # nested folders whose sizes are added up; each takes a descriptor meanwhile
READ_BYTES = 1 << 20
FOLLOW_NOTHING = os.O_NOFOLLOW | os.O_CLOEXEC
# linux/fs.h: the attributes of a file, and those that keep it from being deleted
GET_FLAGS = 0x80086601
SET_FLAGS = 0x40086602
IMMUTABLE = 0x10
APPEND_ONLY = 0x20


class UnreadableFileError(Exception):
    """A file that a program should have written is none that is read; the message says why."""


class Home:
    """A new folder for a program to work in; it is gone after the block, whatever the program has made of it.

    `path` is free of links; `descriptor` stays that of the folder, also where the program renames it. What cannot be
    removed is noted in the log.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._locked, self._lock = _locked_folder()
        self.path = self._locked / HOME
        self.path.mkdir()
        self.descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)

    @property
    def base(self) -> Path:
        """The folder of all homes of this user."""
        return self._locked.parent

    def __enter__(self) -> Self:
        self._undone = stop.undone(self.close)
        self._undone.__enter__()
        return self

    def __exit__(self, *end: object) -> None:
        self._undone.__exit__(None, None, None)

    def close(self) -> None:
        """Remove the folder, wherever it is by now, and what has taken its place; a second call does nothing."""
        if self._lock < 0:
            return
        lock = self._lock
        self._lock = -1
        left = remove_below(self.descriptor)
        left += self._remove_renamed()
        left += remove_below(lock)
        os.close(self.descriptor)
        with suppress(OSError):
            self._locked.rmdir()
        os.close(lock)
        with suppress(OSError):  # others are in use
            self.base.rmdir()
        if left:
            with suppress(OSError), self._log.open("a", encoding="utf-8") as log:
                log.write(f"\n[vobench: {len(left)} files of its folder could not be removed: {left[0]!r}]\n")

    def _remove_renamed(self) -> list[str]:
        """Remove the emptied folder from the place that the program has moved it to; what could not be removed."""
        with suppress(OSError):
            now = os.readlink(f"/proc/self/fd/{self.descriptor}")
            if now == str(self.path) or not os.path.samestat(os.fstat(self.descriptor), os.lstat(now)):
                return []
            try:
                os.rmdir(now)
            except OSError:
                return [now]
        return []


def _locked_folder() -> tuple[Path, int]:
    """A new folder of this user alone, and the descriptor whose lock ends with this process, however that ends."""
    while True:
        base = _base()
        _sweep_once(base)
        try:
            folder = Path(tempfile.mkdtemp(prefix=f"{os.getpid()}-", dir=base))
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)
        except FileNotFoundError:  # another process has removed the folder of homes, or swept this one
            continue
        with suppress(OSError):  # a file system without locks has no sweeping either
            fcntl.flock(lock, fcntl.LOCK_EX)
        if folder.is_dir():
            return folder, lock
        os.close(lock)


def _base() -> Path:
    """The folder of this user's homes, which nobody else can enter."""
    temporary = Path(tempfile.gettempdir()).resolve()
    base = temporary / f"{BASE}-{os.getuid()}"
    with suppress(FileExistsError):
        base.mkdir(mode=0o700)
    try:
        facts = base.lstat()
    except FileNotFoundError:
        return _base()
    is_private = stat.S_ISDIR(facts.st_mode) and facts.st_uid == os.getuid() and not facts.st_mode & 0o077
    return base if is_private else Path(tempfile.mkdtemp(prefix=f"{BASE}-", dir=temporary))


@cache
def _sweep_once(base: Path) -> None:
    """Remove the homes of processes that were killed: a living one holds a lock. Once a process."""
    for folder in base.glob("*-*"):
        with suppress(OSError):
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                remove_below(lock)
                folder.rmdir()
            finally:
                os.close(lock)


def read_below(folder: int, name: str, *, most_bytes: int, check: Callable[[], object]) -> bytes:
    """The content of the file `name` below the folder of a descriptor; no link is followed on the way.

    `check` is called between parts and may raise. Raises UnreadableFileError, and FileNotFoundError.
    """
    *folders, last = Path(name).parts
    place = os.dup(folder)
    try:
        device = os.fstat(place).st_dev
        for part in folders:
            deeper = _opened(part, os.O_DIRECTORY, place)
            os.close(place)
            place = deeper
        file = _opened(last, os.O_NONBLOCK | os.O_NOCTTY, place)
    finally:
        os.close(place)
    try:
        facts = os.fstat(file)
        if not stat.S_ISREG(facts.st_mode):
            raise UnreadableFileError("is no regular file")
        if facts.st_dev != device or facts.st_nlink != 1:
            raise UnreadableFileError("has a second name, which may be of a file of somebody else (a hard link)")
        return _content(file, most_bytes, check)
    finally:
        os.close(file)


def _opened(name: str, flags: int, folder: int) -> int:
    if name in ("..", "/"):
        raise UnreadableFileError("is outside of its folder")
    try:
        return os.open(name, os.O_RDONLY | FOLLOW_NOTHING | flags, dir_fd=folder)
    except FileNotFoundError:
        raise
    except OSError as error:
        is_link = stat.S_ISLNK(os.lstat(name, dir_fd=folder).st_mode)
        why = "is a symbolic link, and links are not followed" if is_link else f"cannot be read ({error.strerror})"
        raise UnreadableFileError(why) from None


def _content(file: int, most_bytes: int, check: Callable[[], object]) -> bytes:
    content = bytearray()
    while True:
        check()
        try:
            part = os.read(file, READ_BYTES)
        except OSError as error:
            raise UnreadableFileError(f"cannot be read ({error.strerror})") from None
        if not part:
            return bytes(content)
        content += part
        if len(content) > most_bytes:
            raise UnreadableFileError(f"is larger than {most_bytes} bytes")


def held_bytes(folder: int, *, most: int) -> int:
    """What the files below a folder take up, a block at least for each, counted until that is more than `most`.

    Folders nested deeper than DEEPEST are more than any limit.
    """
    held = 0
    walks = [_Walk(os.dup(folder))]
    try:
        while walks:
            walk = walks[-1]
            if not walk.names:
                os.close(walks.pop().folder)
                continue
            name = walk.names.pop()
            with suppress(OSError):
                facts = os.lstat(name, dir_fd=walk.folder)
                held += max(facts.st_blocks * 512, 4096)
                if held > most or len(walks) > DEEPEST:
                    return most + 1
                if stat.S_ISDIR(facts.st_mode):
                    flags = os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING
                    walks.append(_Walk(os.open(name, flags, dir_fd=walk.folder)))
    finally:
        for walk in walks:
            os.close(walk.folder)
    return held


class _Walk:
    """A folder whose names are yet to be looked at."""

    def __init__(self, folder: int) -> None:
        self.folder = folder
        self.names = _names(folder)


def remove_below(folder: int) -> list[str]:
    """Delete all that lies below the folder of a descriptor; returns the names of what could not be deleted.

    Folders in folders are first moved up, so that neither the depth nor the length of a path matters.
    """
    failed = set[str]()
    lifted = 0
    while names := [name for name in _names(folder) if name not in failed]:
        for name in names:
            try:
                if not stat.S_ISDIR(os.lstat(name, dir_fd=folder).st_mode):
                    _unlink(name, folder)
                    continue
                lifted = _lift(name, folder, lifted)
                os.rmdir(name, dir_fd=folder)
            except OSError:
                failed.add(name)
    return sorted(failed)


def _names(folder: int) -> list[str]:
    with suppress(OSError):
        return os.listdir(folder)
    return []


def _lift(name: str, folder: int, lifted: int) -> int:
    """Empty a folder: its files are deleted, its folders moved up beside it. Returns how many were moved so far."""
    _unless_immutable(partial(os.chmod, name, 0o700, dir_fd=folder), name, folder)
    inner = os.open(name, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING, dir_fd=folder)
    try:
        _clear_flags(inner)
        for entry in _names(inner):
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
