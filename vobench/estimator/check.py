"""The contract's word on an answer: what is checked before anything is kept of it."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from vobench.errors import VobenchError, printable
from vobench.estimator.protocol import Result, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.se3 import Array

# Beyond any path, and small enough for sums of squares to stay finite.
FARTHEST_M = 1e12
REASON_LETTERS = 500
NAME_LETTERS = 80


class InvalidOutputError(VobenchError):
    """An estimator's answer is not what the contract says."""


def in_one_line(said: object, most: int = REASON_LETTERS) -> str:
    """A text of somebody else's as it may be printed: without control characters or lone surrogates, cut at `most`."""
    return " ".join(printable(str(said)[: 4 * most]).split())[:most]


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
            reason=in_one_line(answer.reason),
            tracks=None if answer.tracks is None else _tracks(answer.tracks),
            stats=_stats(answer.stats),
            covariance=None if answer.covariance is None else _covariance(answer.covariance),
            points=None if answer.points is None else _points(answer.points),
        )
    except InvalidOutputError as error:
        raise InvalidOutputError(f"frame {frame}: {error}") from None


def _array(value: Any, what: str) -> Array:
    """A float64 array. Raises InvalidOutputError where the value is none of real numbers."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InvalidOutputError(f"{what} should be an array ({error})") from None
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
        raise InvalidOutputError(
            f"no status {in_one_line(repr(status), NAME_LETTERS)}. Known: {', '.join(Status)}"
        ) from None


def _tracks(tracks: Any) -> Tracks:
    if not isinstance(tracks, Tracks):
        raise InvalidOutputError(f"tracks must be a vobench.estimator.Tracks, got {type(tracks).__name__}")
    last = _array(tracks.uv_last_px, "uv_last_px")
    now = _array(tracks.uv_px, "uv_px")
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
        numbers = {in_one_line(name, NAME_LETTERS): float(value) for name, value in stats.items()}
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidOutputError(f"stats should be numbers by name ({error})") from None
    return {name: number for name, number in numbers.items() if isfinite(number)}
