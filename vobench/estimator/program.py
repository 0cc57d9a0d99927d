"""A program in a session and a folder of its own, under limits: what all its processes use, and how it ended."""

import marshal
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
from vobench.estimator import sandbox
from vobench.estimator.check import in_one_line
from vobench.estimator.guard import descendants, stat
from vobench.estimator.home import Home, UnreadableFileError, held_bytes, read_below
from vobench.estimator.manifest import Limits
from vobench.estimator.protocol import Result
from vobench.estimator.sandbox import Sandbox
from vobench.portable import PORTABLE, VARIABLES

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
KEPT_ENVIRONMENT = (
    "PATH",
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
GUARD_CODE = "import sys; sys.path.append(sys.argv.pop(1)); import guard; guard.main()"
GUARD = (sys.executable, "-I", "-S", "-c", GUARD_CODE, str(Path(__file__).parent))
MESSAGE_BYTES = 1 << 16
MEBIBYTE = 1 << 20
CPUCLOCK_SCHED = 2  # of another process's clock: linux/posix-timers.h
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
MOST_OF_A_LINE = 160


class EstimatorFailure(Exception):  # noqa: N818 - a result, not a mistake of ours
    """The estimator gave up: `kind` is a run's status, `reason` one line."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind = kind
        self.reason = in_one_line(reason)
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
    starts, in whatever session, has a guard for an ancestor, and is killed with it. It sees the files of
    `sandbox.plan`, of which `folder` is its own, but for those that are `hidden`; `sandbox` has what it could see
    beyond these.
    """

    def __init__(
        self,
        argv: list[str],
        *,
        log: Path,
        limits: Limits,
        home: Home | None = None,
        hidden: Sequence[Path] = (),
        folder: Path | None = None,
        **streams: Any,
    ) -> None:
        self.limits = limits
        self._log_path = log
        self._printed = 0
        self._began = time.monotonic()
        self._looked = 0.0
        self._weighed = time.monotonic()
        self._pids = list[int]()
        self._before_s = _buried_s()
        self.cpu_s = 0.0
        self.peak_mib = 0.0
        self._shared = set[str]()
        self._shared_before = {str(path) for path in Path(SHARED).glob("*")}
        self.sandbox = sandbox.unsandboxed()
        self.is_apart = False  # in a process namespace of its own
        self._disk = self._shared_memory = -1  # descriptors of its file systems, where it has some of its own
        with ExitStack() as undone:
            self._home = home or undone.enter_context(Home(log))
            self.home = self._home.path
            self._files = self._home.descriptor
            self._files_before = held_bytes(self._files, most=sys.maxsize)
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC  # to its end, also once cut
            self._log = os.open(log, flags, 0o666)
            self._log_mode = os.fstat(self._log).st_mode & 0o777
            undone.callback(self._close_log)
            undone.callback(self._free_shared)
            undone.callback(self._close_descriptors)
            line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._line = undone.enter_context(line)
            plan = sandbox.plan(
                argv, home=self.home, homes=self._home.base, folder=folder, hidden=hidden, limits=limits
            )
            given = {"stdin": subprocess.DEVNULL, "stdout": self._log, "stderr": self._log, **streams}
            given |= {"cwd": self.home, "env": self._environment(), "pass_fds": [theirs.fileno()]}
            with theirs:
                self.process = self._started([*GUARD, str(theirs.fileno())], argv[0], given)
            for pipe in filter(None, (self.process.stdin, self.process.stdout)):
                undone.callback(pipe.close)
            undone.enter_context(stop.undone(self._kill, is_awaited=True))
            line.settimeout(limits.start_s)
            try:
                line.send(marshal.dumps(plan))
                if plan["is_isolated"]:
                    self._take_report()
                number = int(line.recv(MESSAGE_BYTES) or b"0")
            except TimeoutError:
                raise EstimatorFailure("timeout", f"it did not run within {limits.start_s:g} s") from None
            except OSError:  # the guard is gone, and its status says why
                number = 0
            if number:
                raise EstimatorFailure("refused", self._why_not_started(argv[0], number, folder))
            self._undone = undone.pop_all()

    def _environment(self) -> dict[str, str]:
        """The variables of the program: few of ours, its threads, and its folder as HOME and TMPDIR."""
        kept = {name: value for name, value in os.environ.items() if name in KEPT_ENVIRONMENT}
        threads = dict.fromkeys(THREADS, str(self.limits.threads))
        home = str(self.home)
        return {**kept, **threads, "PYTHONHASHSEED": "0", "HOME": home, "TMPDIR": home, **sandbox.user_packages()}

    def _started(self, guarded: list[str], name: str, given: dict[str, Any]) -> "subprocess.Popen[bytes]":
        try:
            return subprocess.Popen(guarded, start_new_session=True, **given)
        except (OSError, ValueError) as error:  # no memory for it, or a NUL in its words
            raise EstimatorFailure("refused", f"{name} cannot be started ({error})") from None

    def _take_report(self) -> None:
        """Take what the guard reports of the sandbox, and the descriptors of the program's file systems."""
        message, descriptors, _, _ = socket.recv_fds(self._line, MESSAGE_BYTES, maxfds=3)
        if not message:
            return
        sees, why, self.is_apart = marshal.loads(message)
        self.sandbox = sandbox.of_report(sees, why)
        if descriptors:
            self._disk, self._files, self._shared_memory = descriptors

    def _why_not_started(self, name: str, number: int, folder: Path | None) -> str:
        said = f"{name} cannot be started ({os.strerror(number)})"
        if self.sandbox.level != "none" and sandbox.is_out_of_reach(name, folder):
            return f"{said}: it lies outside of what an estimator may read; name its folder in {sandbox.READ}"
        return said

    def _kill(self) -> None:
        """Have the guard end all of them; and it, and whoever bears our mark, where it cannot."""
        with suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=GUARD_S)
        stop.kill_session(self.process)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=GUARD_S)
        if self.is_apart:  # all of them went with the first of their namespace
            return
        until = time.monotonic() + GUARD_S
        while (strays := _strays(self.home)) and time.monotonic() < until:
            for pid in strays:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(DIE_S)

    def _close_descriptors(self) -> None:
        if self._disk >= 0:
            for descriptor in (self._disk, self._files, self._shared_memory):
                os.close(descriptor)
            self._disk = self._shared_memory = -1

    def _free_shared(self) -> None:
        for path in self._shared:
            with suppress(OSError):
                os.unlink(path)

    def read(self, name: str, *, most_bytes: int) -> bytes:
        """What it wrote to a file below its folder. Raises EstimatorFailure, also where that is a link or no file."""
        try:
            return read_below(self._files, name, most_bytes=most_bytes, check=self._check_time)
        except FileNotFoundError:
            raise EstimatorFailure("invalid_output", "it ended well, but wrote no file {out}") from None
        except UnreadableFileError as error:
            raise EstimatorFailure("invalid_output", f"{{out}} {error}") from None

    def left_s(self) -> float:
        """Seconds that are left of the whole trial's."""
        return self._began + self.limits.trial_s - time.monotonic()

    def _check_time(self) -> None:
        """Raise EstimatorFailure where the trial takes too long."""
        stop.check()
        if self.left_s() < 0:
            raise EstimatorFailure("timeout", f"the whole trial took more than {self.limits.trial_s:g} s")

    def look(self, *, at_once: bool = False) -> None:
        """Add up what all its processes use, now and then. Raises EstimatorFailure beyond a limit."""
        self._check_time()
        is_time = time.monotonic() > self._looked + LOOK_S
        if is_time:
            self._looked = time.monotonic()
            self._pids = [self.process.pid, *descendants(self.process.pid)]
            self._cut_log()
        if not (is_time or at_once):
            return
        stats = {pid: fields for pid in self._pids if (fields := stat(pid))}
        self.cpu_s = max(self.cpu_s, sum(_cpu_s(pid, fields) for pid, fields in stats.items()))
        ours = self._pids[: 1 + self.is_apart]  # the guard, and the first of its namespace
        memory_mib = self._memory_mib({pid: fields for pid, fields in stats.items() if pid not in ours})
        self.peak_mib = max(self.peak_mib, memory_mib)
        if memory_mib > self.limits.memory_mib:
            limit = f"where the limit is {self.limits.memory_mib} MiB"
            raise EstimatorFailure("out_of_memory", f"its processes hold {memory_mib:.0f} MiB, {limit}")
        if self._disk >= 0:
            self._weigh_disk()
        elif time.monotonic() > self._weighed + WEIGH_S:
            self._weigh_files()

    def _memory_mib(self, stats: dict[int, list[str]]) -> float:
        """The memory of processes by their `stat`, with what lies in shared memory.

        Resident pages are added up, which counts those that processes share once for each. Where that is beyond the
        limit, or includes shared memory with a name, each page is divided by the number of those who have it (PSS).
        """
        in_files = 0
        if self._shared_memory >= 0:
            in_files = _used_bytes(self._shared_memory)
        resident = sum(int(fields[21]) for fields in stats.values()) * resource.getpagesize()
        memory = resident + in_files
        if memory > self.limits.memory_mib * MEBIBYTE or in_files > MEBIBYTE:
            parts = [_proportional_bytes(pid, int(fields[21])) for pid, fields in stats.items()]
            private = sum(part[0] for part in parts)
            shared = sum(part[1] for part in parts)
            memory = private + max(shared, in_files)  # of which files that are mapped are a part
        return memory / MEBIBYTE

    def _weigh_disk(self) -> None:
        """Raises EstimatorFailure where the file system of its folder holds more than the limit."""
        if self._is_disk_full():
            raise EstimatorFailure(*self._of_files())
        if time.monotonic() > self._weighed + WEIGH_S:
            self._weigh_nameless(0)

    def _is_disk_full(self) -> bool:
        return self._disk >= 0 and _used_bytes(self._disk) > self.limits.disk_mib * MEBIBYTE

    def _of_files(self) -> tuple[str, str]:
        return "out_of_memory", f"its files hold more than the limit of {self.limits.disk_mib} MiB"

    def _weigh_files(self) -> None:
        """Raises EstimatorFailure where its folder and the nameless files that it holds open are beyond the limit."""
        if self._disk >= 0:
            self._weigh_nameless(0)
            return
        most = self.limits.disk_mib * MEBIBYTE
        held = held_bytes(self._files, most=most + self._files_before) - self._files_before
        self._weigh_nameless(held)

    def _weigh_nameless(self, held: int) -> None:
        self._weighed = time.monotonic()
        known = [os.fstat(descriptor).st_dev for descriptor in (self._disk, self._shared_memory) if descriptor >= 0]
        nameless = {key: file for key, file in _nameless(self._pids).items() if key[0] not in known}
        if self._disk < 0:
            self._shared |= {target for _, target in nameless.values()} - self._shared_before
        if held + sum(size for size, _ in nameless.values()) > self.limits.disk_mib * MEBIBYTE:
            raise EstimatorFailure(*self._of_files())

    def _cut_log(self) -> None:
        """Keep the beginning of a log that is filled without end."""
        size = os.fstat(self._log).st_size
        if size > LOG_BYTES:
            self._printed += size - LOG_BYTES
            os.ftruncate(self._log, LOG_BYTES)

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
        if self._is_disk_full():
            return self._of_files()
        if code == -signal.SIGKILL:
            return "out_of_memory", "killed by the system, most likely for memory"
        by = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        said = self._last_line()
        return "crashed", f"the process ended with {by}{f': {said}' if said else ''}"

    def _last_line(self) -> str:
        size = os.fstat(self._log).st_size
        lines = os.pread(self._log, 4096, max(size - 4096, 0)).decode("utf-8", "replace").split("\n")
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

    def _close_log(self) -> None:
        """Cut the log a last time, and give it the mode that it had, for the program has its descriptor, too."""
        self._cut_log()
        if self._printed:
            os.write(
                self._log, f"\n[vobench: cut here; the estimator printed {LOG_BYTES + self._printed} bytes]\n".encode()
            )
        os.fchmod(self._log, self._log_mode)
        os.close(self._log)


