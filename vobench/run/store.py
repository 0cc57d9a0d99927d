"""The store of finished results, addressed by a hash of all that they depend on; unfinished folders, progress."""

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, Protocol, TypeVar

from vobench import stop
from vobench.run.key import canonical, digest

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


class Store:
    """Finished folders under a root; what is not finished is never seen under its final name."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def path(self, kind: str, inputs: Mapping[str, Any]) -> Path:
        """Where the result of these inputs lies, or will lie."""
        return self.root / kind / digest(inputs)

    def get(self, kind: str, inputs: Mapping[str, Any], build: Callable[[Path], None]) -> Path:
        """The folder made from these inputs; `build` fills an empty one where there is none yet."""
        stop.check()
        final = self.path(kind, inputs)
        if final.is_dir():
            return final
        with unfinished(final.parent) as folder:
            build(folder)
            (folder / "inputs.json").write_text(canonical(inputs), encoding="utf-8")
            try:
                folder.rename(final)
            except OSError:  # where another process was faster, both hold the same
                if not final.is_dir():
                    raise
        return final

    def forget(self, kind: str, inputs: Mapping[str, Any]) -> None:
        """Take the result of these inputs out of the store, in one step."""
        final = self.path(kind, inputs)
        if final.is_dir():
            with unfinished(final.parent) as folder, suppress(FileNotFoundError):
                final.rename(folder / "forgotten")


def write_json(path: Path, content: Any) -> None:
    """JSON that people can read."""
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


Item = TypeVar("Item")


class Progress(Protocol):
    """Receives news of the work, for a bar on a terminal or for nobody."""

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items; `total` of them are expected."""

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """Work of unknown length, which may tell what share of it is done."""


class SilentProgress:
    """Progress that nobody hears of."""

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items."""
        del what, total
        return iter(items)

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """No context around the work."""
        del what
        return nullcontext(lambda _: None)
