"""The contract between vobench and an estimator: frames in, poses out, nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings

Image = NDArray[np.uint8]


class Status(StrEnum):
    """The status of an estimator at one frame."""

    INIT = "init"  # the first frame, or a fresh start
    OK = "ok"
    STATIONARY = "stationary"  # no motion seen: the last pose holds
    DEGRADED = "degraded"  # a pose, but from weak evidence
    LOST = "lost"  # no pose


@dataclass(frozen=True, slots=True)
class EncoderReadings:
    """Wheel encoder counts since the start: stamps t_ns (M,) int64, and ticks (M, 2) int64 of left and right wheel."""

    t_ns: NDArray[np.int64]
    ticks: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Frame:
    """The pictures of one instant, and the sensor readings up to it.

    `left` and `right` are grey (H, W) uint8, or RGB (H, W, 3) uint8 for an estimator that needs colour.
    `encoders` and `imu` hold the readings after the last frame, up to and including the stamp of this one.
    Data of sensors that the estimator does not need is None.
    """

    index: int
    t_ns: int
    left: Image | None = None
    right: Image | None = None
    encoders: EncoderReadings | None = None
    imu: ImuReadings | None = None


@dataclass(frozen=True, slots=True)
class Tracks:
    """Points that are tracked from the last frame to this one in the left picture.

    `uv_last_px` and `uv_px` are (N, 2). `inlier` (N,) bool marks the tracks that fit the accepted motion.
    """

    uv_last_px: Array
    uv_px: Array
    inlier: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Result:
    """The answer of an estimator to one frame. `T_odom_frame` (4, 4) is None if it has no pose.

    `frame` is the left camera or the body, as `pose_of` in the manifest says. odom is that frame at the start.
    `reason` is one word for a status other than ok.
    `stats` are numbers to plot.
    `covariance` (6, 6) is that of the pose, in the axes of odom: position in m, then rotation vector in rad.
    `points` (N, 3) are the estimated points of the scene in odom, in m.
    """

    T_odom_frame: Array | None
    status: Status = Status.OK
    reason: str = ""
    tracks: Tracks | None = None
    stats: Mapping[str, float] = field(default_factory=dict)
    covariance: Array | None = None
    points: Array | None = None


class Estimator(Protocol):
    """A visual-odometry estimator that processes one frame at a time, in order.

    It may have a method `finish()`, which is called after the last frame. It returns revised poses T_odom_frame (4, 4)
    of some or all frames, by the index of the frame. They are scored as a second trajectory.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Get the calibration, and the parameters of the manifest with the changes of the suite."""

    def process(self, frame: Frame) -> Result:
        """Process the next frame, and return the current pose."""
