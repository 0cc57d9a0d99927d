"""Finds scenes, suites, scenarios and estimators by name. The first match in the search order is used.

1. Beside the suite that names them: in <kind>s/, then in the folder of the suite
2. ./<kind>s/
3. <folder>/<kind>s/ for each folder of $VOBENCH_PATH
4. Installed entry points (groups vobench.scenes, vobench.suites, vobench.estimators)
5. Entries included with vobench

A suite is a file <name>.yaml. An estimator is a folder <name>/ that contains estimator.yaml. A scene is a file
<name>.yaml, a folder <name>/ that contains scene.yaml, or a model <name>.glb. A scenario is a file <name>.yaml in
suites/scenarios/.
"""

import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from glob import escape
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from vobench.asset import MODEL_SUFFIXES
from vobench.errors import UnknownNameError, unknown_name_sentence
from vobench.regular_file import read_regular
from vobench.suite.display_path import display_path
from vobench.suite.file_kind import MOST_BYTES, Kind, guessed_kind

KINDS: tuple[Kind, ...] = ("suite", "scenario", "scene", "estimator")
# The possible paths of an entry in a folder of its kind; {} is the name.
FORMS: dict[Kind, tuple[str, ...]] = {
    "suite": ("{}.yaml",),
    "scenario": ("{}.yaml",),
    "scene": ("{}.yaml", "{}/scene.yaml", "{}.glb"),
    "estimator": ("{}/estimator.yaml",),
}
WHAT_IT_IS: dict[Kind, str] = {
    "suite": "a suite is a YAML file with scenes and estimators",
    "scenario": "a scenario is a YAML file with a base and severities",
    "scene": "a scene is a YAML file, a folder with a scene.yaml, or a model",
    "estimator": "an estimator is a folder with an estimator.yaml",
}
NOT_NAMES = ("", ".", "..")
BESIDE_SUITE = "beside the suite"
# A line that begins with a key of suites or scenarios which scenes do not have.
OTHER_KEY = re.compile(rb"^(estimators|severity|include)\s*:", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class CatalogEntry:
    """A scene, suite, scenario or estimator: its name, its path, and the step of the search order that found it.

    `path` is the file of a scene, suite or scenario, and the folder of an estimator.
    """

    kind: Kind
    name: str
    path: Path
    origin: str


def hidden_builtins(entries: Iterable[CatalogEntry]) -> list[str]:
    """A sentence on each estimator that hides the built-in estimator of the same name.

    An estimator that is given by its path hides none.
    """
    sentences = []
    for entry in entries:
        if entry.kind != "estimator" or entry.origin == "path":
            continue
        builtin = builtin_root() / "estimators" / entry.name
        if builtin.is_dir() and entry.path.resolve() != builtin.resolve():
            sentences.append(f"{entry.name} is {entry.path}, not the estimator included with vobench")
    return sentences


def builtin_root() -> Path:
    """The folder of the scenes, suites and estimators that are included with vobench."""
    package = Path(__file__).resolve().parents[1]
    in_wheel = package / "builtin"
    return in_wheel if in_wheel.is_dir() else package.parent


def entries(kind: Kind) -> list[CatalogEntry]:
    """All entries of a kind, sorted by name.

    If several entries have the same name, the one that is used comes first.
    """
    by_path: dict[Path, CatalogEntry] = {}
    for entry in _search(kind):
        by_path.setdefault(entry.path, entry)
    return sorted(by_path.values(), key=lambda entry: entry.name)


def find(kind: Kind, name: str, *, suite: Path | None = None) -> CatalogEntry:
    """The entry with the given name or path. A name that contains a slash or a suffix is a path.

    `suite` is the file that refers to the entry. Names and relative paths are looked up beside it first.
    Raises UnknownNameError with the nearest known name and all known names.
    """
    path = Path(name)
    has_suffix = path.suffix in {".yaml", ".yml", *MODEL_SUFFIXES}
    if has_suffix or "/" in name or os.sep in name:
        return _entry_at(kind, path, suite)
    for entry in _search(kind, suite, name=name):
        return entry
    if name not in NOT_NAMES and path.is_dir():
        raise UnknownNameError(_about_folder(kind, path))
    raise UnknownNameError(unknown_name_sentence(kind, name, _known_names(kind, suite)))


def examples() -> list[CatalogEntry]:
    """The example suites that `vobench new suite` can copy. `find` does not find them."""
    return [*_in_folder("suite", builtin_root() / "examples", "example", None)]


def _about_folder(kind: Kind, folder: Path) -> str:
    """A sentence about a folder that was given where a name or a file is expected."""
    holds_scene = kind == "scene" and (folder / "scene.yaml").is_file()
    holds_estimator = kind == "estimator" and (folder / "estimator.yaml").is_file()
    if holds_scene or holds_estimator:
        return f"no {kind} named '{folder}'; to use the folder, write ./{folder}"
    inside = [entry for entry in _in_folder(kind, folder, "", None) if _is_of_kind(kind, entry.path)]
    paths = ", ".join(display_path(entry.path) for entry in inside)
    contents = f"it contains {paths}" if inside else f"it contains no {kind}"
    return f"{display_path(folder)} is a folder, and {WHAT_IT_IS[kind]}; {contents}"


def _is_of_kind(kind: Kind, path: Path) -> bool:
    """Whether the keys of a file are those of a kind."""
    if path.is_dir() or path.suffix.lower() in MODEL_SUFFIXES:
        return True
    return guessed_kind(path) == kind


def _entry_at(kind: Kind, path: Path, suite: Path | None) -> CatalogEntry:
    """The entry at a path. Raises UnknownNameError."""
    path = _entry_path(kind, path, suite)
    if path.is_dir() and kind != "estimator":
        raise UnknownNameError(_about_folder(kind, path))
    file = path / "estimator.yaml" if kind == "estimator" else path
    if not file.is_file():
        known = ", ".join(_known_names(kind, suite)) or "none"
        raise UnknownNameError(f"no {kind} file at {file}. Known by name: {known}")
    resolved = path.resolve()
    return CatalogEntry(kind, _name_of(kind, resolved), resolved, "path")


def _entry_path(kind: Kind, written: Path, suite: Path | None) -> Path:
    """The path of an entry as it is stored in CatalogEntry. A relative path may start at the folder of the suite."""
    path = written
    if suite and not path.exists() and (suite.parent / path).exists():
        path = suite.parent / path
    if kind == "estimator" and path.name == "estimator.yaml":
        return path.parent
    if kind == "scene" and (path / "scene.yaml").is_file():
        return path / "scene.yaml"
    return path


def _known_names(kind: Kind, suite: Path | None) -> list[str]:
    return sorted({entry.name for entry in _search(kind, suite)})


def _search(kind: Kind, suite: Path | None = None, *, name: str | None = None) -> Iterator[CatalogEntry]:
    """All entries of a kind, or those with one name, in the search order."""
    kind_folder = "suites/scenarios" if kind == "scenario" else f"{kind}s"
    if suite:
        yield from _beside(kind, suite.parent, name)
    yield from _in_folder(kind, Path(kind_folder), f"./{kind_folder}", name)
    for folder in os.environ.get("VOBENCH_PATH", "").split(os.pathsep):
        if folder:
            yield from _in_folder(kind, Path(folder) / kind_folder, "$VOBENCH_PATH", name)
    for entry in _installed(kind):
        if name in (None, entry.name):
            yield entry
    yield from _in_folder(kind, builtin_root() / kind_folder, "built in", name)


def _beside(kind: Kind, folder: Path, name: str | None) -> Iterator[CatalogEntry]:
    """The entries in the folder of a suite. A suite or scenario there may have the same name as a scene."""
    yield from _in_folder(kind, folder / f"{kind}s", BESIDE_SUITE, name)
    if kind == "scenario":
        return
    for entry in _in_folder(kind, folder, BESIDE_SUITE, name):
        if not _is_suite_or_scenario(entry.path):
            yield entry


def _is_suite_or_scenario(path: Path) -> bool:
    if not path.is_file():
        return False
    try:
        content = read_regular(path, most_bytes=MOST_BYTES)
    except OSError:  # whoever uses the file reports that
        return False
    return OTHER_KEY.search(content) is not None


def _installed(kind: Kind) -> Iterator[CatalogEntry]:
    """The entries of installed distributions. Their files are in the package that the entry point refers to."""
    for point in entry_points(group=f"vobench.{kind}s"):
        spec = find_spec(point.value)
        package_folders = (spec.submodule_search_locations or []) if spec else []
        for folder in package_folders:
            path = Path(folder) if kind == "estimator" else _installed_file(kind, Path(folder), point.name)
            distribution = point.dist.name if point.dist else point.value
            yield CatalogEntry(kind, point.name, path, f"installed: {distribution}")


def _installed_file(kind: Kind, folder: Path, name: str) -> Path:
    """The file of an installed entry; the first possible path if none exists."""
    candidates = [folder / form.format(name) for form in FORMS[kind]]
    candidates.append(folder / "scene.yaml")
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    return candidates[0]


def _in_folder(kind: Kind, folder: Path, origin: str, name: str | None) -> Iterator[CatalogEntry]:
    """The entries of a kind in a folder, or those with one name."""
    if name in NOT_NAMES:
        return
    pattern = "*" if name is None else escape(name)
    for form in FORMS[kind]:
        for file in sorted(folder.glob(form.format(pattern))):
            path = file.parent if kind == "estimator" else file
            yield CatalogEntry(kind, _name_of(kind, path), path.resolve(), origin)


def _name_of(kind: Kind, path: Path) -> str:
    """The name of the entry at a path."""
    if kind == "estimator":
        return path.name
    if kind == "scene" and path.name == "scene.yaml":
        return path.parent.name
    return path.stem
