"""The store of finished results, whose keys are hashes of everything that they depend on.

The folder <root>/<kind>/<hash>/ contains a result and its manifest. <root>/state/ contains locks, recorded checks and
durations.
"""

import fcntl
import json
import math
import os
import shutil
import socket
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from vobench import stop
from vobench.errors import InputError
from vobench.runner.entry import MANIFEST, States, fault, remember, seal
from vobench.runner.key import canonical, digest
from vobench.temporary import lock_new_folder, remove_if_abandoned

PREFIX = ".unfinished-"
BAD = ".bad-"
STATE = "state"
INPUTS = "inputs.json"
TIMED = 50  # the approximate number of results of a stage whose durations are recorded
# The first and the largest pause between attempts to take a lock. Ctrl-C is handled between attempts.
FIRST_LOOK_S = 1e-3
LOOK_S = 0.2
PATIENCE_S = 0.5  # the time after which the user is told that a process waits

Tell = Callable[[str], object]


def why_unwritable(folder: Path) -> str:
    """The reason why files cannot be created in a folder; empty if they can. A missing folder is created."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return str(error.strerror)
    return "" if os.access(folder, os.W_OK) else "Permission denied"


@contextmanager
def unfinished(parent: Path) -> Iterator[Path]:
    """An empty folder to fill and rename. If it is not renamed, it is removed after the block."""
    parent.mkdir(parents=True, exist_ok=True)
    folder, lock = _locked_folder(parent)
    try:
        with stop.cleanup_after(lambda: stop.remove(folder)):
            yield folder
    finally:
        os.close(lock)


def _locked_folder(parent: Path) -> tuple[Path, int]:
    """A new folder, and a descriptor that holds its lock until this process ends in any way."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        lock = lock_new_folder(folder)
        if lock is not None:
            os.fchmod(lock, 0o755)
            return folder, lock


def sweep(parent: Path) -> None:
    """Remove the unfinished folders of killed processes. Those of running processes are locked."""
    for folder in parent.glob(f"{PREFIX}*"):
        remove_if_abandoned(folder)


