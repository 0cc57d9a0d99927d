"""The parent of an estimator's processes: none of them outlives the trial or vobench, whatever session it is in.

Where the kernel allows it they live in namespaces of their own (namespaces(7)): they see no other processes, and
folders that are hidden from them are empty.

Run as a script by a bare interpreter, for it should cost next to nothing: nothing of vobench is imported.
"""

import ctypes
import json
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
# linux/sched.h and linux/mount.h
CLONE_NEWNS, CLONE_NEWUSER, CLONE_NEWPID = 0x00020000, 0x10000000, 0x20000000
MS_RDONLY, MS_BIND, MS_REC, MS_PRIVATE = 1, 4096, 16384, 1 << 18


def guard(line: socket.socket, file_bytes: int, hidden: list[str], argv: list[str]) -> NoReturn:
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
    ends, writes = os.pipe()
    main, status = _started(argv, line, hidden, writes), None
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


def _started(argv: list[str], line: socket.socket, hidden: list[str], ended: int) -> int:
    """The id of the program's process, or of the first in its namespaces, which writes on `ended` how the program did.

    Down the line goes "1" where the hidden folders are hidden, else "0", and errno, 0 where the program runs.
    """
    is_apart, (reads, writes) = bool(hidden) and _unshared(), os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGPIPE, signal.SIGXFSZ):  # which our interpreter has changed
            signal.signal(number, signal.SIG_DFL)
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        os.write(writes, b"1 " if is_apart and _hide(hidden) else b"0 ")
        if is_apart:
            _be_first(writes, ended)
        try:
            os.execvp(argv[0], argv)
        except OSError as error:
            os.write(writes, str(error.errno).encode())
        os._exit(CANNOT_START)
    os.close(writes)
    said = b""
    while more := os.read(reads, 16):
        said += more
    line.send(said + b"0" if said.endswith(b" ") else said)
    os.close(reads)
    return pid


def _unshared() -> bool:
    """Whether our children are in a namespace of processes of their own, as the system's root or as one of our own."""
    user, group = os.getuid(), os.getgid()
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.unshare(CLONE_NEWPID) == 0:
            return True
        if libc.unshare(CLONE_NEWUSER | CLONE_NEWPID):
            return False
        for name, text in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
            with open(f"/proc/self/{name}", "w") as file:
                file.write(text)
    except (OSError, AttributeError):
        return False
    return True


def _hide(paths: list[str]) -> bool:
    """Whether folders are now empty and files without content for this process and those that come of it."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNS) or libc.mount(None, b"/", None, MS_REC | MS_PRIVATE, None):
        return False
    libc.mount(b"proc", b"/proc", b"proc", 0, None)  # where the system's own is masked this may not be
    done = True
    for path in paths:
        at = os.fsencode(path)
        if os.path.isdir(at):
            done &= libc.mount(b"tmpfs", at, b"tmpfs", MS_RDONLY, b"size=4k") == 0
        elif os.path.exists(at):
            done &= libc.mount(b"/dev/null", at, None, MS_BIND, None) == 0
    return bool(done)


def _be_first(writes: int, ended: int) -> None:
    """Become the first process of our namespace, with which all others go; come back as the program's alone."""
    pid = os.fork()
    if pid == 0:
        _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        return
    for fd in (0, 1, writes):
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
    guard(socket.socket(fileno=int(sys.argv[1])), int(sys.argv[2]), json.loads(sys.argv[3]), sys.argv[4:])
