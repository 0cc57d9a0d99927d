"""Checks the PNG file that a command is to write."""

from pathlib import Path

from vobench.errors import InputError


def require_png(out: Path) -> None:
    """Raise InputError unless `--out` is a .png in an existing folder."""
    if out.suffix != ".png" or out.is_dir() or not out.parent.is_dir():
        raise InputError(f"--out should be a .png in an existing folder, got {out}")
