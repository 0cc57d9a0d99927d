"""A server process that imports the modules of workers once and forks workers. None of them outlives vobench.

There are three ways in which a worker ends, so that at least one always works:

- A thread of the worker notices that vobench has ended, cleans up and ends the worker.
- The server kills workers that still run after a grace period, and the processes that they have started.
- The kernel kills all workers when the server dies.

The fork server of multiprocessing is not used. Each of its children holds open the pipe whose closing should end the
server, so the server and its workers survive if vobench is killed, and its socket stays in the temporary folder.
"""

import atexit
import ctypes
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from typing import NoReturn

PR_SET_PDEATHSIG = 1  # linux/prctl.h
PR_SET_CHILD_SUBREAPER = 36
FAREWELL_S = 0.8  # the time for workers to end by themselves after vobench has ended
ORPHAN_S = 0.3  # the time for the orphans of a dead worker to end by themselves
LOOK_S = 0.02  # the period at which the server checks whether processes have ended
END_S = 2.0  # the time for the server to end on request
NUMBER = struct.Struct("q")  # a process id or an exit code on a pipe
START = b"w"  # on the control socket: fork a worker


class WorkerProcess:
    """A forked worker: the connection to it, and its exit code."""

    def __init__(self, connection: Connection, status_fd: int) -> None:
        self.connection = connection
        self._status_fd = status_fd
        self._lock = threading.Lock()
        self._pid: int | None = None
        self._exit_code: int | None = None

    @property
    def exit_code(self) -> int | None:
        """The exit code, or minus the number of a signal; None while the worker runs or has not started."""
        return self.join(timeout_s=0)

    @property
    def is_alive(self) -> bool:
        """Whether the worker runs or has not started yet."""
        return self.exit_code is None

    def pid(self, timeout_s: float | None = None) -> int | None:
        """The process id, for which the call waits if necessary; None if the worker does not start in time."""
        self._read(until=lambda: self._pid is not None, timeout_s=timeout_s)
        return self._pid

    def join(self, timeout_s: float | None = None) -> int | None:
        """Wait for the end of the worker, and return its exit code; None if it has not ended in time."""
        self._read(until=lambda: self._exit_code is not None, timeout_s=timeout_s)
        return self._exit_code

    def abandon(self) -> bool:
        """Return whether the worker has not started yet. In this case, it will end as soon as it starts."""
        if self.pid(timeout_s=0) is not None or not self.is_alive:
            return False
        with suppress(OSError), socket.socket(fileno=os.dup(self.connection.fileno())) as line:
            line.shutdown(socket.SHUT_RDWR)
        return True

    def kill(self, number: int) -> None:
        """Send a signal to the worker if it runs."""
        pid = self.pid(timeout_s=0)
        if pid is not None and self.is_alive:
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    def close(self) -> None:
        """Close the connection, which ends the worker, and wait for its end."""
        self.connection.close()
        self.join()
        with self._lock:
            if self._status_fd >= 0:
                os.close(self._status_fd)
            self._status_fd = -1

    def _read(self, *, until: Callable[[], bool], timeout_s: float | None) -> None:
        """Read the reports of the server on the worker: its id, then its exit code."""
        ends_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not until() and self._exit_code is None:
            left_s = None if ends_s is None else max(ends_s - time.monotonic(), 0)
            if not select.select([self._status_fd], [], [], left_s)[0]:
                return
            with self._lock:
                if until() or self._exit_code is not None:
                    return
                report = os.read(self._status_fd, NUMBER.size)
                if len(report) < NUMBER.size:
                    self._exit_code = -signal.SIGKILL  # the server died, which killed the worker
                elif self._pid is None:
                    (self._pid,) = NUMBER.unpack(report)
                else:
                    (self._exit_code,) = NUMBER.unpack(report)


