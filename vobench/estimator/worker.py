"""The process that an estimator lives in: it is handed frames, and knows of nothing else.

Started by `EstimatorProcess` as `python -P -m vobench.estimator.worker FD FOLDER CLASS NAME MEMORY`.
Messages on the connection: ("start", rig, params, seed) or a Frame in; ("ready",), ("result", Result,
wall ms, CPU ms) or ("failed", kind, reason) out.
"""

import ctypes
import resource
import signal
import sys
import time
import traceback
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

from vobench.errors import VobenchError
from vobench.estimator.check import InvalidOutputError, checked
from vobench.estimator.load import load
from vobench.estimator.protocol import Estimator

PR_SET_PDEATHSIG = 1  # from linux/prctl.h


def main(fd: int, folder: Path, class_path: str, name: str, memory_bytes: int) -> None:
    """Serve frames until the other side hangs up."""
    _die_with_parent()
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    connection = Connection(fd)
    try:
        _serve(connection, load(folder, class_path, name=name))
    except (EOFError, BrokenPipeError):
        return
    except Exception as error:
        traceback.print_exc()
        connection.send(("failed", _kind(error), _in_one_line(error)))


def _serve(connection: Connection, estimator: Estimator) -> None:
    _, rig, params, seed = connection.recv()
    estimator.start(rig, params, seed)
    connection.send(("ready",))
    while True:
        frame = connection.recv()
        wall, cpu = time.perf_counter(), time.process_time()
        answer = estimator.process(frame)
        spent = (time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3
        connection.send(("result", checked(answer, frame.index), *spent))


def _die_with_parent() -> None:
    """Where Linux offers it: an estimator in an endless loop must not outlive a vobench that was killed."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _kind(error: Exception) -> str:
    # OpenCV reports a failed allocation as its own error -4.
    if isinstance(error, MemoryError) or "Insufficient memory" in str(error):
        return "out_of_memory"
    if isinstance(error, InvalidOutputError):
        return "invalid_output"
    return "refused" if isinstance(error, VobenchError) else "crashed"


def _in_one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if isinstance(error, VobenchError) else f"{type(error).__name__}: {text}"


if __name__ == "__main__":
    main(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4], int(sys.argv[5]))
