"""Folders that nobody sees before they are whole, and that do not outlive the process that fills them for long."""

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from vobench import stop

PREFIX = ".unfinished-"


def why_unwritable(folder: Path) -> str:
    """Why files cannot be made in a folder, which is made where it is missing; empty where they can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return str(error.strerror)
    return "" if os.access(folder, os.W_OK) else "Permission denied"


@contextmanager
def unfinished(parent: Path) -> Iterator[Path]:
    """An empty folder to fill and rename; one that keeps its name is gone after the block.

    What killed processes left behind in `parent` is swept away first: a living one holds a lock.
    """
    parent.mkdir(parents=True, exist_ok=True)
    _sweep(parent)
    folder, lock = _locked(parent)
    try:
        with stop.undone(lambda: stop.remove(folder)):
            yield folder
    finally:
        os.close(lock)


def _locked(parent: Path) -> tuple[Path, int]:
    """A new folder, and the descriptor whose lock ends with this process, however that ends."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        folder.chmod(0o755)
        lock = os.open(folder, os.O_RDONLY)
        with suppress(OSError):  # a file system without locks has no sweeping either
            fcntl.flock(lock, fcntl.LOCK_EX)
        if folder.is_dir():
            return folder, lock
        os.close(lock)  # another process swept it between its making and its lock


def _sweep(parent: Path) -> None:
    for folder in parent.glob(f"{PREFIX}*"):
        with suppress(OSError):
            lock = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)
