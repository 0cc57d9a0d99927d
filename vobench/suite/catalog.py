"""One search order for scenes, suites, scenarios and estimators; the first of a name wins.

Beside the suite that asks, in <kind>s/ and then in its own folder; ./<kind>s/; <folder>/<kind>s/ for each folder of
$VOBENCH_PATH; installed entry points (groups vobench.scenes, vobench.suites, vobench.estimators); what vobench
brings along. A suite is <name>.yaml, an estimator a folder <name>/ with an estimator.yaml; a scene is <name>.yaml, a
folder <name>/ with a scene.yaml, or a model <name>.glb. A scenario is <name>.yaml in scenarios/ beside suites.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from glob import escape
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from vobench.asset import MODEL_SUFFIXES
from vobench.errors import UnknownNameError, unknown
from vobench.suite.file_kind import Kind, kind_in, shown

KINDS: tuple[Kind, ...] = ("suite", "scenario", "scene", "estimator")
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
NO_NAMES = ("", ".", "..")
NO_SCENE = re.compile(rb"^(estimators|severity|include)\s*:", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Entry:
    """Something with a name, where it lies, and which stop of the search order it came from.

    `path` is the file of a scene, suite or scenario, the folder of an estimator.
    """

    kind: Kind
    name: str
    path: Path
    origin: str


def builtin_root() -> Path:
    """The folder that holds the scenes, suites and estimators that vobench brings along."""
    package = Path(__file__).resolve().parents[1]
    wheel = package / "builtin"
    return wheel if wheel.is_dir() else package.parent


def entries(kind: Kind) -> list[Entry]:
    """Everything of a kind, by name; where a name is there twice, the one that wins comes first."""
    by_path: dict[Path, Entry] = {}
    for entry in _all(kind):
        by_path.setdefault(entry.path, entry)
    return sorted(by_path.values(), key=lambda entry: entry.name)


def find(kind: Kind, name: str, *, suite: Path | None = None) -> Entry:
    """The entry of that name that wins; a path, with a / or a suffix, is taken from here or from beside the suite.

    `suite` is the file that asks, beside which is looked first. Raises UnknownNameError with the nearest name and
    all known ones.
    """
    path = Path(name)
    if path.suffix in {".yaml", ".yml", *MODEL_SUFFIXES} or "/" in name or os.sep in name:
        return _at(kind, path, suite)
    for entry in _all(kind, suite, name=name):
        return entry
    if name not in NO_NAMES and path.is_dir():
        raise UnknownNameError(_about_folder(kind, path))
    raise UnknownNameError(unknown(kind, name, _names(kind, suite)))


def examples() -> list[Entry]:
    """The example suites that vobench brings along, which `vobench new suite` copies; no name finds them otherwise."""
    return [*_in_folder("suite", builtin_root() / "examples", "example", None)]


def _about_folder(kind: Kind, folder: Path) -> str:
    """What to say of a folder where a name or a file is wanted: how to write its path, or what is in it."""
    if kind == "estimator" and (folder / "estimator.yaml").is_file():
        return f"no estimator named '{folder}'; for the folder write ./{folder}"
    if kind == "scene" and (folder / "scene.yaml").is_file():
        return f"no scene named '{folder}'; for the folder write ./{folder}"
    inside = [entry for entry in _in_folder(kind, folder, "", None) if _is_of_kind(kind, entry.path)]
    paths = ", ".join(shown(entry.path) for entry in inside)
    found = f"in it are {paths}" if inside else f"in it is no {kind}"
    return f"{shown(folder)} is a folder, and {WHAT_IT_IS[kind]}; {found}"


def _is_of_kind(kind: Kind, path: Path) -> bool:
    """Whether what lies there is of a kind, as far as its keys tell."""
    return path.is_dir() or path.suffix.lower() in MODEL_SUFFIXES or kind_in(path) == kind


def _at(kind: Kind, path: Path, suite: Path | None) -> Entry:
    if suite and not path.exists() and (suite.parent / path).exists():
        path = suite.parent / path
    if kind == "estimator" and path.name == "estimator.yaml":
        path = path.parent
    if kind == "scene" and (path / "scene.yaml").is_file():
        path /= "scene.yaml"
    wanted = path / "estimator.yaml" if kind == "estimator" else path
    if path.is_dir() and kind != "estimator":
        raise UnknownNameError(_about_folder(kind, path))
    if not wanted.is_file():
        known = ", ".join(_names(kind, suite)) or "none"
        raise UnknownNameError(f"no {kind} file at {wanted}. Known by name: {known}")
    return Entry(kind, _name(kind, path.resolve()), path.resolve(), "path")


def _names(kind: Kind, suite: Path | None) -> list[str]:
    return sorted({entry.name for entry in _all(kind, suite)})


def _all(kind: Kind, suite: Path | None = None, *, name: str | None = None) -> Iterator[Entry]:
    """Every entry of a kind, or those of a name, in the order of search."""
    among = "suites/scenarios" if kind == "scenario" else f"{kind}s"
    if suite:
        yield from _in_folder(kind, suite.parent / f"{kind}s", "beside the suite", name)
        if kind != "scenario":
            yield from (e for e in _in_folder(kind, suite.parent, "beside the suite", name) if not _is_other(e.path))
    yield from _in_folder(kind, Path(among), f"./{among}", name)
    for folder in filter(None, os.environ.get("VOBENCH_PATH", "").split(os.pathsep)):
        yield from _in_folder(kind, Path(folder) / among, "$VOBENCH_PATH", name)
    yield from (entry for entry in _installed(kind) if name in (None, entry.name))
    yield from _in_folder(kind, builtin_root() / among, "built in", name)


def _installed(kind: Kind) -> Iterator[Entry]:
    for point in entry_points(group=f"vobench.{kind}s"):
        spec = find_spec(point.value)
        for folder in spec.submodule_search_locations or [] if spec else []:
            found = [Path(folder, form.format(point.name)) for form in (*FORMS[kind], "scene.yaml")]
            path = Path(folder) if kind == "estimator" else next((p for p in found if p.is_file()), found[0])
            yield Entry(kind, point.name, path, f"installed: {point.dist.name if point.dist else point.value}")


def _in_folder(kind: Kind, folder: Path, origin: str, name: str | None) -> Iterator[Entry]:
    if name in NO_NAMES:
        return
    named = "*" if name is None else escape(name)
    for form in FORMS[kind]:
        for path in sorted(folder.glob(form.format(named))):
            own = path.parent if kind == "estimator" else path
            yield Entry(kind, _name(kind, own), own.resolve(), origin)


def _name(kind: Kind, path: Path) -> str:
    if kind == "estimator":
        return path.name
    return path.parent.name if kind == "scene" and path.name == "scene.yaml" else path.stem


def _is_other(path: Path) -> bool:
    """Whether this file is a suite or a scenario, which may be called as its scene is."""
    return path.is_file() and NO_SCENE.search(path.read_bytes()) is not None
