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
    """What an estimator says of one frame."""

    INIT = "init"  # the first frame, or a fresh start
    OK = "ok"
    STATIONARY = "stationary"  # no motion seen: the last pose holds
    DEGRADED = "degraded"  # a pose, but from weak evidence
    LOST = "lost"  # no pose


@dataclass(frozen=True, slots=True)
class EncoderReadings:
    """Wheel encoder counts since the start: t_ns (M,) int64, ticks (M, 2) int64 left and right."""

    t_ns: NDArray[np.int64]
    ticks: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Frame:
    """All that an estimator sees of one instant: pictures, and the encoders' and the IMU's readings up to it.

    Pictures are grey (H, W) uint8, or (H, W, 3) red, green, blue for one that needs colour: both for an estimator
    that needs stereo, the left one for mono. `encoders` and `imu`
    hold the readings after the last frame up to and including this one's stamp. What was not asked for is None.
    """

    index: int
    t_ns: int
    left: Image | None = None
    right: Image | None = None
    encoders: EncoderReadings | None = None
    imu: ImuReadings | None = None


@dataclass(frozen=True, slots=True)
class Tracks:
    """Points followed from the last frame to this one in the left picture.

    uv_last_px and uv_px are (N, 2); inlier (N,) bool says which the accepted motion explains.
    """

    uv_last_px: Array
    uv_px: Array
    inlier: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Result:
    """What an estimator says of one frame; T_odom_frame is None where it has no pose.

    `frame` is the left camera or the body, as the manifest's `pose_of` says; odom is that frame at
    the start. `reason` is one word for a status that is not ok; `stats` are numbers worth plotting.
    `covariance` (6, 6) is of the pose: position in m, then rotation vector in rad, about the fixed axes of odom.
    `points` (N, 3) are what it takes the scene to be, in odom, in m.
    """

    T_odom_frame: Array | None
    status: Status = Status.OK
    reason: str = ""
    tracks: Tracks | None = None
    stats: Mapping[str, float] = field(default_factory=dict)
    covariance: Array | None = None
    points: Array | None = None


class Estimator(Protocol):
    """A visual-odometry estimator that is fed one frame at a time, in order.

    It may have a method `finish()`, called after the last frame, which returns revised poses T_odom_frame (4, 4) by
    their frame's index, all or some: they are scored as a second track.
    """

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration and the manifest's parameters, as the suite may have changed them."""

    def process(self, frame: Frame) -> Result:
        """Take the next frame; say where the camera is now."""
