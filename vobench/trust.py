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
    """The check that a process makes before a maker runs.

    `announce` is called with a sentence that names the maker, once for each maker.
    `trusted_folders` and `hash_folder` return the folders of `TrustPolicy`.
    `announced` are the makers that have been announced.
    """

    announce: Callable[[str], object]
    trusted_folders: Callable[[], Iterable[Path]]
    hash_folder: Callable[[], Path | None]
    trusts_new: bool = False
    trusted_versions: set[str] = field(default_factory=set)
    announced: set[Path] = field(default_factory=set)


def _ignore(_: str) -> None:
    """Do not announce makers."""


# The last one is in force. The first one is for Python programs that import vobench.
_gates = [Gate(_ignore, trusted_folders=lambda: (Path.cwd(),), hash_folder=lambda: None)]


@contextmanager
def gate(
    announce: Callable[[str], object],
    *,
    trusted_folders: Callable[[], Iterable[Path]],
    hash_folder: Callable[[], Path | None],
) -> Iterator[None]:
    """A block, such as a command, in which makers are announced before they run, and untrusted ones are refused.

    The arguments are those of `Gate`.
    """
    _gates.append(Gate(announce, trusted_folders, hash_folder))
    try:
        yield
    finally:
        _gates.pop()


def trust_new() -> None:
    """Trust every maker that the current command runs, and remember its hash."""
    _gates[-1].trusts_new = True


def trust_version(sources: Iterable[bytes]) -> None:
    """Trust one version of a maker in this process. `sources` are those of `admit`."""
    _gates[-1].trusted_versions.add(_version(sources))


def policy() -> TrustPolicy:
    """The policy in force, for processes that work for this one."""
    current = _gates[-1]
    return TrustPolicy(
        trusted_folders=tuple(folder.resolve() for folder in current.trusted_folders()),
        hash_folder=current.hash_folder(),
        trusted_versions=frozenset(current.trusted_versions),
        trusts_new=current.trusts_new,
    )


def adopt(policy: TrustPolicy) -> None:
    """Apply the policy of another process, which has already announced the makers."""
    _gates[:] = [
        Gate(
            _ignore,
            trusted_folders=lambda: policy.trusted_folders,
            hash_folder=lambda: policy.hash_folder,
            trusts_new=policy.trusts_new,
            trusted_versions=set(policy.trusted_versions),
        )
    ]


def admit(maker: Path, sources: Iterable[bytes], scene_name: str, *, is_contained: bool) -> None:
    """Announce a maker that is about to run.

    `sources` are the maker's code and the code beside it. They are read only if trust is required.
    `is_contained` is whether a sandbox hides the user's files from the maker.
    Raises SuiteError if it does not, and the user does not trust the maker.
    """
    current = _gates[-1]
    path = maker.resolve()
    is_in_trusted_folder = any(path.is_relative_to(folder.resolve()) for folder in current.trusted_folders())
    if not is_contained and not is_in_trusted_folder:
        _require_trust(current, path, sources)
    if path not in current.announced:
        current.announced.add(path)
        current.announce(f"scene {scene_name} runs the program {maker}")


def _require_trust(current: Gate, maker: Path, sources: Iterable[bytes]) -> None:
    """Raise SuiteError if the user does not trust this version of a maker. A newly trusted version is remembered."""
    version = _version(sources)
    hash_folder = current.hash_folder()
    hash_file = hash_folder / version if hash_folder else None
    is_remembered = hash_file is not None and hash_file.is_file()
    if version in current.trusted_versions or is_remembered:
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


def _version(sources: Iterable[bytes]) -> str:
    """A hash of a maker's code and the code beside it."""
    version = hashlib.sha256()
    for source in sources:
        version.update(hashlib.sha256(source).digest())
    return version.hexdigest()
