"""Coverage of the ground truth by an estimate: the share with poses, the gaps and the tracks.

The ground truth is divided into slots. A slot is either a frame, which is one true pose, or an interval of SLOT_NS.
A gap is a sequence of slots without an estimated pose, and a track is a sequence of slots with estimated poses:

    slots      1   2   3   4   5   6   7   8   9
    poses      x   x   x               x   x
               |-------|---------------|---|---|
                 track        gap      track gap
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from vobench.metric.comparison import OURS, MetricDefinition
from vobench.metric.settings import CoverageOf
from vobench.trajectory.associate import Index
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

# Ground truth from motion capture has more poses than a camera has frames, so its poses cannot be the slots. A camera
# at 10 Hz must be able to cover it completely, hence the length of a slot and the tolerance at the end.
MOTION_CAPTURE_STEP_NS = 30_000_000  # ground truth with a shorter median step is from motion capture
SLOT_NS = 200_000_000  # a camera at 10 Hz has an image in every slot
END_NS = 100_000_000  # the largest time from the last image of a camera at 10 Hz to the end of the recording

SlotKind = Literal["frames", "time"]


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of a recording an estimate covers, and where it has gaps.

    A gap begins at the last pose before it and ends at the first pose after it. If there is no such pose, it begins or
    ends with the ground truth.
    Every track after the first one is a relocalisation.

    `ratio` is the share of slots with an estimated pose.
    `gaps` is the number of gaps.
    `longest_gap_frames` is the number of true poses in the gap with the most slots.
    `longest_gap_s` is the duration of this gap.
    `first_lost_frame` is the index of the first true pose in a gap; None if there are no gaps.
    `slot_kind` is "frames" if a slot is a frame, and "time" if it is an interval.
    `time_to_first_pose_s` is the time from the start of the ground truth to the first pose; None without poses.
    `longest_track_s` is the duration of the longest track; 0 without poses.
    `relocalisations` is the number of tracks after the first one.
    `ends_lost` is whether the estimate is lost at the end; see `_ends_lost`.
    """

    ratio: float
    gaps: int
    longest_gap_frames: int
    longest_gap_s: float
    first_lost_frame: int | None
    slot_kind: SlotKind
    time_to_first_pose_s: float | None
    longest_track_s: float
    relocalisations: int
    ends_lost: bool


@dataclass(frozen=True, slots=True)
class Slots:
    """The slots of N true poses.

    `of_frame` (N,) is the index of the slot of each true pose, from 0.
    `kind` is "frames" if each true pose is a slot, and "time" if the slots are intervals.
    """

    of_frame: Index
    kind: SlotKind

    @property
    def count(self) -> int:
        """The number of slots."""
        return int(self.of_frame[-1] + 1)