@contextmanager
def locked(path: Path, tell: Tell = lambda _: None) -> Iterator[None]:
    """Let only one process at a time enter the block. Its id is in the file `path`. Raises Stopped while it waits.

    The lock is released when the process ends in any way.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = _awaited(path, tell)
    try:
        with stop.cleanup_after(lambda: path.unlink(missing_ok=True)):
            yield
    finally:
        os.close(lock)


def _awaited(path: Path, tell: Tell) -> int:
    """Wait for the lock of a path, and return the descriptor that holds it."""
    began = time.monotonic()
    look_s = FIRST_LOOK_S
    while (lock := _taken(path)) is None:
        stop.check()
        if began and time.monotonic() - began > PATIENCE_S:
            began = 0.0
            tell(f"waiting for {_holder(path) or 'another process'}, which makes {path.name}")
        time.sleep(look_s)
        look_s = min(2 * look_s, LOOK_S)
    return lock


def _taken(path: Path) -> int | None:
    """Lock a file, and return the descriptor that holds the lock; None if another process holds it."""
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        return None
    except OSError:  # on a file system without locks, several processes compute a result, and the first one is used
        return lock
    with suppress(FileNotFoundError):
        if os.path.samestat(os.fstat(lock), path.stat()):
            os.truncate(lock, 0)
            os.write(lock, f"process {os.getpid()} on {socket.gethostname()}".encode())
            return lock
    os.close(lock)  # the previous holder has removed the file
    return None


def _unlink_if_free(path: Path) -> None:
    """Remove the file of a lock unless a process holds it."""
    with suppress(OSError):
        lock = os.open(path, os.O_RDWR)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(lock), path.stat()):
                path.unlink()
        finally:
            os.close(lock)


def _holder(path: Path) -> str:
    with suppress(OSError):
        return path.read_text(encoding="utf-8", errors="replace")
    return ""


@dataclass(frozen=True, slots=True)
class StoreEntry:
    """A folder in the store, with the times of its creation and last use in seconds since 1970."""

    kind: str
    path: Path
    bytes: int
    made_s: float
    used_s: float

    @property
    def key(self) -> str:
        """The key of the result, as tasks refer to it."""
        return f"{self.kind}/{self.path.name}"

    @property
    def is_damaged(self) -> bool:
        """Whether the result is damaged, and has been renamed."""
        return self.path.name.startswith(BAD)


def _entry(path: Path) -> StoreEntry:
    used_s = path.stat().st_mtime
    files = [path]
    if path.is_dir():
        files = [file for file in path.rglob("*") if file.is_file()]
    stats = [file.stat() for file in files]
    size = sum(facts.st_size for facts in stats)
    made_s = max((facts.st_mtime for facts in stats), default=used_s)
    return StoreEntry(path.parent.name, path, size, made_s, used_s)


LIMIT = "VOBENCH_CACHE_GB"
GB = 1e9


def limit_bytes() -> float:
    """The size limit of the store from $VOBENCH_CACHE_GB; infinite if it is not set."""
    said = os.environ.get(LIMIT) or "inf"
    with suppress(ValueError):
        if (limit := float(said)) > 0:
            return limit * GB
    raise InputError(f"{LIMIT} should be a number of gigabytes above 0 (got {said!r})")


class Store:
    """Finished folders below a root. A folder gets its final name only when it is complete."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def path(self, kind: str, inputs: Mapping[str, Any]) -> Path:
        """The path of the result of some inputs, whether it exists or not."""
        return self.root / kind / digest(inputs)

    def fault(self, key: str, *, anew: bool = False) -> str:
        """What is wrong with the result of a key `<kind>/<hash>`; empty if nothing. `anew` hashes all files again."""
        return fault(self.root / key, None if anew else self._checked(key))

    def has(self, key: str) -> bool:
        """Whether an undamaged result exists. It counts as used."""
        folder = self.root / key
        if not folder.is_dir() or self.fault(key):
            return False
        with suppress(OSError):
            os.utime(folder)
        return True

    def need(self, key: str) -> Path:
        """The folder of a required result. Raises InputError if it is missing or damaged."""
        if self.has(key):
            return self.root / key
        is_there = (self.root / key).is_dir()
        wrong = f"is damaged ({self.fault(key)})" if is_there else "is gone"
        raise InputError(
            f"a result that this depends on {wrong}; run the same command again to recreate it: {self.root / key}"
        )

    def get(
        self,
        kind: str,
        inputs: Mapping[str, Any],
        build: Callable[[Path], None],
        *,
        keeps: Callable[[Path], bool] = lambda _: True,
        tell: Tell = lambda _: None,
    ) -> Path:
        """The folder of the result of some inputs. If there is no undamaged result, `build` fills an empty folder.

        A result for which `keeps` is false is computed again, unless another process does so while this one waits.
        Raises InputError if the store cannot be written.
        """
        stop.check()
        final = self.path(kind, inputs)
        key = f"{kind}/{final.name}"
        before = _made(final)
        if self.has(key) and keeps(final):
            return final
        self.require_writable()
        with locked(self._lock(key), tell):
            self._set_aside_damaged(key, tell)
            if final.is_dir() and (_made(final) != before or keeps(final)):
                return final
            old = _made(final)
            with unfinished(final.parent) as folder:
                build(folder)
                (folder / INPUTS).write_text(canonical(inputs), encoding="utf-8")
                states = seal(folder)
                if old and old == _made(final):
                    discard(final)
                self._publish(folder, final, states)
        return final

    def _publish(self, folder: Path, final: Path, states: States) -> None:
        try:
            folder.rename(final)
        except OSError:  # without locks, another process may have been faster; both results are equal
            if not final.is_dir():
                raise
            return
        remember(self._checked(f"{final.parent.name}/{final.name}"), states)

    def note_seconds(self, stage: str, seconds: float) -> None:
        """Record the duration of a task."""
        path = self.root / STATE / "seconds" / stage
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a", encoding="ascii") as file:
                file.write(f"{seconds:.3f}\n")

    def seconds(self, stage: str) -> list[float]:
        """The durations of the last results of a stage, in s; empty if there are none."""
        with suppress(OSError, ValueError):
            path = self.root / STATE / "seconds" / stage
            lines = path.read_text(encoding="ascii").split()
            return [float(line) for line in lines[-TIMED:]]
        return []

    def forget(self, keys: Iterable[str]) -> None:
        """Remove results, so that they are computed again. Results that another process is computing are kept."""
        for key in keys:
            if (self.root / key).is_dir():
                self._removed(_entry(self.root / key))

    def set_aside_damaged(self, keys: Iterable[str], tell: Tell) -> None:
        """Rename damaged results, and tell the user why."""
        for key in keys:
            if (self.root / key).is_dir() and self.fault(key):
                with locked(self._lock(key), tell):
                    self._set_aside_damaged(key, tell)

    def _set_aside_damaged(self, key: str, tell: Tell) -> None:
        folder = self.root / key
        if folder.is_dir() and (wrong := self.fault(key)):
            aside = folder.with_name(f"{BAD}{folder.name}")
            shutil.rmtree(aside, ignore_errors=True)
            folder.rename(aside)
            tell(f"a damaged result is computed again, because {wrong}: {folder}")

    def require_writable(self) -> None:
        """Raise InputError if the store cannot be written."""
        if cause := why_unwritable(self.root):
            raise InputError(f"VOBENCH_CACHE should be a folder that can be written ({cause}): {self.root}")

    @contextmanager
    def in_use(self, tell: Tell) -> Iterator[None]:
        """A block, such as a run, during which results that it uses are not removed.

        At the end, the user is told if the store exceeds its size limit. Raises InputError for an invalid limit.
        """
        limit = limit_bytes()
        runs = self.root / STATE / "runs"
        if why_unwritable(self.root):
            yield
            return
        self.sweep()
        with locked(runs / f"{socket.gethostname()}-{os.getpid()}-{time.monotonic_ns()}"):
            yield
        if limit == math.inf:
            return
        held = sum(entry.bytes for entry in self.entries())
        if held > limit:
            tell(
                f"the cache holds {held / GB:.3g} GB, more than {LIMIT} says; "
                f"run: vobench cache gc --keep-gb {limit / GB:g}"
            )

    def sweep(self) -> None:
        """Remove the unfinished folders and the locks of killed processes."""
        for kind in self._kinds():
            sweep(kind)
        for name in ("runs", "locks"):
            for path in self.root.glob(f"{STATE}/{name}/*"):
                _unlink_if_free(path)

    def entries(self) -> Iterator[StoreEntry]:
        """All results in the store, including damaged ones."""
        for kind in self._kinds():
            for path in sorted(kind.iterdir()):
                with suppress(OSError):  # another process may have removed it
                    if not path.name.startswith(PREFIX):
                        yield _entry(path)

    def _kinds(self) -> list[Path]:
        folders = [path for path in self.root.glob("*") if path.is_dir()]
        return sorted(path for path in folders if path.name != STATE)

    def collect(self, *, keep_bytes: float = math.inf, older_s: float = math.inf) -> list[StoreEntry]:
        """Remove unfinished and damaged results, results that have not been used for `older_s`, and then the oldest.

        Results that a process is computing, or that a run uses, are kept. Returns the removed entries.
        """
        self.require_writable()
        self.sweep()
        now_s = time.time()
        starts_s = [path.stat().st_mtime for path in self.root.glob(f"{STATE}/runs/*")]
        first_run_s = min(starts_s, default=math.inf)
        entries = sorted(self.entries(), key=lambda entry: (not entry.is_damaged, entry.used_s))
        held = sum(entry.bytes for entry in entries)
        removed = list[StoreEntry]()
        for entry in entries:
            stop.check()
            is_old = now_s - entry.used_s > older_s
            is_unused = entry.used_s < first_run_s  # by the current runs
            is_dispensable = is_unused and (is_old or held > keep_bytes)
            if (entry.is_damaged or is_dispensable) and self._removed(entry):
                held -= entry.bytes
                removed.append(entry)
        return removed

    def _removed(self, entry: StoreEntry) -> bool:
        """Remove an entry unless a process holds its lock. Returns whether it was removed."""
        self._lock(entry.key).parent.mkdir(parents=True, exist_ok=True)
        lock = _taken(self._lock(entry.key))
        if lock is None:
            return False
        try:
            discard(entry.path)
            self._checked(entry.key).unlink(missing_ok=True)
            self._lock(entry.key).unlink(missing_ok=True)
        finally:
            os.close(lock)
        return True

    def _checked(self, key: str) -> Path:
        return self.root / STATE / "checked" / f"{key}.json"

    def _lock(self, key: str) -> Path:
        return self.root / STATE / "locks" / key.replace("/", "-")


