"""Runs a program in a sandbox and with limits, measures the resources of all its processes, and reports its end."""

import marshal
import os
import re
import resource
import signal
import socket
import subprocess
import sys
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
from vobench.estimator import isolation, sandbox
from vobench.estimator.check import in_one_line
from vobench.estimator.guard import SANDBOX_REPORT, START_REPORT, descendants, stat
from vobench.estimator.guard_plan import GuardPlan, guard_plan
from vobench.estimator.home import Home, UnreadableFileError, held_bytes, read_below
from vobench.estimator.manifest import Limits
from vobench.estimator.program_path import is_unreadable_program
from vobench.estimator.protocol import Result
from vobench.estimator.readable_folders import READ_VARIABLE, user_site_environment
from vobench.estimator.sandbox import Sandbox
from vobench.portable import PORTABLE, VARIABLES
from vobench.temporary import temporary_folder

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
LOG_SPACE_BYTES = 2 * LOG_BYTES  # more disk space than a log of LOG_BYTES needs
END_BYTES = 1 << 16  # the end of a log that is searched for a stack, or for the last line
STACK_HEADING = "Fatal Python error: "
# The lines of a stack with the calls of the thread that failed; the innermost call comes first.
FAILED_THREAD = re.compile(r"^Current thread .*\n((?:  .*\n)*)", re.MULTILINE)
CALL = re.compile(r'  File "(.*)", line (\d+) in (.*)')
LOOK_S = 0.1  # period at which memory and time of a running program are measured
WEIGH_S = 1.0  # period at which the disk space of its files is measured
DEATH_S = 5.0  # a program must end within this time after it has closed its output
SHARED = "/dev/shm/"  # the folder of named shared memory on Linux
DIE_S = 0.005  # the time for a killed process to end
GUARD_S = 2.0  # the time for the guard to end the program's processes
GUARD_CODE = "import sys; sys.path.append(sys.argv.pop(1)); import guard; guard.main()"
GUARD = (sys.executable, "-I", "-S", "-c", GUARD_CODE, str(Path(__file__).parent))
MESSAGE_BYTES = 1 << 16
MEBIBYTE = 1 << 20
CPUCLOCK_SCHED = 2  # the CPU-time clock of another process: linux/posix-timers.h
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
LINE_LETTERS = 160
STAT_BLOCK_BYTES = 512  # the unit of st_blocks
ENTRY_BYTES = 4096  # the approximate size of an entry of a folder
# Fields of /proc/PID/stat after the name: proc(5).
OWN_TICKS = slice(11, 13)
CHILDREN_TICKS = slice(13, 15)
VIRTUAL_BYTES = 20
RESIDENT_PAGES = 21
# A process whose address space is smaller has less than 64 MiB of page tables, which are not counted.
LARGE_BYTES = 1 << 35
# With the limit of descriptors, it bounds the memory that full pipes can hold to that of 500,000 small ones, 4 GiB.
MOST_PROCESSES = 512
# Settings of the kernel: the sizes of the buffers of sockets. The kernel doubles a size that a program asks for.
DEFAULT_BUFFERS = ("core/wmem_default", "core/rmem_default")
LARGEST_BUFFERS = 2 * ("core/wmem_max", "core/rmem_max")
TCP_BUFFERS = ("ipv4/tcp_wmem", "ipv4/tcp_rmem")


