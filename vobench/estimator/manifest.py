"""The manifest of an estimator: what `estimator.yaml` says, read without importing its code."""

import difflib
from io import StringIO
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from vobench.errors import SuiteError

MANIFEST_FILE = "estimator.yaml"


class Manifest(BaseModel):
    """One estimator: its name, where its class is, which sensors it needs and whose pose it gives."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    version: str = Field(min_length=1)
    class_path: str = Field(alias="class", pattern=r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*$")
    needs: tuple[Literal["stereo", "encoders"], ...] = ()
    pose_of: Literal["left_camera", "body"]
    summary: str = Field(min_length=1)
    paper: str = ""
    params: dict[str, Any] = {}

    @property
    def module_name(self) -> str:
        """The file inside the folder, without `.py`."""
        return self.class_path.partition(":")[0]

    @property
    def class_name(self) -> str:
        """The class inside that file."""
        return self.class_path.partition(":")[2]


# What would be right, key by key, for people: pydantic speaks of patterns and types.
EXPECTED = {
    "name": "lower-case letters, digits and _ such as 'lk_epipolar'",
    "version": 'a quoted string such as "1"',
    "class": "file:class such as 'estimator:LkEpipolar'",
    "needs": "a list of stereo, encoders, or [] for none",
    "pose_of": "left_camera or body",
    "summary": "one sentence",
    "paper": "a citation",
    "params": "a mapping of names to values",
}


def read_manifest(folder: Path) -> Manifest:
    """The manifest in an estimator's folder.

    Raises SuiteError, one line with file, key, value and what would be right.
    """
    file = folder / MANIFEST_FILE
    try:
        return Manifest.model_validate(_mapping(file))
    except ValidationError as error:
        raise SuiteError(_in_one_line(file, error)) from None


def _mapping(file: Path) -> dict[str, Any]:
    """The YAML mapping in a file."""
    try:
        content = YAML(typ="safe", pure=True).load(StringIO(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise SuiteError(f"cannot read the manifest of an estimator ({error.strerror}): {file}") from None
    except (YAMLError, UnicodeDecodeError) as error:
        raise SuiteError(f"not YAML: {' '.join(str(error).split())}: {file}") from None
    if not isinstance(content, dict):
        raise SuiteError(f"a manifest is a mapping of {', '.join(EXPECTED)}, got {content!r}: {file}")
    return content


def _in_one_line(file: Path, error: ValidationError) -> str:
    """The first of pydantic's complaints, as a person would say it."""
    first = error.errors()[0]
    key, dotted = str(first["loc"][0]), ".".join(map(str, first["loc"]))
    if first["type"] == "extra_forbidden":
        near = difflib.get_close_matches(key, EXPECTED, n=1)
        hint = f"Did you mean {near[0]!r}? " if near else ""
        return f"no key {key!r} in a manifest. {hint}Known: {', '.join(EXPECTED)}: {file}"
    if first["type"] == "missing":
        return f"key {key!r} is missing, expected {EXPECTED[key]}: {file}"
    return f"{dotted} is {first['input']!r}, expected {EXPECTED[key]}: {file}"
