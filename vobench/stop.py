"""The request to stop, by Ctrl-C or SIGTERM: a flag that every frame and stage looks at, and what a stop tidies up.

Nothing is raised where a signal arrives: amid an import, a library would swallow it. `check` raises, in our own loops.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from subprocess import CompletedProcess, Popen

PR_SET_PDEATHSIG = 1  # linux/prctl.h

Undo = tuple[Callable[[], object], bool]  # what is called, and whether it ends something that we may be waiting for

_requests: list[int] = []
_undos: list[Undo] = []


class Stopped(BaseException):
    """Raised by `check`; no Exception, so that nobody takes it for a failure of his own."""


def request(number: int) -> None:
    """Ask this process to stop, by the number of a signal; what it may be waiting for ends at once."""
    _requests.append(number)
    _call(undo for undo in _undos.copy() if undo[1])


def requested() -> int:
    """The signal that asked first, 0 where none has."""
    return _requests[0] if _requests else 0


def check() -> None:
    """Raise Stopped where a stop is requested."""
    if _requests:
        raise Stopped


def forget() -> None:
    """Take all requests back."""
    _requests.clear()


def undo_all() -> None:
    """Tidy up for a process that ends here and now, from whichever thread: first what runs, then what lies about."""
    latest_first = _undos[::-1]
    _call([undo for undo in latest_first if undo[1]])
    _call(latest_first)


def _call(undos: Iterable[Undo]) -> None:
    for call, _ in undos:
        with suppress(Exception):
            call()


@contextmanager
def undone(call: Callable[[], object], *, is_awaited: bool = False) -> Iterator[None]:
    """Call something after the block, however it ends: even with the process. Raises Stopped as `check` does.

    What `is_awaited`, say another process, is also undone as soon as a stop is requested.
    """
    undo = call, is_awaited
    _undos.append(undo)
    try:
        check()
        yield
    finally:
        call()
        _undos.remove(undo)


def remove(folder: Path) -> None:
    """Delete a folder, where it is still of that name.

    It is renamed first: whoever goes on filling it cannot then publish what is left of it.
    """
    import shutil

    with suppress(OSError):
        gone = folder.rename(folder.with_name(f"{folder.name}-gone"))
        shutil.rmtree(gone, ignore_errors=True)


def kill_session(process: "Popen[str] | Popen[bytes]") -> None:
    """Kill a process that was started in a session of its own, and all that it has started there."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _dying_with_us() -> Callable[[], object]:
    """What a new process calls, on Linux, to be killed when the thread that started it ends, and so when we do."""
    if sys.platform != "linux":
        return lambda: None
    import ctypes

    prctl = ctypes.CDLL(None).prctl
    us = os.getpid()

    def die_with_us() -> None:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != us:  # we were faster
            os._exit(1)

    return die_with_us


def run(
    command: list[str], *, env: Mapping[str, str] | None = None, timeout_s: float | None = None
) -> "CompletedProcess[str]":
    """Run a command, hidden from the terminal and its Ctrl-C, and take what it says; on Linux it ends with us.

    Raises Stopped where we are, and TimeoutExpired.
    """
    from subprocess import DEVNULL, PIPE, CompletedProcess, Popen

    with (
        Popen(
            command,
            env=env,
            text=True,
            stdin=DEVNULL,
            stdout=PIPE,
            stderr=PIPE,
            start_new_session=True,
            preexec_fn=_dying_with_us(),  # noqa: PLW1509 - one system call, whose library is loaded before the fork
        ) as process,
        undone(lambda: kill_session(process), is_awaited=True),
    ):
        out, err = process.communicate(timeout=timeout_s)
    check()
    return CompletedProcess(command, process.returncode, out, err)
