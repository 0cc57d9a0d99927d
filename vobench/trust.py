"""Whose Python code may run as the maker of a scene.

A maker is a program. On the command line, makers that vobench brings along and those below the working folder run; any
other runs once the user trusts that version of the file. From Python nobody is asked: who imports vobench decides.
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


def admit(maker: Path, source: bytes, scene: str) -> None:
    """Name a maker that is about to run. Raises SuiteError if it is a strange one that the user does not trust yet."""
    if not _gates:
        return
    in_force = _gates[-1]
    path = maker.resolve()
    is_ours = any(path.is_relative_to(folder.resolve()) for folder in in_force.ours())
    trusted = in_force.folder() / hashlib.sha256(source).hexdigest()
    if not is_ours and not trusted.is_file():
        if not in_force.trusts_new:
            raise SuiteError(
                "is a program that would run with all your rights, from outside the working folder; read it, then run "
                f"check, run, scene, render or drive with --trust, once for each version of it: {maker}"
            )
        with suppress(OSError):  # without a cache it is asked again
            trusted.parent.mkdir(parents=True, exist_ok=True)
            trusted.write_text(f"{path}\n", encoding="utf-8")
    if path not in in_force.named:
        in_force.named.add(path)
        in_force.tell(f"scene {scene} runs the program {maker}")
