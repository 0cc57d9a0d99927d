"""The guard of an estimator: the parent process of its processes, which none of them outlives, in whatever session.

Where the kernel allows it, the processes are isolated (`isolation`): they see only their own processes and files.

It runs in a bare interpreter and imports nothing else of vobench, because it should start quickly.
"""

import _socket
import ctypes
import marshal
import os
import resource
import select
import signal
import sys
import time
from contextlib import suppress

try:
    from vobench.estimator import isolation
except ModuleNotFoundError:  # the bare interpreter finds modules only in this folder
    import isolation  # type: ignore[import-not-found,no-redef]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, NoReturn

# linux/prctl.h
PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
LOOK_S = 0.5  # period at which the guard checks that vobench is alive; another process may hold its socket open
KILL_S = 0.002  # pause between two rounds of kills
CANNOT_START = 127
# A limit of 0 would still pipe a whole core to a program that the kernel is told to start; 1 prevents that: core(5).
CORE_BYTES = 1
PLAN_BYTES = 1 << 20
# The largest number of descriptors of a process. It bounds the memory of the kernel that pipes and sockets can hold.
MOST_DESCRIPTORS = 1024
OOM_SCORE = b"1000"  # the largest score: if memory runs out, the kernel ends the estimator before anything else
# The first letters of the messages to vobench.
SANDBOX_REPORT = b"S"
START_REPORT = b"E"
STAT_BYTES = 4096  # more than /proc/PID/stat has


def main() -> "NoReturn":
    """Guard the program whose plan arrives on a socket. The first argument is the descriptor of the socket."""
    line = _socket.socket(fileno=int(sys.argv[1]))
    plan = marshal.loads(line.recv(PLAN_BYTES))
    guard(line, plan)


def guard(line: _socket.socket, plan: "dict[str, Any]") -> "NoReturn":
    """Start a program, report its start to vobench, and end as the program ends, or when the socket is closed.

    `plan` is the result of `guard_plan`. `line` is the socket to vobench. The guard sends two messages: a
    SANDBOX_REPORT on what the program can see besides its own files and processes, with the descriptors of
    `isolation.enter`, if the program is isolated; and a START_REPORT with the errno of the start, which is 0 if the
    program runs.
    """
    os.set_inheritable(line.fileno(), False)
    parent = os.getppid()
    limits = (
        (resource.RLIMIT_FSIZE, plan["file_bytes"]),
        (resource.RLIMIT_CORE, CORE_BYTES),
        (resource.RLIMIT_NOFILE, MOST_DESCRIPTORS),
    )
    for limit, value in limits:
        with suppress(ValueError):  # the limit of the guard itself is lower
            resource.setrlimit(limit, (value, value))
    _prctl(PR_SET_CHILD_SUBREAPER, 1)  # orphaned descendants become children of the guard
    heard, hears = os.pipe()
    os.set_blocking(heard, False)
    os.set_blocking(hears, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(hears)
    ends, writes = os.pipe()
    main = _started(plan, line, writes)
    status = None
    os.close(writes)
    for fd in (0, 1, *plan["inherited"]):  # only the program holds them, so vobench notices when it closes them
        os.close(fd)
    while status is None:
        ready, _, _ = select.select([line.fileno(), heard], [], [], LOOK_S)
        with suppress(BlockingIOError):
            os.read(heard, 4096)
        if line.fileno() in ready or os.getppid() != parent:
            break
        status = _buried(main)
    _end_all()
    _end_as(int(os.read(ends, 16) or status or 0))


def _started(plan: "dict[str, Any]", line: _socket.socket, ended: int) -> int:
    """Start the program's process, or the first process of its namespace, and return its id.

    The first process of the namespace writes the status of the program to the descriptor `ended`.
    """
    is_isolated = plan["is_isolated"]
    has_pid_namespace = is_isolated and isolation.new_pid_namespace()
    reads, writes = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGPIPE, signal.SIGXFSZ):  # the interpreter has changed these handlers
            signal.signal(number, signal.SIG_DFL)
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        _be_ended_first()
        if is_isolated:
            _isolate(plan, line, has_pid_namespace=has_pid_namespace)
        line.close()
        if has_pid_namespace:
            _be_first(writes, ended, plan["inherited"])
        try:
            os.execv(plan["program"], plan["argv"])
        except OSError as error:
            os.write(writes, str(error.errno).encode())
        os._exit(CANNOT_START)
    os.close(writes)
    failed = b""
    while more := os.read(reads, 16):
        failed += more
    os.close(reads)
    with suppress(OSError):  # vobench has ended
        line.send(START_REPORT + (failed or b"0"))
    return pid


