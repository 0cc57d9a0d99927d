"""Somebody else's recording as vobench sees it: what it holds, and all that was assumed of it or dropped."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sequence import EncodedFrame, StereoFrame
from vobench.trajectory.trajectory import Stamps, Trajectory

NO_TRUTH = "There is no ground truth."


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording of any form, its pictures not yet read: `frames` reads and checks them one at a time.

    `encoded_frames` are the same as files, untouched where they were 8-bit grey PNG or JPEG.

    `t_ns` (N,) are the pictures' stamps. `truth` is the path of the body in its world, at stamps of its own;
    exposures are their stamps (N,) and times in s and gains in dB (N, 2), encoders their stamps (M,) and counts
    (M, 2). None stands for what there is not.
    `notes` are sentences: everything assumed, converted or dropped.
    """

    form: str
    rig: Rig
    frames: Callable[[], Iterator[StereoFrame]]
    encoded_frames: Callable[[], Iterator[EncodedFrame]]
    t_ns: Stamps
    start_ns: int
    truth: Trajectory | None = None
    imu: ImuReadings | None = None
    encoders: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
    exposures: tuple[NDArray[np.int64], Array] | None = None
    notes: tuple[str, ...] = ()

    @property
    def frame_count(self) -> int:
        """How many pictures, or pairs of them, there are."""
        return len(self.t_ns)
