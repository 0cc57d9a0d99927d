"""Tells suites, scenarios, scenes and estimators' manifests apart by their keys."""

import os
import re
from collections.abc import Collection
from pathlib import Path
from typing import Literal

from vobench.asset import MODEL_SUFFIXES

Kind = Literal["scene", "suite", "scenario", "estimator"]
# Top-level keys that only files of one kind have.
MARKS: dict[Kind, frozenset[str]] = {
    "suite": frozenset(
        {"estimators", "scenes", "scenarios", "source", "rigs", "trajectories", "cameras", "lightings", "repeats"}
    ),
    "scenario": frozenset({"base", "severity"}),
    "scene": frozenset(
        {"white_cd_m2", "room", "lamps", "materials", "furniture", "boxes", "boards", "meshes", "maker", "sun", "sky"}
    ),
    "estimator": frozenset({"class", "command", "stream", "needs", "pose_of", "params"}),
}
NOUNS: dict[Kind, str] = {
    "suite": "a suite",
    "scenario": "a scenario",
    "scene": "a scene",
    "estimator": "an estimator's manifest",
}
TOP_LEVEL_KEY = re.compile(r"^(\w+)\s*:", re.MULTILINE)


def kind_of(keys: Collection[str]) -> Kind | None:
    """The kind of file that most of these top-level keys belong to; None if none of them tells."""
    counts = {kind: len(marks & set(keys)) for kind, marks in MARKS.items()}
    likeliest = max(counts, key=lambda kind: counts[kind])
    return likeliest if counts[likeliest] else None


def kind_in(path: Path) -> Kind | None:
    """The kind of a YAML file by the keys at the starts of its lines, without parsing; None if none of them tells."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    return kind_of(TOP_LEVEL_KEY.findall(text))


def about_other_kind(wanted: Kind, path: Path, keys: Collection[str]) -> str | None:
    """The sentence about a file whose keys are those of another kind; None if it may be of the wanted kind."""
    if MARKS[wanted] & set(keys):
        return None
    actual = kind_of(keys)
    if actual is None:
        return None
    return f"this is {NOUNS[actual]}, not {NOUNS[wanted]}; {_advice(actual, path)}"


def about_model(wanted: Kind, path: Path) -> str | None:
    """The sentence about a model's file that was given in place of a YAML file; None if it is not a model."""
    if path.suffix.lower() not in MODEL_SUFFIXES:
        return None
    return f"this is a model, not {NOUNS[wanted]}; inspect it with `vobench scene {display_path(path)}`"


def display_path(path: Path) -> str:
    """A path as a user would type it: relative if it is below the working directory."""
    absolute = path.resolve()
    working_folder = Path.cwd()
    if absolute.is_relative_to(working_folder):
        return os.path.relpath(absolute, working_folder)
    return str(absolute)


def _advice(kind: Kind, path: Path) -> str:
    match kind:
        case "suite":
            return f"run it with `vobench run {display_path(path)}`"
        case "scene":
            return f"render it with `vobench render {display_path(path)}`"
        case "scenario":
            return f"add it to a suite, as in `scenarios: {{{path.stem}: [1, 3, 5]}}`"
        case "estimator":
            return f"run it with `vobench run quickstart -e {display_path(path.parent)}`"