class EstimatorFailure(Exception):  # noqa: N818 - a result, not an error of vobench
    """The unsuccessful end of a trial. `kind` is the status of the trial, and `reason` is one line."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind = kind
        self.reason = in_one_line(reason)
        super().__init__(f"{kind}: {self.reason}")


class OutputFailure(EstimatorFailure):
    """The end of a program whose output file is missing, or has a `problem` that makes it unsafe to read.

    The reason names the file as {out}. `problem` is a predicate in one line, such as "is larger than 10 bytes", and
    None for a missing file.
    """

    def __init__(self, problem: str | None) -> None:
        self.problem = None if problem is None else in_one_line(problem)
        reason = "it ended well, but wrote no file {out}" if problem is None else f"{{out}} {problem}"
        super().__init__("invalid_output", reason)


@dataclass(frozen=True, slots=True)
class Answer:
    """A checked result and its cost, measured by vobench. `memory_mib` is the peak so far."""

    result: Result
    wall_ms: float
    cpu_ms: float
    memory_mib: float = 0.0


class Program:
    """A running program. Its methods raise EstimatorFailure.

    Its output is written to `log`. It works in a home folder, is started without a shell, and has only the variables
    KEPT_ENVIRONMENT of vobench's environment. A guard is the ancestor of all processes that it starts, in whatever
    session, and kills them with it. It sees the files of `guard_plan`, of which `folder` is its own, except those
    that are `hidden`; `sandbox` describes what it could see. It inherits the descriptors `inherited`.
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
        inherited: Sequence[int] = (),
        **streams: Any,
    ) -> None:
        self.limits = limits
        self._log_path = log
        self._folder = folder
        self._printed = 0
        self._cut_end = b""
        self._stack = ""
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
        self.is_apart = False  # whether it has a private process namespace
        # The descriptors of its private file systems; -1 if it has none.
        self._disk = -1
        self._shared_memory = -1
        with ExitStack() as undone:
            self._home = home or undone.enter_context(Home(log))
            self.home = self._home.path
            self._files = self._home.descriptor
            self._files_before = held_bytes(self._files, most=sys.maxsize)
            self._log = _open_log(log)
            self._log_mode = os.fstat(self._log).st_mode & 0o777
            undone.callback(self._close_log)
            undone.callback(self._free_shared)
            undone.callback(self._close_descriptors)

            line, guard_line = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._line = undone.enter_context(line)
            with guard_line:
                self.process = self._start_guard(guard_line, argv[0], inherited, streams)
            for pipe in (self.process.stdin, self.process.stdout):
                if pipe:
                    undone.callback(pipe.close)
            undone.enter_context(stop.cleanup_after(self._kill, is_awaited=True))

            plan = guard_plan(
                argv,
                work_folder=self.home,
                all_work_folders=self._home.base,
                estimator_folder=folder,
                hidden=hidden,
                limits=limits,
                inherited=inherited,
            )
            self._start_program(plan, folder)
            self._undone = undone.pop_all()

    def _start_guard(
        self, guard_line: socket.socket, name: str, inherited: Sequence[int], streams: dict[str, Any]
    ) -> "subprocess.Popen[bytes]":
        """Start the guard, which then waits for the plan of the program."""
        options = {
            "stdin": subprocess.DEVNULL,
            "stdout": self._log,
            "stderr": self._log,
            "cwd": self.home,
            "env": self._environment(),
            "pass_fds": [guard_line.fileno(), *inherited],
            **streams,
        }
        command = [*GUARD, str(guard_line.fileno())]
        try:
            return subprocess.Popen(command, start_new_session=True, **options)
        except (OSError, ValueError) as error:  # there is too little memory, or an argument contains NUL
            raise EstimatorFailure("refused", f"{name} cannot be started ({error})") from None

    def _start_program(self, plan: GuardPlan, folder: Path | None) -> None:
        """Send the plan to the guard, which starts the program, and receive its reports."""
        start_s = self.limits.start_s
        self._line.settimeout(start_s)
        try:
            self._line.send(marshal.dumps(dict(plan)))
            error_number = self._take_reports()
        except TimeoutError:
            raise EstimatorFailure("timeout", f"it did not run within {start_s:g} s") from None
        except OSError:  # the guard has ended, and its exit status says why
            return
        if error_number:
            raise EstimatorFailure("refused", self._why_not_started(plan["argv"][0], error_number, folder))

    def _environment(self) -> dict[str, str]:
        """The environment variables of the program. HOME and TMPDIR are its home folder."""
        home = str(self.home)
        kept = {name: value for name, value in os.environ.items() if name in KEPT_ENVIRONMENT}
        threads = dict.fromkeys(THREADS, str(self.limits.threads))
        fixed = {"PYTHONHASHSEED": "0", "HOME": home, "TMPDIR": home}
        return {**kept, **threads, **fixed, **user_site_environment()}

    def _take_reports(self) -> int:
        """Receive the guard's reports on the sandbox, if there is one, and on the start, whose errno is returned.

        If the isolation itself fails, the guard reports only the start, and the program's process has ended. If the
        guard has ended, it reports nothing, and its exit status says why.
        """
        while True:
            message, descriptors, _, _ = socket.recv_fds(self._line, MESSAGE_BYTES, maxfds=3)
            if not message:
                return 0
            if message.startswith(START_REPORT):
                return int(message.removeprefix(START_REPORT))
            sees, why, self.is_apart = marshal.loads(message.removeprefix(SANDBOX_REPORT))
            self.sandbox = sandbox.from_guard_report(sees, why)
            if descriptors:
                self._disk, self._files, self._shared_memory = descriptors

    def _why_not_started(self, name: str, error_number: int, folder: Path | None) -> str:
        sentence = f"{name} cannot be started ({os.strerror(error_number)})"
        if self.sandbox.level != "none" and is_unreadable_program(name, folder):
            return f"{sentence}: it lies outside of what an estimator may read; name its folder in {READ_VARIABLE}"
        return sentence

    def _kill(self) -> None:
        """End all processes of the program through the guard, then the guard, then processes that were missed."""
        with suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=GUARD_S)
        stop.kill_session(self.process)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=GUARD_S)
        if self.is_apart:  # all processes ended with the first of their namespace
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
            self._disk = -1
            self._shared_memory = -1

    def _free_shared(self) -> None:
        for path in self._shared:
            with suppress(OSError):
                os.unlink(path)

    def read(self, name: str, *, most_bytes: int) -> bytes:
        """The content of a file below the home folder. Raises OutputFailure if it is missing or not safe to read."""
        try:
            return read_below(self._files, name, most_bytes=most_bytes, check=self._check_time)
        except FileNotFoundError:
            raise OutputFailure(None) from None
        except UnreadableFileError as error:
            raise OutputFailure(str(error)) from None

    def left_s(self) -> float:
        """The time until the limit of the trial, in seconds."""
        return self._began + self.limits.trial_s - time.monotonic()

    def _check_time(self) -> None:
        """Raise EstimatorFailure if the trial has exceeded its limit of time."""
        stop.check()
        if self.left_s() < 0:
            raise EstimatorFailure("timeout", f"the whole trial took more than {self.limits.trial_s:g} s")

    def look(self, *, at_once: bool = False) -> None:
        """Measure the resources of all processes, if LOOK_S has passed or `at_once` is set.

        Raises EstimatorFailure if a limit is exceeded.
        """
        self._check_time()
        is_time = time.monotonic() > self._looked + LOOK_S
        if is_time:
            self._looked = time.monotonic()
            self._pids = [self.process.pid, *descendants(self.process.pid)]
            self._cut_log()
        if not (is_time or at_once):
            return

        stats = _stats(self._pids)
        cpu_s = sum(_cpu_s(pid, fields) for pid, fields in stats.items())
        self.cpu_s = max(self.cpu_s, cpu_s)

        # The guard and the first process of the namespace belong to vobench, so their memory does not count.
        for pid in self._pids[: 1 + self.is_apart]:
            stats.pop(pid, None)
        memory_mib = self._memory_mib(stats)
        self.peak_mib = max(self.peak_mib, memory_mib)
        limit = f"where the limit is {self.limits.memory_mib} MiB"
        if memory_mib > self.limits.memory_mib:
            raise EstimatorFailure("out_of_memory", f"its processes hold {memory_mib:.0f} MiB, {limit}")
        if len(stats) > MOST_PROCESSES:
            sentence = f"it has {len(stats)} processes, where the limit is {MOST_PROCESSES}"
            raise EstimatorFailure("out_of_memory", sentence)
        if is_time and self._socket_mib() > self.limits.memory_mib:
            raise EstimatorFailure("out_of_memory", f"its sockets can hold {self._socket_mib():.0f} MiB, {limit}")

        if self._disk >= 0:
            self._weigh_disk()
        elif time.monotonic() > self._weighed + WEIGH_S:
            self._weigh_files()

    def _memory_mib(self, stats: dict[int, list[str]]) -> float:
        """The memory of processes with the given `stat` fields, including the content of shared memory.

        The resident pages of all processes are added up, so that shared pages count several times. If the sum exceeds
        the limit, or if there is named shared memory, each page is divided by the number of its processes (PSS).
        """
        in_files = _used_bytes(self._shared_memory) if self._shared_memory >= 0 else 0
        resident_pages = {pid: int(fields[RESIDENT_PAGES]) for pid, fields in stats.items()}
        memory = sum(resident_pages.values()) * resource.getpagesize() + in_files
        if memory > self.limits.memory_mib * MEBIBYTE or in_files > MEBIBYTE:
            private = 0
            shared = 0
            for pid, pages in resident_pages.items():
                private_part, shared_part = _proportional_bytes(pid, pages)
                private += private_part
                shared += shared_part
            memory = private + max(shared, in_files)  # mapped files are part of both
        large = [pid for pid, fields in stats.items() if int(fields[VIRTUAL_BYTES]) > LARGE_BYTES]
        memory += sum(map(_page_table_bytes, large))
        return memory / MEBIBYTE

    def _socket_mib(self) -> float:
        """The memory that the buffers of all sockets can hold at most. The kernel does not report how much they hold.

        In a private network, the kernel counts all sockets, even those that no process has open. Otherwise the open
        ones are counted.
        """
        pids = self._pids[1:]  # without the guard, which has another network
        if not pids:  # the program has ended
            return 0.0
        if isolation.NETWORK in self.sandbox.sees:
            count = _open_socket_count(pids)
            tcp_count = count
        else:
            count, tcp_count = _socket_counts(pids[-1])
        has_fixed_size = isolation.SYSTEM_CALLS not in self.sandbox.sees
        of_any = _buffer_bytes(DEFAULT_BUFFERS if has_fixed_size else LARGEST_BUFFERS)
        return (count * of_any + tcp_count * _buffer_bytes(TCP_BUFFERS)) / MEBIBYTE

    def _weigh_disk(self) -> None:
        """Raise EstimatorFailure if the file system of the home folder holds more than the limit."""
        if self._is_disk_full():
            raise self._files_failure()
        if time.monotonic() > self._weighed + WEIGH_S:
            self._weigh_nameless(0)

    def _is_disk_full(self) -> bool:
        return self._disk >= 0 and _used_bytes(self._disk) > self.limits.disk_mib * MEBIBYTE

    def _files_failure(self) -> EstimatorFailure:
        sentence = f"its files hold more than the limit of {self.limits.disk_mib} MiB"
        return EstimatorFailure("out_of_memory", sentence)

    def _weigh_files(self) -> None:
        """Raise EstimatorFailure if the home folder and the open files without a name exceed the limit together."""
        if self._disk >= 0:
            self._weigh_nameless(0)
            return
        limit = self.limits.disk_mib * MEBIBYTE + self._files_before
        held = held_bytes(self._files, most=limit)
        self._weigh_nameless(held - self._files_before)

    def _weigh_nameless(self, held: int) -> None:
        self._weighed = time.monotonic()
        own_devices = set()
        for descriptor in (self._disk, self._shared_memory):
            if descriptor >= 0:
                own_devices.add(os.fstat(descriptor).st_dev)
        nameless = [file for file in _nameless(self._pids) if file.device not in own_devices]
        if self._disk < 0:
            self._shared |= {file.target for file in nameless} - self._shared_before
        held += sum(file.size for file in nameless)
        if held > self.limits.disk_mib * MEBIBYTE:
            raise self._files_failure()

    def _cut_log(self) -> None:
        """Cut the log to LOG_BYTES, and count the bytes that were removed.

        Disk space that the program reserved beyond the end of the log is freed. What the program prints between the two
        calls is removed without being counted.
        """
        facts = os.fstat(self._log)
        size = facts.st_size
        kept = min(size, LOG_BYTES)
        self._printed += size - kept
        if size > kept:
            start = max(size - END_BYTES, LOG_BYTES)
            end = self._cut_end + os.pread(self._log, END_BYTES, start)
            self._cut_end = end[-END_BYTES:]
        if size > kept or facts.st_blocks * STAT_BLOCK_BYTES > LOG_SPACE_BYTES:
            os.ftruncate(self._log, kept)

    def wait(self) -> None:
        """Wait until the program ends. Raises EstimatorFailure unless its exit code is 0."""
        while self.process.poll() is None:
            self.look()
            time.sleep(LOOK_S / 5)
        stop.check()
        self.cpu_s = max(self.cpu_s, _buried_s() - self._before_s)
        if self.process.returncode:
            raise EstimatorFailure(*self.death())

    def death(self) -> tuple[str, str]:
        """The status and the reason of a premature end. The reason includes the last line that the program printed."""
        try:
            code = self.process.wait(timeout=DEATH_S)
        except subprocess.TimeoutExpired:
            return "invalid_output", "it closed its output and still runs"
        if not code:
            return "invalid_output", "it ended, with exit code 0"
        if self._is_disk_full():
            failure = self._files_failure()
            return failure.kind, failure.reason
        if code == -signal.SIGKILL:
            return "out_of_memory", "killed by the system, most likely for memory"
        if code < 0:
            cause = f"signal {signal.Signals(-code).name}"
            self._stack = self._printed_stack()
            if self._stack:
                place = _place_in(self._stack, self._folder)
                return "crashed", f"the process ended with {cause}{place} (its stack is in {self._log_path.name})"
        else:
            cause = f"exit code {code}"
        last_line = self._last_line()
        printed = f": {last_line}" if last_line else ""
        return "crashed", f"the process ended with {cause}{printed}"

    def _printed_stack(self) -> str:
        """The calls of every thread, which Python's fault handler has printed at the end; empty if it has not."""
        _, heading, stack = self._printed_end().rpartition(STACK_HEADING)
        return f"{heading}{stack}" if heading else ""

    def _printed_end(self) -> str:
        """The last END_BYTES that the program printed, even if they were cut off the log."""
        size = os.fstat(self._log).st_size
        start = max(size - END_BYTES, LOG_BYTES if self._printed else 0)
        end = self._cut_end + os.pread(self._log, END_BYTES, start)
        return end[-END_BYTES:].decode("utf-8", "replace")

    def _last_line(self) -> str:
        """The last printed line that is not blank; empty if there is none."""
        for line in reversed(self._printed_end().split("\n")):
            printed = in_one_line(line, LINE_LETTERS)
            if printed:
                return printed
        return ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(EstimatorFailure):
            self._weigh_files()  # finds the shared memory that has to be freed
        if self.process.stdin:
            self.process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=0.5 if kind is None else 0)
        self._undone.close()

    def _close_log(self) -> None:
        """Cut the log a last time. Restore its mode, which the program can change because it has the descriptor."""
        self._cut_log()
        if self._printed:
            printed_bytes = LOG_BYTES + self._printed
            note = f"\n[vobench: cut here; the estimator printed at least {printed_bytes} bytes]\n"
            # The program shares the descriptor, so it can have turned off appending and moved the position.
            os.pwrite(self._log, f"{note}{self._stack}".encode(), os.fstat(self._log).st_size)
        os.fchmod(self._log, self._log_mode)
        os.close(self._log)