class ForkServer:
    """Starts workers, and the server that they are forked from with the first of them.

    `entry` names the function of a worker, as `package.module:function`; it is called with the worker's end of the
    connection and a descriptor that becomes readable when vobench ends, or -1. `preloaded` are the modules that are
    imported once for all workers.
    """

    def __init__(self, entry: str, preloaded: Sequence[str]) -> None:
        self._entry = entry
        self._preloaded = list(preloaded)
        self._lock = threading.Lock()
        self._control: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def start_worker(self) -> WorkerProcess:
        """Request a new worker. It starts when the server has imported all modules."""
        ours, theirs = Pipe()
        reads_fd, writes_fd = os.pipe()
        try:
            with self._lock:
                self._send(START, [theirs.fileno(), writes_fd])
        finally:
            theirs.close()
            os.close(writes_fd)
        return WorkerProcess(ours, reads_fd)

    def close(self) -> None:
        """End the server and all of its workers."""
        with self._lock:
            self._close()

    def _send(self, request: bytes, fds: list[int]) -> None:
        if self._control is not None:
            try:
                socket.send_fds(self._control, [request], fds)
            except OSError:  # the server has been killed
                self._close()
            else:
                return
        self._control = self._started()
        socket.send_fds(self._control, [request], fds)

    def _started(self) -> socket.socket:
        """The control socket of a new server."""
        ours, theirs = socket.socketpair()
        arguments = {"vobench_pid": os.getpid(), "entry": self._entry, "preloaded": self._preloaded}
        with theirs:
            code = (
                f"import json, sys; sys.path[:] = json.loads({json.dumps(sys.path)!r}); "
                f"from {__name__} import serve; serve({theirs.fileno()}, **json.loads({json.dumps(arguments)!r}))"
            )
            self._process = subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C in the terminal is handled by vobench
            )
        return ours

    def _close(self) -> None:
        if self._control is not None:
            self._control.close()
            self._control = None
        if self._process is not None:
            try:
                self._process.wait(timeout=END_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None


_shared: dict[tuple[str, ...], ForkServer] = {}


def shared_server(entry: str, preloaded: Sequence[str]) -> ForkServer:
    """The server of this process for workers with an entry function. It ends with the process."""
    key = (entry, *preloaded)
    if key not in _shared:
        _shared[key] = ForkServer(entry, preloaded)
        atexit.register(_shared[key].close)
    return _shared[key]


def watch(
    connection: Connection, vobench_fd: int, signals_fd: int, *, grace_s: float, leave: Callable[[], None]
) -> None:
    """Call `leave` in a worker when vobench ends or closes the connection to it.

    A byte from `signals_fd` means that the worker received a request to stop. `leave` is called if the worker still
    runs after `grace_s` seconds.
    """
    poll = select.poll()
    poll.register(connection.fileno(), 0)  # 0 selects only the events that are always reported, such as a hang-up
    poll.register(signals_fd, select.POLLIN)
    if vobench_fd >= 0:
        poll.register(vobench_fd, select.POLLIN)
    ready = {fd for fd, _ in poll.poll()}
    if ready == {signals_fd}:
        poll.unregister(signals_fd)
        poll.poll(grace_s * 1000)
    leave()


def serve(control_fd: int, *, vobench_pid: int, entry: str, preloaded: list[str]) -> NoReturn:
    """Run the server: import the modules, then fork workers on request until vobench ends or closes the socket."""
    # The control socket is not read during imports, so the kernel ends the server if vobench ends.
    _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    _require_parent(vobench_pid)
    for name in preloaded:
        with suppress(Exception):  # the worker that needs the module reports the error
            import_module(name)
    module, _, function = entry.partition(":")
    work = getattr(import_module(module), function)
    # From here on, the server itself detects the end of vobench. The kernel would leave workers no time to clean up,
    # and would end the server with the thread of vobench that started it.
    vobench_fd = _pidfd(vobench_pid)
    _prctl(PR_SET_PDEATHSIG, 0)
    _require_parent(vobench_pid)
    _prctl(PR_SET_CHILD_SUBREAPER, 1)  # orphaned processes of workers become children of the server
    with socket.socket(fileno=control_fd) as control:
        control.set_inheritable(False)
        server = _Server(control, vobench_fd, work)
        server.run()
    server.end()
    os._exit(0)


class _Server:
    """The server: its workers by id, with the descriptors on which their ends are reported."""

    def __init__(self, control: socket.socket, vobench_fd: int, work: Callable[[Connection, int], None]) -> None:
        self._control = control
        self._vobench_fd = vobench_fd
        self._work = work
        self._workers: dict[int, int] = {}
        self._orphans_end_s: float | None = None  # the time at which orphans are killed
        self._woken_fd, self._wakes_fd = os.pipe()
        os.set_blocking(self._woken_fd, False)
        os.set_blocking(self._wakes_fd, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self._wakes_fd)

    def run(self) -> None:
        """Fork workers and reap ended ones until vobench ends."""
        poll = select.poll()
        for fd in (self._control.fileno(), self._woken_fd, self._vobench_fd):
            if fd >= 0:
                poll.register(fd, select.POLLIN)
        while True:
            ready = {fd for fd, _ in poll.poll(None if self._orphans_end_s is None else LOOK_S * 1000)}
            if self._vobench_fd in ready:
                return
            if self._woken_fd in ready:
                os.read(self._woken_fd, 4096)
            self._bury()
            self._end_orphans()
            if self._control.fileno() in ready and not self._answer():
                return

    def end(self) -> None:
        """Wait for the workers to end, then kill the remaining ones."""
        ends_s = time.monotonic() + FAREWELL_S
        while self._workers and time.monotonic() < ends_s:
            time.sleep(LOOK_S)
            self._bury()
        children = _children(os.getpid())
        ends_s = time.monotonic() + FAREWELL_S
        while children and time.monotonic() < ends_s:
            for pid in children:
                _kill(pid)
            time.sleep(LOOK_S / 4)
            self._bury()
            children = _children(os.getpid())

    def _answer(self) -> bool:
        """Answer one request. Returns False if vobench has closed the socket."""
        try:
            request, fds, _, _ = socket.recv_fds(self._control, 1, 2)
        except OSError:
            return False
        if not request:
            return False
        connection_fd, status_fd = fds
        try:
            pid = os.fork()
        except OSError:  # there is too little memory or too many processes, which the closed descriptors report
            pid = -1
        if pid == 0:
            self._become_worker(connection_fd, status_fd)
        os.close(connection_fd)
        if pid < 0:
            os.close(status_fd)
            return True
        self._workers[pid] = status_fd
        _report(status_fd, pid)
        return True

    def _become_worker(self, connection_fd: int, status_fd: int) -> NoReturn:
        exit_code = 1
        try:
            server_pid = os.getppid()
            _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
            _require_parent(server_pid)
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self._control.close()
            for fd in (status_fd, self._woken_fd, self._wakes_fd, *self._workers.values()):
                os.close(fd)
            self._work(Connection(connection_fd), self._vobench_fd)
            exit_code = 0
        except Exception:
            traceback.print_exc()
        finally:
            with suppress(Exception):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(exit_code)

    def _bury(self) -> None:
        """Reap and report the workers that have ended."""
        with suppress(ChildProcessError):
            while True:
                pid, status = os.waitpid(-1, os.WNOHANG)
                if not pid:
                    return
                status_fd = self._workers.pop(pid, None)
                if status_fd is not None:
                    _report(status_fd, os.waitstatus_to_exitcode(status))
                    os.close(status_fd)
                    self._orphans_end_s = time.monotonic() + ORPHAN_S

    def _end_orphans(self) -> None:
        """Kill the orphaned processes of dead workers, some time after the death of a worker."""
        if self._orphans_end_s is None or time.monotonic() < self._orphans_end_s:
            return
        orphans = [pid for pid in _children(os.getpid()) if pid not in self._workers]
        for pid in orphans:
            _kill(pid)
        if not orphans:  # otherwise their children have become children of the server
            self._orphans_end_s = None


def _report(fd: int, number: int) -> None:
    with suppress(OSError):  # vobench has ended
        os.write(fd, NUMBER.pack(number))


def _kill(pid: int) -> None:
    with suppress(OSError):
        os.kill(pid, signal.SIGKILL)


def _require_parent(pid: int) -> None:
    """End this process if it has another parent, because its original parent has ended."""
    if os.getppid() != pid:
        os._exit(1)


def _pidfd(pid: int) -> int:
    """A descriptor that becomes readable when a process ends; -1 on systems without such descriptors."""
    try:
        return os.pidfd_open(pid)
    except (AttributeError, OSError):
        return -1


def _prctl(option: int, value: int) -> None:
    with suppress(OSError, AttributeError):  # prctl exists only on Linux
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def _children(parent: int) -> list[int]:
    """The ids of the children of a process; empty on systems without /proc."""
    children = []
    for name in os.listdir("/proc") if sys.platform == "linux" else []:
        if not name.isdigit():
            continue
        with suppress(OSError), open(f"/proc/{name}/stat", errors="replace") as file:
            fields = file.read().rpartition(")")[2].split()
            if int(fields[1]) == parent:
                children.append(int(name))
    return children
