"""The store of finished results, addressed by a hash of all that they depend on; locks, unfinished folders, progress.

<root>/<kind>/<hash>/ holds a result and its manifest; <root>/state/ what is known of them and who works here.
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
TIMED = 50  # results of a stage whose seconds are kept, about
# How often a lock is asked for that another holds: soon at first, and then so that Ctrl-C is answered in time.
FIRST_LOOK_S = 1e-3
LOOK_S = 0.2
PATIENCE_S = 0.5  # before the user is told who is waited for

Tell = Callable[[str], object]


def why_unwritable(folder: Path) -> str:
    """Why files cannot be made in a folder, which is made where it is missing; empty where they can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return str(error.strerror)
    return "" if os.access(folder, os.W_OK) else "Permission denied"


@contextmanager
def unfinished(parent: Path) -> Iterator[Path]:
    """An empty folder to fill and rename; one that keeps its name is gone after the block."""
    parent.mkdir(parents=True, exist_ok=True)
    folder, lock = _locked_folder(parent)
    try:
        with stop.cleanup_after(lambda: stop.remove(folder)):
            yield folder
    finally:
        os.close(lock)


def _locked_folder(parent: Path) -> tuple[Path, int]:
    """A new folder, and the descriptor whose lock ends with this process, however that ends."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        lock = lock_new_folder(folder)
        if lock is not None:
            os.fchmod(lock, 0o755)
            return folder, lock


def sweep(parent: Path) -> None:
    """Remove what killed processes left unfinished in a folder: a living one holds a lock."""
    for folder in parent.glob(f"{PREFIX}*"):
        remove_if_abandoned(folder)


@contextmanager
def locked(path: Path, tell: Tell = lambda _: None) -> Iterator[None]:
    """A block that one process at a time enters; the file `path` says which. Raises Stopped while it waits.

    The lock ends with the process, however that ends.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = _awaited(path, tell)
    try:
        with stop.cleanup_after(lambda: path.unlink(missing_ok=True)):
            yield
    finally:
        os.close(lock)


def _awaited(path: Path, tell: Tell) -> int:
    """The descriptor that holds the lock of this path, once nobody else does."""
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
    """The descriptor of a file that is locked from now on, None where another holds it."""
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        return None
    except OSError:  # a file system without locks: both make it, and the first to finish is taken
        return lock
    with suppress(FileNotFoundError):
        if os.path.samestat(os.fstat(lock), path.stat()):
            os.truncate(lock, 0)
            os.write(lock, f"process {os.getpid()} on {socket.gethostname()}".encode())
            return lock
    os.close(lock)  # whoever held it is through, and took the file away
    return None


def _unlink_if_free(path: Path) -> None:
    """Remove the file of a lock that nobody holds."""
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
    """Something in the store: when it was made and last used, in seconds since 1970; `is_damaged` was set aside."""

    kind: str
    path: Path
    bytes: int
    made_s: float
    used_s: float

    @property
    def key(self) -> str:
        """What tasks name it by."""
        return f"{self.kind}/{self.path.name}"

    @property
    def is_damaged(self) -> bool:
        """Whether it was set aside."""
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
    """How large the user wants the store to be, by $VOBENCH_CACHE_GB; infinite where nothing is said."""
    said = os.environ.get(LIMIT) or "inf"
    with suppress(ValueError):
        if (limit := float(said)) > 0:
            return limit * GB
    raise InputError(f"{LIMIT} should be a number of gigabytes above 0 (got {said!r})")


