"""A program in a session and a folder of its own, under limits: what all its processes use, and how it ended."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from vobench import stop
from vobench.estimator.check import in_one_line
from vobench.estimator.manifest import Limits
from vobench.estimator.protocol import Result

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
KEPT_ENVIRONMENT = ("PATH", "HOME", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "PYTHONPATH", "VIRTUAL_ENV")
LOG_BYTES = 1 << 20
LOOK_S = 0.1  # how often memory and time of a running program are looked at
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
    starts is killed with it.
    """

    def __init__(self, argv: list[str], *, log: Path, limits: Limits, home: Path | None = None, **streams: Any) -> None:
        self.limits, self._log_path, self._log = limits, log, log.open("wb")
        self.home = home or new_home()
        self._began, self._looked, self._pids = time.monotonic(), 0.0, list[str]()
        self._before_s, self.cpu_s, self.peak_mib = _buried_s(), 0.0, 0.0
        kept = {name: value for name, value in os.environ.items() if name in KEPT_ENVIRONMENT}
        one = {**dict.fromkeys(THREADS, str(limits.threads)), "PYTHONHASHSEED": "0"}
        given = {"stdin": subprocess.DEVNULL, "stdout": self._log, "stderr": self._log, **streams}
        with ExitStack() as undone:
            undone.enter_context(stop.undone(lambda: stop.remove(self.home)))
            try:
                self.process = subprocess.Popen(argv, cwd=self.home, env=kept | one, start_new_session=True, **given)
            except OSError as error:
                self._log.close()
                raise EstimatorFailure("refused", f"{argv[0]} cannot be started ({error.strerror})") from None
            undone.enter_context(stop.undone(lambda: stop.kill_session(self.process), is_awaited=True))
            self._undone = undone.pop_all()

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
            self._looked, self._pids = time.monotonic(), session(self.process.pid)
        if not (is_time or at_once):
            return
        stats = [stat for pid in self._pids if (stat := _stat(pid))]
        # Of each its own time, and that of those that it has buried.
        self.cpu_s = max(self.cpu_s, sum(int(ticks) for stat in stats for ticks in stat[11:15]) / TICKS_PER_S)
        memory_mib = sum(int(stat[21]) for stat in stats) * resource.getpagesize() / (1 << 20)
        self.peak_mib = max(self.peak_mib, memory_mib)
        if memory_mib > self.limits.memory_mib:
            limit = f"where the limit is {self.limits.memory_mib} MiB"
            raise EstimatorFailure("out_of_memory", f"its processes hold {memory_mib:.0f} MiB, {limit}")

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
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=0.5 if kind is None else 0)
        # The whole session goes: a program may have started processes of its own.
        stop.kill_session(self.process)
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe:
                with suppress(OSError):
                    pipe.close()
        self._log.close()
        _cut(self._log_path)
        self._undone.close()


def new_home() -> Path:
    """A new folder for a program to work in."""
    return Path(tempfile.mkdtemp(prefix="vobench-estimator-"))


def session(leader: int) -> list[str]:
    """The ids of all processes of a session; none where there is no /proc."""
    pids = os.listdir("/proc") if sys.platform == "linux" else []
    return [pid for pid in pids if pid.isdigit() and (stat := _stat(pid)) and int(stat[3]) == leader]


def _stat(pid: str) -> list[str]:
    """What /proc/<pid>/stat says behind the name: state, parent, group, session, ... (proc(5)); nothing once gone."""
    with suppress(OSError):
        return Path("/proc", pid, "stat").read_text(errors="replace").rpartition(")")[2].split()
    return []


def _buried_s() -> float:
    """CPU seconds of all processes that we have started and that have ended, and of theirs."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def _cut(log: Path) -> None:
    """Keep the beginning of a log that an estimator has filled without end."""
    size = log.stat().st_size
    if size > LOG_BYTES:
        os.truncate(log, LOG_BYTES)
        with log.open("a", encoding="utf-8") as file:
            file.write(f"\n[vobench: cut here; the estimator printed {size} bytes]\n")
