"""The parent of an estimator's processes: none of them outlives the trial or vobench, whatever session it is in.

Where the kernel allows it they are isolated (`isolation`): they see no other processes, and no files but their own.

Run by a bare interpreter, because a start should cost next to nothing: nothing of vobench is imported.
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
except ModuleNotFoundError:  # in the bare interpreter, which has this folder alone to look in
    import isolation  # type: ignore[import-not-found,no-redef]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, NoReturn

# linux/prctl.h
PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
LOOK_S = 0.5  # how often we look whether vobench lives, should its end of the line be held open by another
KILL_S = 0.002
CANNOT_START = 127
PLAN_BYTES = 1 << 20


def main() -> "NoReturn":
    """Guard the program of the plan that is sent on the line, whose descriptor is the first argument."""
    line = _socket.socket(fileno=int(sys.argv[1]))
    plan = marshal.loads(line.recv(PLAN_BYTES))
    guard(line, plan)


def guard(line: _socket.socket, plan: "dict[str, Any]") -> "NoReturn":
    """Start a program, report on the line how that went, and end as it ends, or when the line is cut.

    `plan` is that of `sandbox.plan`. Two messages go down the line: what the program can see beyond its own, with the
    descriptors of `isolation.enter`, and the errno of its start, 0 where it runs.
    """
    os.set_inheritable(line.fileno(), False)
    parent = os.getppid()
    for limit, value in ((resource.RLIMIT_FSIZE, plan["file_bytes"]), (resource.RLIMIT_CORE, 0)):
        with suppress(ValueError):  # where we are given less ourselves
            resource.setrlimit(limit, (value, value))
    _prctl(PR_SET_CHILD_SUBREAPER, 1)  # the orphans of all below us become our own
    heard, hears = os.pipe()
    os.set_blocking(heard, False)
    os.set_blocking(hears, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(hears)
    ends, writes = os.pipe()
    main = _started(plan, line, writes)
    status = None
    os.close(writes)
    for fd in (0, 1):  # the program's alone, whose end is then seen at the other side
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
    """The id of the program's process, or of the first in its namespace, which writes the program's end on `ended`."""
    is_isolated = plan["is_isolated"]
    has_pid_namespace = is_isolated and isolation.new_pid_namespace()
    reads, writes = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGPIPE, signal.SIGXFSZ):  # which our interpreter has changed
            signal.signal(number, signal.SIG_DFL)
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if is_isolated:
            _isolate(plan, line, has_pid_namespace=has_pid_namespace)
        line.close()
        if has_pid_namespace:
            _be_first(writes, ended)
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
    with suppress(OSError):  # where vobench has gone meanwhile
        line.send(failed or b"0")
    return pid


def _isolate(plan: "dict[str, Any]", line: _socket.socket, *, has_pid_namespace: bool) -> None:
    """Isolate this process, and send what it can see all the same, why, and the descriptors of its file systems."""
    sees, why, descriptors = isolation.enter(plan, has_pid_namespace=has_pid_namespace)
    report = marshal.dumps((sees, why, has_pid_namespace))
    packed = b"".join(descriptor.to_bytes(4, sys.byteorder) for descriptor in descriptors)
    rights = [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, packed)] if packed else []
    line.sendmsg([report], rights)
    for descriptor in descriptors:
        os.close(descriptor)


def _be_first(writes: int, ended: int) -> None:
    """Become the first process of our namespace, with which all others go; come back as the program's alone."""
    isolation.hide_from_children()
    pid = os.fork()
    if pid == 0:
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        return
    for fd in (0, 1, 2, writes):
        os.close(fd)
    while True:
        who, status = os.wait()
        if who == pid:
            os.write(ended, str(status).encode())
            os._exit(0)


def _buried(main: int) -> int | None:
    """The status of the program's process, where it has ended; all that have ended are taken off the system's list."""
    status = None
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status = ended[1] if ended[0] == main else status
    return status


def _end_all() -> None:
    """Kill until nobody is left: whoever loses its parent becomes our child."""
    with suppress(ChildProcessError):
        while True:
            for pid in descendants(os.getpid()):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
            time.sleep(KILL_S)


def _end_as(status: int) -> "NoReturn":
    """End with the exit code or by the signal of another process."""
    if os.WIFSIGNALED(status):
        with suppress(OSError):  # SIGKILL has no other handler
            signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.waitstatus_to_exitcode(status))


def _prctl(option: int, value: int) -> None:
    """Where it is Linux that we run on."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def descendants(ancestor: int) -> list[int]:
    """The ids of all processes that come of one; none where there is no /proc."""
    pids = [int(pid) for pid in os.listdir("/proc") if pid.isdigit()] if sys.platform == "linux" else []
    children = dict[int, list[int]]()
    for pid in pids:
        if fields := stat(pid):
            children.setdefault(int(fields[1]), []).append(pid)
    found = [ancestor]
    for pid in found:  # which grows as we go
        found += children.get(pid, [])
    return found[1:]


def stat(pid: int) -> list[str]:
    """What /proc/<pid>/stat says behind the name: state, parent, group, session, ... (proc(5)); nothing once gone."""
    with suppress(OSError), open(f"/proc/{pid}/stat", errors="replace") as file:
        return file.read().rpartition(")")[2].split()
    return []