def _made(folder: Path) -> tuple[int, int] | None:
    """The identity of a folder, which changes when a result is computed again."""
    with suppress(OSError):
        stat = (folder / MANIFEST).stat()
        return stat.st_ino, stat.st_mtime_ns
    return None


def discard(path: Path) -> None:
    """Rename a file or a folder in one step, and remove it with its content."""
    gone = path.with_name(f"{PREFIX}{path.name}-old")
    shutil.rmtree(gone, ignore_errors=True)
    path.rename(gone)
    if gone.is_dir():
        shutil.rmtree(gone, ignore_errors=True)
    else:
        gone.unlink()


def write_json(path: Path, content: Any) -> None:
    """Write content as indented JSON."""
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


Item = TypeVar("Item")


class Progress(Protocol):
    """Receives the progress of work, for example to show a bar on a terminal."""

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """Iterate over items, of which `total` are expected, and report the progress."""

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """A context around work of unknown length. Its value is a function that reports the finished share."""

    def say(self, sentence: str) -> None:
        """Show a sentence that is not overwritten by later progress."""


class SilentProgress:
    """Progress that is not shown. Only sentences are passed on, if there is a function for them."""

    def __init__(self, tell: Tell = lambda _: None) -> None:
        self._tell = tell

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """Iterate over items."""
        del what, total
        return iter(items)

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """A context that does nothing."""
        del what
        return nullcontext(lambda _: None)

    def say(self, sentence: str) -> None:
        """Pass the sentence to the function that was given."""
        self._tell(sentence)


SILENT: Progress = SilentProgress()
