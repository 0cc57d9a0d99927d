"""Whose Python code may run as the maker of a scene.

A maker is a program. Where this machine has a sandbox, every maker runs in it. Where it has none, on the command line,
those below the working folder run; any other runs once the user trusts that version of its code. From Python nobody
is asked.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from vobench.errors import SuiteError


@dataclass(slots=True)
class Gate:
    """What a command does before a maker runs.

    `tell` is given a sentence that names the maker. `ours` are the folders below which makers run unasked, and
    `folder` says where the hashes of trusted makers are kept. A new maker is trusted from now on if `trusts_new`.
    """

    tell: Callable[[str], object]
    ours: Callable[[], Iterable[Path]]
    folder: Callable[[], Path]
    trusts_new: bool = False
    named: set[Path] = field(default_factory=set)


_gates: list[Gate] = []  # the last is in force


@contextmanager
def gate(
    tell: Callable[[str], object], *, ours: Callable[[], Iterable[Path]], folder: Callable[[], Path]
) -> Iterator[None]:
    """A block, such as a command, in which makers are named before they run, and strange ones refused.

    The arguments are those of `Gate`.
    """
    _gates.append(Gate(tell, ours, folder))
    try:
        yield
    finally:
        _gates.pop()


def trust_new() -> None:
    """Trust, from now on, every maker that the command in force is about to run."""
    for each in _gates[-1:]:
        each.trusts_new = True


def admit(maker: Path, sources: Iterable[bytes], scene: str, *, is_contained: bool) -> None:
    """Name a maker that is about to run.

    `sources` are the maker's code and that beside it, read only where trust matters; `is_contained` says whether a
    sandbox keeps the maker from the user's files. Raises SuiteError if none does, and the maker is a strange one that
    the user does not trust yet.
    """
    if not _gates:
        return
    in_force = _gates[-1]
    path = maker.resolve()
    is_ours = any(path.is_relative_to(folder.resolve()) for folder in in_force.ours())
    if not is_contained and not is_ours:
        _require_trust(in_force, path, sources)
    if path not in in_force.named:
        in_force.named.add(path)
        in_force.tell(f"scene {scene} runs the program {maker}")


def _require_trust(in_force: Gate, maker: Path, sources: Iterable[bytes]) -> None:
    """Raise SuiteError if the user does not trust this version of a maker; remember it if the user does from now on."""
    version = hashlib.sha256()
    for source in sources:
        version.update(hashlib.sha256(source).digest())
    trusted = in_force.folder() / version.hexdigest()
    if trusted.is_file():
        return
    if not in_force.trusts_new:
        raise SuiteError(
            "is a program from outside the working folder, and this machine has no sandbox, so that it would run with "
            "all your rights; read it, then run check, run, scene, render or drive with --trust, once for each "
            f"version of it: {maker}"
        )
    with suppress(OSError):  # without a cache it is asked again
        trusted.parent.mkdir(parents=True, exist_ok=True)
        trusted.write_text(f"{maker}\n", encoding="utf-8")
