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

FRAME_NS = 30_000_000  # ground truth with shorter steps is from motion capture, so its poses do not belong to frames
SLOT_NS = 200_000_000  # the length of a slot for motion capture; a camera at 10 Hz has an image in every slot
END_NS = 100_000_000  # the largest time from the last image of a camera at 10 Hz to the end of the recording


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of a recording an estimate covers, and where it has gaps.

    A slot is a frame, which is one true pose, or an interval of 0.2 s; `of` says which.
    A gap is a run of slots without an estimated pose. It lasts from the last pose before the run, or the start of the
    ground truth, to the first pose after the run, or the end.
    A track is a run of estimated poses without a gap. Every track after the first one is a relocalisation.

    `ratio` is the share of slots with an estimated pose.
    `longest_gap_frames` and `longest_gap_s` are the number of true poses in the gap with the most slots, and its
    duration.
    `first_lost_frame` is the index of the first true pose in a gap, None without gaps.
    `ends_lost` is whether the last slot has no pose or, for slots of 0.2 s, the last 0.1 s has none.
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
    """The index (N,), from 0, of the slot of each true pose. A complete estimate has a pose in every slot.

    With "frames", each true pose is a slot. With "auto", each true pose is a slot unless the ground truth is from
    motion capture, which has more poses than a camera has frames; then each interval of 0.2 s is a slot.
    Slots do not depend on the estimate, so a missing pose cannot increase the coverage.
    """
    steps_ns = np.diff(gt_t_ns)
    has_frames = not len(steps_ns) or np.median(steps_ns) >= FRAME_NS
    if of == "frames" or has_frames:
        return np.arange(len(gt_t_ns))
    elapsed_ns = gt_t_ns - gt_t_ns[0]
    interval_count = max(int(elapsed_ns[-1] // SLOT_NS), 1)
    interval = np.minimum(elapsed_ns // SLOT_NS, interval_count - 1)  # the last interval includes the remainder
    return np.unique(interval, return_inverse=True)[1]  # intervals without a true pose are not slots


@dataclass(frozen=True, slots=True)
class _Intervals:
    """The K + 1 intervals that K estimated poses divide the ground truth into.

    `begin_frame` and `end_frame` (K + 1,) are the indices of the true poses at both ends of each interval; the first
    interval begins at -1, and the last one ends at N.
    `begin_ns` and `end_ns` (K + 1,) are the stamps of these poses, limited to the time span of the ground truth.
    `lost_slots` (K + 1,) is the number of slots inside each interval, which have no pose.
    """

    begin_frame: Index
    end_frame: Index
    begin_ns: Stamps
    end_ns: Stamps
    lost_slots: Index


def coverage(gt_t_ns: Stamps, frames: Index, *, of: CoverageOf = "frames") -> Coverage:
    """The coverage of a ground truth with stamps (N,), N > 0, by an estimate of the true poses `frames` (K,)."""
    frames = np.unique(frames)
    slot = slots(gt_t_ns, of)
    slot_count = int(slot[-1] + 1)
    has_time_slots = slot_count < len(gt_t_ns)
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
    is_end_late = has_time_slots and time_without_pose_at_end_ns > END_NS
    return Coverage(
        ratio=len(np.unique(slot[frames])) / slot_count,
        gaps=int(np.count_nonzero(is_gap)),
        longest_gap_frames=longest_gap_frames,
        longest_gap_s=longest_gap_ns / NS_PER_S,
        first_lost_frame=first_lost_frame,
        of="time" if has_time_slots else "frames",
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
    """The duration of the longest run of poses without a gap. There must be at least one pose."""
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

    `survived` is whether the estimate has a pose at the end and covers at least half of the recording.
    `lost_aware` is the lost-aware score.
    `fail_m` is the position error above which a pose is wrong. It is 0 for a stationary robot; then `lost_aware` and
    `confidently_wrong` are None.
    `confidently_wrong` is the number of estimated poses that are wrong.
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
    """Whether an estimate failed, given the position errors (K,) and the slots (K,) of its poses.

    If a slot has several poses, only the one with the smallest error is scored.
    """
    survived = not covered.ends_lost and covered.ratio >= MIN_COVERAGE
    if fail_m <= 0:
        return TrackingFailure(survived, None, fail_m, None)
    slot_count = int(slots.max(initial=-1)) + 1
    smallest_errors_m = np.full(slot_count, np.inf)  # (S,), one for each slot
    np.minimum.at(smallest_errors_m, slots, errors_m)
    covered_errors_m = smallest_errors_m[np.unique(slots)]
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
    """The lost-aware score of a run, from 0 (no correct pose) to 1 (perfect), given the errors (K,) of covered slots.

    The accuracy of a slot with the error e is 1 - e / fail_m, clipped at 0; that of a slot without a pose is 0. A is
    the mean accuracy of all slots. A equals the normalised area under the curve that gives the share of slots with an
    error below e, for e from 0 to `fail_m`.

    The score is 1/2 + A/2 for a run that survived, and A/2 for a failed run, so a failed run ranks below every run that
    survived. Within each of these two groups, a larger error or an additional lost pose never increases the score.
    """
    accuracy = np.clip(1.0 - errors_m / fail_m, 0.0, 1.0)
    mean_accuracy = float(np.mean(accuracy)) if len(errors_m) else 0.0
    area = mean_accuracy * coverage
    if survived:
        return 0.5 + 0.5 * area
    # The score of a failed run with nearly perfect accuracy must not be rounded to 1/2.
    largest_failed = float(np.nextafter(0.5, 0.0))
    return min(0.5 * area, largest_failed)


TIMES = ("coverage_of", "association", "max_diff_ns", "offset_ns")
METRICS = (
    MetricDefinition(
        "coverage",
        "share of the recording with a pose",
        "1",
        "slots with a pose / all slots; a slot is a true pose, or 0.2 s if the truth has more than 33 poses per second",
        OURS,
        TIMES,
        "whether the poses are right",
        headline="ratio",
        full=False,
    ),
    MetricDefinition(
        "lost_aware",
        "accuracy, where lost slots count as 0; 1 is best, 0 is worst",
        "1",
        "A/2 if the run failed, else 1/2 + A/2; A: mean over slots of max(0, 1 − e / (fail_ratio · path)), 0 if lost",
        OURS,
        ("fail_ratio", *TIMES, *POSES),
        "differences between errors above fail_ratio · path: each of them scores 0",
        headline="score",
        full=False,
    ),
)
