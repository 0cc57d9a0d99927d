"""The plan of a suite: its cases, its estimators, and the trials that combine them."""

import fnmatch
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vobench.errors import UnknownNameError, unknown_name_sentence
from vobench.suite.case import Case
from vobench.suite.catalog import CatalogEntry
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.source import RecordedCase
from vobench.suite.suite_spec import Suite
from vobench.suite.yaml_source import Mistakes, YamlFile

AnyCase = Case | RecordedCase  # a case that is simulated, or one that is a recording


@dataclass(frozen=True, slots=True)
class Trial:
    """One run of one estimator on one case. `repeat` counts from 0, and `hidden` is that of the plan."""

    case: AnyCase
    estimator_entry: EstimatorEntry
    repeat: int
    hidden: tuple[Path, ...] = ()

    @property
    def name(self) -> str:
        """The name of the trial in progress messages."""
        return f"{self.estimator_entry.label} on {self.case.name}"


@dataclass(frozen=True, slots=True)
class Plan:
    """The cases and the estimators of a suite. Every combination is a trial, and some are two: see `trials`.

    `found` lists the scenes, scenarios and estimators that the names in the suite refer to.
    `source` is the file of the suite.
    `hidden` are files and folders that no estimator may see, such as the folder of all runs.
    """

    suite: Suite
    simulated: tuple[Case, ...]
    recorded: tuple[RecordedCase, ...]
    estimator_entries: tuple[EstimatorEntry, ...]
    found: tuple[CatalogEntry, ...]
    source: YamlFile
    hidden: tuple[Path, ...] = ()

    @property
    def cases(self) -> tuple[AnyCase, ...]:
        """All cases, simulated ones first."""
        return *self.simulated, *self.recorded

    def trials(self, case: AnyCase) -> list[Trial]:
        """Every trial on one case.

        The repeats of a simulated case are cases of their own, with new noise. A recording is always the same, so only
        an estimator that is not deterministic is repeated on it. A suite with repeats runs each deterministic estimator
        twice on one case or recording, which tests whether it is deterministic.
        """
        trials = list[Trial]()
        for entry in self.estimator_entries:
            for repeat in self._repeats(case, entry):
                trials.append(Trial(case, entry, repeat, self.hidden))
        return trials

    def _repeats(self, case: AnyCase, entry: EstimatorEntry) -> range:
        """The numbers of the trials of an estimator on a case."""
        is_deterministic = entry.manifest.deterministic
        first = 0
        count = 1
        if isinstance(case, Case):
            first = case.repeat
        elif not is_deterministic:
            count = self.suite.repeats
        if is_deterministic and self.suite.repeats > 1 and case.name == self.cases[0].name:
            count = 2
        return range(first, first + count)

    def only(self, cases: Collection[str], scenes: Collection[str]) -> "Plan":
        """The plan with only the cases whose name matches one of `cases`, and whose scene matches one of `scenes`.

        Both are collections of globs. An empty collection selects everything. The name of a case selects its repeats,
        too. Raises UnknownNameError for a glob without a match.
        """
        _require_matches("case", cases, (case.name for case in self.cases))
        _require_matches("scene", scenes, (_scene_name(case) for case in self.cases))

        def is_selected(case: AnyCase) -> bool:
            is_named = _matches_any(case.name, cases) or _matches_any(_first_name(case), cases)
            return is_named and _matches_any(_scene_name(case), scenes)

        simulated = tuple(filter(is_selected, self.simulated))
        recorded = tuple(filter(is_selected, self.recorded))
        return replace(self, simulated=simulated, recorded=recorded)

    def limited(self, **limits: Any) -> "Plan":
        """The plan with the given limits for every estimator."""
        entries = list[EstimatorEntry]()
        for entry in self.estimator_entries:
            entries.append(replace(entry, limits=replace(entry.limits, **limits)))
        return replace(self, estimator_entries=tuple(entries))

    def mistakes(self) -> Mistakes:
        """An empty list of mistakes in the suite's file."""
        return Mistakes(self.source)


def _scene_name(case: AnyCase) -> str:
    return case.variant.get("scene", "")


def _first_name(case: AnyCase) -> str:
    """The name of the case that this one repeats, or else its own name."""
    return (isinstance(case, Case) and case.repeat_of) or case.name


def _matches_any(name: str, patterns: Collection[str]) -> bool:
    """Whether a name matches one of the patterns. Without patterns, every name matches."""
    return not patterns or any(fnmatch.fnmatch(name, pattern) for pattern in patterns)


def _require_matches(kind: str, patterns: Iterable[str], names: Iterable[str]) -> None:
    """Raise UnknownNameError for a pattern that matches no name."""
    known_names = sorted(set(names))
    for pattern in patterns:
        if not fnmatch.filter(known_names, pattern):
            raise UnknownNameError(unknown_name_sentence(kind, pattern, known_names))
