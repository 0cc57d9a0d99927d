"""Import an estimator's folder as a package of its own, so that it may be several files."""

import importlib
import importlib.machinery
import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import cast

from vobench.errors import VobenchError
from vobench.estimator.protocol import Estimator

NAMESPACE = "vobench_estimators"


def load(folder: Path, class_path: str, *, name: str) -> Estimator:
    """A new estimator from `file:Class` in a folder, imported as the package `vobench_estimators.<name>`.

    Raises VobenchError, one line, where the plugin cannot be imported, found or constructed.
    """
    folder, (module_name, _, class_name) = folder.resolve(), class_path.partition(":")
    file = folder / f"{module_name.replace('.', '/')}.py"
    if not file.is_file():
        raise VobenchError(f"estimator {name!r} says class: {class_path}, but there is no {file}")
    made = getattr(_module(folder, f"{NAMESPACE}.{name}", module_name), class_name, None)
    if not isinstance(made, type):
        raise VobenchError(f"estimator {name!r} has no class {class_name!r}: {file}")
    missing = [verb for verb in ("start", "process") if not callable(getattr(made, verb, None))]
    if missing:
        raise VobenchError(f"{class_name} lacks the method {' and '.join(missing)}: {file}")
    try:
        return cast("Estimator", made())
    except Exception as error:  # the user's code may raise anything
        raise VobenchError(f"{class_name}() {_cause(error, folder)}") from error


def _module(folder: Path, package: str, module_name: str) -> ModuleType:
    """The module with the class, freshly imported from this folder and no other of the same name."""
    for name in [name for name in sys.modules if name == package or name.startswith(f"{package}.")]:
        del sys.modules[name]
    importlib.invalidate_caches()
    try:
        _open_package(package, folder)
        return importlib.import_module(f"{package}.{module_name}")
    except Exception as error:
        name = package.removeprefix(f"{NAMESPACE}.")
        raise VobenchError(f"estimator {name!r} cannot be imported: {_cause(error, folder)}") from error


def _open_package(package: str, folder: Path) -> None:
    """Make the folder a package under this name, with or without an `__init__.py`."""
    namespace = sys.modules.setdefault(NAMESPACE, ModuleType(NAMESPACE))
    namespace.__path__ = []
    init = folder / "__init__.py"
    loader = importlib.machinery.SourceFileLoader(package, str(init)) if init.is_file() else None
    spec = importlib.machinery.ModuleSpec(package, loader, is_package=True)
    spec.submodule_search_locations = [str(folder)]
    module = importlib.util.module_from_spec(spec)
    sys.modules[package] = module
    if loader:
        loader.exec_module(module)


def _cause(error: Exception, folder: Path) -> str:
    """What was raised, and the innermost line of the plugin that raised it."""
    if isinstance(error, SyntaxError):
        return f"SyntaxError: {error.msg}: {error.filename}:{error.lineno}"
    inside = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).is_relative_to(folder)]
    place = f"{inside[-1].filename}:{inside[-1].lineno}" if inside else str(folder)
    return f"{type(error).__name__}: {' '.join(str(error).split())}: {place}"
