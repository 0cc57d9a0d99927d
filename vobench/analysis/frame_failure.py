"""Finds the frames in which an estimate fails, the worst part of a recording, and how far two errors coincide."""

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

LOW_ERROR = 0.5  # of the mean error of a part: a smaller error is low
MIN_LOW_SHARE = 0.2  # of the time of a part, in which the error is low

NEGLIGIBLE_LOSS = 0.005  # of the path: a smaller error counts as this when errors are divided
ROUNDING = 1e-9  # of an overlap


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

    A failure that is longer than the part is shown with its beginning or its end: only parts count in which the error
    is low for a fifth of the time, if there are any. Errors that are large throughout could not be compared in time.
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
    has_low_errors = np.zeros(len(starts), bool)
    for index, (start, end) in enumerate(zip(starts.tolist(), ends[starts].tolist(), strict=True)):
        has_low_errors[index] = _has_low_errors(t_ns[start:end], loss[start:end])
    if has_low_errors.any():
        means = np.where(has_low_errors, means, 0.0)
    best = np.flatnonzero(means >= 0.98 * means.max())
    middle = int(starts[best[len(best) // 2]])
    return FrameRange(middle, int(ends[middle]))


def _has_low_errors(t_ns: Stamps, loss: Array) -> bool:
    """Whether the error (F,) at `t_ns` (F,) is low for some of the time."""
    if len(loss) < 2:
        return False
    weights = np.gradient(t_ns.astype(float))
    mean = float(np.average(loss, weights=weights))
    low_share = float(np.average(loss < LOW_ERROR * mean, weights=weights))
    return low_share >= MIN_LOW_SHARE


@dataclass(frozen=True, slots=True)
class Coincidence:
    """How far two errors occur at the same times, and how far they would by chance.

    `overlap` is 0 for errors at different times and 1 for proportional ones; see `coincidence`. Chance is all rotations
    of one error in time: `by_chance` is the mean overlap, and `p` the share of rotations, with that by 0, whose overlap
    is as large.
    """

    overlap: float
    by_chance: float
    p: float


def coincidence(errors: Array, others: Array) -> Coincidence:
    """How far two errors (K,) at the same regular times occur together, whatever their sizes.

    A threshold for errors would depend on the level of each side, and a sum of shared errors on a few large ones. So
    each error becomes a unit vector of the roots of its shares in time. The product b of the two is the Bhattacharyya
    coefficient of the shares, and the overlap is the Tanimoto coefficient b / (2 - b) of the vectors: for errors that
    are constant in equal numbers of frames, it is the number of frames in both relative to those in either. It is 0 if
    one of the errors is 0 throughout.

    Source: Bhattacharyya (1943), "On a measure of divergence between two statistical populations"; Harris (2020), "A
    shift test for independence in generic time series", for the rotations.
    """
    if not errors.any() or not others.any():
        return Coincidence(0.0, 0.0, 1.0)
    root_shares = np.sqrt(errors / errors.sum())
    other_root_shares = np.sqrt(others / others.sum())
    overlaps = []
    for shift in range(len(root_shares)):
        product = root_shares @ np.roll(other_root_shares, shift)
        overlaps.append(product / (2 - product))
    is_as_large = np.array(overlaps) >= overlaps[0] - ROUNDING
    return Coincidence(float(overlaps[0]), float(np.mean(overlaps)), float(is_as_large.mean()))


def twin_coincidence(recorded: Array, changed: Array, unchanged: Array, *, typical: float) -> Coincidence:
    """How far the errors of a recording are raised at the times at which changes raise those of its twin.

    All errors are (K,). `recorded` is that of the recording, of which `typical` is usual elsewhere. `changed` and
    `unchanged` are those of the twin with and without the changes. What is compared is the logarithm of the factor by
    which each side exceeds its usual error, so that a few frames with the whole error do not outweigh many with three
    times the usual one. The twin has the same path: an error that it has without any change is usual in the recording,
    too.
    """
    usual = np.maximum(unchanged, typical)
    return coincidence(_raised_by(recorded, usual), _raised_by(changed, unchanged))


def _raised_by(loss: Array, usual: Array) -> Array:
    """The logarithm (K,) of the factor by which errors (K,) exceed usual ones (K,); 0 where they do not."""
    factor = np.maximum(loss, NEGLIGIBLE_LOSS) / np.maximum(usual, NEGLIGIBLE_LOSS)
    logarithm: Array = np.log(factor).clip(min=0.0)
    return logarithm
