"""Runs a suite in fresh units until each pair of estimators is decided, or shown to be alike.

After every draw of units, all ranked estimators are compared by the confidence sequences of `metric.sequential`, whose
error does not depend on how often one looks or on why one stops.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

from vobench.errors import InputError, SuiteError, counted
from vobench.metric.ranking import DECIDED
from vobench.metric.sequential import PairVerdict, open_pairs
from vobench.report.case_facts import case_facts
from vobench.report.cell import CaseFacts
from vobench.report.json_file import read_object
from vobench.report.leaderboard import make_cells
from vobench.report.pair_sentence import NamedPair, named_pairs
from vobench.runner.folder import UNTIL, RunFolder, TrialScore, with_sequence
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.store import write_json
from vobench.suite.draw import joined
from vobench.suite.plan import Plan

Say = Callable[[str], object]
MOST_UNITS = 10_000
SECONDS_PER_MINUTE = 60
UNITS_OF_TIME = {"s": 1, "min": 60, "h": 3600}


def parse_duration_s(text: str) -> float:
    """The seconds of a duration such as 90s, 40min or 2h. Raises InputError."""
    for unit, seconds in UNITS_OF_TIME.items():
        number = text.removesuffix(unit).strip()
        is_number = number.replace(".", "", 1).isdecimal()
        if text.endswith(unit) and is_number and float(number) > 0:
            return float(number) * seconds
    raise InputError(f"a duration should be a number above 0 with a unit, as in 40min, 90s or 2h, got {text!r}")


@dataclass(frozen=True)
class UntilDecided:
    """The result of `run_until_decided`: the run with all units, what is known of each pair, and what it cost.

    `has_ended` states that no pair is open; otherwise the budget was used up.
    """

    folder: RunFolder
    pairs: tuple[NamedPair, ...]
    draws: int
    units: int
    seconds: float

    @cached_property
    def _open(self) -> list[PairVerdict]:
        return open_pairs([pair.known for pair in self.pairs])

    @property
    def has_ended(self) -> bool:
        """Whether each pair is decided or alike."""
        return not self._open

    @property
    def cost(self) -> str:
        """The sentence on what the run cost, and what the open pairs are expected to take."""
        spent = f"{counted(self.units, 'place')} in {counted(self.draws, 'draw')}, {_minutes(self.seconds)}"
        if self.has_ended:
            return f"Each pair is decided or alike after {spent}"
        count = counted(len(self._open), "pair")
        is_or_are = "is" if len(self._open) == 1 else "are"
        return f"{count} {is_or_are} open after {spent}; {self._forecast}"

    @property
    def _forecast(self) -> str:
        needed = [pair.units_needed(MOST_UNITS) for pair in self._open]
        known = [units for units in needed if units is not None]
        if len(known) < len(needed):
            return "how many more it takes is not known yet"
        more = max(known) - self.units
        return f"about {counted(more, 'more place')} would decide, {_minutes(self.seconds / self.units * more)}"


def _minutes(seconds: float) -> str:
    if seconds < SECONDS_PER_MINUTE:
        return f"{seconds:.0f} s"
    return f"{seconds / SECONDS_PER_MINUTE:.0f} min"


def run_until_decided(
    draw: Callable[[int], Plan],
    *,
    look: PlanRunner,
    finish: PlanRunner,
    ratio: float,
    budget_s: float,
    tell: Say = lambda _: None,
    clock_s: Callable[[], float] = time.monotonic,
) -> UntilDecided:
    """Run draws of a suite until each pair of estimators is decided or alike within `ratio`, or the budget is used up.

    `draw` gives the plan of each draw, counted from 0. `look` runs one draw, and `finish` all of them together at the
    end, when their results are in the cache; the second writes the reports, with `record`. All estimators run in the
    same units. No draw is begun that would exceed the budget if it took as long as the longest before it; the first one
    always runs. Interrupted, the same call resumes from the cache.

    Raises SuiteError if there are not two estimators to compare.
    """
    began_s = clock_s()
    plans = list[Plan]()
    scores = list[TrialScore]()
    facts = dict[str, CaseFacts]()
    longest_s = 0.0
    while True:
        draw_began_s = clock_s()
        plans.append(draw(len(plans)))
        latest = _only_last(joined(plans), len(plans[-1].simulated))
        folder = look(latest)
        found = folder.scores()
        scores += found
        facts |= {score.case: case_facts(folder, score.case) for score in found}

        cells = make_cells(with_sequence(scores), {}, facts)
        pairs = named_pairs(cells, ratio=ratio)
        if not pairs:
            raise SuiteError("two ranked estimators of one division are required to decide anything between them")
        places = len({each.place for each in facts.values()})
        still_open = open_pairs([pair.known for pair in pairs])
        tell(f"{counted(places, 'place')}: {len(pairs) - len(still_open)} of {counted(len(pairs), 'pair')} settled")

        now_s = clock_s()
        longest_s = max(longest_s, now_s - draw_began_s)
        if not still_open or now_s + longest_s > began_s + budget_s or places >= MOST_UNITS:
            break
    final = finish(joined(plans))
    return UntilDecided(final, tuple(pairs), len(plans), places, clock_s() - began_s)


def _only_last(plan: Plan, count: int) -> Plan:
    """The plan with its last cases only."""
    return replace(plan, simulated=plan.simulated[len(plan.simulated) - count :], recorded=())


def record(folder: RunFolder, *, ratio: float) -> None:
    """Write to a run's folder that its units were drawn until decided: its board is tested accordingly."""
    write_json(folder.path / UNTIL, {"ratio": ratio, "level": DECIDED})


def recorded_ratio(folder: RunFolder) -> float | None:
    """The ratio of a run whose units were drawn until decided; None for any other run."""
    ratio = read_object(folder.path / UNTIL).get("ratio")
    return float(ratio) if isinstance(ratio, int | float) and ratio > 1 else None
