"""Statistics over the frames of an estimator on a case: cost, memory, dropped frames, and the commonest reason."""

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean, median

from vobench.runner.estimate import DROPPED
from vobench.runner.frames import FrameRow

OFFSET_KEY = "offset_px"  # of the disparities of a stereo pair, in the statistics that an estimator reports for a frame
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class EstimatorStatistics:
    """Statistics over all frames of an estimator on a case.

    `ms_per_frame` is the mean CPU time of a frame; None if it is unknown.
    `reason` is the commonest reason that the estimator gave for single frames; empty if it gave none.
    `count` is the number of frames with this reason, and `first` the number of the first of them.
    `memory_mib` is the peak memory of the estimator's processes; None if it is unknown.
    `frames` is the number of frames, and `dropped` the number of those that arrived while the estimator was busy.
    `late` is the number of answers that came after the next frame.
    `offset_px` is the offset of the stereo pair's disparities that the estimator reports by the end of a trial, as the
    median over trials; None if it reports none.
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


StatisticsByCell = Mapping[tuple[str, str], EstimatorStatistics]  # by case and estimator


@dataclass(frozen=True, slots=True)
class _FrameReason:
    """A reason that an estimator gives for single frames."""

    text: str = ""
    count: int = 0
    first_frame: int | None = None


def summarize_frames(trials: Sequence[list[FrameRow]]) -> EstimatorStatistics:
    """The statistics over the frames of all trials of one estimator on one case.

    Reasons that differ only in numbers, such as `too few tracks (7)` and `too few tracks (5)`, count as one.
    """
    rows = [row for trial in trials for row in trial]
    costs_ms = [row.cpu_ms for row in rows if row.cpu_ms is not None]
    memory_mib = [row.memory_mib for row in rows if row.memory_mib]
    reason = _commonest_reason(rows)
    return EstimatorStatistics(
        ms_per_frame=fmean(costs_ms) if costs_ms else None,
        reason=reason.text,
        count=reason.count,
        first=reason.first_frame,
        memory_mib=max(memory_mib, default=None),
        frames=len(rows),
        dropped=sum(row.status == DROPPED for row in rows),
        late=sum(_late_answers(trial) for trial in trials),
        offset_px=_median_offset_px(trials),
    )


def _median_offset_px(trials: Sequence[list[FrameRow]]) -> float | None:
    """The median over trials of the offset at the last frame. Offsets of 0 do not count; None if there is no other."""
    offsets_px = []
    for trial in trials:
        offset_px = _last_offset_px(trial)
        if offset_px:
            offsets_px.append(offset_px)
    return median(offsets_px) if offsets_px else None


def _last_offset_px(trial: Sequence[FrameRow]) -> float | None:
    """The offset of disparities that the estimator reports for the last frame of a trial; None if it reports none."""
    if not trial or not trial[-1].stats:
        return None
    offset_px = json.loads(trial[-1].stats).get(OFFSET_KEY)
    is_number = isinstance(offset_px, int | float)
    return float(offset_px) if is_number else None


def _commonest_reason(rows: Sequence[FrameRow]) -> _FrameReason:
    """The commonest reason as the first frame gives it; of equally common ones, the first in alphabetical order."""
    with_reason = [row for row in rows if row.reason]
    if not with_reason:
        return _FrameReason()
    counts = Counter(_without_numbers(row.reason) for row in with_reason)
    pattern, count = min(counts.items(), key=lambda item: (-item[1], item[0]))
    matching = [row for row in with_reason if _without_numbers(row.reason) == pattern]
    first = min(matching, key=lambda row: row.frame)
    return _FrameReason(first.reason, count, first.frame)


def _without_numbers(reason: str) -> str:
    """A reason in which every number is 0."""
    return NUMBER.sub("0", reason)


def _late_answers(trial: Sequence[FrameRow]) -> int:
    """The number of late answers: each causes one run of consecutive dropped frames."""
    is_dropped = [row.status == DROPPED for row in trial]
    return sum(is_now and not was_before for was_before, is_now in pairwise(is_dropped))
