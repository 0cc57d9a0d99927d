"""Coverage of the ground truth by an estimate, failures, and the lost-aware score."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.comparison import OURS, POSES, MetricDefinition
from vobench.metric.settings import CoverageOf
from vobench.trajectory.associate import Index
from vobench.trajectory.trajectory import Stamps

FRAME_NS = 30_000_000  # truth with less between its poses is motion capture's, and its poses are no frames
SLOT_NS = 200_000_000  # of such truth; a camera of 10 Hz leaves none empty, whatever its jitter
END_NS = 100_000_000  # before its end a camera of 10 Hz has its last picture


@dataclass(frozen=True, slots=True)
class Coverage:
    """Share of the recording that has an estimate, and the gaps, stretches that have none.

    `of` says what was counted: frames, the true poses, or time in slots of 0.2 s. A gap's time runs from the
    last pose before it to the first after it, or to the end of the truth; `longest_gap_frames` counts the true
    poses in it. A track is a stretch without gaps; every track after the first is a relocalisation.
    It `ends_lost` without a pose in the last slot; by time, without one in the last 0.1 s.
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
    """The slot (N,) of each true pose, counted from 0, that should have an estimate.

    "frames": each pose is one. "auto": so too, unless the truth is too dense to have a pose a frame; then
    every 0.2 s of it is one. Nothing of the estimate decides, so that no pose it lacks can raise its coverage.
    """
    steps = np.diff(gt_t_ns)
    if of == "frames" or not len(steps) or np.median(steps) >= FRAME_NS:
        return np.arange(len(gt_t_ns))
    since_ns = gt_t_ns - gt_t_ns[0]
    whole = max(int(since_ns[-1] // SLOT_NS), 1)
    return np.unique(np.minimum(since_ns // SLOT_NS, whole - 1), return_inverse=True)[1]


def coverage(gt_t_ns: Stamps, frames: Index, *, of: CoverageOf = "frames") -> Coverage:
    """Coverage of ground truth stamped gt_t_ns (N,), N > 0, by estimates of its `frames` (K,)."""
    frames = np.unique(frames)
    slot = slots(gt_t_ns, of)
    around = np.concatenate([[-1], frames, [len(gt_t_ns)]])
    around_ns = gt_t_ns[np.clip(around, 0, len(gt_t_ns) - 1)]
    lost = np.maximum(np.diff(np.concatenate([[-1], slot[frames], [slot[-1] + 1]])) - 1, 0)
    is_time = bool(slot[-1] < len(gt_t_ns) - 1)
    longest = int(np.argmax(lost))
    first = int(np.argmax(lost > 0))
    # Tracks are the matched poses edges[k] ... edges[k + 1] - 1.
    edges = np.concatenate([[0], np.flatnonzero(lost[1:-1]) + 1, [len(frames)]])
    tracks_ns = around_ns[edges[1:]] - around_ns[1:][edges[:-1]]
    return Coverage(
        ratio=len(np.unique(slot[frames])) / int(slot[-1] + 1),
        gaps=int(np.count_nonzero(lost)),
        longest_gap_frames=int(np.diff(around)[longest] - 1) if lost[longest] else 0,
        longest_gap_s=float(around_ns[longest + 1] - around_ns[longest]) / 1e9 if lost[longest] else 0.0,
        first_lost_frame=int(around[first] + 1) if lost[first] else None,
        of="time" if is_time else "frames",
        time_to_first_pose_s=float(around_ns[1] - gt_t_ns[0]) / 1e9 if len(frames) else None,
        longest_track_s=float(tracks_ns.max()) / 1e9 if len(frames) else 0.0,
        relocalisations=max(len(edges) - 2, 0),
        ends_lost=bool(lost[-1] > 0 or (is_time and around_ns[-1] - around_ns[-2] > END_NS)),
    )


MIN_COVERAGE = 0.5  # with less than half of the recording an estimate has failed, as in the leaderboard


@dataclass(frozen=True, slots=True)
class Failure:
    """How an estimate failed, if it did.

    `survived`: it had a pose at the end, and for half of the recording. `confidently_wrong` counts the poses
    given that are further off than `fail_m`. It and `lost_aware` are None where the truth stands still: fail_m is 0.
    """

    survived: bool
    lost_aware: float | None
    fail_m: float
    confidently_wrong: int | None


def failure(errors_m: Array, slots: Index, covered: Coverage, *, fail_m: float) -> Failure:
    """The failure in position errors (K,) of the poses that there are, each in its slot (K,) of the truth.

    Beyond `fail_m` metres a pose is wrong.
    """
    survived = not covered.ends_lost and covered.ratio >= MIN_COVERAGE
    if fail_m <= 0:
        return Failure(survived, None, fail_m, None)
    best_m = np.full(int(slots.max(initial=-1)) + 1, np.inf)
    np.minimum.at(best_m, slots, errors_m)
    lost_aware = lost_aware_score(best_m[np.unique(slots)], covered.ratio, survived=survived, fail_m=fail_m)
    return Failure(survived, lost_aware, fail_m, int(np.count_nonzero(errors_m > fail_m)))


def lost_aware_score(errors_m: Array, coverage: float, *, survived: bool, fail_m: float) -> float:
    """1 for a perfect survivor, 0 for nothing right; every survivor has 1/2 or more, every other run less.

    A is the area under the curve that says what share of the slots has an error below e, over e from 0 to
    `fail_m`, as a share of that range: the mean of 1 - e / fail_m, cut at 0, where a lost slot gives 0. A
    survivor scores 1/2 + A/2, a failed run A/2: so a crash, however accurate before, ranks below whoever
    got through, and among equals neither an added error nor a pose more lost ever raises the score.
    """
    right = float(np.mean(np.clip(1.0 - errors_m / fail_m, 0.0, 1.0))) if len(errors_m) else 0.0
    area = right * coverage
    # A failed run that was perfect in all frames but few comes near 1/2, and must not round to it.
    return 0.5 + 0.5 * area if survived else min(0.5 * area, float(np.nextafter(0.5, 0.0)))


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
