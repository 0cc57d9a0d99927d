"""Requests to stop, by Ctrl-C or SIGTERM: a flag that every frame and stage checks, and what is cleaned up.

A signal does not raise an exception where it arrives, because a library could suppress it in the middle of an import.
Instead `check` raises, in vobench's own loops.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from subprocess import CompletedProcess, Popen

PR_SET_PDEATHSIG = 1  # linux/prctl.h


@dataclass(frozen=True, slots=True, eq=False)
class _Cleanup:
    """A function that cleans up, and whether it ends something that this process may be waiting for."""

    call: Callable[[], object]
    is_awaited: bool


_requests: list[int] = []  # numbers of signals
_cleanups: list[_Cleanup] = []


class Stopped(BaseException):
    """Raised by `check`; not an Exception, so that no caller handles it as a failure."""


def request(number: int) -> None:
    """Ask this process to stop, with the number of a signal. Whatever it may be waiting for ends at once."""
    _requests.append(number)
    _call([cleanup for cleanup in _cleanups.copy() if cleanup.is_awaited])


def requested() -> int:
    """The number of the first signal that requested a stop; 0 if there is none."""
    return _requests[0] if _requests else 0


def check() -> None:
    """Raise Stopped if a stop is requested."""
    if _requests:
        raise Stopped


def withdraw_requests() -> None:
    """Withdraw all requests."""
    _requests.clear()


def clean_up_all() -> None:
    """Clean up from any thread for a process that ends now: first end what is running, then remove what is left."""
    latest_first = _cleanups[::-1]
    _call([cleanup for cleanup in latest_first if cleanup.is_awaited])
    _call(latest_first)


def _call(cleanups: Iterable[_Cleanup]) -> None:
    for cleanup in cleanups:
        with suppress(Exception):
            cleanup.call()


@contextmanager
def cleanup_after(call: Callable[[], object], *, is_awaited: bool = False) -> Iterator[None]:
    """Call a function after the block, however it ends, even if the process ends. Raises Stopped as `check` does.

    If it ends something `is_awaited`, such as another process, it is also called as soon as a stop is requested.
    """
    cleanup = _Cleanup(call, is_awaited)
    _cleanups.append(cleanup)
    try:
        check()
        yield
    finally:
        call()
        _cleanups.remove(cleanup)


def remove(folder: Path) -> None:
    """Delete a folder, if it still exists.

    It is renamed first, so that a process that still writes to it cannot publish an incomplete folder.
    """
    import shutil

    with suppress(OSError):
        renamed = folder.rename(folder.with_name(f"{folder.name}-gone"))
        shutil.rmtree(renamed, ignore_errors=True)


def kill_session(process: "Popen[str] | Popen[bytes]") -> None:
    """Kill a process that was started in its own session, and all processes that it has started there."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _die_with_parent() -> Callable[[], object]:
    """A function for a new process, which on Linux is then killed when the thread that started it ends."""
    if sys.platform != "linux":
        return lambda: None
    import ctypes

    prctl = ctypes.CDLL(None).prctl
    parent_pid = os.getpid()

    def request_death_signal() -> None:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        has_parent_ended = os.getppid() != parent_pid
        if has_parent_ended:
            os._exit(1)

    return request_death_signal


def run(
    command: list[str], *, env: Mapping[str, str] | None = None, timeout_s: float | None = None
) -> "CompletedProcess[str]":
    """Run a command without access to the terminal and its Ctrl-C, and capture its output.

    On Linux it ends with this process. Raises Stopped if this process is asked to stop, and TimeoutExpired.
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
            preexec_fn=_die_with_parent(),  # noqa: PLW1509 - one system call, whose library is loaded before the fork
        ) as process,
        cleanup_after(lambda: kill_session(process), is_awaited=True),
    ):
        out, err = process.communicate(timeout=timeout_s)
    check()
    return CompletedProcess(command, process.returncode, out, err)
