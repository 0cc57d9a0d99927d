"""Finds a program on PATH, and names programs and modules that an isolated estimator may not read."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from vobench.estimator.readable_folders import READ_VARIABLE, readable_folders


def program_path(program: str, estimator_folder: Path | None) -> str:
    """The path of a program: the first match on PATH that an estimator may read, or else the first match.

    For example, `python3` is the system's interpreter even if PATH lists the shim of a version manager, which is in the
    user's home, before it. Without a match, it is the program's name.
    """
    if os.sep in program:
        return program
    matches = []
    for search_folder in os.environ.get("PATH", os.defpath).split(os.pathsep):
        path = shutil.which(program, path=search_folder)
        if path is not None:
            matches.append(path)

    for path in matches:
        if not _unreadable([path], estimator_folder):
            return path
    return matches[0] if matches else program


def is_unreadable_program(program: str, estimator_folder: Path | None) -> bool:
    """Whether a program exists, but not in a folder that an estimator may read."""
    path = program_path(program, estimator_folder)
    return bool(_unreadable([path], estimator_folder))


def hint_on_modules(estimator_folder: Path | None) -> str:
    """A clause about the folders in PYTHONPATH that an estimator may not read; empty if it may read all of them."""
    module_folders = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    unreadable = _unreadable(module_folders, estimator_folder)
    if not unreadable:
        return ""
    return f"; PYTHONPATH has {', '.join(unreadable)}, which an estimator may not read: name it in {READ_VARIABLE}"


def _unreadable(paths: Sequence[str], estimator_folder: Path | None) -> list[str]:
    """The paths that exist, but not in a folder that an estimator may read."""
    folders = readable_folders(estimator_folder)
    unreadable = []
    for path in paths:
        if not Path(path).exists():
            continue
        resolved = Path(path).resolve()
        if not any(resolved.is_relative_to(folder) for folder in folders):
            unreadable.append(path)
    return unreadable
