"""New suites and scenes: a commented file that works as it is, or a copy of one that there is."""

import re
import shutil
from pathlib import Path

from vobench.asset import MODEL_SUFFIXES
from vobench.errors import InputError, UnknownNameError, unknown
from vobench.suite import catalog
from vobench.suite.catalog import Entry

TEMPLATES = Path(__file__).parent / "templates"
NAME_LINE = re.compile(r"^name\s*:\s*[^\s#]+", re.MULTILINE)


def require_name(name: str) -> None:
    """Raise InputError for a name that cannot be that of a new file."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"a name should be lower-case letters, digits and _, a letter first (got {name!r})")


def require_free(path: Path) -> None:
    """Raise InputError where there is a file or a folder already."""
    if path.exists():
        raise InputError(f"there is one already; choose another name or take it away: {path}")


def new_suite(name: str, *, out: Path = Path("suites"), source: str | None = None) -> Path:
    """Write out/<name>.yaml, a suite; return its path.

    `source` names the suite or the example that is copied, or is its path; without it, it is a commented template.

    Raises:
        InputError: The name is not possible or taken.
        UnknownNameError: There is no suite or example called `source`.
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
    """Write a scene; return the path of its YAML file.

    `source` names the scene that is copied, or is its path; without it, it is a commented template. The copy is
    out/<name>.yaml, or out/<name>/scene.yaml with all files beside it where the original is in a folder of its own.

    Raises:
        InputError: The name is not possible or taken, or `source` is a model.
        UnknownNameError: There is no scene called `source`.
    """
    require_name(name)
    file = out / f"{name}.yaml"
    folder = out / name
    require_free(file)
    require_free(folder)
    original = catalog.find("scene", source).path if source else TEMPLATES / "scene.yaml"
    if original.suffix.lower() in MODEL_SUFFIXES:
        raise InputError(
            f"a model has no YAML to copy; `vobench new scene {name}`, and give it `meshes: [{{file: {original}}}]`"
        )
    text = _renamed(original, name)
    out.mkdir(parents=True, exist_ok=True)
    if original.name == "scene.yaml" and source:
        shutil.copytree(original.parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
        file = folder / "scene.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def _suite_or_example(name: str) -> Entry:
    """The example of this name, else the suite. Raises UnknownNameError."""
    examples = {entry.name: entry for entry in catalog.examples()}
    if name in examples:
        return examples[name]
    try:
        return catalog.find("suite", name)
    except UnknownNameError:
        if "/" in name or name.endswith(".yaml"):
            raise
    suites = {entry.name for entry in catalog.entries("suite")}
    raise UnknownNameError(unknown("suite or example", name, sorted(suites | examples.keys())))


def _renamed(original: Path, name: str) -> str:
    """The text of a file with another name, which its comments about commands use too."""
    text = original.read_text(encoding="utf-8")
    if original.parent == TEMPLATES:
        return text.replace("NAME", name)
    text = text.replace(f"examples/{original.stem}.yaml", name)
    return NAME_LINE.sub(f"name: {name}", text, count=1)
