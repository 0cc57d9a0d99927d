"""Keys: a hash of all that a result depends on, from its inputs to the code that makes it."""

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

PACKAGE = Path(__file__).resolve().parents[1]
# What reads modules: this Python and this file.
READER = hashlib.sha256(sys.version.encode() + Path(__file__).read_bytes()).digest()
# Imports that only a type checker sees: no result depends on them.
TYPES_ONLY = re.compile(rb"^if TYPE_CHECKING:\n(?:(?: .*)?\n)+", re.MULTILINE)


def cache_folder() -> Path:
    """$VOBENCH_CACHE, or vobench/ in the user's cache folder."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(os.environ.get("VOBENCH_CACHE") or home / "vobench")


def canonical(inputs: Mapping[str, Any]) -> str:
    """JSON with sorted keys: the same text for the same content."""
    return json.dumps(inputs, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False)


def digest(inputs: Mapping[str, Any]) -> str:
    """128 bits of SHA-256 over the same JSON on one line, which is written faster, in hex."""
    text = json.dumps(inputs, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def folder_digest(folder: Path) -> str:
    """A hash over names and contents of all files below a folder, compiled Python left out."""
    state = hashlib.sha256()
    for path in sorted(_files(folder)):
        state.update(f"{path.relative_to(folder)}\0".encode())
        state.update(hashlib.sha256(path.read_bytes()).digest())
    return state.hexdigest()[:32]


def _files(folder: Path) -> Iterator[Path]:
    for place, folders, names in os.walk(folder, followlinks=True):
        folders[:] = [name for name in folders if name != "__pycache__"]
        yield from (path for name in names if (path := Path(place, name)).is_file())


def versions(*libraries: str) -> dict[str, str]:
    """What something is made with: the versions of vobench, Python and these distributions."""
    return {"vobench": __version__, **library_versions(*libraries)}


@cache
def library_versions(*names: str) -> dict[str, str]:
    """Versions of Python and of the installed distributions whose release can change a result's bytes."""
    return {"python": platform.python_version(), **{name: _version(name) for name in names}}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # whoever needs it says so, and how to install it
        return "not installed"


@cache
def code_digest(*entries: str, package: Path = PACKAGE) -> str:
    """A hash of the import closure of these modules: their code without docstrings and comments, and its data files.

    A room among them stands for all of its modules.
    """
    known, state = _modules(package), hashlib.sha256()
    found = closure((n for entry in entries for n in known if f"{n}.".startswith(f"{entry}.")), package=package)
    for name, module in sorted(found.items()):
        state.update(f"{name}\0{module.digest}".encode())
    for folder in sorted({known[name].parent for name in found} - {package}):
        for path in sorted(path for path in _files(folder) if path.suffix not in {".py", ".pyc"}):
            state.update(f"{path.relative_to(package)}\0{hashlib.sha256(path.read_bytes()).hexdigest()}".encode())
    return state.hexdigest()[:32]


def imported_by(folder: Path) -> list[str]:
    """The modules of vobench that the Python files of a folder, such as an estimator's, import themselves."""
    names = set[str]()
    for path in _files(folder):
        if path.suffix == ".py":
            with suppress(SyntaxError, ValueError):  # whoever runs it says what is wrong with it
                names.update(_module(path.read_bytes()).imports)
    return sorted(names & _modules(PACKAGE).keys())


@dataclass(frozen=True, slots=True)
class Module:
    """A module's code as a hash, and all names that may be of modules of vobench it imports, at once or later."""

    digest: str
    imports: frozenset[str]


MODULE = TypeAdapter(Module)


def closure(entries: Iterable[str], *, package: Path = PACKAGE) -> dict[str, Module]:
    """All modules that these import, themselves included, by name.

    The package's own file is none of them: it looks its names up when a notebook asks for them.
    """
    known, found, waiting = _modules(package), dict[str, Module](), list(entries)
    while waiting:
        name = waiting.pop()
        if name in known and name not in found:
            found[name] = _module(known[name].read_bytes())
            waiting += [*found[name].imports, name.rpartition(".")[0]]
    return found


@cache
def _modules(package: Path) -> dict[str, Path]:
    """Where each module of vobench lies."""
    paths = {path.relative_to(package).with_suffix(""): path for path in package.glob("**/*.py")}
    named = {".".join(("vobench", *place.parts)).removesuffix(".__init__"): path for place, path in paths.items()}
    return {name: path for name, path in named.items() if name != "vobench"}


@cache
def _module(source: bytes) -> Module:
    """What a source says, compiled once for all processes: the cache folder may be without it, or broken."""
    known = cache_folder() / "modules" / hashlib.sha256(READER + source).hexdigest()
    with suppress(OSError, ValueError):
        return MODULE.validate_json(known.read_bytes(), strict=True)
    module = _compiled(source)
    with suppress(OSError):
        known.parent.mkdir(parents=True, exist_ok=True)
        part = known.with_suffix(f".{os.getpid()}")
        part.write_bytes(MODULE.dump_json(module))
        part.replace(known)
    return module


def _compiled(source: bytes) -> Module:
    # optimize=2 leaves docstrings out; asserts go too, which change no result.
    bare = _bare(compile(TYPES_ONLY.sub(b"", source), "", "exec", optimize=2, dont_inherit=True))
    # The second form of marshal has no references, which depend on what else the process holds.
    return Module(hashlib.sha256(marshal.dumps(bare, 2)).hexdigest(), frozenset(_imports(bare)))


def _bare(code: CodeType) -> CodeType:
    """The code without its place in the file."""
    consts = tuple(_bare(const) if isinstance(const, CodeType) else const for const in code.co_consts)
    return code.replace(co_consts=consts, co_filename="", co_firstlineno=0, co_linetable=b"")


def _imports(code: CodeType) -> Iterator[str]:
    """Dotted names in code are of modules; `from` one of them may come another."""
    for name in code.co_names:
        if name == "vobench" or name.startswith("vobench."):
            yield name
            yield from (f"{name}.{part}" for part in code.co_names if "." not in part)
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield from _imports(const)
