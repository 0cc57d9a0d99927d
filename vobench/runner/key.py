"""Computes the keys of results: hashes of everything that a result depends on, from its inputs to the code."""

import ast
import hashlib
import json
import marshal
import os
import platform
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import CodeType
from typing import Any

from pydantic import TypeAdapter

from vobench import __version__
from vobench.estimator.readable_folders import folders_readable_by_all
from vobench.regular_file import open_regular

PACKAGE = Path(__file__).resolve().parents[1]
PLUGIN = "vobench.plugin"
# The digest of a module depends on the version of Python and on this file.
READER = hashlib.sha256(sys.version.encode() + Path(__file__).read_bytes()).digest()
READ_BYTES = 1 << 20  # the number of bytes of a file that are read at a time
CODE_SUFFIXES = {".py", ".pyc"}  # files with other suffixes are data files
# Imports for type checkers only, on which no result depends.
TYPES_ONLY = re.compile(rb"^if TYPE_CHECKING:\n(?:(?: .*)?\n)+", re.MULTILINE)


def cache_folder() -> Path:
    """The folder of the cache: $VOBENCH_CACHE, or vobench/ in the user's cache folder."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(os.environ.get("VOBENCH_CACHE") or home / "vobench")


def canonical(inputs: Mapping[str, Any]) -> str:
    """The inputs as JSON with sorted keys, so that equal content gives equal text."""
    return json.dumps(inputs, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False)


def digest(inputs: Mapping[str, Any]) -> str:
    """The first 128 bits of the SHA-256 hash of the inputs, in hex."""
    # JSON on one line is faster to write than that of `canonical`.
    text = json.dumps(inputs, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def folder_digest(folder: Path) -> str:
    """A hash of the names and contents of all files below a folder, except compiled Python."""
    state = hashlib.sha256()
    for path in sorted(_files(folder)):
        state.update(f"{path.relative_to(folder)}\0".encode())
        state.update(_content_digest(path))
    return state.hexdigest()[:32]


def _content_digest(path: Path) -> bytes:
    content = hashlib.sha256()
    with open_regular(path) as file:
        while part := file.read(READ_BYTES):
            content.update(part)
    return content.digest()


def _files(folder: Path) -> Iterator[Path]:
    """The files below a folder, except compiled Python.

    A link is followed only if estimators may read its target. Of several links to one folder, only one is followed.
    """
    readable = [folder.resolve(), *folders_readable_by_all()]
    seen = set[str]()  # the targets of links to folders
    for parent, folders, names in os.walk(folder, followlinks=True):
        # os.walk enters only the folders that remain in this list.
        folders[:] = [name for name in sorted(folders) if _is_searched(Path(parent, name), readable, seen)]
        for name in names:
            path = Path(parent, name)
            if _is_readable(path, readable) and path.is_file():
                yield path


def _is_searched(folder: Path, readable: Iterable[Path], seen: set[str]) -> bool:
    """Whether a folder is searched for files. If it is a link, its target is added to `seen`."""
    if folder.name == "__pycache__":
        return False
    if not folder.is_symlink():
        return True
    target = os.path.realpath(folder)
    if target in seen or not _is_readable(folder, readable):
        return False
    seen.add(target)
    return True


def _is_readable(path: Path, readable: Iterable[Path]) -> bool:
    """Whether a path is not a link, or is a link into a readable folder."""
    if not path.is_symlink():
        return True
    target = Path(os.path.realpath(path))
    return any(target.is_relative_to(folder) for folder in readable)


def versions(*libraries: str) -> dict[str, str]:
    """The versions of vobench, Python and the given distributions."""
    return {"vobench": __version__, **library_versions(*libraries)}


@cache
def library_versions(*names: str) -> dict[str, str]:
    """The versions of Python and of installed distributions that can change the bytes of a result."""
    versions_by_name = {name: _version(name) for name in names}
    return {"python": platform.python_version(), **versions_by_name}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # the code that needs the package reports that it is missing
        return "not installed"


@cache
def code_digest(*entries: str, package: Path = PACKAGE) -> str:
    """A hash of modules and of everything that they import, directly or indirectly.

    The hash covers the code without docstrings and comments, and the data files in the folders of the modules.

    `entries` are the names of modules and packages. A package stands for all of its modules.
    `package` is the folder of vobench.
    """
    known = _modules(package)
    requested = [name for name in known if _is_in(name, entries)]
    modules = closure(requested, package=package)
    state = hashlib.sha256()
    for name, module in sorted(modules.items()):
        state.update(f"{name}\0{module.digest}".encode())
    folders = {known[name].parent for name in modules} - {package}
    for folder in sorted(folders):
        data_files = [path for path in _files(folder) if path.suffix not in CODE_SUFFIXES]
        for path in sorted(data_files):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            state.update(f"{path.relative_to(package)}\0{content}".encode())
    return state.hexdigest()[:32]


def _is_in(name: str, entries: Iterable[str]) -> bool:
    """Whether a module is one of the entries, or is inside a package that is one of them."""
    return any(name == entry or name.startswith(f"{entry}.") for entry in entries)


def imported_by(folder: Path, *, package: Path = PACKAGE) -> list[str]:
    """The modules of vobench that the Python files of a folder, for example of an estimator, import directly.

    A name from `vobench.plugin`, or a retired name, stands for the module that defines it. Tests (`test_*.py`) are not
    part of the estimator, so they are ignored.
    """
    names = set[str]()
    for path in _files(folder):
        if path.suffix == ".py" and not path.name.startswith("test_"):
            with suppress(SyntaxError, ValueError):  # an error is reported when the file is run
                names.update(_module(path.read_bytes()).imports)
    homes = _homes(package)
    names.update([homes[name] for name in names if name in homes])
    return sorted(names & _modules(package).keys())


@cache
def _homes(package: Path) -> dict[str, str]:
    """The module that defines each name of `vobench.plugin` and each retired name, such as `vobench.plugin.se3`."""
    homes = dict[str, str]()
    for name, target in offered_names(package).items():
        target_module, _, _ = target.partition(":")
        homes[f"{PLUGIN}.{name}"] = target_module
    for module, moved in _table(package / "retired.py", "MOVED").items():
        for name, new_place in moved.items():
            new_module, _, _ = new_place.rpartition(".")
            homes[f"{module}.{name}"] = homes.get(new_place) or new_module
    return homes


@cache
def offered_names(package: Path = PACKAGE) -> dict[str, str]:
    """The module of each name that plugins may import: `HOMES` of `vobench.plugin`, read without importing it."""
    return _table(package / "plugin.py", "HOMES")


def _table(path: Path, name: str) -> dict[str, Any]:
    """The literal dictionary that a file assigns to a name. The file is not imported."""
    if not path.is_file():
        return {}
    for statement in ast.parse(path.read_bytes()).body:
        if not isinstance(statement, ast.Assign):
            continue
        assigned = [target.id for target in statement.targets if isinstance(target, ast.Name)]
        if name in assigned:
            table: dict[str, Any] = ast.literal_eval(statement.value)
            return table
    raise LookupError(f"{path} assigns no {name}")


@dataclass(frozen=True, slots=True)
class Module:
    """The hash of a module's code, and all names in it that can be modules of vobench."""

    digest: str
    imports: frozenset[str]


