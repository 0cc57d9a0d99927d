"""The sandbox of estimators: the files that they may read, and a record of how well each one was isolated."""

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
# The user cannot open these folders. An estimator has a private /dev, /proc, /sys and /tmp, and / holds all files.
NEVER_READ = ("/", "/dev", "/proc", "/sys", "/tmp")
MEBIBYTE = 1 << 20
DISK_ALLOWANCE_BYTES = MEBIBYTE  # the disk is larger than the limit by this, so that an excess can be detected

Level = Literal["full", "partial", "none"]
EVERYTHING = (isolation.FILES, isolation.PROCESSES, isolation.NETWORK)


@dataclass(frozen=True, slots=True)
class Sandbox:
    """How well an estimator was isolated.

    `sees` lists what the estimator could see besides its own files and processes.
    `read` lists the folders that the user has opened to all estimators.
    `why` is the reason why the kernel did not allow a private mount tree; empty if it did.
    """

    level: Level
    sees: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
    why: str = ""

    @property
    def sentence(self) -> str:
        """A sentence that says what the estimator could see."""
        opened_folders = [f"{path} ({READ})" for path in self.read]
        if self.level == "none":
            return f"not sandboxed: it could see {_listed(self.sees)}"
        files = [] if isolation.FILES in self.sees else ["only its own files"]
        return f"saw {_listed([*files, *opened_folders, *self.sees])}"


def _listed(phrases: Sequence[str]) -> str:
    """The phrases joined by commas, with "and" before the last one."""
    if len(phrases) < 2:
        return "".join(phrases)
    return f"{', '.join(phrases[:-1])} and {phrases[-1]}"


def of_report(sees: Sequence[str], why: str) -> Sandbox:
    """The record of an isolated program, from the guard's report.

    `sees` lists what the program can see in spite of the isolation. `why` is as in `Sandbox`.
    """
    level: Level = "partial" if sees else "full"
    if isolation.FILES in sees and isolation.PROCESSES in sees:
        level = "none"
    return Sandbox(level, tuple(sees), opened(), why)


def unsandboxed() -> Sandbox:
    """The record of a program that is not isolated, because the user has switched the sandbox off or it needs Linux."""
    why = f"{SWITCH}={OFF}" if is_switched_off() else "not Linux"
    return Sandbox("none", EVERYTHING, why=why)


def is_switched_off() -> bool:
    """Whether the user has switched the sandbox off, for example to run programs that start containers."""
    return os.environ.get(SWITCH, "").lower() == OFF


def opened() -> tuple[str, ...]:
    """The folders that the user has opened to all estimators with $VOBENCH_SANDBOX_READ."""
    return tuple(path for path in _named_folders() if not _is_never_read(path))


def note_on_unopened() -> str:
    """A sentence about the folders in $VOBENCH_SANDBOX_READ that are not opened; empty if all of them are."""
    unopened = [path for path in _named_folders() if _is_never_read(path)]
    if not unopened or is_switched_off():
        return ""
    return (
        f"{READ} does not open {_listed(unopened)}: estimators have their own /dev, /proc, /sys and /tmp, "
        "and / holds all files; name the subfolders that they need"
    )


def _named_folders() -> list[str]:
    """The absolute paths of the folders in $VOBENCH_SANDBOX_READ."""
    words = [word for word in os.environ.get(READ, "").split(os.pathsep) if word]
    return [os.path.abspath(os.path.expanduser(word)) for word in words]


def _is_never_read(path: str) -> bool:
    return os.path.realpath(path) in NEVER_READ


def readable() -> list[Path]:
    """The real paths of the folders that every estimator may read: all of them if it is not isolated."""
    if is_switched_off() or sys.platform != "linux":
        return [Path("/")]
    return _allowed()


def _allowed() -> list[Path]:
    """The real paths of the folders that every isolated estimator may read."""
    return [Path(path).resolve() for path in (*isolation.SYSTEM, *libraries(), *opened())]


