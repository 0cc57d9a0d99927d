"""The command line: each command parses its arguments, calls one function and prints the result."""

import atexit
import faulthandler
import os
import select
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from vobench import stop

STDOUT = 1
STDERR = 2
SIGNALS = (signal.SIGINT, signal.SIGTERM)
SENTENCE = "stopped; completed stages are cached, run the same command again to resume"
GRACE_S = 0.8  # longer than most frames take, but an import may take longer

# Control sequences that clear what a progress bar leaves behind.
CLEAR_LINE = "\r\033[K"
SHOW_CURSOR = "\033[?25h"


def main() -> None:
    """The entry point of the `vobench` command."""
    # Shown for names that have moved since the release a plugin was written for (`vobench/retired.py`).
    warnings.filterwarnings("default", message=r"vobench\.", category=DeprecationWarning)
    if not faulthandler.is_enabled():
        faulthandler.enable(STDERR)  # if a native library ends the process, the stack says where
    try:
        with _stoppable():
            from vobench.cli.app import run

            run()
    except KeyboardInterrupt:  # before the handler of signals is in place
        raise SystemExit(128 + signal.SIGINT) from None


@contextmanager
def _stoppable() -> Iterator[None]:
    """A block that Ctrl-C or SIGTERM ends, with one sentence and the exit code 128 plus the signal's number.

    The first signal is a request, which the block checks from time to time. If the block has not ended after GRACE_S,
    or at a second signal, a watching thread ends the process, whatever it is doing.
    """
    stop.withdraw_requests()
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    watcher = threading.Thread(target=_watch, args=(read_end,), name="stop", daemon=True)
    watcher.start()
    previous_fd = signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    for number in SIGNALS:
        signal.signal(number, lambda number, _: stop.request(number))
    try:
        yield
    finally:
        for number in SIGNALS:  # from here on there is nothing to clean up
            signal.signal(number, lambda number, _: os._exit(128 + number))
        signal.set_wakeup_fd(previous_fd)
        os.close(write_end)
        watcher.join()
        os.close(read_end)
        _exit_if_stopped()


def _exit_if_stopped() -> None:
    """Exit after a block that a request to stop has ended, or that ended before it noticed the request."""
    if not stop.requested():
        return
    if "--debug" in sys.argv:
        import traceback

        traceback.print_exc()
    print(_stopped_json(), end="", flush=True)
    print(_stopped_line(), end="", file=sys.stderr, flush=True)
    code = 128 + stop.requested()
    stop.withdraw_requests()
    # Called before all other exit functions, because libraries take a second or two to unload.
    atexit.register(os._exit, code)
    raise SystemExit(code) from None


def _watch(read_end: int) -> None:
    """Read the numbers of signals from a pipe, which works even while the main thread is busy."""
    first_signal = _next_signal(read_end)
    if not first_signal:
        return
    readable, _, _ = select.select([read_end], [], [], GRACE_S)
    is_grace_over = not readable
    if is_grace_over or _next_signal(read_end):
        _end_process(first_signal)


def _next_signal(read_end: int) -> int:
    """The next of SIGNALS; 0 when the pipe is closed because the block has ended."""
    while byte := os.read(read_end, 1):
        if byte[0] in SIGNALS:
            return byte[0]
    return 0


def _end_process(number: int) -> None:
    """Clean up and end the process, whatever its main thread is doing."""
    stop.clean_up_all()
    line = _stopped_line()
    if os.isatty(STDERR):
        line = f"{CLEAR_LINE}{SHOW_CURSOR}{line}"
    _write_if_ready(STDERR, line)
    _write_if_ready(STDOUT, _stopped_json())
    os._exit(128 + number)


def _write_if_ready(fd: int, text: str) -> None:
    """Write to a file descriptor unless nobody reads it. `print` could wait for a lock of the main thread."""
    _, writable, _ = select.select([], [fd], [], 0)
    if text and writable:
        os.write(fd, text.encode())


def _stopped_line() -> str:
    """What a stopped command prints to standard error."""
    return f"vobench: {SENTENCE}\n"


def _stopped_json() -> str:
    """What a stopped command prints to standard output."""
    return f'{{"error": "{SENTENCE}"}}\n' if "--json" in sys.argv else ""
