"""Runs the maker of a scene: a Python file whose `make(seed)` returns things, materials and, optionally, lights.

A maker is a program that somebody else may have written. It runs in the sandbox of estimators, where it can read its
own folder and no other file of the user's, and hands back data. Makers that vobench brings along are part of vobench
and run in its own process.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from vobench import trust
from vobench.errors import SuiteError
from vobench.estimator import isolation
from vobench.estimator.check import in_one_line
from vobench.estimator.home import Home
from vobench.estimator.manifest import Limits
from vobench.estimator.program import EstimatorFailure, Program, sandbox_here
from vobench.suite.catalog import builtin_root
from vobench.suite.maker_message import MakerScene, decode
from vobench.suite.maker_worker import ERROR, SCENE, call, sentence

LIMITS = Limits(trial_s=600.0, threads=max(os.cpu_count() or 1, 1))
WORKER = (sys.executable, "-P", "-m", "vobench.suite.maker_worker")
SCENE_BYTES = 2 << 30
ERROR_BYTES = 1 << 16


def made_by(maker: Path, *, seed: int, scene: str) -> MakerScene:
    """What a maker makes of a seed, for the scene of that name.

    Raises SuiteError, one line that names the maker, for whatever goes wrong in it; also where there is no sandbox on
    this machine and the user does not trust the maker.
    """
    if maker.resolve().is_relative_to(builtin_root().resolve()):
        return _in_this_process(maker, seed)
    trust.admit(maker, _sources(maker), scene, is_contained=_is_contained())
    return _in_a_sandbox(maker, seed)


def _in_this_process(maker: Path, seed: int) -> MakerScene:
    try:
        return call(str(maker), seed)
    except Exception as error:
        raise SuiteError(f"{maker}: {sentence(error)}") from error


def _is_contained() -> bool:
    """Whether a program in the sandbox of this machine is kept from the user's files."""
    return isolation.FILES not in sandbox_here().sees


def _sources(maker: Path) -> Iterator[bytes]:
    """The maker's code and all other Python code in its folder, with names."""
    others = [path for path in maker.parent.rglob("*.py") if path.name != maker.name and path.is_file()]
    for path in [maker, *sorted(others)]:
        yield str(path.relative_to(maker.parent)).encode()
        yield path.read_bytes()


def _in_a_sandbox(maker: Path, seed: int) -> MakerScene:
    with ExitStack() as opened:
        home = opened.enter_context(Home(Path(os.devnull)))
        log = home.path.parent / "log.txt"
        try:
            argv = [*WORKER, str(maker.resolve()), str(seed)]
            program = opened.enter_context(
                Program(argv, log=log, limits=LIMITS, home=home, folder=maker.parent.resolve())
            )
            program.wait()
            failure = _read(program, ERROR, ERROR_BYTES)
            content = b"" if failure else program.read(SCENE, most_bytes=SCENE_BYTES)
        except EstimatorFailure as failed:
            raise SuiteError(f"{maker}: {_reason(failed)}") from None
    if failure:
        raise SuiteError(f"{maker}: {in_one_line(failure.decode('utf-8', 'replace'))}")
    try:
        return decode(content)
    except SuiteError as error:
        raise SuiteError(f"{maker}: {error}") from None


def _reason(failed: EstimatorFailure) -> str:
    """Why a maker handed back nothing, in a sentence on makers."""
    if failed.kind == "timeout":
        return f"took more than {LIMITS.trial_s:g} s"
    if failed.kind == "invalid_output":
        return "ended without handing back a scene"
    return failed.reason


def _read(program: Program, name: str, most_bytes: int) -> bytes:
    """The content of a file that the program may have written; empty where it has not."""
    try:
        return program.read(name, most_bytes=most_bytes)
    except EstimatorFailure:
        return b""
