"""The plan that the guard of a program receives: the program, its limits, and the files that it may see."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

from vobench.estimator import isolation
from vobench.estimator.manifest import Limits
from vobench.estimator.program_path import program_path
from vobench.estimator.readable_folders import granted_folders, is_switched_off

MEBIBYTE = 1 << 20
DISK_ALLOWANCE_BYTES = MEBIBYTE  # the disk is larger than the limit by this, so that an excess can be detected


class GuardPlan(TypedDict):
    """The guard's instructions, in types that marshal supports.

    `home` is the working folder, which is empty or holds the program's input.
    `homes` is the folder that holds the working folders of all estimators.
    `read` lists the folders that the program may read besides those of the system.
    `hidden` lists the real paths that appear empty to the program, even inside a readable folder.
    `graphics` is whether the program gets the devices of a graphics processor.
    `inherited` lists the descriptors that only the program keeps.
    """

    is_isolated: bool
    program: str
    argv: list[str]
    file_bytes: int
    disk_bytes: int
    memory_bytes: int
    home: str
    homes: str
    read: list[str]
    hidden: list[str]
    graphics: bool
    inherited: list[int]


def guard_plan(
    argv: Sequence[str],
    *,
    work_folder: Path,
    all_work_folders: Path,
    estimator_folder: Path | None,
    hidden: Sequence[Path],
    limits: Limits,
    inherited: Sequence[int] = (),
) -> GuardPlan:
    """The plan of a program with the command line `argv`.

    `work_folder` and `all_work_folders` are `home` and `homes` of the plan.
    `estimator_folder` is the estimator's own folder, if it has one.
    """
    return {
        "is_isolated": not is_switched_off() and sys.platform == "linux",
        "program": program_path(argv[0], estimator_folder),
        "argv": list(argv),
        "file_bytes": limits.disk_mib * MEBIBYTE,
        "disk_bytes": limits.disk_mib * MEBIBYTE + DISK_ALLOWANCE_BYTES,
        "memory_bytes": limits.memory_mib * MEBIBYTE,
        "home": str(work_folder),
        "homes": str(all_work_folders),
        "read": granted_folders(estimator_folder),
        "hidden": [str(path.resolve()) for path in hidden],
        "graphics": _has_graphics(),
        "inherited": list(inherited),
    }


def _has_graphics() -> bool:
    """Whether this machine has a graphics processor."""
    device_names = os.listdir("/dev") if os.path.isdir("/dev") else []
    is_nvidia = any(name.startswith(isolation.GRAPHICS_PREFIX) for name in device_names)
    return is_nvidia or any(os.path.exists(path) for path in isolation.GRAPHICS)
