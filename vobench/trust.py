"""Decides which scene makers may run. A maker is a Python program beside a scene.

If this machine has a sandbox, every maker may run in it. Without a sandbox, the makers below the working folder may
run. Any other maker runs only after the user has trusted that version of its code: with `--trust` on the command line,
or `vobench.trust_maker` in Python.
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

    `trusted_folders` are the folders below which all makers are trusted.
    `hash_folder` is the folder that holds the hashes of trusted makers, if there is one.
    `trusted_versions` are the hashes of other trusted makers.
    `trusts_new` is whether every maker that is about to run is trusted from then on.
    """

    trusted_folders: tuple[Path, ...] = ()
    hash_folder: Path | None = None
    trusted_versions: frozenset[str] = frozenset()
    trusts_new: bool = False


@dataclass(slots=True)
class Gate:
    """What a process has to know to check a maker before it runs.

    `announce` is called once for each maker, with a sentence that names it.
    `trusted_folders` and `hash_folder` return the folders of `TrustPolicy`. They are called for each check, because the
    working folder may change.
    `trusts_new` and `trusted_versions` are as in `TrustPolicy`.
    `announced` are the paths of the makers that have been announced.
    """

    announce: Callable[[str], object]
    trusted_folders: Callable[[], Iterable[Path]]
    hash_folder: Callable[[], Path | None]
    trusts_new: bool = False
    trusted_versions: set[str] = field(default_factory=set)
    announced: set[Path] = field(default_factory=set)


def _announce_nothing(_: str) -> None:
    """Do not announce makers."""


# A stack of gates, of which the last is in force. A `gate` block adds its gate when it begins and removes it when it
# ends. The first gate is never removed. It applies in Python programs that import vobench: they trust the makers below
# the working folder, and no hashes are stored.
_gates = [Gate(_announce_nothing, trusted_folders=lambda: (Path.cwd(),), hash_folder=lambda: None)]


def _current_gate() -> Gate:
    return _gates[-1]


@contextmanager
def gate(
    announce: Callable[[str], object],
    *,
    trusted_folders: Callable[[], Iterable[Path]],
    hash_folder: Callable[[], Path | None],
) -> Iterator[None]:
    """Put a new gate in force during a `with` block, such as a command of the command line.

    The arguments are those of `Gate`. After the block, the gate from before it is in force again.
    """
    _gates.append(Gate(announce, trusted_folders, hash_folder))
    try:
        yield
    finally:
        _gates.pop()


def trust_new() -> None:
    """Trust every maker that runs while the current gate is in force, and store the hash of its code."""
    _current_gate().trusts_new = True


def trust_version(sources: Iterable[bytes]) -> None:
    """Trust one version of a maker while the current gate is in force. `sources` are those of `admit`."""
    _current_gate().trusted_versions.add(_version_hash(sources))


def policy() -> TrustPolicy:
    """The policy in force, which can be sent to a worker process."""
    current = _current_gate()
    return TrustPolicy(
        trusted_folders=tuple(folder.resolve() for folder in current.trusted_folders()),
        hash_folder=current.hash_folder(),
        trusted_versions=frozenset(current.trusted_versions),
        trusts_new=current.trusts_new,
    )


def adopt(policy: TrustPolicy) -> None:
    """Replace all gates of this process, a worker, by one with the policy of the process that it works for.

    The gate announces nothing, because the other process has announced the makers.
    """
    adopted = Gate(
        _announce_nothing,
        trusted_folders=lambda: policy.trusted_folders,
        hash_folder=lambda: policy.hash_folder,
        trusts_new=policy.trusts_new,
        trusted_versions=set(policy.trusted_versions),
    )
    _gates[:] = [adopted]


def admit(maker: Path, sources: Iterable[bytes], scene_name: str, *, is_contained: bool) -> None:
    """Check whether a maker may run, and announce it.

    `sources` are the maker's code and the code beside it. They are read only if the user's trust is required.
    `is_contained` is whether the maker runs in a sandbox, which hides the user's files from it.
    Raises SuiteError if the maker may not run.
    """
    current = _current_gate()
    path = maker.resolve()
    if not is_contained and not _is_in_trusted_folder(current, path):
        _require_trust(current, path, sources)
    if path not in current.announced:
        current.announced.add(path)
        current.announce(f"scene {scene_name} runs the program {maker}")


def _is_in_trusted_folder(current: Gate, maker: Path) -> bool:
    return any(maker.is_relative_to(folder.resolve()) for folder in current.trusted_folders())


def _require_trust(current: Gate, maker: Path, sources: Iterable[bytes]) -> None:
    """Raise SuiteError if the user does not trust this version of a maker.

    If new makers are trusted, the version is trusted from now on, and its hash is stored.
    """
    version = _version_hash(sources)
    if version in current.trusted_versions:
        return
    hash_folder = current.hash_folder()
    hash_file = hash_folder / version if hash_folder else None
    if hash_file is not None and hash_file.is_file():
        return
    if not current.trusts_new:
        raise SuiteError(
            "is a program from outside the working folder, and this machine has no sandbox, so that it would run with "
            "all your rights; read it, then run check, run, scene, render or drive with --trust, or in Python call "
            f"vobench.trust_maker, once for each version of it: {maker}"
        )
    current.trusted_versions.add(version)
    if hash_file is not None:
        with suppress(OSError):  # the user is asked again if the hash cannot be stored
            hash_file.parent.mkdir(parents=True, exist_ok=True)
            hash_file.write_text(f"{maker}\n", encoding="utf-8")


def _version_hash(sources: Iterable[bytes]) -> str:
    """The hash that identifies one version of a maker: of its code and the code beside it.

    Each file is hashed first, so that the same bytes in other files give another hash.
    """
    version = hashlib.sha256()
    for source in sources:
        version.update(hashlib.sha256(source).digest())
    return version.hexdigest()
