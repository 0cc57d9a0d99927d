"""The manifest of an estimator, `estimator.yaml`: how it is run, its sensors, its claims and its limits."""

import re
from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError, unknown_name_sentence
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
    """Limits for all processes of an estimator together. `trial_s` is measured from the start of the program."""

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
    """One estimator: its name, how it is run, the sensors it needs, the frame of its poses, and its claims.

    A `baseline` is no competitor: boards show it beside the ranking.
    """

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
    baseline: bool = False
    limits: Limits = USUAL
    summary: str = ""
    paper: str = ""
    params: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        kinds = {
            "class": self.class_path,
            "command": self.command,
            "stream": self.stream,
            "oracle": self.oracle,
        }
        given = [kind for kind, value in kinds.items() if value]
        if len(given) != 1:
            raise SettingError(f"an estimator has one of {', '.join(kinds)} (got {' and '.join(given) or 'none'})")
        names_out = any("{out}" in word for word in self.command)
        if self.command and self.out == OUT and not names_out:
            raise SettingError(
                "should have {out}, the file for the program's poses, or `out` should name it", "command"
            )
        self._check_placeholders("command", self.command, PLACEHOLDERS)
        self._check_placeholders("stream", self.stream, IN_STREAM)

    def _check_placeholders(self, key: str, argv: Argv, placeholders: tuple[str, ...]) -> None:
        """Raise SettingError if an argv has a placeholder that is neither in `placeholders` nor a parameter."""
        known = [*placeholders, *self.params]
        for name in PLACEHOLDER.findall(" ".join(argv)):
            if name not in known:
                raise SettingError(unknown_name_sentence("placeholder or parameter", name, known), key)

    @property
    def described(self) -> str:
        """The summary. Without one, how the estimator is run and which sensors it needs."""
        if self.summary:
            return self.summary
        argv = self.command or self.stream
        program = self.class_path or " ".join(argv) or "oracle"
        sensors = " and ".join(self.needs) or "no sensor"
        return f"{program}, needs {sensors}"

    @property
    def claims(self) -> tuple[str, ...]:
        """The claims that the leaderboard shows beside the name, which most estimators do not make."""
        claims = {
            "Sim(3)": not self.metric,
            "whole recording": bool(self.command),
            "not causal": not self.causal and not self.command,
            "not deterministic": not self.deterministic,
            "oracle": self.oracle,
            "baseline": self.baseline,
        }
        return tuple(claim for claim, holds in claims.items() if holds)