def _isolate(plan: "dict[str, Any]", line: _socket.socket, *, has_pid_namespace: bool) -> None:
    """Isolate this process, and send a report: what it can still see, why, and the descriptors of its file systems."""
    sees, why, descriptors = isolation.enter(plan, has_pid_namespace=has_pid_namespace)
    report = SANDBOX_REPORT + marshal.dumps((sees, why, has_pid_namespace))
    packed = b"".join(descriptor.to_bytes(4, sys.byteorder) for descriptor in descriptors)
    rights = [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, packed)] if packed else []
    line.sendmsg([report], rights)
    for descriptor in descriptors:
        os.close(descriptor)


def _be_ended_first() -> None:
    """Let the kernel end this process and its descendants before others if memory runs out: proc(5), oom_score_adj."""
    with suppress(OSError), open("/proc/self/oom_score_adj", "wb", buffering=0) as file:
        file.write(OOM_SCORE)


def _be_first(writes: int, ended: int, inherited: "list[int]") -> None:
    """Make this process the first of its namespace, and return only in a child process, which becomes the program.

    When the first process of a namespace ends, the kernel kills all others.
    """
    isolation.hide_from_children()
    pid = os.fork()
    if pid == 0:
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        return
    for fd in (0, 1, 2, writes, *inherited):
        os.close(fd)
    while True:
        who, status = os.wait()
        if who == pid:
            os.write(ended, str(status).encode())
            os._exit(0)


def _buried(main: int) -> int | None:
    """Reap all processes that have ended, and return the status of the process `main` if it is one of them."""
    status = None
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status = ended[1] if ended[0] == main else status
    return status


def _end_all() -> None:
    """Kill all descendants. Those that lose their parent become children of the guard, so that none is missed."""
    with suppress(ChildProcessError):
        while True:
            for pid in descendants(os.getpid()):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
            time.sleep(KILL_S)


def _end_as(status: int) -> "NoReturn":
    """End this process with the exit code of another process, or by the signal that ended it."""
    if os.WIFSIGNALED(status):
        with suppress(OSError):  # the handler of SIGKILL cannot be set
            signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.waitstatus_to_exitcode(status))


def _prctl(option: int, value: int) -> None:
    """Call prctl(2), which exists only on Linux."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def descendants(ancestor: int) -> list[int]:
    """The ids of all descendants of a process; empty on a system without /proc."""
    names = os.listdir("/proc") if sys.platform == "linux" else []
    pids = [int(name) for name in names if name.isdigit()]
    children = dict[int, list[int]]()
    for pid in pids:
        if fields := stat(pid):
            children.setdefault(int(fields[1]), []).append(pid)
    family = [ancestor]
    for pid in family:  # the loop also visits the ids that it appends
        family += children.get(pid, [])
    return family[1:]


def stat(pid: int) -> list[str]:
    """The fields of /proc/<pid>/stat after the name: state, parent, group, session and so on (see proc(5)).

    Empty if the process no longer exists.
    """
    with suppress(OSError):
        file = os.open(f"/proc/{pid}/stat", os.O_RDONLY)  # a text file takes twice the time, and there are many
        try:
            content = os.read(file, STAT_BYTES)
        finally:
            os.close(file)
        return content.rpartition(b")")[2].decode("ascii").split()
    return []
