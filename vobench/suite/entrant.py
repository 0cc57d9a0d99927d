"""The estimators of a suite, with their parameters, limits and modes."""

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
    """An estimator as it takes part in a suite: its folder, manifest, parameters and limits.

    In mode `step` it receives the next frame when it has finished the previous one, in `real_time` when the camera
    delivers it.
    """

    label: str
    folder: Path
    manifest: Manifest
    params: dict[str, Any]
    limits: Limits = USUAL
    mode: Mode = "step"

    @property
    def claims(self) -> tuple[str, ...]:
        """What a board shows beside the label."""
        if self.mode == "real_time":
            return (*self.manifest.claims, "real time")
        return tuple(self.manifest.claims)


@dataclass(frozen=True, slots=True)
class EntrantReader:
    """Reads the estimators of a suite, of which entries may be missing, and gathers mistakes."""

    suite: Suite
    mistakes: Mistakes
    lookup: Lookup

    def all(self) -> tuple[EstimatorEntry, ...]:
        """Every estimator that the suite lists, in each of its modes."""
        entrants = list[EstimatorEntry]()
        for index, spec in enumerate(self._specs()):
            with self.mistakes.at("estimators", index):
                entrants += self._in_each_mode(self._read(spec, index), entrants)
        return tuple(entrants)

    def only(self, names: Sequence[str]) -> tuple[EstimatorEntry, ...]:
        """The suite's estimators of these labels, which may be globs, or other estimators with their defaults.

        Raises UnknownNameError and SuiteError, because the mistake is not the suite's.
        """
        index_by_label = dict[str, int]()
        for index, spec in enumerate(self._specs()):
            index_by_label.setdefault(spec.label or spec.name, index)

        entrants = list[EstimatorEntry]()
        for label in self._labels_matching(names):
            index_in_suite = index_by_label.get(label)
            spec = EstimatorSettings(name=label) if index_in_suite is None else self._specs()[index_in_suite]
            entrants += self._in_each_mode(self._read(spec, index_in_suite), entrants)
        return tuple(entrants)

    def _specs(self) -> tuple[EstimatorSettings, ...]:
        return getattr(self.suite, "estimators", ())

    def _labels_matching(self, names: Sequence[str]) -> list[str]:
        """The suite's labels that match, or the name itself if none does."""
        known_labels = [spec.label or spec.name for spec in self._specs()]
        labels = list[str]()
        for name in names:
            labels += fnmatch.filter(known_labels, name) or [name]
        return labels

    def _in_each_mode(self, entrant: EstimatorEntry, earlier: Sequence[EstimatorEntry]) -> list[EstimatorEntry]:
        """The entrant in each mode of the suite; modes after the first are part of the label."""
        modes = tuple(dict.fromkeys(getattr(self.suite, "modes", ("step",))))
        taken_labels = [other.label for other in earlier]
        entrants = list[EstimatorEntry]()
        for mode in modes:
            label = entrant.label if mode == modes[0] else f"{entrant.label}.{mode}"
            if label in taken_labels:
                raise SuiteError(f"two estimators are called '{label}'; give one of them another label")
            entrants.append(replace(entrant, label=label, mode=mode))
        return entrants

    def _read(self, spec: EstimatorSettings, index: int | None) -> EstimatorEntry:
        """The entrant with its manifest. Raises VobenchError if there is no such estimator."""
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
    """The limits with another value for one of them. Raises SuiteError for a fraction of what is counted."""
    new_value: float | None = value
    if isinstance(getattr(limits, key), int):
        new_value = nearest_whole(value)
    if new_value is None:
        raise SuiteError(f"should be a whole number (got {value:g})")
    changed: dict[str, Any] = {key: new_value}
    return replace(limits, **changed)


def _check_parameter(key: str, value: Any, defaults: Mapping[str, Any]) -> None:
    """Raise SuiteError unless the manifest has this parameter, with a default of the value's type.

    A whole number may replace a fraction, and the reverse. A default of None allows any type.
    """
    if key not in defaults:
        raise SuiteError(unknown_name_sentence("parameter", key, list(defaults)))
    default = defaults[key]
    if default is not None and _parameter_type(default) is not _parameter_type(value):
        raise SuiteError(f"parameter '{key}' should be of the type of its default {default!r}, got {value!r}")


def _parameter_type(value: Any) -> type:
    return int if isinstance(value, float) else type(value)