def _place_in(stack: str, folder: Path | None) -> str:
    """The innermost call in a stack that is in the estimator's folder, or else the innermost call, as a clause.

    It is empty if the thread that failed has no call of Python.
    """
    thread = FAILED_THREAD.search(stack)
    lines = thread[1].splitlines() if thread else []
    calls = [call for line in lines if (call := CALL.fullmatch(line))]
    own_calls = [call for call in calls if folder and Path(call[1]).is_relative_to(folder)]
    for file, line_number, function in (call.groups() for call in (*own_calls, *calls)):
        return f" in {function} at {file}:{line_number}"
    return ""


def _open_log(path: Path) -> int:
    """Create an empty log, and return its descriptor. Writes always append, even after the log is cut."""
    flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC
    return os.open(path, flags, 0o666)


@cache
def sandbox_here() -> Sandbox:
    """The sandbox that a program gets on this machine. It is tried with a program once per process."""
    with temporary_folder() as folder:
        try:
            with Program(["true"], log=folder / "log.txt", limits=Limits()) as program:
                return program.sandbox
        except EstimatorFailure:
            return sandbox.unsandboxed()


def sandbox_works() -> bool:
    """Whether this machine can isolate a program completely."""
    return sandbox_here().level == "full"


def _strays(home: Path) -> list[int]:
    """The ids of processes that were started with this folder as TMPDIR, unless they have changed their environment."""
    mark = f"\0TMPDIR={home}\0".encode()
    names = os.listdir("/proc") if sys.platform == "linux" else []
    strays = []
    for pid in filter(str.isdigit, names):
        with suppress(OSError):
            environment = b"\0" + Path("/proc", pid, "environ").read_bytes()
            if mark in environment:
                strays.append(int(pid))
    return strays


