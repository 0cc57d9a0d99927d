"""The null hypothesis: the camera never moved."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.plugin import Frame, Result, Rig


class StandStill:
    """Answers every frame with the pose of the first."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Nothing to prepare."""

    def process(self, frame: Frame) -> Result:  # noqa: ARG002
        """The pose of the first frame."""
        return Result(np.eye(4))
