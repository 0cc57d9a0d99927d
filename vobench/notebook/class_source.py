"""The folder of an estimator, written from a class that is defined in a notebook or a program.

An estimator runs in a process of its own, which imports it from a file. So the source of the class is written to one,
together with the source of what it uses of its module: imports, functions, other classes and plain constants.
"""

import ast
import builtins
import inspect
import json
import linecache
import re
import symtable
import sys
import types
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vobench.errors import InputError
from vobench.estimator.manifest import MANIFEST_FILE

ESTIMATORS = Path("estimators")
MODULE = "estimator"
MARK = "# Written by vobench from a Python class; run the cell or the program again to change it."
# What a class may say of itself, and what holds where it does not.
ATTRIBUTES: dict[str, Any] = {
    "version": "1",
    "needs": ("stereo",),
    "pose_of": "left_camera",
    "params": {},
    "metric": True,
    "causal": True,
    "deterministic": True,
}
PLAIN = (bool, int, float, complex, str, bytes, type(None))


def write_estimator(cls: type, *, root: Path = ESTIMATORS) -> Path:
    """Write a class as an estimator's folder, `root`/<name>, and return that folder.

    The class has the methods of `vobench.plugin.Estimator`. Its attributes `needs`, `pose_of`, `params`, `version`,
    `metric`, `causal` and `deterministic` stand for the keys of a manifest; the first line of its docstring is the
    summary. Raises InputError where its source cannot be found or uses what cannot be written to a file, and where
    the folder holds something that was not written by this function.
    """
    for method in ("start", "process"):
        if not callable(getattr(cls, method, None)):
            raise InputError(f"an estimator has a method {method}(), but {cls.__name__} has none")
    name = snake_case(cls.__name__)
    manifest = _manifest(cls, name)
    source = class_module(cls)

    folder = root / name
    file = folder / MANIFEST_FILE
    if folder.exists() and not (file.is_file() and file.read_text(encoding="utf-8").startswith(MARK)):
        raise InputError(f"there is an estimator of that name that was not written from a class: {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(manifest, encoding="utf-8")
    (folder / f"{MODULE}.py").write_text(source, encoding="utf-8")
    return folder


def snake_case(name: str) -> str:
    """A class's name as an estimator's: `MyLKTracker` is my_lk_tracker."""
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return split.strip("_").lower()


def _manifest(cls: type, name: str) -> str:
    """The manifest as YAML, which JSON values are, too."""
    docstring = (inspect.getdoc(cls) or "").strip()
    summary = docstring.splitlines()[0] if docstring else f"The class {cls.__name__}"
    content = {"name": name, "class": f"{MODULE}:{cls.__name__}", "summary": summary}
    for key, default in ATTRIBUTES.items():
        content[key] = getattr(cls, key, default)
    content["version"] = str(content["version"])
    lines = [MARK]
    for key, value in content.items():
        try:
            lines.append(f"{key}: {json.dumps(value)}")
        except TypeError:
            raise InputError(f"{cls.__name__}.{key} should be plain values, got {value!r}") from None
    return "\n".join([*lines, ""])


def class_module(cls: type) -> str:
    """The source of a module that holds a class and all that it uses of its own module. Raises InputError."""
    module = sys.modules.get(cls.__module__)
    collected = _Collected(module)
    collected.add_source(cls.__name__, cls)
    return collected.text(f"The estimator {cls.__name__}.")


@dataclass(slots=True)
class _Collected:
    """The parts of a module that is being written: imports, constants, and definitions in order of their use."""

    module: types.ModuleType | None
    imports: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    visiting: set[str] = field(default_factory=set)

    def add_source(self, name: str, defined: Any) -> None:
        """Add a class or a function with what it uses."""
        if name in self.visiting:
            return
        self.visiting.add(name)
        source = source_of(defined)
        for used in global_names(source):
            if used != name and not hasattr(builtins, used):
                self._add_global(used, by=name)
        self.definitions[name] = source

    def _add_global(self, name: str, *, by: str) -> None:
        values = vars(self.module) if self.module else {}
        if name not in values:
            raise InputError(f"{by} uses {name}, which is not defined")
        value = values[name]
        if isinstance(value, types.ModuleType):
            self.imports[name] = _import_module(value.__name__, name)
        elif _is_importable(value, self.module):
            self.imports[name] = _import_name(_public_home(value), value.__qualname__, name)
        elif isinstance(value, (type, types.FunctionType)):
            self.add_source(name, value)
        elif _is_plain(value):
            self.constants[name] = f"{name} = {value!r}"
        else:
            raise InputError(
                f"{by} uses {name}, a {type(value).__name__}, which cannot be written to a file; "
                "make it inside the class, or pass it by `params`"
            )

    def text(self, docstring: str) -> str:
        imports = sorted(self.imports.values())
        constants = list(self.constants.values())
        sections = [f'"""{docstring}"""', "\n".join(imports), "\n".join(constants), *self.definitions.values()]
        return "\n\n".join(section for section in sections if section) + "\n"


def _public_home(value: Any) -> str:
    """The module from which a plugin imports a value: `vobench.plugin` for what vobench offers."""
    from vobench import plugin

    if value.__module__.startswith("vobench.") and value.__qualname__ in plugin.__all__:
        return plugin.__name__
    return str(value.__module__)


def _import_module(module: str, name: str) -> str:
    return f"import {module}" if module == name else f"import {module} as {name}"


def _import_name(module: str, original: str, name: str) -> str:
    return f"from {module} import {original}" + ("" if original == name else f" as {name}")


def _is_importable(value: Any, module: types.ModuleType | None) -> bool:
    """Whether a value is an object at the top level of another module than the one that is being written."""
    home = getattr(value, "__module__", None)
    name = getattr(value, "__qualname__", None)
    if not isinstance(home, str) or not isinstance(name, str) or "." in name:
        return False
    if home == "__main__" or (module is not None and home == module.__name__):
        return False
    return getattr(sys.modules.get(home), name, None) is value


def _is_plain(value: Any) -> bool:
    """Whether the repr of a value makes it again."""
    if isinstance(value, PLAIN):
        return True
    if isinstance(value, (tuple, list, set, frozenset)):
        return all(_is_plain(each) for each in value)
    if isinstance(value, dict):
        return all(_is_plain(key) and _is_plain(each) for key, each in value.items())
    return False


def source_of(defined: Any) -> str:
    """The source of a class or function, also of one that was defined in a notebook's cell. Raises InputError."""
    function = _a_function(defined)
    if function is None:
        raise InputError(f"the source of {defined.__name__} cannot be found: it has no function of its own")
    code = function.__code__
    lines = linecache.getlines(code.co_filename)
    try:
        tree = ast.parse("".join(lines))
    except SyntaxError:
        tree = ast.Module([], [])
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        if not isinstance(node, kinds) or node.name != defined.__name__:
            continue
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        if first <= code.co_firstlineno <= (node.end_lineno or first):
            return inspect.cleandoc("\n" + "".join(lines[first - 1 : node.end_lineno])) + "\n"
    raise InputError(f"the source of {defined.__name__} cannot be found; define it in a cell or a file")


def _a_function(defined: Any) -> types.FunctionType | None:
    """A function whose code says where a class or function stands."""
    if isinstance(defined, types.FunctionType):
        unwrapped = inspect.unwrap(defined)
        return unwrapped if isinstance(unwrapped, types.FunctionType) else None
    for value in vars(defined).values():
        function = getattr(value, "__func__", value)
        if isinstance(function, types.FunctionType) and function.__qualname__.startswith(defined.__qualname__):
            return function
    return None


def global_names(source: str) -> list[str]:
    """The names that a source takes from its module, or from Python's builtins, in order of their spelling."""
    found: set[str] = set()

    def look(table: symtable.SymbolTable, *, is_top: bool) -> None:
        for symbol in table.get_symbols():
            if symbol.is_referenced() and (symbol.is_global() or is_top) and not (is_top and symbol.is_assigned()):
                found.add(symbol.get_name())
        for inner in table.get_children():
            look(inner, is_top=False)

    look(symtable.symtable(source, "source", "exec"), is_top=True)
    return sorted(found)
