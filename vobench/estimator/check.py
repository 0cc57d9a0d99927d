"""Checks the answers of an estimator before anything else uses them."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from vobench.errors import VobenchError, printable
from vobench.estimator.protocol import Result, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.se3 import Array

LEAST_VARIANCE = 1e-24  # of covariances; their inverse and their product with errors stay finite
MOST_VARIANCE = 1e24
FARTHEST_M = 1e12  # farther than any path, and small enough for finite sums of squares
REASON_LETTERS = 500
NAME_LETTERS = 80
REAL_KINDS = "fiub"  # NumPy's kinds float, signed integer, unsigned integer and bool


class InvalidOutputError(VobenchError):
    """An answer of an estimator violates the contract."""


def in_one_line(text: object, limit: int = REASON_LETTERS) -> str:
    """A text of unknown origin as one printable line, without control characters, and cut to `limit` characters."""
    beginning = str(text)[: 4 * limit]
    words = printable(beginning).split()
    return " ".join(words)[:limit]


def checked(answer: Any, frame: int) -> Result:
    """The answer as a Result with plain types. Raises InvalidOutputError with the number of the frame."""
    if not isinstance(answer, Result):
        raise InvalidOutputError(
            f"frame {frame}: process() must return a vobench.estimator.Result, got {type(answer).__name__}"
        )
    needs_pose = answer.status not in (Status.LOST, Status.INIT)
    if answer.T_odom_frame is None and needs_pose:
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
    """A float64 array. Raises InvalidOutputError unless the value is an array of real numbers."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InvalidOutputError(f"{what} should be an array ({error})") from None
    if array.dtype.kind not in REAL_KINDS:
        raise InvalidOutputError(f"{what} should be an array of real numbers, got {array.dtype}")
    return array.astype(np.float64)


def _pose(T_odom_frame: Any) -> Array:
    T = _array(T_odom_frame, "the pose")
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise InvalidOutputError(f"the pose should be a finite (4, 4) array, got shape {T.shape}")
    if np.abs(T[:3, 3]).max() > FARTHEST_M:
        raise InvalidOutputError(f"the pose is farther than {FARTHEST_M:g} m away")
    has_last_row = np.array_equal(T[3], [0, 0, 0, 1])
    if not se3.is_rotation(T[:3, :3]) or not has_last_row:
        raise InvalidOutputError("the pose is not a rigid transform (R'R differs from I, or the last row from 0 0 0 1)")
    return T


def _covariance(covariance: Any) -> Array:
    P = _array(covariance, "the covariance")
    if P.shape != (6, 6) or not np.isfinite(P).all():
        raise InvalidOutputError(f"the covariance should be a finite (6, 6) array, got shape {P.shape}")
    rounding = 1e-9 * np.abs(P).max()
    is_symmetric = np.allclose(P, P.T, rtol=1e-6, atol=rounding)
    least_variance = np.linalg.eigvalsh(P)[0]
    if not is_symmetric or least_variance <= 0:
        raise InvalidOutputError("the covariance is not symmetric and positive definite")
    if least_variance < LEAST_VARIANCE or np.abs(P).max() > MOST_VARIANCE:
        raise InvalidOutputError(f"the covariance has a variance below {LEAST_VARIANCE:g} or above {MOST_VARIANCE:g}")
    return P


def _points(points: Any) -> Array:
    X = _array(points, "points")
    if X.ndim != 2 or X.shape[1] != 3:
        raise InvalidOutputError(f"points should be (N, 3), got {X.shape}")
    return X


def checked_revision(revised: Any) -> dict[int, Array]:
    """The revised poses that `finish` returned, by the index of their frame. Raises InvalidOutputError."""
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
    uv_last_px = _array(tracks.uv_last_px, "uv_last_px")
    uv_px = _array(tracks.uv_px, "uv_px")
    inlier = _array(tracks.inlier, "inlier").astype(bool)
    pixels_shape = (len(inlier), 2) if inlier.ndim == 1 else None
    if uv_last_px.shape != pixels_shape or uv_px.shape != pixels_shape:
        shapes = f"{uv_last_px.shape}, {uv_px.shape} and {inlier.shape}"
        raise InvalidOutputError(f"tracks should be (N, 2), (N, 2) and (N,), got {shapes}")
    return Tracks(uv_last_px, uv_px, inlier)


def _stats(stats: Any) -> dict[str, float]:
    """The finite statistics by name. Raises InvalidOutputError if one is not a number."""
    if not isinstance(stats, Mapping):
        raise InvalidOutputError(f"stats should be numbers by name, got {type(stats).__name__}")
    try:
        numbers = {in_one_line(name, NAME_LETTERS): float(value) for name, value in stats.items()}
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidOutputError(f"stats should be numbers by name ({error})") from None
    return {name: number for name, number in numbers.items() if isfinite(number)}
