"""The folder that a program works in: made, read and removed without following what the program has put there.

A home is a temporary folder of vobench's (`temporary`): what a killed vobench has left is removed by the next.
"""

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Self

from vobench import stop
from vobench.temporary import FOLLOW_NOTHING, locked_folder, names, remove_below

HOME = "home"
DEEPEST = 256  # nested folders whose sizes are added up; each takes a descriptor meanwhile
READ_BYTES = 1 << 20


class UnreadableFileError(Exception):
    """A file that a program should have written is none that is read; the message says why."""


class Home:
    """A new folder for a program to work in; it is gone after the block, whatever the program has made of it.

    `path` is free of links; `descriptor` stays that of the folder, also where the program renames it. What cannot be
    removed is noted in the log.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._locked, self._lock = locked_folder()
        self.path = self._locked / HOME
        self.path.mkdir()
        self.descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)

    @property
    def base(self) -> Path:
        """The folder of all homes of this user."""
        return self._locked.parent

    def __enter__(self) -> Self:
        self._undone = stop.cleanup_after(self.close)
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
        self.names = names(folder)
