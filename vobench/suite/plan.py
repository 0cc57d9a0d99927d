"""The plan of a suite: its cases, its estimators, and the trials that combine them."""

import fnmatch
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any

from vobench.errors import UnknownNameError, unknown_name_sentence
from vobench.suite.case import Case
from vobench.suite.catalog import CatalogEntry
from vobench.suite.entrant import EstimatorEntry
from vobench.suite.source import RecordedCase
from vobench.suite.suite_spec import Suite
from vobench.suite.yaml_source import Mistakes, YamlFile


@dataclass(frozen=True, slots=True)
class Trial:
    """One run of one entrant on one case; `repeat` counts from 0."""

    case: Case | RecordedCase
    entrant: EstimatorEntry
    repeat: int

    @property
    def name(self) -> str:
        """The trial's name in progress messages."""
        return f"{self.entrant.label} on {self.case.name}"


@dataclass(frozen=True, slots=True)
class Plan:
    """The cases × entrants × repeats of a suite.

    `found` lists the scenes and estimators that the suite's names refer to; `source` is the suite's file.
    """

    suite: Suite
    simulated: tuple[Case, ...]
    recorded: tuple[RecordedCase, ...]
    entrants: tuple[EstimatorEntry, ...]
    found: tuple[CatalogEntry, ...]
    source: YamlFile

    @property
    def cases(self) -> tuple[Case | RecordedCase, ...]:
        """All cases, simulated ones first."""
        return *self.simulated, *self.recorded

    def trials(self, case: Case | RecordedCase) -> list[Trial]:
        """Every trial on one case."""
        return [Trial(case, entrant, repeat) for entrant in self.entrants for repeat in range(self.suite.repeats)]

    def only(self, cases: Collection[str], scenes: Collection[str]) -> "Plan":
        """The plan restricted to cases whose names match any of `cases`, and whose scenes match any of `scenes`.

        Both are globs; an empty collection selects everything. Raises UnknownNameError for a pattern without a match.
        """
        _require_matches("case", cases, (case.name for case in self.cases))
        _require_matches("scene", scenes, (_scene_name(case) for case in self.cases))

        def is_selected(case: Case | RecordedCase) -> bool:
            return _matches_any(case.name, cases) and _matches_any(_scene_name(case), scenes)

        simulated = tuple(filter(is_selected, self.simulated))
        recorded = tuple(filter(is_selected, self.recorded))
        return replace(self, simulated=simulated, recorded=recorded)

    def limited(self, **limits: Any) -> "Plan":
        """The plan with these values in every entrant's Limits."""
        entrants = list[EstimatorEntry]()
        for entrant in self.entrants:
            entrants.append(replace(entrant, limits=replace(entrant.limits, **limits)))
        return replace(self, entrants=tuple(entrants))

    def mistakes(self) -> Mistakes:
        """An empty list of mistakes in the suite's file."""
        return Mistakes(self.source)


def _scene_name(case: Case | RecordedCase) -> str:
    return case.variant.get("scene", "")


def _matches_any(name: str, patterns: Collection[str]) -> bool:
    """Whether a name matches one of the patterns; without patterns every name does."""
    return not patterns or any(fnmatch.fnmatch(name, pattern) for pattern in patterns)


def _require_matches(kind: str, patterns: Iterable[str], names: Iterable[str]) -> None:
    """Raise UnknownNameError for a pattern that no name matches."""
    known_names = sorted(set(names))
    for pattern in patterns:
        if not fnmatch.filter(known_names, pattern):
            raise UnknownNameError(unknown_name_sentence(kind, pattern, known_names))
