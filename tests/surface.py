"""The public surface of a module as text: each name with its signature, fields and public methods, as in the source.

The text is the same for every version of Python and numpy, as it comes from the source and not from evaluated types.
"""

import ast
import difflib
import inspect
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent
from types import GenericAlias, ModuleType, UnionType
from typing import Any

Definition = ast.FunctionDef | ast.ClassDef


def surface(module: ModuleType) -> str:
    """The surface of `module.__all__`: a line for each name, an indented one for each field or method of a class."""
    lines = [line for name in sorted(module.__all__) for line in described(name, getattr(module, name))]
    return "".join(f"{line}\n" for line in lines)


def changes(frozen: Path, module: ModuleType) -> str:
    """What differs between a module's surface and a file that froze it, as a diff; empty where nothing does."""
    before = frozen.read_text(encoding="utf-8").splitlines()
    now = surface(module).splitlines()
    return "\n".join(difflib.unified_diff(before, now, "frozen", "now", lineterm="", n=1))


def described(name: str, value: Any) -> Iterator[str]:
    """The lines of one name: what it is, and for a class or module its public members, indented."""
    if inspect.ismodule(value):
        yield f"module {name}"
        yield from (f"    {line}" for line in _members_of_module(value))
    elif isinstance(value, GenericAlias | UnionType):
        yield f"{name}: a type"
    elif inspect.isclass(value):
        yield f"class {name}"
        yield from (f"    {line}" for line in _members_of_class(value))
    elif inspect.isroutine(value):
        yield f"def {name}{_signature(_definition(value))}"
    else:
        yield f"{name}: {type(value).__name__}"


def _definition(value: Any) -> Any:
    """The definition of a function or class in its source."""
    return ast.parse(dedent(inspect.getsource(value))).body[0]


def _signature(function: ast.FunctionDef) -> str:
    result = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    return f"({ast.unparse(function.args)}){result}"


def _members_of_module(module: ModuleType) -> Iterator[str]:
    """The functions and classes that a module defines itself, by name."""
    for name, value in sorted(vars(module).items()):
        if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__:
            yield from described(name, value)


def _members_of_class(kind: type) -> Iterator[str]:
    """Fields and public methods of a class and of its bases in vobench, each in the order of the source."""
    seen = set[str]()
    for base in kind.__mro__:
        if not base.__module__.startswith("vobench"):
            continue
        for statement in _definition(base).body:
            for name, line in _member(statement):
                if name not in seen:
                    yield line
                seen.add(name)


def _member(statement: ast.stmt) -> Iterator[tuple[str, str]]:
    """The name and the line of a public member that a statement in a class's body defines; nothing for any other."""
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
        name = statement.target.id
        line = ast.unparse(statement)
    elif isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
        name = statement.targets[0].id
        line = ast.unparse(statement)
    elif isinstance(statement, ast.FunctionDef):
        name = statement.name
        marks = "".join(f"@{ast.unparse(mark)} " for mark in statement.decorator_list)
        line = f"{marks}def {name}{_signature(statement)}"
    else:
        return
    if name == "__init__" or not name.startswith("_"):
        yield name, line
