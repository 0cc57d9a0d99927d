"""Imports of a plugin from internal modules of vobench, and what it should import instead."""

import ast
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import vobench
from vobench import retired
from vobench.runner.key import PLUGIN, offered_names

PLUGIN_NAME = PLUGIN.rpartition(".")[2]


@dataclass(frozen=True, slots=True)
class ForeignImport:
    """An import from a module of vobench other than `vobench.plugin`.

    name: what is imported from the module; empty if the module itself is imported.
    """

    line: int
    module: str
    name: str

    @property
    def full_name(self) -> str:
        """The module and the name, joined by a dot."""
        return f"{self.module}.{self.name}" if self.name else self.module

    @property
    def remedy(self) -> str:
        """What the plugin should import instead, or why there is no replacement."""
        advice_if_gone = retired.GONE.get(self.module, {}).get(self.name)
        if advice_if_gone is not None:
            return advice_if_gone

        new_home = retired.MOVED.get(self.module, {}).get(self.name)
        if new_home is None:
            offered = _offered_name(self)
            if offered is None:
                return f"{PLUGIN} does not offer it, so it may change or be removed without notice"
            return _import_statement(offered)

        if not new_home.startswith(f"{PLUGIN}."):
            return f"it is {new_home} now, which {PLUGIN} does not offer"
        return _import_statement(new_home.rpartition(".")[2])


def _import_statement(name: str) -> str:
    return f"from {PLUGIN} import {name}"


def foreign_imports(folder: Path) -> Iterator[tuple[Path, ForeignImport]]:
    """Each file's path relative to the folder, with one foreign import of it.

    Files that are not valid Python are skipped.
    """
    for path in sorted(folder.rglob("*.py")):
        with suppress(SyntaxError, ValueError):  # a syntax error is reported when the plugin runs
            tree = ast.parse(path.read_bytes())
            for foreign in _imports_of_vobench(tree):
                yield path.relative_to(folder), foreign


def _imports_of_vobench(tree: ast.Module) -> Iterator[ForeignImport]:
    """The imports of internal modules, and of names in them, anywhere in a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from _imported_names(node)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                is_internal = alias.name.startswith("vobench.") and alias.name != PLUGIN
                if is_internal:
                    yield ForeignImport(node.lineno, alias.name, "")


def _imported_names(node: ast.ImportFrom) -> Iterator[ForeignImport]:
    """The names that one statement `from … import …` imports from an internal module."""
    module = node.module
    is_relative = node.level > 0
    if module is None or is_relative or module == PLUGIN:
        return
    package = module.split(".")[0]
    if package != "vobench":
        return

    public = {PLUGIN_NAME, *vobench.__all__} if module == "vobench" else set()
    for alias in node.names:
        if alias.name not in public:
            yield ForeignImport(node.lineno, module, alias.name)


def _offered_name(foreign: ForeignImport) -> str | None:
    """The name under which `vobench.plugin` offers the imported object; None if it does not offer it."""
    for offered, home in offered_names().items():
        if foreign.full_name == _home_name(offered, home):
            return offered
    return foreign.name if _is_reexported(foreign) else None


def _home_name(offered: str, home: str) -> str:
    """The full name of an object that `vobench.plugin` offers.

    home: its module; `module:name` if its name there differs.
    """
    module, _, original = home.partition(":")
    is_module = module.rpartition(".")[2] == offered
    return module if is_module else f"{module}.{original or offered}"


def _is_reexported(foreign: ForeignImport) -> bool:
    """Whether the import is an alias of the object that `vobench.plugin` offers under the same name."""
    home = offered_names().get(foreign.name, "").partition(":")[0]
    if not home:
        return False
    with suppress(ImportError, AttributeError):
        imported = getattr(import_module(foreign.module), foreign.name)
        return imported is getattr(import_module(home), foreign.name)
    return False
