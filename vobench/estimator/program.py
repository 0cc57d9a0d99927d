"""A program in a session and a folder of its own, under limits: what all its processes use, and how it ended."""

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from stat import S_ISREG
from types import TracebackType
from typing import Any, Self

from vobench import stop
from vobench.estimator.check import in_one_line
from vobench.estimator.guard import descendants, stat
from vobench.estimator.manifest import Limits
from vobench.estimator.protocol import Result
from vobench.portable import PORTABLE, VARIABLES

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
KEPT_ENVIRONMENT = (
    "PATH",
    "HOME",
    "LANG",
    "LC_ALL",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "VIRTUAL_ENV",
    PORTABLE,
    *VARIABLES,
)
LOG_BYTES = 1 << 20
LOOK_S = 0.1  # how often memory and time of a running program are looked at
WEIGH_S = 1.0  # how often its files are
SHARED = "/dev/shm/"  # Linux's shared memory, where it has a name
DIE_S = 0.005  # for a process that is killed to be gone
GUARD_S = 2.0  # the guard's time to end what it guards
GUARD = (sys.executable, "-I", "-S", str(Path(__file__).with_name("guard.py")))
CPUCLOCK_SCHED = 2  # of another process's clock: linux/posix-timers.h
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
MOST_OF_A_LINE = 160


