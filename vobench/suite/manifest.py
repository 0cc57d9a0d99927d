"""What an estimator's `estimator.yaml` may say: read without importing its code."""

from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import MinLen

from vobench.setting import Matching, settings
from vobench.suite import yaml_file

MANIFEST_FILE = "estimator.yaml"
CLASS_PATH = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*"


Text = Annotated[str, MinLen(1)]


def _key_of(name: str) -> str:
    return "class" if name == "class_path" else name


@settings()
class Manifest:
    """One estimator: its name, where its class is, which sensors it needs and whose pose it gives."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"alias_generator": _key_of}

    name: Annotated[str, Matching(r"[a-z][a-z0-9_]*", "lower-case letters, digits and _, a letter first")]
    version: Text
    class_path: Annotated[str, Matching(CLASS_PATH, "file:Class, as in 'estimator:Mine'")]
    needs: tuple[Literal["stereo", "mono", "colour", "encoders", "imu"], ...] = ()
    pose_of: Literal["left_camera", "body"]
    summary: Text
    paper: str = ""
    params: dict[str, Any] = field(default_factory=dict)


def read_manifest(folder: Path) -> Manifest:
    """The manifest in an estimator's folder. Raises SuiteError, one line, where it is wrong."""
    return yaml_file.read(folder / MANIFEST_FILE, Manifest)
