"""Imports of a plugin from the inside of vobench, and what it should import in place of them."""

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
    """An import from elsewhere than `vobench.plugin`: its line, the module, and the name, empty for a module."""

    line: int
    module: str
    name: str

    @property
    def full_name(self) -> str:
        """Module and name."""
        return f"{self.module}.{self.name}" if self.name else self.module

    @property
    def remedy(self) -> str:
        """What the plugin should import in place of it."""
        gone = retired.GONE.get(self.module, {}).get(self.name)
        if gone is not None:
            return gone
        moved = retired.MOVED.get(self.module, {}).get(self.name)
        if moved is not None and not moved.startswith(f"{PLUGIN}."):
            return f"it is {moved} now, which {PLUGIN} does not offer"
        offered = _offered_name(self) if moved is None else moved.rpartition(".")[2]
        if offered is not None:
            return f"from {PLUGIN} import {offered}"
        return f"{PLUGIN} does not offer it, so it may change or be removed without notice"


def foreign_imports(folder: Path) -> Iterator[tuple[Path, ForeignImport]]:
    """The foreign imports of the Python files in a folder, with the paths of these files in it.

    A file that is not valid Python has none.
    """
    for path in sorted(folder.rglob("*.py")):
        with suppress(SyntaxError, ValueError):  # running it reports what is wrong with it
            for foreign in _imports_of_vobench(ast.parse(path.read_bytes())):
                yield path.relative_to(folder), foreign


def _imports_of_vobench(tree: ast.Module) -> Iterator[ForeignImport]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from _imported_names(node)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("vobench.") and alias.name != PLUGIN:
                    yield ForeignImport(node.lineno, alias.name, "")


def _imported_names(node: ast.ImportFrom) -> Iterator[ForeignImport]:
    """The names that a statement `from … import …` imports from the inside of vobench."""
    module = node.module
    is_relative = node.level > 0
    if module is None or is_relative or module == PLUGIN or module.split(".")[0] != "vobench":
        return
    public = {PLUGIN_NAME, *vobench.__all__} if module == "vobench" else set()
    for alias in node.names:
        if alias.name not in public:
            yield ForeignImport(node.lineno, module, alias.name)


def _offered_name(foreign: ForeignImport) -> str | None:
    """The name under which `vobench.plugin` offers what is imported, None if it does not."""
    for offered, home in offered_names().items():
        if foreign.full_name == _home_name(offered, home):
            return offered
    return foreign.name if _is_reexported(foreign) else None


def _home_name(offered: str, home: str) -> str:
    """The full name of what `vobench.plugin` offers; `home` is a module, or module:name for another name."""
    module, _, original = home.partition(":")
    is_module = module.rpartition(".")[2] == offered
    return module if is_module else f"{module}.{original or offered}"


def _is_reexported(foreign: ForeignImport) -> bool:
    """Whether the module has imported a name that `vobench.plugin` offers from the same home."""
    home = offered_names().get(foreign.name, "").partition(":")[0]
    if not home:
        return False
    with suppress(ImportError, AttributeError):
        imported = getattr(import_module(foreign.module), foreign.name)
        return imported is getattr(import_module(home), foreign.name)
    return False