class EstimatorFailure(Exception):  # noqa: N818 - a result, not a mistake of ours
    """The estimator gave up: `kind` is a run's status, `reason` one line."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind, self.reason = kind, in_one_line(reason)
        super().__init__(f"{kind}: {self.reason}")


@dataclass(frozen=True, slots=True)
class Answer:
    """A checked result and what it cost, by our own clocks; memory is the most that it held so far."""

    result: Result
    wall_ms: float
    cpu_ms: float
    memory_mib: float = 0.0


class Program:
    """A running program; what it prints goes to `log`. Its verbs raise EstimatorFailure.

    It has a folder of its own to work in, no shell, and of our environment KEPT_ENVIRONMENT alone. All that it
    starts, in whatever session, has a guard for an ancestor, and is killed with it. Where `is_apart` it sees neither
    the folders that are `hidden` from it, but for those in which something lies that it needs, nor other processes.
    """

    def __init__(
        self,
        argv: list[str],
        *,
        log: Path,
        limits: Limits,
        home: Path | None = None,
        hidden: Sequence[Path] = (),
        **streams: Any,
    ) -> None:
        self.limits, self._log_path, self._printed = limits, log, 0
        self.home = home or new_home()
        self._began, self._looked, self._weighed = time.monotonic(), 0.0, time.monotonic()
        self._pids, self._files_before = list[int](), _held_bytes(self.home, most=sys.maxsize)
        self._before_s, self.cpu_s, self.peak_mib = _buried_s(), 0.0, 0.0
        self._shared, self._shared_before = set[str](), {str(path) for path in Path(SHARED).glob("*")}
        kept = {name: value for name, value in os.environ.items() if name in KEPT_ENVIRONMENT}
        one = {**dict.fromkeys(THREADS, str(limits.threads)), "PYTHONHASHSEED": "0", "TMPDIR": str(self.home)}
        with ExitStack() as undone:
            undone.enter_context(stop.undone(lambda: stop.remove(self.home)))
            self._log = undone.enter_context(log.open("ab"))  # to its end, also once we have cut it
            os.truncate(log, 0)
            undone.callback(self._free_shared)
            line, theirs = socket.socketpair()
            self._line = undone.enter_context(line)
            given = {"stdin": subprocess.DEVNULL, "stdout": self._log, "stderr": self._log, **streams}
            unseen = json.dumps([str(path) for path in hidden if not _holds(path, [self.home, *_needed(argv)])])
            guarded = [*GUARD, str(theirs.fileno()), str(limits.disk_mib << 20), unseen, *argv]
            given |= {"cwd": self.home, "env": kept | one, "pass_fds": [theirs.fileno()]}
            try:
                with theirs:
                    self.process = subprocess.Popen(guarded, start_new_session=True, **given)
            except (OSError, ValueError) as error:  # no memory for it, or a NUL in its words
                raise EstimatorFailure("refused", f"{argv[0]} cannot be started ({error})") from None
            for pipe in filter(None, (self.process.stdin, self.process.stdout)):
                undone.callback(pipe.close)
            undone.enter_context(stop.undone(self._kill, is_awaited=True))
            line.settimeout(limits.start_s)
            try:
                self.is_apart, errno = map(int, (line.recv(16) or b"0 0").split())
            except TimeoutError:
                raise EstimatorFailure("timeout", f"it did not run within {limits.start_s:g} s") from None
            if errno:
                raise EstimatorFailure("refused", f"{argv[0]} cannot be started ({os.strerror(errno)})")
            self._undone = undone.pop_all()

    def _kill(self) -> None:
        """Have the guard end all of them; and it, and whoever bears our mark, where it cannot."""
        with suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=GUARD_S)
        stop.kill_session(self.process)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=GUARD_S)
        until = time.monotonic() + GUARD_S
        while (strays := _strays(self.home)) and time.monotonic() < until:
            for pid in strays:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(DIE_S)

    def _free_shared(self) -> None:
        for path in self._shared:
            with suppress(OSError):
                os.unlink(path)

    def left_s(self) -> float:
        """Seconds that are left of the whole trial's."""
        return self._began + self.limits.trial_s - time.monotonic()

    def look(self, *, at_once: bool = False) -> None:
        """Add up what all its processes use, now and then. Raises EstimatorFailure beyond a limit."""
        stop.check()
        if self.left_s() < 0:
            raise EstimatorFailure("timeout", f"the whole trial took more than {self.limits.trial_s:g} s")
        is_time = time.monotonic() > self._looked + LOOK_S
        if is_time:
            self._looked, self._pids = time.monotonic(), [self.process.pid, *descendants(self.process.pid)]
            self._cut_log()
        if not (is_time or at_once):
            return
        stats = {pid: fields for pid in self._pids if (fields := stat(pid))}
        self.cpu_s = max(self.cpu_s, sum(_cpu_s(pid, fields) for pid, fields in stats.items()))
        ours = self._pids[: 1 + bool(self.is_apart)]  # the guard, and the first of its namespace
        pages = sum(int(fields[21]) for pid, fields in stats.items() if pid not in ours)
        memory_mib = pages * resource.getpagesize() / (1 << 20)
        self.peak_mib = max(self.peak_mib, memory_mib)
        if memory_mib > self.limits.memory_mib:
            limit = f"where the limit is {self.limits.memory_mib} MiB"
            raise EstimatorFailure("out_of_memory", f"its processes hold {memory_mib:.0f} MiB, {limit}")
        if time.monotonic() > self._weighed + WEIGH_S:
            self._weigh_files()

    def _weigh_files(self) -> None:
        """Raises EstimatorFailure where its folder and the nameless files that it holds open are beyond the limit."""
        self._weighed, most = time.monotonic(), self.limits.disk_mib << 20
        held = _held_bytes(self.home, most=most + self._files_before) - self._files_before
        nameless = _nameless(self._pids)
        self._shared |= {target for _, target in nameless.values()} - self._shared_before
        if held + sum(size for size, _ in nameless.values()) > most:
            reason = f"its files hold more than the limit of {self.limits.disk_mib} MiB"
            raise EstimatorFailure("out_of_memory", reason)

    def _cut_log(self) -> None:
        """Keep the beginning of a log that is filled without end."""
        size = os.path.getsize(self._log_path)
        if size > LOG_BYTES:
            self._printed += size - LOG_BYTES
            os.truncate(self._log_path, LOG_BYTES)

    def wait(self) -> None:
        """Wait for its end. Raises EstimatorFailure where that is none that it wanted."""
        while self.process.poll() is None:
            self.look()
            time.sleep(LOOK_S / 5)
        stop.check()
        self.cpu_s = max(self.cpu_s, _buried_s() - self._before_s)
        if self.process.returncode:
            raise EstimatorFailure(*self.death())

    def death(self) -> tuple[str, str]:
        """Status and reason of an end that nobody asked for, with the last line that it printed."""
        try:
            code = self.process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return "invalid_output", "it closed its output and lives on"
        if not code:
            return "invalid_output", "it ended, with exit code 0"
        if code == -signal.SIGKILL:
            return "out_of_memory", "killed by the system, most likely for memory"
        by = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        said = self._last_line()
        return "crashed", f"the process ended with {by}{f': {said}' if said else ''}"

    def _last_line(self) -> str:
        with self._log_path.open("rb") as log:
            log.seek(max(os.path.getsize(self._log_path) - 4096, 0))
            lines = log.read(4096).decode("utf-8", "replace").split("\n")
        return next(filter(None, (in_one_line(line, MOST_OF_A_LINE) for line in reversed(lines))), "")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(EstimatorFailure):
            self._weigh_files()  # what it would leave in shared memory
        if self.process.stdin:
            self.process.stdin.close()  # there is no more to come
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=0.5 if kind is None else 0)
        self._undone.close()
        self._cut_log()
        if self._printed:
            with self._log_path.open("a", encoding="utf-8") as log:
                log.write(f"\n[vobench: cut here; the estimator printed {LOG_BYTES + self._printed} bytes]\n")


