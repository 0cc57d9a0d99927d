"""Accuracy that no failure can raise: lost frames count as failed, and who gives up ranks below who doesn't."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.coverage import Coverage
from vobench.trajectory.associate import Index

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
    if fail_m <= 0:
        raise ValueError(f"fail_m should be more than 0, but is {fail_m}")
    right = float(np.mean(np.clip(1.0 - errors_m / fail_m, 0.0, 1.0))) if len(errors_m) else 0.0
    area = right * coverage
    # A failed run that was perfect in all frames but few comes near 1/2, and must not round to it.
    return 0.5 + 0.5 * area if survived else min(0.5 * area, float(np.nextafter(0.5, 0.0)))