def _stats(pids: Iterable[int]) -> dict[int, list[str]]:
    """The fields of /proc/PID/stat of those processes that still run."""
    stats = {}
    for pid in pids:
        fields = stat(pid)
        if fields:
            stats[pid] = fields
    return stats


def _cpu_s(pid: int, fields: list[str]) -> float:
    """The CPU time of a process, which its clock measures in ns, and of its ended children, which is in ticks."""
    of_children_s = sum(map(int, fields[CHILDREN_TICKS])) / TICKS_PER_S
    try:
        own_s = time.clock_gettime(~pid << 3 | CPUCLOCK_SCHED)
    except OSError:
        own_s = sum(map(int, fields[OWN_TICKS])) / TICKS_PER_S
    return own_s + of_children_s


def _used_bytes(descriptor: int) -> int:
    """The used bytes of a private file system. An empty file counts as one block."""
    facts = os.fstatvfs(descriptor)
    in_blocks = (facts.f_blocks - facts.f_bfree) * facts.f_frsize
    in_entries = (facts.f_files - facts.f_ffree) * ENTRY_BYTES
    return max(in_blocks, in_entries)


def _proportional_bytes(pid: int, resident_pages: int) -> tuple[int, int]:
    """The proportional memory of a process in bytes: that of private pages and files, and that of shared memory.

    Source: proc(5), smaps_rollup. If the kernel does not report it, all resident pages count as private.
    """
    with suppress(OSError, ValueError), open(f"/proc/{pid}/smaps_rollup", encoding="ascii") as file:
        kib = {}
        for line in file:
            if line.startswith("Pss"):
                name, amount, *_ = line.split()
                kib[name] = int(amount)
        shared = kib.get("Pss_Shmem:", 0)
        return 1024 * (kib["Pss:"] - shared), 1024 * shared
    return resident_pages * resource.getpagesize(), 0


