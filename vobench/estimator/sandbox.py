"""What an estimator may see: the files that it is given, what it saw beyond them, and the sentence on that."""

import os
import shutil
import site
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from vobench.estimator import isolation
from vobench.estimator.manifest import Limits

READ = "VOBENCH_SANDBOX_READ"
SWITCH = "VOBENCH_SANDBOX"
OFF = "off"
# Never opened: an estimator has /dev, /proc, /sys and /tmp of its own, and / would be all files.
NEVER_READ = ("/", "/dev", "/proc", "/sys", "/tmp")
MEBIBYTE = 1 << 20
DISK_ALLOWANCE_BYTES = MEBIBYTE  # beyond the limit, so that an estimator can exceed it and this is noticed

Level = Literal["full", "partial", "none"]
EVERYTHING = (isolation.FILES, isolation.PROCESSES, isolation.NETWORK)


@dataclass(frozen=True, slots=True)
class Sandbox:
    """How well an estimator was isolated.

    sees: what it could see beyond its own files and processes. read: the folders that the user has opened to it.
    why: the reason that the kernel did not allow a mount tree of its own; empty if it did.
    """

    level: Level
    sees: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
    why: str = ""

    @property
    def sentence(self) -> str:
        """What the estimator saw, for a person."""
        opened = [f"{path} ({READ})" for path in self.read]
        if self.level == "none":
            return f"not sandboxed: it could see {_listed(self.sees)}"
        files = [] if isolation.FILES in self.sees else ["only its own files"]
        return f"saw {_listed([*files, *opened, *self.sees])}"


def _listed(things: Sequence[str]) -> str:
    """Things as a sentence lists them."""
    if len(things) < 2:
        return "".join(things)
    return f"{', '.join(things[:-1])} and {things[-1]}"


def of_report(sees: Sequence[str], why: str) -> Sandbox:
    """The record of a program that is isolated but for what it sees."""
    level: Level = "partial" if sees else "full"
    if isolation.FILES in sees and isolation.PROCESSES in sees:
        level = "none"
    return Sandbox(level, tuple(sees), opened(), why)


def unsandboxed() -> Sandbox:
    """The record of a program that runs as any other, since the user or the system has it so."""
    why = f"{SWITCH}={OFF}" if is_switched_off() else "not Linux"
    return Sandbox("none", EVERYTHING, why=why)


def is_switched_off() -> bool:
    """Whether the user wants no sandbox, say for programs that start containers."""
    return os.environ.get(SWITCH, "").lower() == OFF


def opened() -> tuple[str, ...]:
    """The folders that the user has opened to all estimators by $VOBENCH_SANDBOX_READ."""
    return tuple(path for path in _named_folders() if not _is_never_read(path))


def note_on_unopened() -> str:
    """Why some folders in $VOBENCH_SANDBOX_READ are not opened, as one sentence; empty if all are."""
    unopened = [path for path in _named_folders() if _is_never_read(path)]
    if not unopened or is_switched_off():
        return ""
    return (
        f"{READ} does not open {_listed(unopened)}: estimators have their own /dev, /proc, /sys and /tmp, "
        "and / holds all files; name the folders inside that they need"
    )


def _named_folders() -> list[str]:
    """The folders in $VOBENCH_SANDBOX_READ."""
    words = [word for word in os.environ.get(READ, "").split(os.pathsep) if word]
    return [os.path.abspath(os.path.expanduser(word)) for word in words]


def _is_never_read(path: str) -> bool:
    return os.path.realpath(path) in NEVER_READ


def libraries() -> list[str]:
    """The interpreter and its libraries: prefixes, the user's site-packages, and the package vobench."""
    folders = [sys.prefix, sys.base_prefix, sys.exec_prefix, str(Path(__file__).parents[1])]
    if site.ENABLE_USER_SITE and os.path.isdir(site.getusersitepackages()):
        folders.append(site.getusersitepackages())
    return list(dict.fromkeys(os.path.abspath(folder) for folder in folders))


def user_packages() -> dict[str, str]:
    """The variable that keeps the user's site-packages where they are, though HOME is another."""
    return {"PYTHONUSERBASE": site.getuserbase()} if site.ENABLE_USER_SITE else {}


def plan(
    argv: Sequence[str], *, home: Path, homes: Path, folder: Path | None, hidden: Sequence[Path], limits: Limits
) -> dict[str, Any]:
    """The guard's instructions: the program to start, its limits and what it may see, in types that marshal supports.

    home: the folder to work in, empty or with what the program is given. homes: the folder with the homes of all
    estimators. folder: the estimator's. hidden: paths that are empty to the estimator even in a readable folder.
    """
    own = [] if folder is None else [str(folder.absolute())]
    return {
        "is_isolated": not is_switched_off() and sys.platform == "linux",
        "program": found(argv[0], folder),
        "argv": list(argv),
        "file_bytes": limits.disk_mib * MEBIBYTE,
        "disk_bytes": limits.disk_mib * MEBIBYTE + DISK_ALLOWANCE_BYTES,
        "memory_bytes": limits.memory_mib * MEBIBYTE,
        "home": str(home),
        "homes": str(homes),
        "read": [*libraries(), *opened(), *own],
        "hidden": [str(path.resolve()) for path in hidden],
        "graphics": _has_graphics(),
    }


def _has_graphics() -> bool:
    """Whether there is a graphics processor, which estimators may use."""
    names = os.listdir("/dev") if os.path.isdir("/dev") else []
    is_nvidia = any(name.startswith(isolation.GRAPHICS_PREFIX) for name in names)
    return is_nvidia or any(os.path.exists(path) for path in isolation.GRAPHICS)


def found(program: str, folder: Path | None) -> str:
    """The path of a program: the first on PATH that an estimator may read, else the first of all.

    So `python3` is the system's where the shim of a version manager, in the user's home, comes before it.
    """
    if os.sep in program:
        return program
    places = os.environ.get("PATH", os.defpath).split(os.pathsep)
    paths = [path for place in places if (path := shutil.which(program, path=place))]
    readable = [path for path in paths if not _out_of_reach([path], folder)]
    return next(iter([*readable, *paths]), program)


def is_out_of_reach(program: str, folder: Path | None) -> bool:
    """Whether a program is there, but in no folder that an estimator may read."""
    return bool(_out_of_reach([found(program, folder)], folder))


def hint_on_modules(folder: Path | None) -> str:
    """Why a module may not be found: the folders of PYTHONPATH that an estimator may not read; empty where it may."""
    named = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    unreadable = _out_of_reach(named, folder)
    if not unreadable:
        return ""
    return f"; PYTHONPATH has {', '.join(unreadable)}, which an estimator may not read: name it in {READ}"


def _out_of_reach(paths: Sequence[str], folder: Path | None) -> list[str]:
    """The paths that exist, but lie in no folder that an estimator may read."""
    readable = [*isolation.SYSTEM, *libraries(), *opened()]
    if folder is not None:
        readable.append(str(folder))
    readable_folders = [Path(name).resolve() for name in readable]

    unreadable = []
    for path in paths:
        if not Path(path).exists():
            continue
        resolved = Path(path).resolve()
        if not any(resolved.is_relative_to(readable_folder) for readable_folder in readable_folders):
            unreadable.append(path)
    return unreadable
