"""An estimator at arm's length: in a process of its own, under limits, its failures as data."""

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from vobench import stop
from vobench.estimator.protocol import Frame, Result
from vobench.geometry.rig import Rig

# One thread each: runs compare, and do not fight for cores.
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENCV_FOR_THREADS_NUM": "1",
    "PYTHONHASHSEED": "0",
}
LOG_BYTES = 1 << 20
ANSWER_BYTES = 64 << 20  # a pose, some numbers and tracks; more is no answer but noise on the connection
KEPT_ENVIRONMENT = ("PATH", "HOME", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "PYTHONPATH", "VIRTUAL_ENV")


class EstimatorFailure(Exception):  # noqa: N818 - a result, not a mistake of ours
    """The estimator gave up: `kind` is a run's status, `reason` one line."""

    def __init__(self, kind: str, reason: str) -> None:
        super().__init__(f"{kind}: {reason}")
        self.kind = kind
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Limits:
    """What an estimator may take: seconds to start and for each frame, bytes of its own data."""

    start_s: float = 60.0
    frame_s: float = 20.0
    memory_bytes: int = 4 << 30


@dataclass(frozen=True, slots=True)
class Answer:
    """A checked result and what it cost."""

    result: Result
    wall_ms: float
    cpu_ms: float


class EstimatorProcess:
    """A running estimator; what it prints goes to `log`. Its verbs raise EstimatorFailure."""

    def __init__(self, folder: Path, class_path: str, *, name: str, log: Path, limits: Limits) -> None:
        self._limits = limits
        self._connection, child = Pipe()
        self._home = Path(tempfile.mkdtemp(prefix="vobench-estimator-"))
        fd, memory = str(child.fileno()), str(limits.memory_bytes)
        self._log_path, self._log = log, log.open("wb")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "vobench.estimator.worker", fd, str(folder), class_path, name, memory],
            pass_fds=[child.fileno()],
            cwd=self._home,
            env={k: v for k, v in os.environ.items() if k in KEPT_ENVIRONMENT} | ONE_THREAD,
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        child.close()
        with ExitStack() as undone:
            undone.enter_context(stop.undone(lambda: stop.remove(self._home)))
            undone.enter_context(stop.undone(lambda: stop.kill_session(self._process), is_awaited=True))
            self._undone = undone.pop_all()

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Hand over the calibration and the parameters."""
        self._ask(("start", rig, dict(params), seed), self._limits.start_s)

    def process(self, frame: Frame) -> Answer:
        """Hand over the next frame; what the estimator says of it, checked."""
        _, result, wall_ms, cpu_ms = self._ask(frame, self._limits.frame_s)
        return Answer(result, wall_ms, cpu_ms)

    def _ask(self, message: Any, timeout_s: float) -> tuple[Any, ...]:
        stop.check()
        try:
            return self._answer(message, timeout_s)
        except EstimatorFailure:
            stop.check()  # which kills the process that we are waiting for
            raise

    def _answer(self, message: Any, timeout_s: float) -> tuple[Any, ...]:
        try:
            self._connection.send(message)
            answered = self._connection.poll(timeout_s)
            reply: tuple[Any, ...] = pickle.loads(self._connection.recv_bytes(ANSWER_BYTES)) if answered else ()
        except (EOFError, ConnectionError):
            raise EstimatorFailure(*self._death()) from None
        except Exception as error:  # bytes of somebody else's on our connection can be unpickled into anything
            raise EstimatorFailure("crashed", f"its answer cannot be read ({error})") from None
        if not answered:
            raise EstimatorFailure("timeout", f"no answer within {timeout_s:g} s")
        if reply[0] == "failed":
            raise EstimatorFailure(reply[1], reply[2])
        return reply

    def _death(self) -> tuple[str, str]:
        try:
            code = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return "crashed", "it closed its connection and lives on"
        if code == -signal.SIGKILL:
            return "out_of_memory", "killed by the system, most likely for memory"
        by = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return "crashed", f"the process ended with {by}"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=0.5 if kind is None else 0)
        # The whole session goes: an estimator may have started processes of its own.
        stop.kill_session(self._process)
        self._process.wait()
        self._log.close()
        _cut(self._log_path)
        self._undone.close()


def _cut(log: Path) -> None:
    """Keep the beginning of a log that an estimator has filled without end."""
    size = log.stat().st_size
    if size > LOG_BYTES:
        os.truncate(log, LOG_BYTES)
        with log.open("a", encoding="utf-8") as file:
            file.write(f"\n[vobench: cut here; the estimator printed {size} bytes]\n")