@cache
def sandbox_works() -> bool:
    """Whether this machine lets us hide folders and processes from a program; it is tried once."""
    with tempfile.TemporaryDirectory() as folder:
        unseen, log = Path(folder, "unseen"), Path(folder, "log.txt")
        unseen.mkdir()
        try:
            with Program(["true"], log=log, limits=Limits(), hidden=[unseen]) as program:
                return bool(program.is_apart)
        except EstimatorFailure:
            return False


def _needed(argv: Sequence[str]) -> list[Path]:
    """What a program reads: our interpreter and packages, and what its words and our environment name."""
    named = [*argv, *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    own = [Path(sys.prefix), Path(sys.base_prefix), Path(__file__)]
    return [*own, *(Path(word).absolute() for word in named if os.sep in word)]


def _holds(folder: Path, paths: Iterable[Path]) -> bool:
    """Whether one of the paths lies in a folder, or is it."""
    real = folder.resolve()
    return any(path == folder or path.resolve().is_relative_to(real) for path in paths)


def new_home() -> Path:
    """A new folder for a program to work in."""
    return Path(tempfile.mkdtemp(prefix="vobench-estimator-"))


def _strays(home: Path) -> list[int]:
    """Processes whose environment names this folder, as it does unless they have changed it."""
    mark, found = f"\0TMPDIR={home}\0".encode(), list[int]()
    for pid in os.listdir("/proc") if sys.platform == "linux" else []:
        with suppress(OSError):
            if pid.isdigit() and mark in b"\0" + Path("/proc", pid, "environ").read_bytes():
                found.append(int(pid))
    return found


def _cpu_s(pid: int, fields: list[str]) -> float:
    """CPU seconds of a process, by its own clock of ns, and of the children that it has buried, by ticks."""
    buried = sum(map(int, fields[13:15])) / TICKS_PER_S
    try:
        return time.clock_gettime(~pid << 3 | CPUCLOCK_SCHED) + buried
    except OSError:
        return sum(map(int, fields[11:13])) / TICKS_PER_S + buried


def _held_bytes(folder: Path, *, most: int) -> int:
    """What the files below a folder take up, counted until that is more than `most`; a block at least for each."""
    held = 0
    for at, folders, names in os.walk(folder):
        for name in (*folders, *names):
            with suppress(OSError):
                held += max(os.lstat(os.path.join(at, name)).st_blocks * 512, 4096)
            if held > most:
                return held
    return held


def _nameless(pids: Iterable[int]) -> dict[tuple[int, int], tuple[int, str]]:
    """Bytes and names of files held open that no folder of theirs shows, shared memory with them, by device and id."""
    held = dict[tuple[int, int], tuple[int, str]]()
    for pid in pids:
        with suppress(OSError):
            for name in os.listdir(f"/proc/{pid}/fd"):
                with suppress(OSError):
                    target, facts = os.readlink(f"/proc/{pid}/fd/{name}"), os.stat(f"/proc/{pid}/fd/{name}")
                    if S_ISREG(facts.st_mode) and (not facts.st_nlink or target.startswith(SHARED)):
                        held[facts.st_dev, facts.st_ino] = facts.st_blocks * 512, target
    return held


def _buried_s() -> float:
    """CPU seconds of all processes that we have started and that have ended, and of theirs."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
