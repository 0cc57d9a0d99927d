"""The content of a sequence that is exported: its rig, readings and ground truth."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vobench.errors import SequenceError
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sequence import (
    Sequence,
    has_case,
    has_truth,
    read_case,
    read_imu_bias,
    read_true_rig,
    read_truth,
    read_twist,
    truth_channels,
)
from vobench.sequence.topic import CASE_ATTACHMENT, TRUTH_FILE
from vobench.trajectory.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class ExportSource:
    """A sequence with its readings and ground truth. What was not recorded is None.

    `true_rig` is the rig with its true calibration; without ground truth, it is the nominal one.
    `truth` is the trajectory of the body.
    `twist` (N, 6) is the linear velocity (m/s) and the angular velocity (rad/s) of the body, in the axes of the body.
    `channels` lists the recorded channels of per-pixel ground truth.
    `case` is the description of the simulated case.
    """

    folder: Path
    sequence: Sequence
    true_rig: Rig
    truth: Trajectory | None = None
    twist: Array | None = None
    bias: ImuBias | None = None
    imu: ImuReadings | None = None
    channels: tuple[str, ...] = ()
    case: Mapping[str, Any] | None = None

    @property
    def rig(self) -> Rig:
        """The nominal calibration, without the IMU if it has no readings."""
        rig = self.sequence.rig
        return rig if self.imu else replace(rig, imu=None)


def open_source(folder: Path) -> ExportSource:
    """Open the sequence in a folder for an export. Raises SequenceError if one of its files is incomplete."""
    sequence = Sequence.open(folder)
    imu = sequence.imu()
    recorded_imu = imu if len(imu.t_ns) else None
    if not has_truth(folder):
        return ExportSource(folder, sequence, sequence.rig, imu=recorded_imu)

    truth = read_truth(folder)
    bias = read_imu_bias(folder)
    return ExportSource(
        folder=folder,
        sequence=sequence,
        true_rig=read_true_rig(folder),
        truth=truth if len(truth) else None,
        twist=read_twist(folder),
        bias=bias if len(bias.t_ns) else None,
        imu=recorded_imu,
        channels=truth_channels(folder),
        case=_case(folder),
    )


def _case(folder: Path) -> Mapping[str, Any] | None:
    """The description of the simulated case; None if the sequence has none.

    JSON that is not an object is no description. Raises SequenceError if the attachment is damaged or is not JSON.
    """
    if not has_case(folder):
        return None
    text = read_case(folder)
    try:
        case = json.loads(text)
    except ValueError as error:  # the text is not JSON, or not UTF-8
        raise SequenceError(f"the attachment {CASE_ATTACHMENT} is not JSON ({error}): {folder / TRUTH_FILE}") from None
    return case if isinstance(case, dict) else None