@cache
def sandbox_here() -> Sandbox:
    """What a program on this machine could see; it is tried once."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            with Program(["true"], log=Path(folder, "log.txt"), limits=Limits()) as program:
                return program.sandbox
        except EstimatorFailure:
            return sandbox.unsandboxed()


def sandbox_works() -> bool:
    """Whether this machine lets us show a program its own files alone, and nothing else."""
    return sandbox_here().level == "full"


def _strays(home: Path) -> list[int]:
    """Processes whose environment names this folder, as it does unless they have changed it."""
    mark = f"\0TMPDIR={home}\0".encode()
    found = list[int]()
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


def _used_bytes(descriptor: int) -> int:
    """What is taken of a file system that is the program's alone; of a file without content its entry, a block."""
    facts = os.fstatvfs(descriptor)
    blocks = (facts.f_blocks - facts.f_bfree) * facts.f_frsize
    return max(blocks, (facts.f_files - facts.f_ffree) * 4096)


def _proportional_bytes(pid: int, resident_pages: int) -> tuple[int, int]:
    """A process's part of the memory that it has: private and of files, and shared (proc(5), smaps_rollup).

    Where the kernel does not say, all that is resident.
    """
    with suppress(OSError, ValueError), open(f"/proc/{pid}/smaps_rollup", encoding="ascii") as file:
        kib = {line.split(":")[0]: int(line.split()[1]) for line in file if line.startswith("Pss")}
        shared = kib.get("Pss_Shmem", 0)
        return 1024 * (kib["Pss"] - shared), 1024 * shared
    return resident_pages * resource.getpagesize(), 0


def _nameless(pids: Iterable[int]) -> dict[tuple[int, int], tuple[int, str]]:
    """Bytes and names of files held open that no folder of theirs shows, shared memory with them, by device and id."""
    held = dict[tuple[int, int], tuple[int, str]]()
    for pid in pids:
        with suppress(OSError):
            for name in os.listdir(f"/proc/{pid}/fd"):
                with suppress(OSError):
                    target = os.readlink(f"/proc/{pid}/fd/{name}")
                    facts = os.stat(f"/proc/{pid}/fd/{name}")
                    if S_ISREG(facts.st_mode) and (not facts.st_nlink or target.startswith(SHARED)):
                        held[facts.st_dev, facts.st_ino] = facts.st_blocks * 512, target
    return held


def _buried_s() -> float:
    """CPU seconds of all processes that we have started and that have ended, and of theirs."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
