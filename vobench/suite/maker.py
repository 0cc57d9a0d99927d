"""Runs the maker of a scene: a Python file whose `make(seed)` returns things, materials and, optionally, lights.

A maker can be untrusted code. It therefore runs in the same sandbox as estimators, where it can read the files in its
folder but no other files of the user, and returns the scene as data. The makers that are included in vobench are
trusted, and run in this process.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from vobench import trust
from vobench.errors import SuiteError, error_sentence
from vobench.estimator import isolation
from vobench.estimator.check import in_one_line
from vobench.estimator.home import Home
from vobench.estimator.manifest import Limits
from vobench.estimator.program import EstimatorFailure, Program, sandbox_here
from vobench.suite.catalog import builtin_root
from vobench.suite.maker_message import MakerScene, decode
from vobench.suite.maker_worker import ERROR, SCENE, call

LIMITS = Limits(trial_s=600.0, threads=max(os.cpu_count() or 1, 1))
WORKER = (sys.executable, "-P", "-m", "vobench.suite.maker_worker")
SCENE_BYTES = 2 << 30
ERROR_BYTES = 1 << 16
NO_SCENE = "ended without handing back a scene"


def made_by(maker: Path, *, seed: int, scene: str) -> MakerScene:
    """The scene that a maker creates from a seed. `scene` is the name of the scene.

    Raises SuiteError if the maker fails, or if this machine has no sandbox and the user does not trust the maker.
    """
    if maker.resolve().is_relative_to(builtin_root().resolve()):
        return _in_this_process(maker, seed)
    trust.admit(maker, _sources(maker), scene, is_contained=_is_contained())
    return _in_a_sandbox(maker, seed)


def _in_this_process(maker: Path, seed: int) -> MakerScene:
    try:
        return call(str(maker), seed)
    except Exception as error:
        raise SuiteError(f"{maker}: {error_sentence(error)}") from error


def _is_contained() -> bool:
    """Whether the sandbox on this machine hides the user's files."""
    return isolation.FILES not in sandbox_here().sees


def _sources(maker: Path) -> Iterator[bytes]:
    """The name and content of the maker, followed by those of all other Python files in its folder and subfolders."""
    others = [path for path in maker.parent.rglob("*.py") if path != maker and path.is_file()]
    for path in [maker, *sorted(others)]:
        yield str(path.relative_to(maker.parent)).encode()
        yield path.read_bytes()


def _in_a_sandbox(maker: Path, seed: int) -> MakerScene:
    try:
        return decode(_worker_output(maker, seed))
    except EstimatorFailure as failure:
        raise SuiteError(f"{maker}: {_reason(failure)}") from None
    except SuiteError as error:
        raise SuiteError(f"{maker}: {error}") from None


def _worker_output(maker: Path, seed: int) -> bytes:
    """The encoded scene that a worker process writes in the sandbox.

    Raises EstimatorFailure if the process fails, and SuiteError with the error that the maker raised.
    """
    command = [*WORKER, str(maker.resolve()), str(seed)]
    with ExitStack() as stack:
        home = stack.enter_context(Home(Path(os.devnull)))
        log = home.path.parent / "log.txt"
        program = stack.enter_context(
            Program(command, log=log, limits=LIMITS, home=home, folder=maker.parent.resolve())
        )
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