class Store:
    """Finished folders under a root; what is not finished is never seen under its final name."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def path(self, kind: str, inputs: Mapping[str, Any]) -> Path:
        """Where the result of these inputs lies, or will lie."""
        return self.root / kind / digest(inputs)

    def fault(self, key: str, *, anew: bool = False) -> str:
        """What is wrong with a result, `<kind>/<hash>`, empty where nothing is; `anew` hashes all of it."""
        return fault(self.root / key, None if anew else self._checked(key))

    def has(self, key: str) -> bool:
        """Whether a result is there and sound; it counts as used."""
        folder = self.root / key
        if not folder.is_dir() or self.fault(key):
            return False
        with suppress(OSError):
            os.utime(folder)
        return True

    def need(self, key: str) -> Path:
        """The folder of a result that should be there. Raises InputError where it is not, or is damaged."""
        if self.has(key):
            return self.root / key
        is_there = (self.root / key).is_dir()
        wrong = f"is damaged ({self.fault(key)})" if is_there else "is gone"
        raise InputError(f"a result {wrong} that this is made of; the same command makes it anew: {self.root / key}")

    def get(
        self,
        kind: str,
        inputs: Mapping[str, Any],
        build: Callable[[Path], None],
        *,
        keeps: Callable[[Path], bool] = lambda _: True,
        tell: Tell = lambda _: None,
    ) -> Path:
        """The folder made from these inputs; `build` fills an empty one where there is none that is sound.

        What is there and not of those that `keeps` is made anew, unless another process did so while we waited for
        it. Raises InputError where nothing can be written.
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
        except OSError:  # where no locks are kept another process may be faster; both hold the same
            if not final.is_dir():
                raise
            return
        remember(self._checked(f"{final.parent.name}/{final.name}"), states)

    def note_seconds(self, stage: str, seconds: float) -> None:
        """Keep how long a result took."""
        path = self.root / STATE / "seconds" / stage
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a", encoding="ascii") as file:
                file.write(f"{seconds:.3f}\n")

    def seconds(self, stage: str) -> list[float]:
        """How long the last results of a stage took; empty where none was made."""
        with suppress(OSError, ValueError):
            path = self.root / STATE / "seconds" / stage
            lines = path.read_text(encoding="ascii").split()
            return [float(line) for line in lines[-TIMED:]]
        return []

    def forget(self, keys: Iterable[str]) -> None:
        """Remove results, so that they are made anew; what another process makes meanwhile stays."""
        for key in keys:
            if (self.root / key).is_dir():
                self._removed(_entry(self.root / key))

    def set_aside_damaged(self, keys: Iterable[str], tell: Tell) -> None:
        """Give results that are not as they were written another name, and say why."""
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
            tell(f"a damaged result is made anew, for {wrong}: {folder}")

    def require_writable(self) -> None:
        """Raise InputError where nothing can be made here."""
        if cause := why_unwritable(self.root):
            raise InputError(f"VOBENCH_CACHE should be a folder that can be written ({cause}): {self.root}")

    @contextmanager
    def in_use(self, tell: Tell) -> Iterator[None]:
        """A block, such as a run, from whose beginning on nothing that is used may be removed.

        In the end the user is told where the store is larger than he wants it to be. Raises InputError where he does
        not say so as a number.
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
        """Remove what killed processes left behind: unfinished folders and locks."""
        for kind in self._kinds():
            sweep(kind)
        for name in ("runs", "locks"):
            for path in self.root.glob(f"{STATE}/{name}/*"):
                _unlink_if_free(path)

    def entries(self) -> Iterator[StoreEntry]:
        """All that lies in the store, what was set aside as damaged included."""
        for kind in self._kinds():
            for path in sorted(kind.iterdir()):
                with suppress(OSError):  # another process may remove it meanwhile
                    if not path.name.startswith(PREFIX):
                        yield _entry(path)

    def _kinds(self) -> list[Path]:
        folders = [path for path in self.root.glob("*") if path.is_dir()]
        return sorted(path for path in folders if path.name != STATE)

    def collect(self, *, keep_bytes: float = math.inf, older_s: float = math.inf) -> list[StoreEntry]:
        """Remove what is unfinished or damaged, what was last used so long ago, and then the least recently used.

        What a process makes, or a run uses, stays. Returns what is removed.
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
            is_unused = entry.used_s < first_run_s  # by the runs that are under way
            is_dispensable = is_unused and (is_old or held > keep_bytes)
            if (entry.is_damaged or is_dispensable) and self._removed(entry):
                held -= entry.bytes
                removed.append(entry)
        return removed

    def _removed(self, entry: StoreEntry) -> bool:
        """Whether an entry could be removed: nobody holds its lock."""
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
    """What tells a result from the one that it was before it was made anew."""
    with suppress(OSError):
        stat = (folder / MANIFEST).stat()
        return stat.st_ino, stat.st_mtime_ns
    return None


def discard(path: Path) -> None:
    """Take a file or a folder away in one step, and remove what it held."""
    gone = path.with_name(f"{PREFIX}{path.name}-old")
    shutil.rmtree(gone, ignore_errors=True)
    path.rename(gone)
    if gone.is_dir():
        shutil.rmtree(gone, ignore_errors=True)
    else:
        gone.unlink()


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

    def say(self, sentence: str) -> None:
        """One sentence that stays."""


class SilentProgress:
    """Progress that nobody hears of but for sentences that stay, if somebody is to be told."""

    def __init__(self, tell: Tell = lambda _: None) -> None:
        self._tell = tell

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items."""
        del what, total
        return iter(items)

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """No context around the work."""
        del what
        return nullcontext(lambda _: None)

    def say(self, sentence: str) -> None:
        """Told to whoever asked for it."""
        self._tell(sentence)


SILENT: Progress = SilentProgress()
