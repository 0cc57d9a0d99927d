"""What an estimator's `estimator.yaml` may say: read without importing its code."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from vobench.setting import Matching
from vobench.suite import yaml_file

MANIFEST_FILE = "estimator.yaml"
CLASS_PATH = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*"


class Manifest(BaseModel):
    """One estimator: its name, where its class is, which sensors it needs and whose pose it gives."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, populate_by_name=True)

    name: Annotated[str, Matching(r"[a-z][a-z0-9_]*", "lower-case letters, digits and _, a letter first")]
    version: Annotated[str, Field(min_length=1)]
    class_path: Annotated[str, Field(alias="class"), Matching(CLASS_PATH, "file:Class, as in 'estimator:Mine'")]
    needs: tuple[Literal["stereo", "mono", "encoders", "imu"], ...] = ()
    pose_of: Literal["left_camera", "body"]
    summary: Annotated[str, Field(min_length=1)]
    paper: str = ""
    params: dict[str, Any] = {}


def read_manifest(folder: Path) -> Manifest:
    """The manifest in an estimator's folder. Raises SuiteError, one line, where it is wrong."""
    return yaml_file.read(folder / MANIFEST_FILE, Manifest)
