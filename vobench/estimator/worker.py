"""The process an estimator runs in: its folder imported, frames handed to it."""

import ctypes
import importlib
import importlib.machinery
import importlib.util
import pickle
import resource
import signal
import sys
import time
import traceback
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType
from typing import cast

from vobench.errors import VobenchError
from vobench.estimator.process import InvalidOutputError, checked, checked_revision
from vobench.estimator.protocol import Estimator, Frame

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


PR_SET_PDEATHSIG = 1  # from linux/prctl.h


def main(fd: int, folder: Path, class_path: str, name: str, memory_bytes: int) -> None:
    """Serve frames until the other side hangs up."""
    _die_with_parent()
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    connection = Connection(fd)
    try:
        _serve(connection, load(folder, class_path, name=name))
    except (EOFError, BrokenPipeError):
        return
    except Exception as error:
        traceback.print_exc()
        connection.send(("failed", _kind(error), _in_one_line(error)))


def _serve(connection: Connection, estimator: Estimator) -> None:
    is_watched = False
    while True:
        message = connection.recv()
        if isinstance(message, Frame):
            before = pickle.dumps(message) if is_watched else b""
            wall, cpu = time.perf_counter(), _cpu_s()
            answer = estimator.process(message)
            spent = (time.perf_counter() - wall) * 1e3, (_cpu_s() - cpu) * 1e3
            if is_watched and pickle.dumps(message) != before:
                raise InvalidOutputError(f"frame {message.index}: process() changed the frame it was given")
            connection.send(("result", checked(answer, message.index), *spent))
        elif message[0] == "start":
            *told, is_watched = message[1:]
            estimator.start(*told)
            connection.send(("ready",))
        else:
            finish = getattr(estimator, "finish", dict)
            connection.send(("revised", checked_revision(finish() or {})))


def _cpu_s() -> float:
    """CPU time of this process and of those that it has started and that have ended."""
    spent = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in spent)


def _die_with_parent() -> None:
    """Where Linux offers it: an estimator in an endless loop must not outlive a vobench that was killed."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _kind(error: Exception) -> str:
    # OpenCV reports a failed allocation as its own error -4.
    if isinstance(error, MemoryError) or "Insufficient memory" in str(error):
        return "out_of_memory"
    if isinstance(error, InvalidOutputError):
        return "invalid_output"
    return "refused" if isinstance(error, VobenchError) else "crashed"


def _in_one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if isinstance(error, VobenchError) else f"{type(error).__name__}: {text}"


if __name__ == "__main__":
    main(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4], int(sys.argv[5]))
