"""Reads a suite and creates its plan."""

from collections import Counter
from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from vobench.errors import SuiteError
from vobench.setting import hints
from vobench.suite import catalog, yaml_file
from vobench.suite.case import with_repeats
from vobench.suite.estimator_entry import EstimatorEntryReader
from vobench.suite.lookup import Lookup
from vobench.suite.plan import Plan
from vobench.suite.scenario_case import ScenarioCases
from vobench.suite.source import RecordedCase, recorded_cases
from vobench.suite.suite_case import Axes, AxisReader, Variant
from vobench.suite.suite_spec import Suite, missing_axis
from vobench.suite.yaml_source import Mistakes


def read_plan(
    name: str, *, only_estimators: tuple[str, ...] = (), changes: Mapping[str, str] = MappingProxyType({})
) -> Plan:
    """The plan of a suite, given its name or path. Nothing is simulated, and no estimator is imported.

    `only_estimators` are labels, globs of labels, or names of other estimators.
    `changes` are those of `yaml_file.read_all`.

    Raises SuiteError with all mistakes, or UnknownNameError.
    """
    path = catalog.find("suite", name).path
    reading = yaml_file.read_all(path, Suite, changes, kind="suite")
    mistakes = Mistakes(reading.source, list(reading.mistakes))
    with mistakes.at():
        _require_axes(reading.source.plain, mistakes)
    return _plan(reading.model, mistakes, only_estimators)


def _require_axes(content: Mapping[str, Any], mistakes: Mistakes) -> None:
    """Raise SuiteError if an incomplete suite also lacks an axis. A misspelt key counts as the most similar key."""
    intended_keys = set[str]()
    for key in content:
        intended_keys.update(get_close_matches(str(key), hints(Suite), n=1))
    missing = missing_axis(intended_keys)
    if mistakes.recorded and missing:
        raise SuiteError(missing)


def _plan(suite: Suite, mistakes: Mistakes, only_estimators: tuple[str, ...]) -> Plan:
    """The plan of a suite, which may be incomplete. Raises SuiteError with all mistakes."""
    lookup = Lookup(mistakes.source.path.resolve())
    estimator_reader = EstimatorEntryReader(suite, mistakes, lookup)
    estimator_entries = estimator_reader.only(only_estimators) if only_estimators else estimator_reader.all()

    axis_reader = AxisReader(suite, mistakes, lookup)
    scenes = axis_reader.scenes()
    replayed = axis_reader.replayed_poses()
    axes = axis_reader.axes(scenes, axis_reader.rigs())
    variants = _variants(suite, axis_reader, axes)
    scenario_cases = ScenarioCases(suite, mistakes, lookup, axes, replayed).all()
    simulated_names = [variant.name for variant in variants] + [case.name for case in scenario_cases]
    with mistakes.at("scenarios"):
        _require_distinct(simulated_names)
    recorded = _recorded_cases(suite, mistakes, set(simulated_names))

    mistakes.require_none()
    axis_cases = [axis_reader.case(variant, axes, replayed) for variant in variants]
    simulated = tuple(with_repeats((*axis_cases, *scenario_cases), suite.repeats))
    with mistakes.at("repeats"):
        _require_distinct([case.name for case in simulated])
    mistakes.require_none()
    return Plan(suite, simulated, recorded, estimator_entries, tuple(lookup.entries), mistakes.source)


def _variants(suite: Suite, axis_reader: AxisReader, axes: Axes) -> list[Variant]:
    """The cases of the axes: all combinations, or those of a design; none if the design spreads scenarios."""
    if suite.spread is None:
        return axis_reader.variants(axes)
    variants = list[Variant]()
    if not suite.scenarios and not axis_reader.mistakes.recorded:
        with axis_reader.mistakes.at("spread"):
            variants = axis_reader.spread_variants(axes, suite.spread)
    return variants


def _require_distinct(names: list[str]) -> None:
    """Raise SuiteError if two cases have the same name."""
    for name, count in Counter(names).items():
        if count > 1:
            raise SuiteError(f"two cases are called '{name}'; rename a variant of an axis")


def _recorded_cases(suite: Suite, mistakes: Mistakes, simulated_names: set[str]) -> tuple[RecordedCase, ...]:
    """The recordings of a suite. A recording with the same name as another case is a mistake."""
    folder = mistakes.source.path.parent
    recorded = list[RecordedCase]()
    for index, spec in enumerate(suite.source):
        with mistakes.at("source", index):
            recorded += recorded_cases(spec, folder, entry=index)

    taken_names = set(simulated_names)
    for case in recorded:
        with mistakes.at("source", case.entry):
            if case.name in taken_names:
                raise SuiteError(f"two cases are called '{case.name}'; rename one of them: {case.source.path}")
        taken_names.add(case.name)
    return tuple(recorded)
