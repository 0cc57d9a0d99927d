"""Creates suites and scenes, from a commented template or as a copy."""

import re
import shutil
from pathlib import Path

from vobench.asset import MODEL_SUFFIXES
from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.suite import catalog
from vobench.suite.catalog import CatalogEntry

TEMPLATES = Path(__file__).parent / "templates"
NAME_LINE = re.compile(r"^name\s*:\s*[^\s#]+", re.MULTILINE)


def require_name(name: str) -> None:
    """Raise InputError unless a name is valid for a new suite or scene."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(
            f"a name should consist of lower-case letters, digits and _, and begin with a letter (got {name!r})"
        )


def require_free(path: Path) -> None:
    """Raise InputError if a file or a folder exists at the path."""
    if path.exists():
        raise InputError(f"already exists; choose another name, or remove it: {path}")


def new_suite(name: str, *, out: Path = Path("suites"), source: str | None = None) -> Path:
    """Write a suite to out/<name>.yaml, and return its path.

    `source` is the name or path of the suite or example to copy; without it, a commented template is used.

    Raises:
        InputError: The name is not valid, or taken.
        UnknownNameError: There is no suite or example with the name `source`.
    """
    require_name(name)
    path = out / f"{name}.yaml"
    require_free(path)
    original = _suite_or_example(source).path if source else TEMPLATES / "suite.yaml"
    text = _renamed(original, name)
    out.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def new_scene(name: str, *, out: Path = Path("scenes"), source: str | None = None) -> Path:
    """Write a scene, and return the path of its YAML file.

    `source` is the name or path of the scene to copy; without it, a commented template is used. The copy is
    out/<name>.yaml, or out/<name>/scene.yaml with all files beside it if the original has a folder of its own.

    Raises:
        InputError: The name is not valid or taken, or `source` is a model.
        UnknownNameError: There is no scene with the name `source`.
    """
    require_name(name)
    file = out / f"{name}.yaml"
    folder = out / name
    require_free(file)
    require_free(folder)
    original = catalog.find("scene", source).path if source else TEMPLATES / "scene.yaml"
    if original.suffix.lower() in MODEL_SUFFIXES:
        raise InputError(
            f"a model has no YAML to copy; run `vobench new scene {name}` and add `meshes: [{{file: {original}}}]`"
        )
    text = _renamed(original, name)
    out.mkdir(parents=True, exist_ok=True)
    if original.name == "scene.yaml" and source:
        shutil.copytree(original.parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
        file = folder / "scene.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def _suite_or_example(name: str) -> CatalogEntry:
    """The example with this name, or else the suite. Raises UnknownNameError."""
    examples = {entry.name: entry for entry in catalog.examples()}
    if name in examples:
        return examples[name]
    try:
        return catalog.find("suite", name)
    except UnknownNameError:
        if "/" in name or name.endswith(".yaml"):
            raise
    suite_names = {entry.name for entry in catalog.entries("suite")}
    known_names = sorted(suite_names | examples.keys())
    raise UnknownNameError(unknown_name_sentence("suite or example", name, known_names))


def _renamed(original: Path, name: str) -> str:
    """The text of a file in which the name is replaced, also in comments."""
    text = original.read_text(encoding="utf-8")
    if original.parent == TEMPLATES:
        return text.replace("NAME", name)
    text = text.replace(f"examples/{original.stem}.yaml", name)
    return NAME_LINE.sub(f"name: {name}", text, count=1)
