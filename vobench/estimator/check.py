"""Whether an estimator's answer keeps the contract; what passes is in plain types that need no plugin to be read."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from vobench.errors import VobenchError
from vobench.estimator.protocol import Result, Status, Tracks
from vobench.geometry import se3
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
