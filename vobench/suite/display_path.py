"""Paths in messages."""

import os
from pathlib import Path


def display_path(path: Path) -> str:
    """A path as a user would type it: relative if it is inside the working directory, otherwise absolute."""
    absolute = path.resolve()
    working_folder = Path.cwd()
    if absolute.is_relative_to(working_folder):
        return os.path.relpath(absolute, working_folder)
    return str(absolute)
