"""The folder that a program works in. It is created, read and removed without following the program's links.

A home is a temporary folder of vobench (`temporary`). If vobench is killed, its next process removes the folder.
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
DEEPEST = 256  # the largest depth of nested folders whose sizes are added up; each level takes a descriptor
READ_BYTES = 1 << 20


class UnreadableFileError(Exception):
    """An output file of a program cannot be read safely.

    The message is a predicate for the file, such as "is empty".
    """


class Home:
    """A new folder for a program to work in. It is removed at the end of the block.

    `path` contains no links. `descriptor` refers to the folder even if the program renames it.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._locked, self._lock = locked_folder()
        self.path = self._locked / HOME
        self.path.mkdir()
        self.descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | FOLLOW_NOTHING)

    @property
    def base(self) -> Path:
        """The folder that holds all homes of this user."""
        return self._locked.parent

    def __enter__(self) -> Self:
        self._undone = stop.cleanup_after(self.close)
        self._undone.__enter__()
        return self

    def __exit__(self, *end: object) -> None:
        self._undone.__exit__(None, None, None)

    def close(self) -> None:
        """Remove the folder, even if the program has moved it, and what is now in its place.

        Files that cannot be removed are noted in the log. A second call does nothing.
        """
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
        with suppress(OSError):  # other homes are in use
            self.base.rmdir()
        if left:
            with suppress(OSError), self._log.open("a", encoding="utf-8") as log:
                log.write(f"\n[vobench: {len(left)} files of its folder could not be removed: {left[0]!r}]\n")

    def _remove_renamed(self) -> list[str]:
        """Remove the empty folder if the program has moved it, and return its path if that fails."""
        with suppress(OSError):
            current_path = os.readlink(f"/proc/self/fd/{self.descriptor}")
            is_unmoved = current_path == str(self.path)
            if is_unmoved or not os.path.samestat(os.fstat(self.descriptor), os.lstat(current_path)):
                return []
            try:
                os.rmdir(current_path)
            except OSError:
                return [current_path]
        return []


def read_below(folder: int, name: str, *, most_bytes: int, check: Callable[[], object]) -> bytes:
    """The content of the file `name` below a folder, which is given by its descriptor. No link is followed.

    `check` is called before each part of the file is read, and may raise.
    Raises FileNotFoundError if there is no such file, and UnreadableFileError if it is not safe to read or too large.
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
    """The descriptor of a file in a folder, opened for reading. Raises UnreadableFileError for a link."""
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
    """The content of an open file. Raises UnreadableFileError if it is larger than `most_bytes`."""
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
    """The disk space of all files below a folder, at least one block for each. Counting stops above `most`.

    For folders that are nested deeper than DEEPEST, the result is `most` + 1.
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
    """A folder, and the names in it that have not been visited."""

    def __init__(self, folder: int) -> None:
        self.folder = folder
        self.names = names(folder)
