"""Runs the maker or the generator of a scene, which are Python files.

`make(seed)` of a maker returns things, materials and, optionally, lights; `generate(seed, lighting)` of a generator
returns a GeneratedPlace. Both can be untrusted code. They therefore run in the same sandbox as estimators, where they
can read the files in their folder but no other files of the user, and return the scene as data. Those that are
included in vobench are trusted, and run in this process.
"""

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from vobench import trust
from vobench.errors import SuiteError, error_sentence
from vobench.estimator import isolation
from vobench.estimator.check import in_one_line
from vobench.estimator.home import Home
from vobench.estimator.manifest import Limits
from vobench.estimator.program import EstimatorFailure, Program, sandbox_here
from vobench.scene.generated_place import GeneratedPlace
from vobench.suite.catalog import builtin_root
from vobench.suite.maker_message import decode
from vobench.suite.maker_worker import ERROR, GENERATE, MAKE, SCENE, call

LIMITS = Limits(trial_s=600.0, threads=max(os.cpu_count() or 1, 1))
WORKER = (sys.executable, "-P", "-m", "vobench.suite.maker_worker")
SCENE_BYTES = 2 << 30
ERROR_BYTES = 1 << 16
NO_SCENE = "ended without handing back a scene"


def made_by(maker: Path, *, seed: int, scene: str) -> GeneratedPlace:
    """The scene that a maker creates from a seed. `scene` is the name of the scene.

    Raises SuiteError if the maker fails, or if this machine has no sandbox and the user does not trust the maker.
    """
    return _returned_by(maker, MAKE, (seed,), scene)


def generated_by(generator: Path, *, seed: int, lighting: str, scene: str) -> GeneratedPlace:
    """The place that a generator creates from a seed. Raises SuiteError under the same conditions as `made_by`."""
    return _returned_by(generator, GENERATE, (seed, lighting), scene)


def _returned_by(file: Path, function: str, arguments: Sequence[Any], scene: str) -> GeneratedPlace:
    if file.resolve().is_relative_to(builtin_root().resolve()):
        return _in_this_process(file, function, arguments)
    trust.admit(file, sources(file), scene, is_contained=_is_contained())
    return _in_a_sandbox(file, function, arguments)


def _in_this_process(file: Path, function: str, arguments: Sequence[Any]) -> GeneratedPlace:
    try:
        return call(str(file), function, arguments)
    except Exception as error:
        raise SuiteError(f"{file}: {error_sentence(error)}") from error


def _is_contained() -> bool:
    """Whether the sandbox on this machine hides the user's files."""
    return isolation.FILES not in sandbox_here().sees


def sources(maker: Path) -> Iterator[bytes]:
    """The name and content of the maker, followed by those of all other Python files in its folder and subfolders."""
    others = [path for path in maker.parent.rglob("*.py") if path != maker and path.is_file()]
    for path in [maker, *sorted(others)]:
        yield str(path.relative_to(maker.parent)).encode()
        yield path.read_bytes()


def _in_a_sandbox(file: Path, function: str, arguments: Sequence[Any]) -> GeneratedPlace:
    try:
        return decode(_worker_output(file, function, arguments))
    except EstimatorFailure as failure:
        raise SuiteError(f"{file}: {_reason(failure)}") from None
    except SuiteError as error:
        raise SuiteError(f"{file}: {error}") from None


def _worker_output(file: Path, function: str, arguments: Sequence[Any]) -> bytes:
    """The encoded scene that a worker process writes in the sandbox.

    Raises EstimatorFailure if the process fails, and SuiteError with the error that the code raised.
    """
    command = [*WORKER, str(file.resolve()), function, json.dumps(arguments)]
    with ExitStack() as stack:
        home = stack.enter_context(Home(Path(os.devnull)))
        log = home.path.parent / "log.txt"
        program = stack.enter_context(Program(command, log=log, limits=LIMITS, home=home, folder=file.parent.resolve()))
        program.wait()
        error_text = _read_if_written(program, ERROR, ERROR_BYTES)
        scene = b"" if error_text else program.read(SCENE, most_bytes=SCENE_BYTES)
    if error_text:
        raise SuiteError(in_one_line(error_text.decode("utf-8", "replace")))
    return scene


def _reason(failure: EstimatorFailure) -> str:
    """The reason why a maker returned no scene.

    A failure's reason is worded for estimators: it can mention a trial, or the output file as {out}.
    """
    if failure.kind == "timeout":
        return f"took more than {LIMITS.trial_s:g} s"
    if failure.kind != "invalid_output":
        return failure.reason
    is_file_unreadable = failure.reason.startswith("{out} ")
    if not is_file_unreadable:
        return NO_SCENE
    return f"{NO_SCENE}: {failure.reason.replace('{out}', SCENE)}"


def _read_if_written(program: Program, name: str, most_bytes: int) -> bytes:
    """The content of a file that the program may have written; empty if it cannot be read."""
    try:
        return program.read(name, most_bytes=most_bytes)
    except EstimatorFailure:
        return b""