def slots(gt_t_ns: Stamps, rule: CoverageOf) -> Slots:
    """The slots of a ground truth with stamps (N,). A complete estimate has a pose in every slot.

    With "frames", each true pose is a slot. With "auto", each true pose is a slot unless the ground truth is from
    motion capture, which has more poses than a camera has frames; then each interval of SLOT_NS is a slot.
    Slots do not depend on the estimate, so a missing pose cannot increase the coverage.
    """
    if rule == "frames" or not _is_motion_capture(gt_t_ns):
        return Slots(np.arange(len(gt_t_ns)), "frames")

    elapsed_ns = gt_t_ns - gt_t_ns[0]
    interval_count = max(int(elapsed_ns[-1] // SLOT_NS), 1)
    last_interval = interval_count - 1
    interval_of_frame = np.minimum(elapsed_ns // SLOT_NS, last_interval)  # the last interval includes the remainder
    _, slot_of_frame = np.unique(interval_of_frame, return_inverse=True)  # intervals without a true pose are not slots
    return Slots(slot_of_frame, "time")


def _is_motion_capture(gt_t_ns: Stamps) -> bool:
    """Whether ground truth with stamps (N,) has more poses per second than a camera has frames."""
    steps_ns = np.diff(gt_t_ns)
    if len(steps_ns) == 0:
        return False
    return bool(np.median(steps_ns) < MOTION_CAPTURE_STEP_NS)


def coverage(gt_t_ns: Stamps, estimated_frames: Index, *, rule: CoverageOf = "frames") -> Coverage:
    """The coverage of a ground truth with stamps (N,), N > 0.

    `estimated_frames` (K,) are the indices of the true poses for which the estimate has a pose.
    `rule` defines the slots; see `slots`.
    """
    frames = np.unique(estimated_frames)
    gt_slots = slots(gt_t_ns, rule)
    intervals = _intervals(gt_t_ns, frames, gt_slots)
    is_gap = intervals.lost_slots > 0
    longest_gap = _longest_gap(intervals)

    time_to_first_pose_s = None
    longest_track_s = 0.0
    if len(frames):
        time_to_first_pose_s = float(intervals.end_ns[0] - gt_t_ns[0]) / NS_PER_S
        longest_track_s = _longest_track_ns(intervals) / NS_PER_S

    covered_slots = np.unique(gt_slots.of_frame[frames])
    is_inner_gap = is_gap[1:-1]  # not before the first pose, and not after the last one
    return Coverage(
        ratio=len(covered_slots) / gt_slots.count,
        gaps=int(np.count_nonzero(is_gap)),
        longest_gap_frames=longest_gap.frames,
        longest_gap_s=longest_gap.duration_ns / NS_PER_S,
        first_lost_frame=_first_lost_frame(intervals),
        slot_kind=gt_slots.kind,
        time_to_first_pose_s=time_to_first_pose_s,
        longest_track_s=longest_track_s,
        relocalisations=int(np.count_nonzero(is_inner_gap)),
        ends_lost=_ends_lost(intervals, gt_slots.kind),
    )


@dataclass(frozen=True, slots=True)
class _Intervals:
    """The K + 1 intervals before, between and after K estimated poses. N is the number of true poses.

    `begin_frame` (K + 1,) is the index of the true pose at the beginning of each interval; -1 for the first interval.
    `end_frame` (K + 1,) is the index of the true pose at the end of each interval; N for the last interval.
    `begin_ns` (K + 1,) is the stamp at the beginning of each interval; the start of the ground truth for the first.
    `end_ns` (K + 1,) is the stamp at the end of each interval; the end of the ground truth for the last.
    `lost_slots` (K + 1,) is the number of slots inside each interval. They have no estimated pose.
    """

    begin_frame: Index
    end_frame: Index
    begin_ns: Stamps
    end_ns: Stamps
    lost_slots: Index


def _intervals(gt_t_ns: Stamps, frames: Index, gt_slots: Slots) -> _Intervals:
    """The intervals before, between and after the frames (K,) that have an estimated pose."""
    frame_count = len(gt_t_ns)
    border_frames = np.concatenate([[-1], frames, [frame_count]])
    border_slots = np.concatenate([[-1], gt_slots.of_frame[frames], [gt_slots.count]])
    nearest_frames = np.clip(border_frames, 0, frame_count - 1)
    border_ns = gt_t_ns[nearest_frames]
    slot_steps = np.diff(border_slots)
    return _Intervals(
        begin_frame=border_frames[:-1],
        end_frame=border_frames[1:],
        begin_ns=border_ns[:-1],
        end_ns=border_ns[1:],
        lost_slots=np.maximum(slot_steps - 1, 0),  # two poses can be in one slot
    )


class _Gap(NamedTuple):
    """A gap in an estimate.

    `frames` is the number of true poses in the gap.
    `duration_ns` is its duration.
    """

    frames: int
    duration_ns: float


def _longest_gap(intervals: _Intervals) -> _Gap:
    """The gap with the most slots; without gaps, a gap of length 0."""
    longest = int(np.argmax(intervals.lost_slots))
    if intervals.lost_slots[longest] == 0:
        return _Gap(0, 0.0)
    inner_frames = intervals.end_frame[longest] - intervals.begin_frame[longest] - 1
    duration_ns = intervals.end_ns[longest] - intervals.begin_ns[longest]
    return _Gap(int(inner_frames), float(duration_ns))


def _first_lost_frame(intervals: _Intervals) -> int | None:
    """The index of the first true pose in a gap; None if there are no gaps."""
    is_gap = intervals.lost_slots > 0
    if not is_gap.any():
        return None
    first_gap = int(np.argmax(is_gap))
    return int(intervals.begin_frame[first_gap] + 1)


def _longest_track_ns(intervals: _Intervals) -> float:
    """The duration of the longest sequence of poses without a gap. There must be at least one pose."""
    pose_ns = intervals.end_ns[:-1]  # (K,)
    is_gap_between = intervals.lost_slots[1:-1] > 0  # (K - 1,)
    is_first = np.concatenate([[True], is_gap_between])
    is_last = np.concatenate([is_gap_between, [True]])
    durations_ns = pose_ns[is_last] - pose_ns[is_first]
    return float(durations_ns.max())


def _ends_lost(intervals: _Intervals, slot_kind: SlotKind) -> bool:
    """Whether the estimate is lost at the end of the recording.

    It is lost if the last slot has no pose or, with slots that are intervals, if the last END_NS have no pose.
    """
    time_after_last_pose_ns = intervals.end_ns[-1] - intervals.begin_ns[-1]
    is_last_slot_lost = intervals.lost_slots[-1] > 0
    is_end_late = slot_kind == "time" and time_after_last_pose_ns > END_NS
    return bool(is_last_slot_lost or is_end_late)


MATCHING_SETTINGS = ("coverage_of", "association", "max_diff_ns", "offset_ns")
METRICS = (
    MetricDefinition(
        id="coverage",
        title="share of the recording with a pose",
        unit="1",
        formula="slots with a pose / all slots; "
        f"a slot is a true pose, or {SLOT_NS / NS_PER_S:g} s if the truth has more than "
        f"{NS_PER_S // MOTION_CAPTURE_STEP_NS} poses per second",
        source=OURS,
        settings=MATCHING_SETTINGS,
        blind="whether the poses are right",
        headline="ratio",
        full=False,
    ),
)
