"""An estimator in Python in a process of its own; its answers checked, its failures as data."""

import pickle
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from multiprocessing import Pipe
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from vobench import stop
from vobench.errors import VobenchError
from vobench.estimator.manifest import Limits
from vobench.estimator.program import EstimatorFailure, Program
from vobench.estimator.protocol import Frame, Result, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

# Beyond any path, and small enough for sums of squares to stay finite.
FARTHEST_M = 1e12


class InvalidOutputError(VobenchError):
    """An estimator's answer is not what the contract says."""


def checked(answer: Any, frame: int) -> Result:
    """The answer as a Result of plain types. Raises InvalidOutputError, naming the frame."""
    if not isinstance(answer, Result):
        raise InvalidOutputError(
            f"frame {frame}: process() must return a vobench.estimator.Result, got {type(answer).__name__}"
        )
    if answer.T_odom_frame is None and answer.status not in (Status.LOST, Status.INIT):
        raise InvalidOutputError(f"frame {frame}: status '{answer.status}' needs a pose; without one say lost or init")
    try:
        return Result(
            T_odom_frame=None if answer.T_odom_frame is None else _pose(answer.T_odom_frame),
            status=_status(answer.status),
            reason=" ".join(str(answer.reason).split()),
            tracks=None if answer.tracks is None else _tracks(answer.tracks),
            stats=_stats(answer.stats),
            covariance=None if answer.covariance is None else _covariance(answer.covariance),
            points=None if answer.points is None else _points(answer.points),
        )
    except InvalidOutputError as error:
        raise InvalidOutputError(f"frame {frame}: {error}") from None


def _array(value: Any, what: str) -> Array:
    """A float64 array. Raises InvalidOutputError where the value is none of real numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise InvalidOutputError(f"{what} should be an array of real numbers, got {array.dtype}")
    return array.astype(np.float64)


def _pose(T_odom_frame: Any) -> Array:
    T = _array(T_odom_frame, "the pose")
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise InvalidOutputError(f"the pose is no finite (4, 4) array (shape {T.shape})")
    if np.abs(T[:3, 3]).max() > FARTHEST_M:
        raise InvalidOutputError(f"the pose is farther than {FARTHEST_M:g} m away")
    if not se3.is_rotation(T[:3, :3]) or not np.array_equal(T[3], [0, 0, 0, 1]):
        raise InvalidOutputError("the pose is no rigid transform (R'R differs from I, or the last row from 0 0 0 1)")
    return T


def _covariance(covariance: Any) -> Array:
    P = _array(covariance, "the covariance")
    if P.shape != (6, 6) or not np.isfinite(P).all():
        raise InvalidOutputError(f"the covariance is no finite (6, 6) array (shape {P.shape})")
    if not np.allclose(P, P.T, rtol=1e-6, atol=1e-9 * np.abs(P).max()) or np.linalg.eigvalsh(P)[0] <= 0:
        raise InvalidOutputError("the covariance is not symmetric and positive definite")
    return P


def _points(points: Any) -> Array:
    X = _array(points, "points")
    if X.ndim != 2 or X.shape[1] != 3:
        raise InvalidOutputError(f"points should be (N, 3), got {X.shape}")
    return X


def checked_revision(revised: Any) -> dict[int, Array]:
    """Poses by their frame's index, as `finish` gives them. Raises InvalidOutputError."""
    if not isinstance(revised, Mapping):
        raise InvalidOutputError(f"finish() must return poses by their frame's index, got {type(revised).__name__}")
    try:
        return {int(frame): _pose(T) for frame, T in revised.items()}
    except (InvalidOutputError, TypeError, ValueError) as error:
        raise InvalidOutputError(f"finish(): {error}") from None


def _status(status: Any) -> Status:
    try:
        return Status(status)
    except ValueError:
        raise InvalidOutputError(f"no status {status!r}. Known: {', '.join(Status)}") from None


def _tracks(tracks: Any) -> Tracks:
    if not isinstance(tracks, Tracks):
        raise InvalidOutputError(f"tracks must be a vobench.estimator.Tracks, got {type(tracks).__name__}")
    last, now = _array(tracks.uv_last_px, "uv_last_px"), _array(tracks.uv_px, "uv_px")
    inlier = _array(tracks.inlier, "inlier").astype(bool)
    if not (last.shape == now.shape == (len(inlier), 2) and inlier.ndim == 1):
        shapes = f"{last.shape}, {now.shape} and {inlier.shape}"
        raise InvalidOutputError(f"tracks should be (N, 2), (N, 2) and (N,), got {shapes}")
    return Tracks(last, now, inlier)


def _stats(stats: Any) -> dict[str, float]:
    """Numbers by name; one that is not finite says nothing and is left out."""
    if not isinstance(stats, Mapping):
        raise InvalidOutputError(f"stats should be numbers by name, got {type(stats).__name__}")
    try:
        numbers = {str(name): float(value) for name, value in stats.items()}
    except (TypeError, ValueError) as error:
        raise InvalidOutputError(f"stats should be numbers by name ({error})") from None
    return {name: number for name, number in numbers.items() if isfinite(number)}


ANSWER_BYTES = 64 << 20  # a pose, some numbers and tracks; more is no answer but noise on the connection


@dataclass(frozen=True, slots=True)
class Answer:
    """A checked result and what it cost; memory is the most that it held so far."""

    result: Result
    wall_ms: float
    cpu_ms: float
    memory_mib: float = 0.0


class EstimatorProcess:
    """A running estimator; what it prints goes to `log`. Its verbs raise EstimatorFailure."""

    def __init__(self, folder: Path, class_path: str, *, name: str, log: Path, limits: Limits) -> None:
        self._limits = limits
        self._connection, child = Pipe()
        fd, memory = str(child.fileno()), str(limits.memory_mib << 20)
        argv = [sys.executable, "-P", "-m", "vobench.estimator.worker", fd, str(folder), class_path, name, memory]
        self._program = Program(argv, log=log, limits=limits, pass_fds=[child.fileno()])
        child.close()

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int, *, is_watched: bool = False) -> None:
        """Hand over the calibration and the parameters; who `is_watched` fails where it changes a frame."""
        self._ask(("start", rig, dict(params), seed, is_watched), self._limits.start_s)

    def process(self, frame: Frame) -> Answer:
        """Hand over the next frame; what the estimator says of it, checked."""
        _, result, wall_ms, cpu_ms = self._ask(frame, self._limits.frame_s)
        return Answer(result, wall_ms, cpu_ms, self._program.peak_mib)

    def finish(self) -> dict[int, Array]:
        """Say that there are no more frames; the poses that the estimator revises, by their frame's index."""
        _, revised = self._ask(("finish",), self._limits.trial_s)
        return dict(revised)

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
            answered = self._connection.poll(max(min(timeout_s, self._program.left_s()), 0))
            reply: tuple[Any, ...] = pickle.loads(self._connection.recv_bytes(ANSWER_BYTES)) if answered else ()
        except (EOFError, ConnectionError):
            raise EstimatorFailure(*self._program.death()) from None
        except Exception as error:  # bytes of somebody else's on our connection can be unpickled into anything
            raise EstimatorFailure("crashed", f"its answer cannot be read ({error})") from None
        self._program.look()
        if not answered:
            raise EstimatorFailure("timeout", f"no answer within {timeout_s:g} s")
        if reply[0] == "failed":
            raise EstimatorFailure(reply[1], reply[2])
        return reply

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()
        self._program.__exit__(kind, error, trace)
