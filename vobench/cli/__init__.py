"""The command line: a command parses, calls one function and prints."""

import atexit
import os
import select
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from vobench import stop

SIGNALS = (signal.SIGINT, signal.SIGTERM)
SENTENCE = "stopped; finished stages are kept, the same command goes on from there"
GRACE_S = 0.8  # hardly a frame takes as long, but an import may
# what a progress bar leaves behind
CLEAR_LINE = "\r\033[K"
SHOW_CURSOR = "\033[?25h"


def main() -> None:
    """The entry point of the `vobench` command."""
    # Names that a plugin of an earlier release imports and that have moved (`vobench/retired.py`).
    warnings.filterwarnings("default", message=r"vobench\.", category=DeprecationWarning)
    try:
        with _stoppable():
            from vobench.cli.app import run

            run()
    except KeyboardInterrupt:  # before we listen to it
        raise SystemExit(128 + signal.SIGINT) from None


@contextmanager
def _stoppable() -> Iterator[None]:
    """A block that Ctrl-C or SIGTERM ends: with one sentence, and 128 and the signal's number as exit code.

    The first signal is a request, which the block heeds where it looks at it. Where it has not after GRACE_S, or at
    a second signal, a thread that watches ends the process, whatever it is in the middle of.
    """
    stop.forget()
    heard, hears = os.pipe()
    os.set_blocking(hears, False)
    watch = threading.Thread(target=_watch, args=(heard,), name="stop", daemon=True)
    watch.start()
    before = signal.set_wakeup_fd(hears, warn_on_full_buffer=False)
    for number in SIGNALS:
        signal.signal(number, lambda number, _: stop.request(number))
    try:
        yield
    finally:
        for number in SIGNALS:  # from here on there is nothing to tidy up
            signal.signal(number, lambda number, _: os._exit(128 + number))
        signal.set_wakeup_fd(before)
        os.close(hears)
        watch.join()
        os.close(heard)
        _end_softly()


def _end_softly() -> None:
    """After a block that has heeded a request, or ended before it could."""
    if not stop.requested():
        return
    if "--debug" in sys.argv:
        import traceback

        traceback.print_exc()
    for stream, text in zip((sys.stdout, sys.stderr), _last_words(), strict=True):
        print(text, end="", file=stream, flush=True)
    code = 128 + stop.requested()
    stop.forget()
    atexit.register(os._exit, code)  # the last to come is called first: libraries take a second or two to go
    raise SystemExit(code) from None


def _watch(heard: int) -> None:
    """Read the numbers of signals, which come down a pipe even while the main thread is in the middle of something."""
    first = _next(heard)
    if not first:
        return
    more, _, _ = select.select([heard], [], [], GRACE_S)
    if not more or _next(heard):
        _end_here(first)


def _next(heard: int) -> int:
    """The next of our signals, 0 when the pipe is closed, as the block has ended."""
    while byte := os.read(heard, 1):
        if byte[0] in SIGNALS:
            return byte[0]
    return 0


def _end_here(number: int) -> None:
    """Tidy up and end the process, whatever its main thread does."""
    stop.undo_all()
    out, err = _last_words()
    for fd, text in ((2, f"{CLEAR_LINE}{SHOW_CURSOR}{err}" if os.isatty(2) else err), (1, out)):
        # Not by print: the main thread may hold its lock, or wait for somebody to read.
        if text and select.select([], [fd], [], 0)[1]:
            os.write(fd, text.encode())
    os._exit(128 + number)


def _last_words() -> tuple[str, str]:
    """What a stopped command says on standard output and standard error."""
    return f'{{"error": "{SENTENCE}"}}\n' if "--json" in sys.argv else "", f"vobench: {SENTENCE}\n"
