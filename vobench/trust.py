"""Whose Python code may run as the maker of a scene.

A maker is a program. Where this machine has a sandbox, every maker runs in it. Where it has none, those below the
working folder run. Any other runs only after the user has trusted that version of its code: with `--trust` on the
command line, or `vobench.trust_maker` in Python.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from vobench.errors import SuiteError


@dataclass(frozen=True, slots=True)
class TrustPolicy:
    """Which makers may run without a sandbox. It can be sent to other processes.

    `ours` are the folders below which makers run unasked.
    `hashes` is the folder that holds the hashes of trusted makers, if there is one.
    `versions` are the hashes of other trusted makers.
    A new maker is trusted from now on if `trusts_new`.
    """

    ours: tuple[Path, ...] = ()
    hashes: Path | None = None
    versions: frozenset[str] = frozenset()
    trusts_new: bool = False


@dataclass(slots=True)
class Gate:
    """What a process does before a maker runs.

    `tell` is given a sentence that names the maker. `ours` and `folder` return the folders of `TrustPolicy`.
    """

    tell: Callable[[str], object]
    ours: Callable[[], Iterable[Path]]
    folder: Callable[[], Path | None]
    trusts_new: bool = False
    versions: set[str] = field(default_factory=set)
    named: set[Path] = field(default_factory=set)


def _tell_nobody(_: str) -> None:
    """Ignore the sentence."""


# The last is in force. The first is that of Python programs, which import vobench.
_gates = [Gate(_tell_nobody, ours=lambda: (Path.cwd(),), folder=lambda: None)]


@contextmanager
def gate(
    tell: Callable[[str], object], *, ours: Callable[[], Iterable[Path]], folder: Callable[[], Path | None]
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
    _gates[-1].trusts_new = True


def trust_version(sources: Iterable[bytes]) -> None:
    """Trust one version of a maker in this process. `sources` are those of `admit`."""
    _gates[-1].versions.add(_version(sources))


def policy() -> TrustPolicy:
    """The policy in force, for processes that work for this one."""
    in_force = _gates[-1]
    ours = tuple(folder.resolve() for folder in in_force.ours())
    return TrustPolicy(ours, in_force.folder(), frozenset(in_force.versions), in_force.trusts_new)


def adopt(policy: TrustPolicy) -> None:
    """Apply the policy of another process, which has named the makers already."""
    own = Gate(_tell_nobody, lambda: policy.ours, lambda: policy.hashes, policy.trusts_new, set(policy.versions))
    _gates[:] = [own]


def admit(maker: Path, sources: Iterable[bytes], scene: str, *, is_contained: bool) -> None:
    """Name a maker that is about to run.

    `sources` are the maker's code and that beside it, read only where trust matters; `is_contained` says whether a
    sandbox keeps the maker from the user's files. Raises SuiteError if none does, and the maker is a strange one that
    the user does not trust yet.
    """
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
    version = _version(sources)
    hashes = in_force.folder()
    trusted = hashes / version if hashes else None
    if version in in_force.versions or (trusted and trusted.is_file()):
        return
    if not in_force.trusts_new:
        raise SuiteError(
            "is a program from outside the working folder, and this machine has no sandbox, so that it would run with "
            "all your rights; read it, then run check, run, scene, render or drive with --trust, or in Python call "
            f"vobench.trust_maker, once for each version of it: {maker}"
        )
    in_force.versions.add(version)
    if trusted:
        with suppress(OSError):  # without a cache it is asked again
            trusted.parent.mkdir(parents=True, exist_ok=True)
            trusted.write_text(f"{maker}\n", encoding="utf-8")


def _version(sources: Iterable[bytes]) -> str:
    """A hash of a maker's code and that beside it."""
    version = hashlib.sha256()
    for source in sources:
        version.update(hashlib.sha256(source).digest())
    return version.hexdigest()
