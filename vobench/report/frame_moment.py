"""The frames of a trial that are worth a look."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.runner.frames import FrameRow
from vobench.trajectory.nanoseconds import NS_PER_S

LEAST_GAP_FRAMES = 5  # between two moments
NO_ERROR = -1.0  # in place of the error of a frame without a pose: below every error


@dataclass(frozen=True, slots=True)
class FrameMoment:
    """A frame that is worth a look, its time since the first frame, and the reason."""

    frame: int
    t_s: float
    why: str


def worst_moments(frames: Sequence[FrameRow], errors_m: Array) -> list[FrameMoment]:
    """The frames where tracking was lost, where the error is largest, and where it grows most.

    `errors_m` (N,) are the position errors of the frames, infinite for no pose.
    """
    if not frames:
        return []
    known_m = np.where(np.isinf(errors_m), NO_ERROR, errors_m)
    is_lost = [index > 0 and row.status in ("lost", "") for index, row in enumerate(frames)]
    growth_m = np.diff(known_m, prepend=known_m[:1])
    criteria = (("lost", np.array(is_lost, float)), ("large error", known_m), ("jump", growth_m))

    moments = []
    chosen: list[int] = []
    for why, values in criteria:
        is_apart = _far_from(chosen, len(frames))
        index = int(np.argmax(np.where(is_apart, values, -np.inf)))
        if is_apart[index] and values[index] > 0:
            chosen.append(index)
            t_s = (frames[index].t_ns - frames[0].t_ns) / NS_PER_S
            moments.append(FrameMoment(frames[index].frame, round(t_s, 2), why))
    return moments


def _far_from(chosen: Sequence[int], count: int) -> Array:
    """Which of `count` frames are at least LEAST_GAP_FRAMES from those chosen (N,)."""
    is_apart = np.ones(count, bool)
    for index in chosen:
        is_apart &= np.abs(np.arange(count) - index) >= LEAST_GAP_FRAMES
    return is_apart
