"""Statistics over the frames of an estimator on a case: cost, memory, dropped frames and the commonest reason."""

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean, median

from vobench.runner.estimate import DROPPED
from vobench.runner.frames import FrameRow

OFFSET = "offset_px"  # of the disparities of a stereo pair, in the statistics that an estimator states for a frame
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class EstimatorStatistics:
    """Statistics over all frames of an estimator on a case.

    `ms_per_frame` is the mean CPU time of a frame, and `memory_mib` the most that the estimator's processes held.
    `reason` is the commonest reason that the estimator gave for single frames, `count` the number of these frames and
    `first` the number of the first. Of all `frames`, `dropped` were dropped because `late` answers came after the
    next frame. `offset_px` is the offset of the stereo pair's disparities that the estimator found by the end of a
    trial, the median over trials; None if it found none.
    """

    ms_per_frame: float | None = None
    reason: str = ""
    count: int = 0
    first: int | None = None
    memory_mib: float | None = None
    frames: int = 0
    dropped: int = 0
    late: int = 0
    offset_px: float | None = None


# By case and estimator.
Answered = Mapping[tuple[str, str], EstimatorStatistics]


def summarize_frames(trials: Sequence[list[FrameRow]]) -> EstimatorStatistics:
    """The statistics over the frames of all trials of one estimator on one case.

    Reasons that differ only in numbers, such as `too few tracks (7)` and `too few tracks (5)`, count as one.
    """
    rows = [row for trial in trials for row in trial]
    costs_ms = [row.cpu_ms for row in rows if row.cpu_ms is not None]
    memory_mib = [row.memory_mib for row in rows if row.memory_mib]
    reason, count, first = _commonest_reason(rows)
    return EstimatorStatistics(
        ms_per_frame=fmean(costs_ms) if costs_ms else None,
        reason=reason,
        count=count,
        first=first,
        memory_mib=max(memory_mib, default=None),
        frames=len(rows),
        dropped=sum(row.status == DROPPED for row in rows),
        late=sum(_missed_deadlines(trial) for trial in trials),
        offset_px=_disparity_offset_px(trials),
    )


def _disparity_offset_px(trials: Sequence[list[FrameRow]]) -> float | None:
    """The median over trials of the offset that the last frame states; None if none of them states one but 0."""
    found_px = []
    for trial in trials:
        stated = json.loads(trial[-1].stats or "{}") if trial else {}
        offset_px = stated.get(OFFSET)
        if isinstance(offset_px, int | float) and offset_px:
            found_px.append(float(offset_px))
    return median(found_px) if found_px else None


def _commonest_reason(rows: Sequence[FrameRow]) -> tuple[str, int, int | None]:
    """The commonest reason, the number of frames that have it, and the number of the first one."""
    with_reason = [row for row in rows if row.reason]
    if not with_reason:
        return "", 0, None
    counts = Counter(_without_numbers(row.reason) for row in with_reason)
    commonest, count = min(counts.items(), key=lambda item: (-item[1], item[0]))
    alike = [row for row in with_reason if _without_numbers(row.reason) == commonest]
    first = min(alike, key=lambda row: row.frame)
    return first.reason, count, first.frame


def _without_numbers(reason: str) -> str:
    return NUMBER.sub("0", reason)


def _missed_deadlines(trial: Sequence[FrameRow]) -> int:
    """The number of late answers: each causes one run of consecutive dropped frames."""
    is_dropped = [row.status == DROPPED for row in trial]
    return sum(now and not before for before, now in pairwise(is_dropped))
