"""The process in which the class of an estimator runs: it imports the class and passes frames to it."""

import errno
import faulthandler
import importlib
import importlib.machinery
import importlib.util
import os
import pickle
import resource
import sys
import traceback
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import BinaryIO, cast

import numpy as np

from vobench.errors import VobenchError, error_sentence
from vobench.estimator.check import InvalidOutputError, checked, checked_revision, in_one_line
from vobench.estimator.frame_memory import copied, opened_memory
from vobench.estimator.message import HEADER, answered, revision, unpickled, unpickled_shared
from vobench.estimator.protocol import Estimator, Image

NAMESPACE = "vobench_estimators"


def load(folder: Path, class_path: str, *, name: str) -> Estimator:
    """An instance of `file:Class`. The folder of the file is imported as the package `vobench_estimators.<name>`.

    Raises VobenchError if the class cannot be found, imported or constructed.
    """
    folder = folder.resolve()
    module_name, _, class_name = class_path.partition(":")
    file = folder / f"{module_name.replace('.', '/')}.py"
    if not file.is_file():
        raise VobenchError(f"estimator {name!r} says class: {class_path}, but there is no {file}")
    module = _module(folder, f"{NAMESPACE}.{name}", module_name)
    kind = getattr(module, class_name, None)
    if not isinstance(kind, type):
        raise VobenchError(f"estimator {name!r} has no class {class_name!r}: {file}")
    missing = [method for method in ("start", "process") if not callable(getattr(kind, method, None))]
    if missing:
        raise VobenchError(f"{class_name} lacks the method {' and '.join(missing)}: {file}")
    try:
        return cast("Estimator", kind())
    except Exception as error:  # the user's code may raise anything
        raise VobenchError(f"{class_name}() {_cause(error, folder)}") from error


def _module(folder: Path, package: str, module_name: str) -> ModuleType:
    """The module that contains the class, imported again from this folder."""
    for name in list(sys.modules):
        if f"{name}.".startswith(f"{package}."):
            del sys.modules[name]
    importlib.invalidate_caches()
    try:
        _open_package(package, folder)
        return importlib.import_module(f"{package}.{module_name}")
    except Exception as error:
        estimator = package.removeprefix(f"{NAMESPACE}.")
        raise VobenchError(f"estimator {estimator!r} cannot be imported: {_cause(error, folder)}") from error


def _open_package(package: str, folder: Path) -> None:
    """Import the folder as a package with this name. It need not have an `__init__.py`."""
    namespace = sys.modules.setdefault(NAMESPACE, ModuleType(NAMESPACE))
    namespace.__path__ = []
    init = folder / "__init__.py"
    loader = None
    if init.is_file():
        loader = importlib.machinery.SourceFileLoader(package, str(init))
    spec = importlib.machinery.ModuleSpec(package, loader, is_package=True)
    spec.submodule_search_locations = [str(folder)]
    module = importlib.util.module_from_spec(spec)
    sys.modules[package] = module
    if loader:
        loader.exec_module(module)


def _cause(error: Exception, folder: Path) -> str:
    """The exception as a sentence, with the innermost line of the estimator's code in its traceback."""
    if isinstance(error, SyntaxError):
        return f"SyntaxError: {error.msg}: {error.filename}:{error.lineno}"
    place = str(folder)
    for call in traceback.extract_tb(error.__traceback__):
        if Path(call.filename).is_relative_to(folder):
            place = f"{call.filename}:{call.lineno}"
    sentence = " ".join(str(error).split())
    return f"{type(error).__name__}: {sentence}: {place}"


Message = tuple[bytes, bytes]  # tag and content


def main(folder: Path, class_path: str, name: str, *, memory_bytes: int, frame_descriptor: int) -> None:
    """Answer requests until vobench closes the connection.

    `memory_bytes` is the limit of memory. `frame_descriptor` is that of the shared memory with frames, or -1.
    """
    # If a fault ends this process, the calls of every thread are written to the log; since Python 3.14 also those of
    # libraries.
    faulthandler.enable()
    # Warnings about retired names are written to the log.
    warnings.filterwarnings("default", message=r"vobench\.", category=DeprecationWarning)
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    frame_memory = opened_memory(frame_descriptor)
    requests, answers = _taken_over()
    try:
        estimator = load(folder, class_path, name=name)
        for tag, content in _answers(requests, estimator, frame_memory):
            answers.write(HEADER.pack(tag, len(content)) + content)
    except (EOFError, BrokenPipeError):
        return
    except Exception as error:
        traceback.print_exc()
        content = in_one_line(error_sentence(error)).encode("utf-8", "replace")
        answers.write(HEADER.pack(_tag(error), len(content)) + content)


def _taken_over() -> tuple[BinaryIO, BinaryIO]:
    """The connection to vobench, which was on standard input and output.

    From then on, standard input is empty and standard output is the log.
    """
    requests = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    os.close(nothing)
    return requests, answers


def _answers(requests: BinaryIO, estimator: Estimator, frame_memory: Image | None) -> Iterator[Message]:
    """The answers to all requests, in order. Requests come from vobench, so they can be unpickled."""
    is_watched = False
    while head := requests.read(HEADER.size):
        tag, length = HEADER.unpack(head)
        payload = np.empty(length, np.uint8).data  # unlike a bytearray, it is not filled with zeros first
        received = requests.readinto(payload)  # type: ignore[attr-defined]
        if received < length:
            raise EOFError
        if tag in (b"FRAM", b"SHRD"):
            if tag == b"SHRD":
                assert frame_memory is not None
                frame = unpickled_shared(payload, partial(copied, frame_memory))
            else:
                frame = unpickled(payload)
            before = pickle.dumps(frame) if is_watched else b""
            result = checked(estimator.process(frame), frame.index)
            if is_watched and pickle.dumps(frame) != before:
                raise InvalidOutputError(f"frame {frame.index}: process() changed the frame it was given")
            yield b"POSE", answered(result, frame.index)
        elif tag == b"CALB":
            *arguments, is_watched = pickle.loads(payload)
            estimator.start(*arguments)
            yield b"REDY", b""
        else:
            finish = getattr(estimator, "finish", dict)
            revised = checked_revision(finish() or {})
            for index, T_odom_frame in revised.items():
                yield b"REVI", revision(index, T_odom_frame)
            yield b"DONE", b""


def _tag(error: Exception) -> bytes:
    is_disk_full = isinstance(error, OSError) and error.errno == errno.ENOSPC
    # OpenCV reports a failed allocation as an error with code -4.
    if isinstance(error, MemoryError) or is_disk_full or "Insufficient memory" in str(error):
        return b"NMEM"
    if isinstance(error, InvalidOutputError):
        return b"WRNG"
    return b"FAIL" if isinstance(error, VobenchError) else b"CRSH"


if __name__ == "__main__":
    main(
        Path(sys.argv[1]),
        sys.argv[2],
        sys.argv[3],
        memory_bytes=int(sys.argv[4]),
        frame_descriptor=int(sys.argv[5]),
    )
