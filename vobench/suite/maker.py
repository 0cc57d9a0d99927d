"""Runs the maker or the generator of a scene, which are Python files.

`make(seed)` of a maker returns things, materials and, optionally, lights; `generate(seed, lighting)` of a generator
returns a GeneratedPlace.

Both can be untrusted code. They therefore run in the same sandbox as estimators. There they can read the files in their
folder but no other files of the user, and they return the scene as data. The makers and generators that are included in
vobench are trusted, and run in this process.
"""

import json
import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from vobench import trust
from vobench.errors import SuiteError, error_sentence
from vobench.estimator import isolation
from vobench.estimator.check import in_one_line
from vobench.estimator.home import Home
from vobench.estimator.manifest import Limits
from vobench.estimator.program import EstimatorFailure, OutputFailure, Program, sandbox_here
from vobench.scene.generated_place import GeneratedPlace
from vobench.suite.catalog import builtin_root
from vobench.suite.maker_message import decode
from vobench.suite.maker_worker import ERROR_FILE, GENERATE, MAKE, SCENE_FILE, call
from vobench.suite.scene_code import sources

LIMITS = Limits(trial_s=600.0, threads=os.cpu_count() or 1)  # a large margin: built-in places take seconds
# -P keeps the current folder out of the module search path, so that no file there can replace a module of vobench.
WORKER = (sys.executable, "-P", "-m", "vobench.suite.maker_worker")
MAX_SCENE_BYTES = 2 << 30  # so that a hostile maker cannot exhaust the memory
MAX_ERROR_BYTES = 1 << 16  # the largest size of the text of an error
NO_SCENE = "returned no scene"


def create_scene(maker: Path, *, seed: int, scene_name: str) -> GeneratedPlace:
    """The scene that a maker creates from a seed.

    Raises SuiteError if the maker fails, or if this machine has no sandbox and the user does not trust the maker.
    """
    return _run(maker, MAKE, (seed,), scene_name)


def generate_place(generator: Path, *, seed: int, lighting: str, scene_name: str) -> GeneratedPlace:
    """The place that a generator creates from a seed.

    Raises SuiteError if the generator fails, or if this machine has no sandbox and the user does not trust it.
    """
    return _run(generator, GENERATE, (seed, lighting), scene_name)


def _run(file: Path, function: str, arguments: Sequence[Any], scene_name: str) -> GeneratedPlace:
    """The scene that a function of a file returns; it runs in this process if the file is included in vobench."""
    is_builtin = file.resolve().is_relative_to(builtin_root().resolve())
    if is_builtin:
        return _run_trusted(file, function, arguments)
    trust.admit(file, sources(file), scene_name, is_contained=_is_contained())
    return _run_sandboxed(file, function, arguments)


def _run_trusted(file: Path, function: str, arguments: Sequence[Any]) -> GeneratedPlace:
    """The scene that a function returns in this process."""
    try:
        return call(str(file), function, arguments)
    except Exception as error:
        raise SuiteError(f"{file}: {error_sentence(error)}") from error


def _is_contained() -> bool:
    """Whether the sandbox on this machine hides the user's files."""
    accessible = sandbox_here().sees
    return isolation.FILES not in accessible


def _run_sandboxed(file: Path, function: str, arguments: Sequence[Any]) -> GeneratedPlace:
    """The scene that a function returns in a worker process in the sandbox."""
    try:
        encoded_scene = _worker_output(file, function, arguments)
        return decode(encoded_scene)
    except EstimatorFailure as failure:
        raise SuiteError(f"{file}: {_failure_reason(failure)}") from None
    except SuiteError as error:
        raise SuiteError(f"{file}: {error}") from None


def _worker_output(file: Path, function: str, arguments: Sequence[Any]) -> bytes:
    """The encoded scene that a worker process writes in the sandbox.

    Raises EstimatorFailure if the process fails, and SuiteError with the error that the code raised.
    """
    command = [*WORKER, str(file.resolve()), function, json.dumps(arguments)]
    with ExitStack() as stack:
        home = stack.enter_context(Home(log=Path(os.devnull)))  # files that cannot be removed are not reported
        output_log = home.path.parent / "log.txt"  # what the code prints is removed with the home
        program = stack.enter_context(
            Program(command, log=output_log, limits=LIMITS, home=home, folder=file.parent.resolve())
        )
        program.wait()
        error_text = _read_if_written(program, ERROR_FILE, MAX_ERROR_BYTES)
        if error_text:
            raise SuiteError(in_one_line(error_text.decode("utf-8", "replace")))
        return program.read(SCENE_FILE, most_bytes=MAX_SCENE_BYTES)


def _failure_reason(failure: EstimatorFailure) -> str:
    """Why there is no scene, in words for the author of a maker. Failures are worded for authors of estimators."""
    if failure.kind == "timeout":
        return f"took more than {LIMITS.trial_s:g} s"
    if isinstance(failure, OutputFailure):
        return NO_SCENE if failure.problem is None else f"{NO_SCENE}: {SCENE_FILE} {failure.problem}"
    return failure.reason


def _read_if_written(program: Program, name: str, most_bytes: int) -> bytes:
    """The content of a file that the program may have written; empty if it cannot be read."""
    try:
        return program.read(name, most_bytes=most_bytes)
    except EstimatorFailure:
        return b""
