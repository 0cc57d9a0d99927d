"""What an estimator's `estimator.yaml` may say: how it is run, what it needs, what it claims, what it may take."""

import re
from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError, unknown
from vobench.setting import Matching, Positive, settings

MANIFEST_FILE = "estimator.yaml"
CLASS_PATH = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*"
OUT = "poses.txt"
PLACEHOLDER = re.compile(r"\{(\w*)\}")
PLACEHOLDERS = ("dataset", "calib", "out", "seed", "rate_hz")
IN_STREAM = ("seed", "rate_hz")

Text = Annotated[str, MinLen(1)]
Need = Literal["stereo", "mono", "colour", "encoders", "imu"]


Argv = tuple[Annotated[str, MinLen(1)], ...]


@settings()
class Limits:
    """What an estimator may take, its processes together; the clock of `trial_s` runs from its start."""

    start_s: Positive = 60.0
    frame_s: Positive = 20.0
    trial_s: Positive = 7200.0
    memory_mib: Annotated[int, Ge(64)] = 4096
    disk_mib: Annotated[int, Ge(1)] = 4096
    threads: Annotated[int, Ge(1), Le(256)] = 1


USUAL = Limits()


def _key_of(name: str) -> str:
    return "class" if name == "class_path" else name


@settings()
class Manifest:
    """One estimator: its name, one way to run it, which sensors it needs, whose pose it gives, what it claims."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"alias_generator": _key_of}

    name: Annotated[str, Matching(r"[a-z][a-z0-9_]*", "lower-case letters, digits and _, a letter first")]
    version: Text
    class_path: Annotated[str, Matching(CLASS_PATH, "file:Class, as in 'estimator:Mine'")] | None = None
    command: Argv = ()
    stream: Argv = ()
    oracle: bool = False
    dataset: Literal["kitti", "euroc", "tum"] = "kitti"
    out: Annotated[str, Matching(r"(?!.*\.\.)\w[\w.-]*(/\w[\w.-]*)*", "a file below the work folder")] = OUT
    needs: tuple[Need, ...] = ()
    pose_of: Literal["left_camera", "body", "imu"]
    metric: bool = True
    causal: bool = True
    deterministic: bool = True
    limits: Limits = USUAL
    summary: str = ""
    paper: str = ""
    params: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ways = {"class": self.class_path, "command": self.command, "stream": self.stream, "oracle": self.oracle}
        given = [way for way, said in ways.items() if said]
        if len(given) != 1:
            raise SettingError(f"an estimator has one of {', '.join(ways)} (got {' and '.join(given) or 'none'})")
        if self.command and self.out == OUT and not any("{out}" in word for word in self.command):
            raise SettingError(
                "should have {out}, where the program is to write its poses, or `out` say where", "command"
            )
        for key, argv, known in (("command", self.command, PLACEHOLDERS), ("stream", self.stream, IN_STREAM)):
            for name in PLACEHOLDER.findall(" ".join(argv)):
                if name not in (*known, *self.params):
                    raise SettingError(unknown("placeholder or parameter", name, [*known, *self.params]), key)

    @property
    def described(self) -> str:
        """The summary or, where the manifest has none, how the estimator is run and which sensors it needs."""
        if self.summary:
            return self.summary
        how = self.class_path or " ".join(self.command or self.stream) or "oracle"
        return f"{how}, needs {' and '.join(self.needs) or 'no sensor'}"

    @property
    def claims(self) -> tuple[str, ...]:
        """What a board says beside the name, as it is not what all others claim."""
        said = {
            "Sim(3)": not self.metric,
            "whole recording": bool(self.command),
            "not causal": not self.causal and not self.command,
            "not deterministic": not self.deterministic,
            "oracle": self.oracle,
        }
        return tuple(claim for claim, holds in said.items() if holds)
