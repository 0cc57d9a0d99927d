"""How much of the ground truth an estimate covers: without it no error can be ranked."""

from dataclasses import dataclass

import numpy as np

from vobench.trajectory.associate import Index
from vobench.trajectory.trajectory import Stamps


@dataclass(frozen=True, slots=True)
class Coverage:
    """Share of ground-truth frames that have an estimate, and the gaps, runs of frames that don't.

    A gap's time runs from the last covered frame before it to the first after it (or to the end).
    """

    ratio: float
    gaps: int
    longest_gap_frames: int
    longest_gap_s: float
    first_lost_frame: int | None


def coverage(gt_t_ns: Stamps, frames: Index) -> Coverage:
    """Coverage of ground truth stamped gt_t_ns (N,), N > 0, by estimates of `frames` (K,), increasing."""
    n = len(gt_t_ns)
    around = np.concatenate([[-1], frames, [n]])
    lost = np.diff(around) - 1
    edges_ns = gt_t_ns[np.clip(around, 0, n - 1)]
    longest = int(np.argmax(lost))
    first = int(np.argmax(lost > 0))
    return Coverage(
        ratio=len(frames) / n,
        gaps=int(np.count_nonzero(lost)),
        longest_gap_frames=int(lost[longest]),
        longest_gap_s=float(edges_ns[longest + 1] - edges_ns[longest]) / 1e9 if lost[longest] else 0.0,
        first_lost_frame=int(around[first]) + 1 if lost[first] else None,
    )
