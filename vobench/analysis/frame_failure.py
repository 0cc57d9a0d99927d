"""Finds the frames in which an estimate fails, the worst part of a recording, and how far two trials fail alike."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.segment_loss import loss_of_motions
from vobench.geometry.se3 import Array
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory

Frames = NDArray[np.bool_]  # (N,), one for each frame

HALF_SPAN_S = 0.2  # the error of a frame is that of the motion from so long before it to so long after it
FAILING_FACTOR = 3.0  # a frame fails if its error is so many times that of a typical frame, ...
MIN_FAILING_LOSS = 0.02  # ... and at least this
MAX_FAILING_LOSS = 0.5


def frame_losses(gt: Trajectory, est: Trajectory, *, scale: float = 1.0) -> Array:
    """The error (N,) around each frame of the ground truth, 0 to 1, as `segment_loss` defines it.

    It is that of the motion from 0.2 s before the frame to 0.2 s after it, and at least from the frame before it to
    the one after it. `scale` multiplies the positions of the estimate.
    """
    frames = np.arange(len(gt))
    half_span_ns = round(HALF_SPAN_S * NS_PER_S)
    first = np.searchsorted(gt.t_ns, gt.t_ns - half_span_ns)
    last = np.searchsorted(gt.t_ns, gt.t_ns + half_span_ns, side="right") - 1
    first = np.minimum(first, frames - 1).clip(min=0)
    last = np.maximum(last, frames + 1).clip(max=len(gt) - 1)
    return loss_of_motions(gt, est, first, last, scale=scale)


def failing_loss(typical: float) -> float:
    """The error from which a frame fails, given that of a typical frame."""
    return float(np.clip(FAILING_FACTOR * typical, MIN_FAILING_LOSS, MAX_FAILING_LOSS))


@dataclass(frozen=True, slots=True)
class FrameRange:
    """A part of a recording: its frames from `first` to before `end`."""

    first: int
    end: int

    @property
    def frames(self) -> slice:
        """The indices of its frames."""
        return slice(self.first, self.end)

    def __len__(self) -> int:
        return self.end - self.first


def worst_window(t_ns: Stamps, loss: Array, duration_s: float) -> FrameRange:
    """The frames of the part of a duration with the largest mean error. `t_ns` and `loss` are (N,).

    Of parts with equal errors it is the middle one, so that large errors in the middle of small ones are centred.
    """
    ends = np.searchsorted(t_ns, t_ns + round(duration_s * NS_PER_S), side="right")
    is_whole = ends < len(t_ns)
    is_whole[0] = True  # of a shorter recording, all
    starts = np.flatnonzero(is_whole)
    sums = np.concatenate([[0.0], np.cumsum(loss)])
    totals = sums[ends[starts]] - sums[starts]
    durations_s = (t_ns[ends[starts] - 1] - t_ns[starts]) / NS_PER_S

    # Missing frames count as much as others, so errors are weighted by time.
    means = totals / (ends[starts] - starts) * durations_s
    best = np.flatnonzero(means >= 0.98 * means.max())
    middle = int(starts[best[len(best) // 2]])
    return FrameRange(middle, int(ends[middle]))


def overlap(frames: Frames, others: Frames) -> float:
    """The number of frames (N,) in both sets relative to those in either, 0 to 1; 0 if there are none."""
    in_either = int((frames | others).sum())
    return int((frames & others).sum()) / in_either if in_either else 0.0
