"""The folder of an estimator, written from a class that is defined in a notebook or a program.

An estimator runs in a separate process, which imports it from a file. Therefore the source of the class is written to
a file, together with what it uses from its module: imports, functions, other classes and plain constants.
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
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vobench.errors import InputError
from vobench.estimator.manifest import MANIFEST_FILE

ESTIMATORS = Path("estimators")
MODULE = "estimator"
MARK = "# Written by vobench from a Python class; run the cell or the program again to change it."
# The attributes of a class that are keys of its manifest, with their defaults.
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
    `metric`, `causal` and `deterministic` become keys of the manifest, and the first line of its docstring becomes the
    summary. Raises InputError if its source cannot be found or uses a value that cannot be written to a file, or if
    the folder holds an estimator that was not written by this function.
    """
    for method in ("start", "process"):
        if not callable(getattr(cls, method, None)):
            raise InputError(f"an estimator must have a method {method}(), but {cls.__name__} has none")
    name = snake_case(cls.__name__)
    manifest = _manifest(cls, name)
    source = class_module(cls)

    folder = root / name
    file = folder / MANIFEST_FILE
    is_ours = file.is_file() and file.read_text(encoding="utf-8").startswith(MARK)
    if folder.exists() and not is_ours:
        raise InputError(f"an estimator of that name exists that was not written from a class: {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(manifest, encoding="utf-8")
    (folder / f"{MODULE}.py").write_text(source, encoding="utf-8")
    return folder


def snake_case(name: str) -> str:
    """The name of a class as the name of an estimator: `MyLKTracker` is my_lk_tracker."""
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return split.strip("_").lower()


def _manifest(cls: type, name: str) -> str:
    """The manifest as YAML; its values are JSON, which is valid YAML."""
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
            raise InputError(f"{cls.__name__}.{key} should consist of plain values, got {value!r}") from None
    return "\n".join([*lines, ""])


def class_module(cls: type) -> str:
    """The source of a module with a class and everything that it uses from its own module. Raises InputError."""
    module = sys.modules.get(cls.__module__)
    parts = _ModuleParts(module)
    parts.add_source(cls.__name__, cls)
    return parts.text(f"The estimator {cls.__name__}.")


@dataclass(slots=True)
class _ModuleParts:
    """The parts of a module that is being written: imports, constants, and definitions in order of their use."""

    module: types.ModuleType | None
    imports: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    visiting: set[str] = field(default_factory=set)

    def add_source(self, name: str, defined: Any) -> None:
        """Add a class or a function, and everything that it uses."""
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
                "create it inside the class, or pass it in `params`"
            )

    def text(self, docstring: str) -> str:
        """The source of the module."""
        imports = "\n".join(sorted(self.imports.values()))
        constants = "\n".join(self.constants.values())
        sections = [f'"""{docstring}"""', imports, constants, *self.definitions.values()]
        return "\n\n".join(section for section in sections if section) + "\n"


def _public_home(value: Any) -> str:
    """The module from which a plugin imports a value: `vobench.plugin` if that offers it."""
    from vobench import plugin

    home = str(value.__module__)
    is_offered = home.startswith("vobench.") and value.__qualname__ in plugin.__all__
    return plugin.__name__ if is_offered else home


def _import_module(module: str, name: str) -> str:
    return f"import {module}" if module == name else f"import {module} as {name}"


def _import_name(module: str, original: str, name: str) -> str:
    alias = "" if original == name else f" as {name}"
    return f"from {module} import {original}{alias}"


def _is_importable(value: Any, module: types.ModuleType | None) -> bool:
    """Whether a value is an object at the top level of a module other than the one that is being written."""
    home = getattr(value, "__module__", None)
    name = getattr(value, "__qualname__", None)
    if not isinstance(home, str) or not isinstance(name, str) or "." in name:
        return False
    is_own_module = module is not None and home == module.__name__
    if home == "__main__" or is_own_module:
        return False
    return getattr(sys.modules.get(home), name, None) is value


def _is_plain(value: Any) -> bool:
    """Whether the repr of a value is an expression that recreates it."""
    if isinstance(value, PLAIN):
        return True
    if isinstance(value, (tuple, list, set, frozenset)):
        return all(_is_plain(item) for item in value)
    if isinstance(value, dict):
        return all(_is_plain(item) for item in (*value.keys(), *value.values()))
    return False


def source_of(defined: Any) -> str:
    """The source of a class or function, even if it was defined in a notebook's cell. Raises InputError."""
    function = _a_function(defined)
    if function is None:
        raise InputError(f"the source of {defined.__name__} cannot be found: it defines no function")
    code = function.__code__
    lines = linecache.getlines(code.co_filename)
    for node in _definitions("".join(lines), defined.__name__):
        decorator_lines = [decorator.lineno for decorator in node.decorator_list]
        first = min([node.lineno, *decorator_lines])
        last = node.end_lineno or first
        if first <= code.co_firstlineno <= last:
            source = "".join(lines[first - 1 : last])
            return inspect.cleandoc("\n" + source) + "\n"
    raise InputError(f"the source of {defined.__name__} cannot be found; define it in a cell or a file")


def _definitions(source: str, name: str) -> Iterator[ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef]:
    """The classes and functions of a name in a source; none if it is not valid Python."""
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return
    for node in ast.walk(tree):
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and node.name == name:
            yield node


def _a_function(defined: Any) -> types.FunctionType | None:
    """A function whose code object tells where a class or function is defined."""
    if isinstance(defined, types.FunctionType):
        unwrapped = inspect.unwrap(defined)
        return unwrapped if isinstance(unwrapped, types.FunctionType) else None
    for value in vars(defined).values():
        function = getattr(value, "__func__", value)
        if not isinstance(function, types.FunctionType):
            continue
        is_defined_here = function.__qualname__.startswith(defined.__qualname__)
        if is_defined_here:
            return function
    return None


def global_names(source: str) -> list[str]:
    """The names that a source takes from its module or from Python's builtins, in alphabetical order."""
    module = symtable.symtable(source, "source", "exec")
    names = set[str]()
    for symbol in module.get_symbols():
        if symbol.is_referenced() and not symbol.is_assigned():
            names.add(symbol.get_name())
    for scope in module.get_children():
        names |= _global_names_of_scope(scope)
    return sorted(names)


def _global_names_of_scope(scope: symtable.SymbolTable) -> set[str]:
    """The global names that a class or function refers to, and those of the scopes in it."""
    names = set[str]()
    for symbol in scope.get_symbols():
        if symbol.is_referenced() and symbol.is_global():
            names.add(symbol.get_name())
    for inner in scope.get_children():
        names |= _global_names_of_scope(inner)
    return names
