"""Draws of a suite: the same suite in other places, on other drives, by other seeds."""

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from vobench.errors import SuiteError
from vobench.suite.case import Case
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan
from vobench.suite.suite_spec import Suite

# Base seeds are drawn so far apart that places and drives of two draws have different seeds.
SEEDS_PER_DRAW = 10_000
DRAWS = 199_000


def random_base_seed() -> int:
    """A base seed that nobody can know in advance."""
    return SEEDS_PER_DRAW * (1 + secrets.randbelow(DRAWS))


@dataclass(frozen=True, slots=True)
class Draws:
    """The plans of a suite with consecutive seeds: each has the places and drives that follow those of the one before.

    `changes` are those of `read_plan`. They may contain the base seed of the first plan.
    """

    suite: str
    changes: Mapping[str, str]
    only_estimators: tuple[str, ...] = ()

    def plan(self, number: int) -> Plan:
        """The plan of a draw, counted from 0. The seed of all noise counts, too.

        Raises SuiteError if the suite is wrong, or if it has no places that can be drawn.
        """
        first = read_plan(self.suite, only_estimators=self.only_estimators, changes=self.changes)
        seeds = _seeds(first.suite)
        if number == 0:
            return first
        seeds_before = number * seeds
        changes = {
            **self.changes,
            "base_seed": str(first.suite.base_seed + seeds_before),
            "seed": str(first.suite.seed + number),
        }
        return read_plan(self.suite, only_estimators=self.only_estimators, changes=changes)


def _seeds(suite: Suite) -> int:
    """The number of seeds that one draw of a suite uses up. Raises SuiteError if it has no places with seeds."""
    of_scenes = [entry.seeds or 0 for entry in suite.scenes or ()]
    if not any(of_scenes):
        raise SuiteError(
            "fresh units require places that can be drawn, and the suite has none; "
            "give a scene seeds, as in scenes: [{name: flat, seeds: 4}]"
        )
    of_drives = [getattr(drive, "seeds", None) or 0 for drive in (suite.trajectories or {}).values()]
    return max([*of_scenes, *of_drives])


def joined(plans: Sequence[Plan]) -> Plan:
    """One plan with the cases of several draws of a suite.

    The number of the draw is added to the names of cases that collide.
    """
    taken = set[str]()
    cases = list[Case]()
    for number, plan in enumerate(plans):
        for case in plan.simulated:
            name = f"{case.name}-draw{number}" if case.name in taken else case.name
            taken.add(name)
            repeat_of = case.repeat_of
            if repeat_of is not None and name != case.name:
                repeat_of = f"{repeat_of}-draw{number}"
            cases.append(replace(case, name=name, repeat_of=repeat_of))
    return replace(plans[0], simulated=tuple(cases))
