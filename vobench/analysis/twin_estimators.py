"""The estimators of a twin: the usual ones, and those that a user names by label, by name or as an entry of a suite."""

import fnmatch
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vobench.errors import InputError, SuiteError
from vobench.suite.estimator_entry import EstimatorEntryReader
from vobench.suite.lookup import Lookup
from vobench.suite.suite_spec import Suite
from vobench.suite.validation_message import validation_mistakes
from vobench.suite.yaml_file import checked, json_schema
from vobench.suite.yaml_parser import parse_text
from vobench.suite.yaml_source import Mistakes, YamlFile, plain_tree

Entry = str | Mapping[str, Any]  # of the list of estimators of a suite

# Five different estimators, and two of them with other parameters.
USUAL_ESTIMATORS: tuple[Entry, ...] = (
    "lk_epipolar",
    {"name": "lk_epipolar", "label": "lk_epipolar_plain", "params": {"estimate_offset": 0}},
    "stereo_pnp",
    "feature_vo",
    "mono_vo",
    {"name": "stereo_pnp", "label": "stereo_pnp_wide", "params": {"window_px": 21}},
    "stand_still",
)
FEWEST_RANKED = 3
OPTION = Path("-e")  # that mistakes name in place of a file


def twin_estimators(wanted: Sequence[str] = ()) -> list[Entry]:
    """The entries of a suite for the wanted estimators; the usual ones if none is named.

    Each is the label of a usual estimator, which may be a glob, the name or folder of any other one, or an entry of a
    suite in YAML, such as `{name: stereo_pnp, label: wide, params: {window_px: 21}}`.

    Raises InputError if there are fewer than three, UnknownNameError, and SuiteError for a wrong entry.
    """
    entries = list[Entry]()
    for text in wanted:
        entries += _entries_of(text)
    if not wanted:
        entries += USUAL_ESTIMATORS
    if len(entries) < FEWEST_RANKED:
        raise InputError(f"an order needs {FEWEST_RANKED} estimators or more, and -e names {len(entries)}")
    _require_correct(entries)
    return entries


def _entries_of(text: str) -> list[Entry]:
    """The entries for one wanted estimator."""
    if text.lstrip().startswith("{"):
        entry = plain_tree(parse_text(OPTION, text).tree)
        return [entry]
    labelled = {_label(entry): entry for entry in USUAL_ESTIMATORS}
    matching = fnmatch.filter(labelled, text)
    return [labelled[label] for label in matching] or [text]


def _label(entry: Entry) -> str:
    return entry if isinstance(entry, str) else str(entry["label"])


def _require_correct(entries: Sequence[Entry]) -> None:
    """Raise UnknownNameError or SuiteError if a suite could not have these estimators."""
    content = {"name": "twin", "scenes": ["office"], "estimators": list(entries)}
    source = YamlFile(OPTION, content)
    try:
        suite = checked(Suite, content)
    except ValidationError as error:
        raise SuiteError(*validation_mistakes(source, error, json_schema(Suite))) from None
    mistakes = Mistakes(source)
    EstimatorEntryReader(suite, mistakes, Lookup(Path.cwd() / OPTION)).all()
    mistakes.require_none()
