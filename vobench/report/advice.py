"""What a run would have to add so that its board decides a chosen ratio of losses: places, drives and time."""

from collections.abc import Mapping, Sequence
from math import ceil

from vobench.errors import counted
from vobench.report.total import CHOSEN_RATIO, Total
from vobench.suite.plan import Plan

SECONDS_PER_MINUTE = 60
STAGES_PER_TRIAL = ("estimate", "score")


def cost_of_deciding(totals: Sequence[Total], plan: Plan, typical_s: Mapping[str, float], *, jobs: int) -> str:
    """The sentence on what it takes to decide a ratio of CHOSEN_RATIO between all neighbours.

    It is empty if no pair of neighbours needs more places, as far as is known.

    `typical_s` is the duration of a task of each stage in earlier runs. The number of places follows from the variance
    between places that this board saw; a ratio of CHOSEN_RATIO is then decided in 95 of 100 boards.
    """
    if not totals:
        return ""
    most = max(totals, key=_more_places_needed)
    more_places = _more_places_needed(most)
    if more_places == 0:
        return ""
    more_drives = ceil(more_places * most.drives / most.places)
    seconds = more_places * _seconds_per_place(plan, typical_s, jobs=jobs, places=most.places)
    time = f", {_duration(seconds)}" if seconds > 0 else ""
    drives = counted(more_drives, "more drive")
    return f"To decide a ratio of {CHOSEN_RATIO:g}: about {drives} in {counted(more_places, 'more place')}{time}"


def _more_places_needed(total: Total) -> int:
    """The places that are missing for a decision on an estimator and the one above; 0 if decided, or if not known."""
    if total.decided_above is not False or total.places_needed is None:
        return 0
    return max(0, total.places_needed - total.places)


def _seconds_per_place(plan: Plan, typical_s: Mapping[str, float], *, jobs: int, places: int) -> float:
    """The seconds that a run of all tasks of the plan takes, divided by its places; 0 if a stage was never timed.

    Estimators run one after the other unless the suite shares time.
    """
    trials = len(plan.simulated) * len(plan.estimator_entries)
    scenes = {case.variant["scene"] for case in plan.simulated}
    tasks = {"sequence": len(plan.simulated), **dict.fromkeys(STAGES_PER_TRIAL, trials)}
    if any(case.rendering.needs_bake for case in plan.simulated):
        tasks["bake"] = len(scenes)
    if not tasks.keys() <= typical_s.keys():
        return 0.0
    estimators_at_once = jobs if plan.suite.share_time else 1
    seconds = 0.0
    for stage, count in tasks.items():
        at_once = estimators_at_once if stage == "estimate" else jobs
        seconds += count * typical_s[stage] / at_once
    return seconds / places


def _duration(seconds: float) -> str:
    if seconds < SECONDS_PER_MINUTE:
        return "less than a minute"
    return f"about {seconds / SECONDS_PER_MINUTE:.0f} min"
