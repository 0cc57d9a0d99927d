"""Recognises suites, scenarios, scenes and estimator manifests by their top-level keys."""

import re
from collections.abc import Collection
from pathlib import Path
from typing import Literal

from vobench.asset import MODEL_SUFFIXES
from vobench.regular_file import read_regular
from vobench.suite.display_path import display_path

Kind = Literal["scene", "suite", "scenario", "estimator"]
# Top-level keys by which a kind is recognised. A key belongs here if only one of the dataclasses Suite, ScenarioFile,
# SceneFile and Manifest has a field of that name, which a test checks, and if the name does not occur in other YAML.
DISTINCTIVE_KEYS: dict[Kind, frozenset[str]] = {
    "suite": frozenset(
        {
            "estimators",
            "scenes",
            "scenarios",
            "source",
            "rigs",
            "trajectories",
            "cameras",
            "lightings",
            "repeats",
        }
    ),
    "scenario": frozenset({"base", "severity"}),
    "scene": frozenset(
        {
            "white_cd_m2",
            "room",
            "lamps",
            "materials",
            "furniture",
            "boxes",
            "boards",
            "meshes",
            "maker",
            "generator",
            "sun",
            "sky",
        }
    ),
    "estimator": frozenset({"class", "command", "stream", "needs", "pose_of", "params"}),
}
KIND_NOUNS: dict[Kind, str] = {
    "suite": "a suite",
    "scenario": "a scenario",
    "scene": "a scene",
    "estimator": "an estimator's manifest",
}
MOST_BYTES = 2 << 20  # the largest YAML file that is read
TOP_LEVEL_KEY = re.compile(r"^(\w+)\s*:", re.MULTILINE)  # a key that is not indented


def kind_of_keys(keys: Collection[str]) -> Kind | None:
    """The kind of file that has the most of these top-level keys; None if no kind has any of them.

    Of two kinds with equally many, it is the one that is first in DISTINCTIVE_KEYS.
    """
    counts = {kind: len(distinctive_keys & set(keys)) for kind, distinctive_keys in DISTINCTIVE_KEYS.items()}
    likeliest = max(counts, key=lambda kind: counts[kind])
    return likeliest if counts[likeliest] > 0 else None


def guessed_kind(path: Path) -> Kind | None:
    """The kind of a YAML file, guessed from the keys that begin its lines without indentation.

    The file is not parsed. None if it cannot be read, or if no kind has any of its keys.
    """
    try:
        text = read_regular(path, most_bytes=MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    return kind_of_keys(TOP_LEVEL_KEY.findall(text))


def wrong_kind_sentence(wanted: Kind, path: Path, keys: Collection[str]) -> str | None:
    """A sentence that names the kind of a file, if it is not the wanted kind.

    None if the file has a key of the wanted kind, or if its kind is unknown.
    """
    has_wanted_key = bool(DISTINCTIVE_KEYS[wanted] & set(keys))
    if has_wanted_key:
        return None
    actual = kind_of_keys(keys)
    if actual is None:
        return None
    return f"this is {KIND_NOUNS[actual]}, not {KIND_NOUNS[wanted]}; {_advice(actual, path)}"


def model_sentence(wanted: Kind, path: Path) -> str | None:
    """A sentence for a 3-D model that was given instead of a YAML file; None if the file is not a model."""
    if path.suffix.lower() not in MODEL_SUFFIXES:
        return None
    return f"this is a model, not {KIND_NOUNS[wanted]}; inspect it with `vobench scene {display_path(path)}`"


def _advice(kind: Kind, path: Path) -> str:
    """How to use a file of this kind."""
    match kind:
        case "suite":
            return f"run it with `vobench run {display_path(path)}`"
        case "scene":
            return f"render it with `vobench render {display_path(path)}`"
        case "scenario":
            return f"add it to a suite, as in `scenarios: {{{path.stem}: [1, 3, 5]}}`"
        case "estimator":
            return f"run it with `vobench run quickstart -e {display_path(path.parent)}`"
