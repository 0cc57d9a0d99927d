"""Coverage of the ground truth by an estimate, failures, and the lost-aware score."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.comparison import OURS, POSES, MetricDefinition
from vobench.metric.settings import CoverageOf
from vobench.trajectory.associate import Index
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

FRAME_NS = 30_000_000  # ground truth with shorter steps comes from motion capture, so its poses are not frames
SLOT_NS = 200_000_000  # the length of a slot for such ground truth; a camera at 10 Hz has an image in every slot
END_NS = 100_000_000  # the largest time between the last image of a camera at 10 Hz and the end of the recording


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of a recording an estimate covers, and where it has gaps.

    `of` says what a slot is: one frame, which is one true pose, or 0.2 s of time.
    `ratio` is the share of slots with an estimated pose.
    A gap is a run of slots without a pose. It lasts from the pose before it, or the start of the ground truth, to the
    pose after it, or the end. `longest_gap_frames` counts the true poses in the gap that has the most slots.
    A track is a run of poses without a gap. Every track after the first is a relocalisation.
    `ends_lost` is True if the last slot has no pose or, for slots of time, if the last 0.1 s has none.
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
    """The index (N,) of the slot that each true pose belongs to, from 0. A complete estimate has a pose in every slot.

    "frames" makes each true pose a slot. "auto" does the same unless the true poses are denser than the frames of a
    camera; then each 0.2 s is a slot. Slots do not depend on the estimate, so a missing pose cannot raise the coverage.
    """
    steps_ns = np.diff(gt_t_ns)
    has_frames = not len(steps_ns) or np.median(steps_ns) >= FRAME_NS
    if of == "frames" or has_frames:
        return np.arange(len(gt_t_ns))
    elapsed_ns = gt_t_ns - gt_t_ns[0]
    slot_count = max(int(elapsed_ns[-1] // SLOT_NS), 1)
    slot_with_empty = np.minimum(elapsed_ns // SLOT_NS, slot_count - 1)  # the last one includes the remainder
    return np.unique(slot_with_empty, return_inverse=True)[1]


@dataclass(frozen=True, slots=True)
class _Intervals:
    """The K + 1 intervals between the start of the ground truth, the K estimated poses and the end.

    `begin_frame`, `end_frame` (K + 1,) are the frames of the poses at both ends of an interval; -1 is the start, and N
    the end. `begin_ns`, `end_ns` (K + 1,) are their stamps. `lost_slots` (K + 1,) counts the slots between them.
    """

    begin_frame: Index
    end_frame: Index
    begin_ns: Stamps
    end_ns: Stamps
    lost_slots: Index


def coverage(gt_t_ns: Stamps, frames: Index, *, of: CoverageOf = "frames") -> Coverage:
    """The coverage of a ground truth with stamps (N,), N > 0, by an estimate that has poses for `frames` (K,)."""
    frames = np.unique(frames)
    slot = slots(gt_t_ns, of)
    slot_count = int(slot[-1] + 1)
    is_time = slot_count < len(gt_t_ns)
    intervals = _intervals(gt_t_ns, frames, slot)
    is_gap = intervals.lost_slots > 0
    has_pose = len(frames) > 0

    longest_gap_frames = 0
    longest_gap_ns = 0.0
    first_lost_frame = None
    if is_gap.any():
        longest = int(np.argmax(intervals.lost_slots))
        longest_gap_frames = int(intervals.end_frame[longest] - intervals.begin_frame[longest] - 1)
        longest_gap_ns = float(intervals.end_ns[longest] - intervals.begin_ns[longest])
        first = int(np.argmax(is_gap))
        first_lost_frame = int(intervals.begin_frame[first] + 1)

    time_without_pose_at_end_ns = intervals.end_ns[-1] - intervals.begin_ns[-1]
    is_end_late = is_time and time_without_pose_at_end_ns > END_NS
    return Coverage(
        ratio=len(np.unique(slot[frames])) / slot_count,
        gaps=int(np.count_nonzero(is_gap)),
        longest_gap_frames=longest_gap_frames,
        longest_gap_s=longest_gap_ns / NS_PER_S,
        first_lost_frame=first_lost_frame,
        of="time" if is_time else "frames",
        time_to_first_pose_s=float(intervals.end_ns[0] - gt_t_ns[0]) / NS_PER_S if has_pose else None,
        longest_track_s=_longest_track_ns(intervals) / NS_PER_S if has_pose else 0.0,
        relocalisations=int(np.count_nonzero(is_gap[1:-1])),
        ends_lost=bool(is_gap[-1] or is_end_late),
    )


def _intervals(gt_t_ns: Stamps, frames: Index, slot: Index) -> _Intervals:
    """The intervals between the frames (K,) that have a pose; `slot` (N,) is the slot of each true pose."""
    frame_count = len(gt_t_ns)
    slot_count = int(slot[-1] + 1)
    border_frames = np.concatenate([[-1], frames, [frame_count]])
    border_slots = np.concatenate([[-1], slot[frames], [slot_count]])
    border_ns = gt_t_ns[np.clip(border_frames, 0, frame_count - 1)]
    lost_slots = np.maximum(np.diff(border_slots) - 1, 0)
    return _Intervals(border_frames[:-1], border_frames[1:], border_ns[:-1], border_ns[1:], lost_slots)


def _longest_track_ns(intervals: _Intervals) -> float:
    """The duration of the longest run of poses without a gap. There must be a pose."""
    pose_ns = intervals.end_ns[:-1]  # (K,)
    is_gap_between = intervals.lost_slots[1:-1] > 0  # (K - 1,)
    is_first = np.concatenate([[True], is_gap_between])
    is_last = np.concatenate([is_gap_between, [True]])
    durations_ns = pose_ns[is_last] - pose_ns[is_first]
    return float(durations_ns.max())


MIN_COVERAGE = 0.5  # an estimate that covers less of the recording counts as failed, as in the leaderboard


@dataclass(frozen=True, slots=True)
class TrackingFailure:
    """Whether an estimate failed, and how accurate its poses are.

    `survived` is True if the estimate has a pose at the end and covers at least half of the recording.
    `lost_aware` is the lost-aware score.
    `fail_m` is the position error above which a pose is wrong.
    `confidently_wrong` counts the estimated poses that are wrong.
    `lost_aware` and `confidently_wrong` are None if the robot is stationary, because `fail_m` is then 0.
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
    """The failure of an estimate from the position errors (K,) of its poses and their slots (K,).

    A pose with an error above `fail_m` metres is wrong. If a slot has several poses, the best one is scored.
    """
    survived = not covered.ends_lost and covered.ratio >= MIN_COVERAGE
    if fail_m <= 0:
        return TrackingFailure(survived, None, fail_m, None)
    slot_count = int(slots.max(initial=-1)) + 1
    best_error_m = np.full(slot_count, np.inf)  # of each slot
    np.minimum.at(best_error_m, slots, errors_m)
    covered_errors_m = best_error_m[np.unique(slots)]
    lost_aware = lost_aware_score(covered_errors_m, covered.ratio, survived=survived, fail_m=fail_m)
    confidently_wrong = int(np.count_nonzero(errors_m > fail_m))
    return TrackingFailure(survived, lost_aware, fail_m, confidently_wrong)


def lost_aware_score(
    errors_m: Array,
    coverage: float,
    *,
    survived: bool,
    fail_m: float,
) -> float:
    """The lost-aware score of a run with an error (K,) per covered slot: 1 is perfect, 0 means that no pose is right.

    The accuracy of a slot with error e is 1 - e / fail_m, clipped at 0. It is 0 for a slot without a pose. A is the
    mean accuracy of all slots. It is the normalised area under the curve of the share of slots with an error below e,
    for e from 0 to `fail_m`.

    A run that survived scores 1/2 + A/2, a failed run A/2. A failed run therefore ranks below every run that survived.
    Among runs that survived, and among failed runs, a larger error or another lost pose never raises the score.
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