def _page_table_bytes(pid: int) -> int:
    """The size of the page tables of a process, which can be large although it has few pages: proc(5), VmPTE."""
    with suppress(OSError, ValueError), open(f"/proc/{pid}/status", encoding="ascii", errors="replace") as file:
        for line in file:
            if line.startswith("VmPTE:"):
                return 1024 * int(line.split()[1])
    return 0


def _socket_counts(pid: int) -> tuple[int, int]:
    """The numbers of all sockets and of TCP sockets in the network of a process: proc(5), sockstat."""
    count = 0
    tcp_count = 0
    for name in ("sockstat", "sockstat6"):
        with suppress(OSError, ValueError), open(f"/proc/{pid}/net/{name}", encoding="ascii") as file:
            for line in file:
                words = line.split()
                if words[0] == "sockets:":
                    count = int(words[2])
                elif words[0] in ("TCP:", "TCP6:"):
                    tcp_count += int(words[2])
    return count, tcp_count


def _open_socket_count(pids: Iterable[int]) -> int:
    """The number of sockets that processes have open."""
    sockets = set[str]()
    for pid in pids:
        folder = f"/proc/{pid}/fd"
        with suppress(OSError):
            for name in os.listdir(folder):
                with suppress(OSError):
                    target = os.readlink(f"{folder}/{name}")
                    if target.startswith("socket:"):
                        sockets.add(target)
    return len(sockets)


