"""Coverage of the ground truth by an estimate, failures, and the lost-aware score."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.comparison import OURS, POSES, MetricDefinition
from vobench.metric.settings import CoverageOf
from vobench.trajectory.associate import Index
from vobench.trajectory.trajectory import Stamps

FRAME_NS = 30_000_000  # truth with shorter steps is from motion capture, and its poses are not frames
SLOT_NS = 200_000_000  # of such truth; a camera at 10 Hz leaves no slot empty, whatever its jitter
END_NS = 100_000_000  # a camera at 10 Hz takes its last image this long before the end


@dataclass(frozen=True, slots=True)
class Coverage:
    """Share of the recording with an estimate, and its gaps, the stretches without one.

    `of` is what was counted: frames, which are the true poses, or time in slots of 0.2 s. A gap lasts from the last
    pose before it to the first after it, or to the end of the truth; `longest_gap_frames` counts the true poses in it.
    A track is a stretch without gaps; every track after the first is a relocalisation. `ends_lost` means that the last
    slot has no pose, or, if time is counted, the last 0.1 s.
    """

    ratio: float
    gaps: int
    longest_gap_frames: int
    longest_gap_s: float
    first_lost_frame: int | None
    of: Literal["frames", "time"]
    time_to_first_pose_s: float | None
    longest_track_s: float
    relocalisations: int
    ends_lost: bool


def slots(gt_t_ns: Stamps, of: CoverageOf) -> Index:
    """The slot (N,) of each true pose, counted from 0; each slot should have an estimate.

    "frames": each pose is a slot. "auto": the same, unless the truth is too dense to have one pose per frame; then
    every 0.2 s is a slot. The estimate does not matter, so that no missing pose can raise the coverage.
    """
    steps_ns = np.diff(gt_t_ns)
    has_frames = not len(steps_ns) or np.median(steps_ns) >= FRAME_NS
    if of == "frames" or has_frames:
        return np.arange(len(gt_t_ns))
    since_ns = gt_t_ns - gt_t_ns[0]
    n_slots = max(int(since_ns[-1] // SLOT_NS), 1)
    slot = np.minimum(since_ns // SLOT_NS, n_slots - 1)
    return np.unique(slot, return_inverse=True)[1]


def coverage(gt_t_ns: Stamps, frames: Index, *, of: CoverageOf = "frames") -> Coverage:
    """Coverage of ground truth stamped gt_t_ns (N,), N > 0, by estimates of its `frames` (K,)."""
    n = len(gt_t_ns)
    frames = np.unique(frames)
    slot = slots(gt_t_ns, of)
    n_slots = int(slot[-1] + 1)
    is_time = n_slots < n

    # The matched poses between the start and the end of the truth, and how many slots are lost between each two.
    edge_frames = np.concatenate([[-1], frames, [n]])
    edge_slots = np.concatenate([[-1], slot[frames], [n_slots]])
    edge_ns = gt_t_ns[np.clip(edge_frames, 0, n - 1)]
    lost_slots = np.maximum(np.diff(edge_slots) - 1, 0)  # (K + 1,)
    is_gap = lost_slots > 0
    longest = int(np.argmax(lost_slots))
    first = int(np.argmax(is_gap))
    has_gap = bool(is_gap.any())
    gap_frames = int(edge_frames[longest + 1] - edge_frames[longest] - 1)
    gap_ns = float(edge_ns[longest + 1] - edge_ns[longest])

    # Track k has the matched poses from track_edges[k] to track_edges[k + 1] - 1.
    has_pose = bool(len(frames))
    inner_gaps = np.flatnonzero(lost_slots[1:-1]) + 1
    track_edges = np.concatenate([[0], inner_gaps, [len(frames)]])
    track_ends_ns = edge_ns[track_edges[1:]]
    track_starts_ns = edge_ns[1:][track_edges[:-1]]
    longest_track_ns = float((track_ends_ns - track_starts_ns).max())

    left_at_end_ns = edge_ns[-1] - edge_ns[-2]
    is_end_late = is_time and left_at_end_ns > END_NS
    return Coverage(
        ratio=len(np.unique(slot[frames])) / n_slots,
        gaps=int(np.count_nonzero(is_gap)),
        longest_gap_frames=gap_frames if has_gap else 0,
        longest_gap_s=gap_ns / 1e9 if has_gap else 0.0,
        first_lost_frame=int(edge_frames[first] + 1) if has_gap else None,
        of="time" if is_time else "frames",
        time_to_first_pose_s=float(edge_ns[1] - gt_t_ns[0]) / 1e9 if has_pose else None,
        longest_track_s=longest_track_ns / 1e9 if has_pose else 0.0,
        relocalisations=max(len(track_edges) - 2, 0),
        ends_lost=bool(is_gap[-1] or is_end_late),
    )


MIN_COVERAGE = 0.5  # an estimate of less than half of the recording has failed, as in the leaderboard


@dataclass(frozen=True, slots=True)
class TrackingFailure:
    """Whether an estimate failed, and how wrong its poses are.

    `survived` means a pose at the end, and poses for half of the recording. `confidently_wrong` counts the estimated
    poses with an error above `fail_m`. It and `lost_aware` are None for a stationary truth, for which fail_m is 0.
    """

    survived: bool
    lost_aware: float | None
    fail_m: float
    confidently_wrong: int | None


def failure(
    errors_m: Array,
    slots: Index,
    covered: Coverage,
    *,
    fail_m: float,
) -> TrackingFailure:
    """The failure of an estimate by the position errors (K,) of its poses, each in its slot (K,) of the truth.

    A pose with an error above `fail_m` metres is wrong.
    """
    survived = not covered.ends_lost and covered.ratio >= MIN_COVERAGE
    if fail_m <= 0:
        return TrackingFailure(survived, None, fail_m, None)
    n_slots = int(slots.max(initial=-1)) + 1
    best_m = np.full(n_slots, np.inf)
    np.minimum.at(best_m, slots, errors_m)
    covered_m = best_m[np.unique(slots)]
    lost_aware = lost_aware_score(covered_m, covered.ratio, survived=survived, fail_m=fail_m)
    confidently_wrong = int(np.count_nonzero(errors_m > fail_m))
    return TrackingFailure(survived, lost_aware, fail_m, confidently_wrong)


def lost_aware_score(
    errors_m: Array,
    coverage: float,
    *,
    survived: bool,
    fail_m: float,
) -> float:
    """1 for a perfect survivor, 0 if nothing is right; a survivor has 1/2 or more, every other run less.

    A is the area under the curve of the share of slots with an error below e, over e from 0 to `fail_m`, relative to
    that range: the mean of 1 - e / fail_m, clipped at 0, with 0 for a lost slot. A survivor scores 1/2 + A/2, a failed
    run A/2. So a run that crashes ranks below all that finish, however accurate it was before, and among equals
    neither an added error nor another lost pose ever raises the score.
    """
    accuracy = np.clip(1.0 - errors_m / fail_m, 0.0, 1.0)
    mean_accuracy = float(np.mean(accuracy)) if len(errors_m) else 0.0
    area = mean_accuracy * coverage
    if survived:
        return 0.5 + 0.5 * area
    # A failed run that is perfect in nearly all frames approaches 1/2, and must not round to it.
    largest_failed = float(np.nextafter(0.5, 0.0))
    return min(0.5 * area, largest_failed)


TIMES = ("coverage_of", "association", "max_diff_ns", "offset_ns")
METRICS = (
    MetricDefinition(
        "coverage",
        "share of the recording with a pose",
        "1",
        "slots with a pose / slots; a slot is a true pose, or 0.2 s of truth with more than 33 poses a second",
        OURS,
        TIMES,
        "whether the poses are right",
        headline="ratio",
        full=False,
    ),
    MetricDefinition(
        "lost_aware",
        "accuracy with lost counted as failed, 1 best and 0 worst",
        "1",
        "A/2 of a failed run, 1/2 + A/2 of a survivor; A: mean of 1 − e / (fail_ratio · path), cut at 0, lost slots 0",
        OURS,
        ("fail_ratio", *TIMES, *POSES),
        "differences beyond fail_ratio of the path: all of them are failures",
        headline="score",
        full=False,
    ),
)
