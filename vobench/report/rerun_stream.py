"""A stream of a Rerun recording on the time lines of a trial's frames, with colours and sizes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.report.blueprint import FRAME_TIMELINE
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

Color = tuple[int, int, int]
Indices = NDArray[np.int64]

GREEN = (60, 200, 90)
RED = (235, 60, 60)
PATH_RADIUS = rr.Radius.ui_points(1.8)
LINE_RADIUS = rr.Radius.ui_points(1.5)
PIXEL_CENTRE = 0.5  # Rerun has the corner of the top-left pixel at (0, 0), vobench its centre


def time_columns(frames: Indices, t_ns: Stamps) -> list[rr.TimeColumn]:
    """The number of each frame, and the time since the start."""
    elapsed = rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))
    return [rr.TimeColumn(FRAME_TIMELINE, sequence=frames), elapsed]


@dataclass(frozen=True, slots=True)
class FrameStream:
    """A Rerun stream with the stamps t_ns (N,) of the frames, the first of which has the number `first`."""

    stream: rr.RecordingStream
    t_ns: Stamps
    first: int = 0

    @property
    def count(self) -> int:
        """The number of frames."""
        return len(self.t_ns)

    def static(self, entity: str, *components: Any) -> None:
        """Log components that hold at all times."""
        self.stream.log(entity, *components, static=True)

    def columns(self, entity: str, frames: Indices, columns: Any) -> None:
        """Send one row for each of these frames, on both time lines."""
        if len(frames):
            times = time_columns(frames + self.first, self.t_ns[frames])
            self.stream.send_columns(entity, times, columns)

    def every(self, entity: str, columns: Any) -> None:
        """Send one row for each frame."""
        self.columns(entity, np.arange(self.count), columns)

    def poses(self, entity: str, frames: Indices, T: Array) -> None:
        """Send the pose of an entity (K, 4, 4) in its parent, for each of these frames."""
        columns = rr.Transform3D.columns(translation=T[:, :3, 3], mat3x3=T[:, :3, :3])
        self.columns(entity, frames, columns)

    def match(self, t_ns: Stamps) -> tuple[Indices, Indices]:
        """The frames that have a sample within half the time between frames, and the index of that sample."""
        if not len(t_ns):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        after = np.searchsorted(t_ns, self.t_ns).clip(max=len(t_ns) - 1)
        before = (after - 1).clip(min=0)
        is_before_nearer = self.t_ns - t_ns[before] < t_ns[after] - self.t_ns
        nearest = np.where(is_before_nearer, before, after)
        step_ns = np.diff(self.t_ns).min(initial=NS_PER_S)
        distance_ns = np.abs(t_ns[nearest] - self.t_ns)
        frames = np.flatnonzero(2 * distance_ns < step_ns)
        return frames, nearest[frames]
