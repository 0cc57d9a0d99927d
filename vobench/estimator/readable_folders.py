"""The folders that an isolated estimator may read: the system's, Python's, its own, and those that the user opens."""

import os
import site
import sys
from pathlib import Path

from vobench.errors import listed
from vobench.estimator import isolation

READ_VARIABLE = "VOBENCH_SANDBOX_READ"
SWITCH_VARIABLE = "VOBENCH_SANDBOX"
OFF = "off"
# The user cannot open these folders. An estimator has a private /dev, /proc, /sys and /tmp, and / holds all files.
NEVER_READ = ("/", "/dev", "/proc", "/sys", "/tmp")


def is_switched_off() -> bool:
    """Whether the user has switched the sandbox off, for example to run programs that start containers."""
    return os.environ.get(SWITCH_VARIABLE, "").lower() == OFF


def readable_folders(estimator_folder: Path | None) -> list[Path]:
    """The real paths of all folders that an isolated estimator may read.

    `estimator_folder` is its own folder, if it has one.
    """
    return [Path(path).resolve() for path in (*isolation.SYSTEM, *granted_folders(estimator_folder))]


def folders_readable_by_all() -> list[Path]:
    """The real paths of the folders that every estimator may read: all folders if estimators are not isolated."""
    if is_switched_off() or sys.platform != "linux":
        return [Path("/")]
    return readable_folders(None)


def granted_folders(estimator_folder: Path | None) -> list[str]:
    """The folders, besides those of the system, that an isolated estimator may read."""
    own_folders = [] if estimator_folder is None else [str(estimator_folder.absolute())]
    return [*python_folders(), *folders_opened_by_user(), *own_folders]


def python_folders() -> list[str]:
    """The folders of Python: its prefixes, the user's site-packages, and the package vobench."""
    folders = [sys.prefix, sys.base_prefix, sys.exec_prefix, str(Path(__file__).parents[1])]
    if site.ENABLE_USER_SITE and os.path.isdir(site.getusersitepackages()):
        folders.append(site.getusersitepackages())
    return list(dict.fromkeys(os.path.abspath(folder) for folder in folders))


def user_site_environment() -> dict[str, str]:
    """The environment variable by which Python finds the user's site-packages in spite of another HOME.

    Empty if Python does not use the user's site-packages.
    """
    return {"PYTHONUSERBASE": site.getuserbase()} if site.ENABLE_USER_SITE else {}


def folders_opened_by_user() -> tuple[str, ...]:
    """The folders that the user has opened to all estimators with $VOBENCH_SANDBOX_READ."""
    return tuple(path for path in _named_folders() if not _is_never_read(path))


def note_on_unopened() -> str:
    """A sentence about the folders in $VOBENCH_SANDBOX_READ that are not opened; empty if all of them are."""
    unopened = [path for path in _named_folders() if _is_never_read(path)]
    if not unopened or is_switched_off():
        return ""
    return (
        f"{READ_VARIABLE} does not open {listed(unopened)}: estimators have their own /dev, /proc, /sys and /tmp, "
        "and / holds all files; name the subfolders that they need"
    )


def _named_folders() -> list[str]:
    """The absolute paths of the folders in $VOBENCH_SANDBOX_READ."""
    words = [word for word in os.environ.get(READ_VARIABLE, "").split(os.pathsep) if word]
    return [os.path.abspath(os.path.expanduser(word)) for word in words]


def _is_never_read(path: str) -> bool:
    return os.path.realpath(path) in NEVER_READ
