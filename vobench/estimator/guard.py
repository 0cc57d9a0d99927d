"""The parent of an estimator's processes: none of them outlives the trial or vobench, whatever session it is in.

Run as a script by a bare interpreter, for it should cost next to nothing: nothing of vobench is imported.
"""

import ctypes
import os
import resource
import select
import signal
import socket
import sys
import time
from contextlib import suppress
from typing import NoReturn

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
LOOK_S = 0.5  # how often we look whether vobench lives, should its end of the line be held open by another
KILL_S = 0.002
CANNOT_START = 127


def guard(line: socket.socket, file_bytes: int, argv: list[str]) -> NoReturn:
    """Start a program, say on the line how that went, and end as it ends, or when the line is cut."""
    line.set_inheritable(False)
    parent = os.getppid()
    for limit, value in ((resource.RLIMIT_FSIZE, file_bytes), (resource.RLIMIT_CORE, 0)):
        with suppress(ValueError):  # where we are given less ourselves
            resource.setrlimit(limit, (value, value))
    _prctl(PR_SET_CHILD_SUBREAPER, 1)  # the orphans of all below us become our own
    heard, hears = os.pipe()
    os.set_blocking(heard, False)
    os.set_blocking(hears, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(hears)
    main, status = _started(argv, line), None
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
    _end_as(status or 0)


def _started(argv: list[str], line: socket.socket) -> int:
    """The id of the program's process, when it runs; errno goes down the line, 0 where all is well."""
    reads, writes = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGPIPE, signal.SIGXFSZ):  # which our interpreter has changed
            signal.signal(number, signal.SIG_DFL)
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        try:
            os.execvp(argv[0], argv)
        except OSError as error:
            os.write(writes, str(error.errno).encode())
        os._exit(CANNOT_START)
    os.close(writes)
    line.send(os.read(reads, 16) or b"0")
    os.close(reads)
    return pid


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


def _end_as(status: int) -> NoReturn:
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


if __name__ == "__main__":
    guard(socket.socket(fileno=int(sys.argv[1])), int(sys.argv[2]), sys.argv[3:])