@cache
def _buffer_bytes(settings: Sequence[str]) -> int:
    """The sum of the largest sizes of buffers in settings of the kernel."""
    total = 0
    for setting in settings:
        with suppress(OSError, ValueError, IndexError):
            largest = Path("/proc/sys/net", setting).read_text(encoding="ascii").split()[-1]
            total += int(largest)
    return total


@dataclass(frozen=True, slots=True)
class _OpenFile:
    """A file that a process holds open: its device, its size on disk in bytes, and its path in /proc."""

    device: int
    size: int
    target: str


def _nameless(pids: Iterable[int]) -> list[_OpenFile]:
    """The open files of processes that are deleted or in shared memory, without duplicates."""
    files = dict[tuple[int, int], _OpenFile]()
    for pid in pids:
        folder = f"/proc/{pid}/fd"
        with suppress(OSError):
            for name in os.listdir(folder):
                with suppress(OSError):
                    target = os.readlink(f"{folder}/{name}")
                    facts = os.stat(f"{folder}/{name}")
                    is_hidden = not facts.st_nlink or target.startswith(SHARED)
                    if S_ISREG(facts.st_mode) and is_hidden:
                        size = facts.st_blocks * STAT_BLOCK_BYTES
                        files[facts.st_dev, facts.st_ino] = _OpenFile(facts.st_dev, size, target)
    return list(files.values())


def _buried_s() -> float:
    """The CPU time of all ended descendants of this process."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
