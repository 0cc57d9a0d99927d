"""Reads the estimators of a suite, with their parameters, limits and modes."""

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vobench.errors import SuiteError, unknown_name_sentence
from vobench.estimator.manifest import USUAL, Limits, Manifest
from vobench.setting import nearest_whole
from vobench.suite.lookup import Lookup
from vobench.suite.manifest import read_manifest
from vobench.suite.suite_spec import EstimatorSettings, Mode, Suite
from vobench.suite.yaml_source import Mistakes


@dataclass(frozen=True, slots=True)
class EstimatorEntry:
    """An entry in a suite's list of estimators: the estimator's folder, manifest, parameters and limits.

    In mode `step`, the estimator gets the next frame when it has finished the previous one. In mode `real_time`, it
    gets each frame when a camera would deliver it.
    """

    label: str
    folder: Path
    manifest: Manifest
    params: dict[str, Any]
    limits: Limits = USUAL
    mode: Mode = "step"

    @property
    def claims(self) -> tuple[str, ...]:
        """The claims that the leaderboard shows beside the label."""
        if self.mode == "real_time":
            return (*self.manifest.claims, "real time")
        return tuple(self.manifest.claims)


@dataclass(frozen=True, slots=True)
class EstimatorEntryReader:
    """Reads the estimators of a suite, which may be incomplete, and collects mistakes."""

    suite: Suite
    mistakes: Mistakes
    lookup: Lookup

    def all(self) -> tuple[EstimatorEntry, ...]:
        """Every estimator that the suite lists, in each of its modes."""
        entries = list[EstimatorEntry]()
        for index, spec in enumerate(self._specs()):
            with self.mistakes.at("estimators", index):
                entries += self._in_each_mode(self._read(spec, index), entries)
        return tuple(entries)

    def only(self, names: Sequence[str]) -> tuple[EstimatorEntry, ...]:
        """The estimators of the suite with the given labels, which may be globs.

        A name without a match refers to another estimator, which is run with its defaults. Raises UnknownNameError and
        SuiteError instead of collecting mistakes, because the names are not in the suite.
        """
        index_by_label = dict[str, int]()
        for index, spec in enumerate(self._specs()):
            index_by_label.setdefault(spec.label or spec.name, index)

        entries = list[EstimatorEntry]()
        for label in self._labels_matching(names):
            index_in_suite = index_by_label.get(label)
            spec = EstimatorSettings(name=label) if index_in_suite is None else self._specs()[index_in_suite]
            entries += self._in_each_mode(self._read(spec, index_in_suite), entries)
        return tuple(entries)

    def _specs(self) -> tuple[EstimatorSettings, ...]:
        return getattr(self.suite, "estimators", ())

    def _labels_matching(self, names: Sequence[str]) -> list[str]:
        """The labels in the suite that match the names. A name without a match is returned itself."""
        known_labels = [spec.label or spec.name for spec in self._specs()]
        labels = list[str]()
        for name in names:
            labels += fnmatch.filter(known_labels, name) or [name]
        return labels

    def _in_each_mode(self, entry: EstimatorEntry, earlier: Sequence[EstimatorEntry]) -> list[EstimatorEntry]:
        """The entry in each mode of the suite. The label contains the mode, except for the first mode."""
        modes = tuple(dict.fromkeys(getattr(self.suite, "modes", ("step",))))
        taken_labels = [other.label for other in earlier]
        entries = list[EstimatorEntry]()
        for mode in modes:
            label = entry.label if mode == modes[0] else f"{entry.label}.{mode}"
            if label in taken_labels:
                raise SuiteError(f"two estimators are called '{label}'; give one of them another label")
            entries.append(replace(entry, label=label, mode=mode))
        return entries

    def _read(self, spec: EstimatorSettings, index: int | None) -> EstimatorEntry:
        """The entry for a section of the suite. Raises VobenchError if there is no such estimator."""
        folder = self.lookup.find("estimator", spec.name).path
        manifest = read_manifest(folder)

        for key, value in spec.params.items():
            with self.mistakes.at("estimators", index or 0, "params", key):
                _check_parameter(key, value, manifest.params)

        limits = manifest.limits
        for key, value in spec.limits.items():
            with self.mistakes.at("estimators", index or 0, "limits"):
                limits = _with_limit(limits, key, value)

        params = {**manifest.params, **spec.params}
        return EstimatorEntry(spec.label or manifest.name, folder, manifest, params, limits)


def _with_limit(limits: Limits, key: str, value: float) -> Limits:
    """The limits with another value for one of them. Raises SuiteError if the value should be an integer but is not."""
    new_value: float | None = value
    if isinstance(getattr(limits, key), int):
        new_value = nearest_whole(value)
    if new_value is None:
        raise SuiteError(f"should be a whole number (got {value:g})")
    changed: dict[str, Any] = {key: new_value}
    return replace(limits, **changed)


def _check_parameter(key: str, value: Any, defaults: Mapping[str, Any]) -> None:
    """Raise SuiteError unless the manifest has this parameter, and its default has the type of the value.

    Integers and floats can replace each other. A default of None allows any type.
    """
    if key not in defaults:
        raise SuiteError(unknown_name_sentence("parameter", key, list(defaults)))
    default = defaults[key]
    if default is not None and _parameter_type(default) is not _parameter_type(value):
        raise SuiteError(f"parameter '{key}' should be of the type of its default {default!r}, got {value!r}")


def _parameter_type(value: Any) -> type:
    return int if isinstance(value, float) else type(value)
