"""The two time lines of a recording."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vobench.trajectory.trajectory import Stamps
from vobench.viewer.blueprint import FRAME_TIMELINE


def time_columns(frames: NDArray[np.int64], t_ns: Stamps) -> list[rr.TimeColumn]:
    """The frame's number, and seconds since the start."""
    seconds = rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))
    return [rr.TimeColumn(FRAME_TIMELINE, sequence=frames), seconds]
