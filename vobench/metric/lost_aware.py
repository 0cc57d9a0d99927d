"""The lost-aware score: the accuracy of an estimate, where lost frames and failed runs count."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.comparison import OURS, POSES, MetricDefinition
from vobench.metric.coverage import MATCHING_SETTINGS, Coverage
from vobench.trajectory.associate import Index

MIN_COVERAGE = 0.5  # an estimate that covers less of the recording counts as failed, as in the leaderboard


@dataclass(frozen=True, slots=True)
class TrackingResult:
    """Whether an estimate survived the recording, and how accurate its poses are.

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


def tracking_result(
    errors_m: Array,
    pose_slots: Index,
    coverage: Coverage,
    *,
    fail_m: float,
) -> TrackingResult:
    """The result of an estimate with K poses, given their position errors (K,) and the slots (K,) that they are in.

    If a slot has several poses, only the one with the smallest error is scored.
    """
    survived = not coverage.ends_lost and coverage.ratio >= MIN_COVERAGE
    if fail_m <= 0:
        return TrackingResult(survived, lost_aware=None, fail_m=fail_m, confidently_wrong=None)
    slot_count = int(pose_slots.max(initial=-1)) + 1
    smallest_errors_m = np.full(slot_count, np.inf)  # (S,), one for each slot
    np.minimum.at(smallest_errors_m, pose_slots, errors_m)
    covered_errors_m = smallest_errors_m[np.unique(pose_slots)]
    return TrackingResult(
        survived,
        lost_aware=lost_aware_score(covered_errors_m, coverage.ratio, survived=survived, fail_m=fail_m),
        fail_m=fail_m,
        confidently_wrong=int(np.count_nonzero(errors_m > fail_m)),
    )


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


METRICS = (
    MetricDefinition(
        id="lost_aware",
        title="accuracy, where lost slots count as 0; 1 is best, 0 is worst",
        unit="1",
        formula=(
            "A/2 if the run failed, else 1/2 + A/2; "
            "A: mean over slots of max(0, 1 − e / (fail_ratio · path)), 0 if lost"
        ),
        source=OURS,
        settings=("fail_ratio", *MATCHING_SETTINGS, *POSES),
        blind="differences between errors above fail_ratio · path: each of them scores 0",
        headline="score",
        full=False,
    ),
)