MODULE = TypeAdapter(Module)


def closure(entries: Iterable[str], *, package: Path = PACKAGE) -> dict[str, Module]:
    """All modules that the given modules import, directly or indirectly, including themselves, by name.

    `vobench` itself and `vobench.plugin` are excluded, because they import names only on request.
    """
    known = _modules(package)
    modules = dict[str, Module]()
    waiting = list(entries)
    while waiting:
        name = waiting.pop()
        if name in known and name not in modules:
            module = _module(known[name].read_bytes())
            modules[name] = module
            parent_package, _, _ = name.rpartition(".")
            waiting += [*module.imports, parent_package]
    return modules


@cache
def _modules(package: Path) -> dict[str, Path]:
    """The file of each module of vobench."""
    modules = {}
    for path in package.glob("**/*.py"):
        parts = path.relative_to(package).with_suffix("").parts
        name = ".".join(("vobench", *parts)).removesuffix(".__init__")
        if name not in {"vobench", PLUGIN}:
            modules[name] = path
    return modules


@cache
def _module(source: bytes) -> Module:
    """The digest and imports of a source. The result is cached in a file for all processes."""
    cached = cache_folder() / "modules" / hashlib.sha256(READER + source).hexdigest()
    with suppress(OSError, ValueError):
        return MODULE.validate_json(cached.read_bytes(), strict=True)
    module = _compiled(source)
    with suppress(OSError):
        cached.parent.mkdir(parents=True, exist_ok=True)
        temporary = cached.with_suffix(f".{os.getpid()}")
        temporary.write_bytes(MODULE.dump_json(module))
        temporary.replace(cached)
    return module


def _compiled(source: bytes) -> Module:
    """The digest and imports of a source, from its compiled code."""
    # optimize=2 omits docstrings, and asserts, which do not change results.
    runtime_source = TYPES_ONLY.sub(b"", source)
    code = compile(runtime_source, "", "exec", optimize=2, dont_inherit=True)
    bare = _bare(code)
    # Version 2 of marshal has no references, which would depend on other objects in the process.
    digest = hashlib.sha256(marshal.dumps(bare, 2)).hexdigest()
    imports = {*_imports(bare), *_plugin_names(ast.parse(source))}
    return Module(digest, frozenset(imports))


def _bare(code: CodeType) -> CodeType:
    """The code without its file name and line numbers."""
    bare_consts = tuple(_bare(const) if isinstance(const, CodeType) else const for const in code.co_consts)
    return code.replace(co_consts=bare_consts, co_filename="", co_firstlineno=0, co_linetable=b"")


def _imports(code: CodeType) -> Iterator[str]:
    """The names in code that may be modules of vobench: the dotted names, and the names imported from one of them."""
    for name in code.co_names:
        is_in_vobench = name == "vobench" or name.startswith("vobench.")
        if is_in_vobench and name != PLUGIN:
            yield name
            yield from (f"{name}.{part}" for part in code.co_names if "." not in part)
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield from _imports(const)


def _plugin_names(tree: ast.Module) -> set[str]:
    """The names that a file imports from `vobench.plugin`, each as `vobench.plugin.name`.

    If the file imports the module itself, or all names with a star, every name in the file can be one of them.
    """
    imported = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            imported |= _imported_names(node)
    imports_all = PLUGIN in imported or f"{PLUGIN}.*" in imported
    if imports_all:
        imported |= _all_names(tree)
    return {name for name in imported if name.startswith(f"{PLUGIN}.")}


def _imported_names(node: ast.Import | ast.ImportFrom) -> set[str]:
    """The full names that an import statement imports, such as `vobench.plugin.se3`."""
    prefix = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
    return {f"{prefix}{alias.name}" for alias in node.names}


def _all_names(tree: ast.Module) -> set[str]:
    """All names and attributes in a file, as if each were a name of `vobench.plugin`."""
    names = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            names.add(f"{PLUGIN}.{node.attr}")
        elif isinstance(node, ast.Name):
            names.add(f"{PLUGIN}.{node.id}")
    return names
