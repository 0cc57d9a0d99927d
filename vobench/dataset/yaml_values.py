"""Numbers, texts and matrices out of a calibration's YAML, with complaints that name file and key."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent

from vobench.dataset.files import read_text
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array

MOST_CHARACTERS = 1 << 16  # calibrations have a thousand or two
OPENCV_HEAD = re.compile(r"\A%YAML:1\.0[^\n]*")  # what OpenCV wants first, and no YAML allows
MOST_BRACKETS = 500  # a camera has a dozen; the parser takes time by the square of their depth
SKEW_TOLERANCE = 1e-3  # of a mount as people print it


@dataclass(frozen=True, slots=True)
class Values:
    """A YAML file as a tree; keys lead to what it says."""

    path: Path
    tree: Any

    def has(self, *keys: str) -> bool:
        """Whether there is something at a place."""
        return self._find(keys) is not None

    def at(self, *keys: str) -> Any:
        """What stands at a place. Raises InputError where nothing does."""
        found = self._find(keys)
        if found is None:
            raise InputError(f"{self.path}: the key {'.'.join(keys)} is missing")
        return found

    def text(self, *keys: str) -> str:
        """A text. Raises InputError."""
        found = self.at(*keys)
        if not isinstance(found, str):
            raise self._wrong(keys, "text", found)
        return found

    def number(self, *keys: str) -> float:
        """A finite number. Raises InputError."""
        found = self.at(*keys)
        if not _is_number(found):
            raise self._wrong(keys, "a finite number", found)
        return float(found)

    def positive(self, *keys: str, or_zero: bool = False) -> float:
        """A finite number above 0, or from 0 on. Raises InputError."""
        found = self.number(*keys)
        if found < 0 or not (found or or_zero):
            raise self._wrong(keys, "0 or more" if or_zero else "above 0", found)
        return found

    def numbers(self, *keys: str) -> list[float]:
        """A list of finite numbers. Raises InputError."""
        found = self.at(*keys)
        if not isinstance(found, list) or not all(map(_is_number, found)):
            raise self._wrong(keys, "a list of finite numbers", found)
        return [float(value) for value in found]

    def size(self, *keys: str) -> tuple[int, int]:
        """Width and height in pixels. Raises InputError."""
        found = self.numbers(*keys)
        if len(found) != 2 or any(value < 1 or value % 1 or value > 1e5 for value in found):
            raise self._wrong(keys, "a width and a height in pixels", found)
        return int(found[0]), int(found[1])

    def transform(self, *keys: str) -> Array:
        """A rigid transform (4, 4), as rows or as EuRoC's rows, cols and data; its rotation is made exact.

        Raises InputError.
        """
        found = self.at(*keys)
        flat = found.get("data") if isinstance(found, dict) else found
        rows = flat if isinstance(flat, list) else []
        cells = [cell for row in rows for cell in (row if isinstance(row, list) else [row])]
        if len(cells) != 16 or not all(map(_is_number, cells)):
            raise self._wrong(keys, "a 4 x 4 matrix of finite numbers", found)
        T = np.array(cells, float).reshape(4, 4)
        if not se3.is_rotation(T[:3, :3], tolerance=SKEW_TOLERANCE) or T[3].tolist() != [0, 0, 0, 1]:
            raise self._wrong(keys, "a rigid transform with the last row 0 0 0 1", T.tolist())
        return se3.transform(se3.nearest_rotation(T[:3, :3]), T[:3, 3])

    def _find(self, keys: tuple[str, ...]) -> Any:
        tree = self.tree
        for key in keys:
            tree = tree.get(key) if isinstance(tree, dict) else None
        return tree

    def _wrong(self, keys: tuple[str, ...], wanted: str, found: Any) -> InputError:
        return InputError(f"{self.path}: {'.'.join(keys)} should be {wanted}, but is {_short(found)}")


def read_yaml(path: Path) -> Values:
    """A YAML 1.2 file with keys and values. Raises InputError, with line and column where there are some."""
    text = OPENCV_HEAD.sub("", read_text(path), count=1)
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"{len(text)} characters are no calibration (at most {MOST_CHARACTERS}): {path}")
    if text.count("[") + text.count("{") > MOST_BRACKETS:
        raise InputError(f"{path}: no YAML of a calibration has more than {MOST_BRACKETS} brackets")
    try:
        _refuse_aliases(text, path)
        tree = YAML(typ="safe", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
        raise InputError(f"{place}: no YAML: {_one_line(error.problem or error)}") from None
    except InputError:
        raise
    except Exception as error:  # odd text makes the parser raise errors of many kinds
        raise InputError(f"{path}: no YAML: {type(error).__name__} {_one_line(error)}") from None
    if not isinstance(tree, dict):
        raise InputError(f"{path}: should be keys with values, but is {_short(tree)}")
    return Values(path, tree)


def _refuse_aliases(text: str, path: Path) -> None:
    """No calibration has an alias, and a few nested ones stand for more than fits in memory."""
    for event in YAML(typ="safe", pure=True).parse(text):
        if isinstance(event, AliasEvent):
            raise InputError(f"{path}:{event.start_mark.line + 1}: an alias (*{event.anchor}) has no place here")


def _is_number(value: Any) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) < 1e300 and math.isfinite(value)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())[:200]


def _short(value: Any) -> str:
    shown = "nothing" if value is None else repr(value)
    return shown if len(shown) <= 120 else f"{shown[:117]}..."
