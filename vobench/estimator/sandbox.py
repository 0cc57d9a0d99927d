"""The record of how well an estimator was isolated."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from vobench.errors import listed
from vobench.estimator import isolation
from vobench.estimator.readable_folders import (
    OFF,
    READ_VARIABLE,
    SWITCH_VARIABLE,
    folders_opened_by_user,
    is_switched_off,
)

Level = Literal["full", "partial", "none"]
EVERYTHING = (isolation.FILES, isolation.PROCESSES, isolation.NETWORK)


@dataclass(frozen=True, slots=True)
class Sandbox:
    """How well an estimator was isolated.

    `sees` lists what the estimator could see besides its own files and processes.
    `read` lists the folders that the user has opened to all estimators, relative to the working folder if they are in
    it: results that are published should not show where they were made.
    `why` is the reason why there is no private mount tree: the sandbox is switched off, the system is not Linux, or the
    kernel did not allow it. It is empty if there is one.
    """

    level: Level
    sees: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
    why: str = ""

    @property
    def sentence(self) -> str:
        """A sentence that says what the estimator could see."""
        if self.level == "none":
            return f"not sandboxed: it could see {listed(self.sees)}"
        opened_folders = [f"{path} ({READ_VARIABLE})" for path in self.read]
        visible = [*opened_folders, *self.sees]
        if isolation.FILES not in self.sees:
            visible.insert(0, "only its own files")
        return f"saw {listed(visible)}"


def from_guard_report(visible: Sequence[str], no_mount_tree_reason: str) -> Sandbox:
    """The record of an isolated program, from the guard's report.

    `visible` lists what the program can see in spite of the isolation.
    `no_mount_tree_reason` is the reason why the kernel did not allow a private mount tree; empty if it did.
    """
    opened_folders = tuple(_shown(folder) for folder in folders_opened_by_user())
    return Sandbox(_level(visible), sees=tuple(visible), read=opened_folders, why=no_mount_tree_reason)


def _shown(folder: str) -> str:
    """The path of a folder, relative to the working folder if it is in it."""
    working_folder = Path.cwd()
    if not Path(folder).is_relative_to(working_folder):
        return folder
    return os.path.relpath(folder, working_folder)


def _level(visible: Sequence[str]) -> Level:
    """How well a program is isolated that can see these things."""
    if not visible:
        return "full"
    # A program that sees the files and the processes of the user can read the ground truth and the harness's memory.
    # Whether it also has the network makes no difference to that.
    sees_user = isolation.FILES in visible and isolation.PROCESSES in visible
    return "none" if sees_user else "partial"


def unsandboxed() -> Sandbox:
    """The record of a program that is not isolated, because the user has switched it off or the system is not Linux."""
    reason = f"{SWITCH_VARIABLE}={OFF}" if is_switched_off() else "not Linux"
    return Sandbox("none", sees=EVERYTHING, why=reason)