def libraries() -> list[str]:
    """The folders of Python: its prefixes, the user's site-packages, and the package vobench."""
    folders = [sys.prefix, sys.base_prefix, sys.exec_prefix, str(Path(__file__).parents[1])]
    if site.ENABLE_USER_SITE and os.path.isdir(site.getusersitepackages()):
        folders.append(site.getusersitepackages())
    return list(dict.fromkeys(os.path.abspath(folder) for folder in folders))


def user_packages() -> dict[str, str]:
    """The environment variable by which Python finds the user's site-packages in spite of another HOME."""
    return {"PYTHONUSERBASE": site.getuserbase()} if site.ENABLE_USER_SITE else {}


def plan(
    argv: Sequence[str], *, home: Path, homes: Path, folder: Path | None, hidden: Sequence[Path], limits: Limits
) -> dict[str, Any]:
    """The guard's instructions, in types that marshal supports: the program, its limits, and the files that it may see.

    `home` is the working folder, which is empty or holds the program's input.
    `homes` is the folder that holds the homes of all estimators.
    `folder` is the estimator's folder, if it has one.
    `hidden` lists paths that appear empty to the program, even inside a readable folder.
    """
    estimator_folders = [] if folder is None else [str(folder.absolute())]
    return {
        "is_isolated": not is_switched_off() and sys.platform == "linux",
        "program": program_path(argv[0], folder),
        "argv": list(argv),
        "file_bytes": limits.disk_mib * MEBIBYTE,
        "disk_bytes": limits.disk_mib * MEBIBYTE + DISK_ALLOWANCE_BYTES,
        "memory_bytes": limits.memory_mib * MEBIBYTE,
        "home": str(home),
        "homes": str(homes),
        "read": [*libraries(), *opened(), *estimator_folders],
        "hidden": [str(path.resolve()) for path in hidden],
        "graphics": _has_graphics(),
    }


def _has_graphics() -> bool:
    """Whether this machine has a graphics processor."""
    device_names = os.listdir("/dev") if os.path.isdir("/dev") else []
    is_nvidia = any(name.startswith(isolation.GRAPHICS_PREFIX) for name in device_names)
    return is_nvidia or any(os.path.exists(path) for path in isolation.GRAPHICS)


def program_path(program: str, folder: Path | None) -> str:
    """The path of a program: the first match on PATH that an estimator may read, or else the first match.

    For example, `python3` is the system's interpreter even if PATH lists the shim of a version manager, which is in the
    user's home, before it.
    """
    if os.sep in program:
        return program
    search_folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    matches = [path for search_folder in search_folders if (path := shutil.which(program, path=search_folder))]
    readable = [path for path in matches if not _unreadable([path], folder)]
    return next(iter([*readable, *matches]), program)


def is_out_of_reach(program: str, folder: Path | None) -> bool:
    """Whether a program exists, but not in a folder that an estimator may read."""
    return bool(_unreadable([program_path(program, folder)], folder))


def hint_on_modules(folder: Path | None) -> str:
    """A clause about the folders in PYTHONPATH that an estimator may not read; empty if it may read all of them."""
    module_folders = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    unreadable = _unreadable(module_folders, folder)
    if not unreadable:
        return ""
    return f"; PYTHONPATH has {', '.join(unreadable)}, which an estimator may not read: name it in {READ}"


def _unreadable(paths: Sequence[str], folder: Path | None) -> list[str]:
    """The paths that exist, but not in a folder that an estimator may read."""
    readable_folders = _allowed()
    if folder is not None:
        readable_folders.append(folder.resolve())

    unreadable = []
    for path in paths:
        if not Path(path).exists():
            continue
        resolved = Path(path).resolve()
        if not any(resolved.is_relative_to(readable_folder) for readable_folder in readable_folders):
            unreadable.append(path)
    return unreadable
