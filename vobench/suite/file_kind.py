"""Tells suites, scenarios, scenes and estimators' manifests apart by their keys, to say so where one is mistaken."""

import os
import re
from collections.abc import Collection
from pathlib import Path
from typing import Literal

from vobench.asset import MODEL_SUFFIXES

Kind = Literal["scene", "suite", "scenario", "estimator"]
# Keys of the top level that files of one kind alone have.
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
    """The kind of file that has most of these keys of the top level; None where no key tells."""
    counts = {kind: len(marks & set(keys)) for kind, marks in MARKS.items()}
    likeliest = max(counts, key=lambda kind: counts[kind])
    return likeliest if counts[likeliest] else None


def kind_in(path: Path) -> Kind | None:
    """The kind of a YAML file by the keys at the starts of its lines, without parsing it; None where no key tells."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    return kind_of(TOP_LEVEL_KEY.findall(text))


def mistaken_for(wanted: Kind, path: Path, keys: Collection[str]) -> str | None:
    """What to say of a file with these keys where one of another kind is wanted; None if it may be what is wanted."""
    if MARKS[wanted] & set(keys):
        return None
    found = kind_of(keys)
    if found is None:
        return None
    return f"this is {NOUNS[found]}, not {NOUNS[wanted]}; {_what_to_do(found, path)}"


def model_mistaken_for(wanted: Kind, path: Path) -> str | None:
    """What to say of a model's file where a YAML file is wanted; None if it is no model."""
    if path.suffix.lower() not in MODEL_SUFFIXES:
        return None
    return f"this is a model, not {NOUNS[wanted]}; look it over with `vobench scene {shown(path)}`"


def shown(path: Path) -> str:
    """A path as somebody here would type it: relative where it is below the working directory."""
    whole = path.resolve()
    here = Path.cwd()
    return os.path.relpath(whole, here) if whole.is_relative_to(here) else str(whole)


def _what_to_do(found: Kind, path: Path) -> str:
    match found:
        case "suite":
            return f"run it with `vobench run {shown(path)}`"
        case "scene":
            return f"draw it with `vobench render {shown(path)}`"
        case "scenario":
            return f"name it in a suite, as in `scenarios: {{{path.stem}: [1, 3, 5]}}`"
        case "estimator":
            return f"run it with `vobench run quickstart -e {shown(path.parent)}`"
