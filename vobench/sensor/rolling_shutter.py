"""The exposure of each row of a picture by a rolling shutter."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vobench.errors import InputError
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps


@dataclass(frozen=True, slots=True)
class RowStrip:
    """A strip of adjacent rows that are exposed at the same time.

    `rows` are the rows of the strip.
    `start_ns` (M,) is the start of each sub-frame of the exposure.
    `end_ns` (M,) is the end of each sub-frame.
    """

    rows: slice
    start_ns: Stamps
    end_ns: Stamps

    @property
    def mid_ns(self) -> Stamps:
        """The time (M,) at the middle of each sub-frame, for which it is rendered."""
        durations_ns = self.end_ns - self.start_ns
        return self.start_ns + durations_ns // 2


def row_strips(
    height: int,
    *,
    readout_s: float,
    t_ns: int,
    exposure_s: float,
    strip_count: int,
    sub_frames: int,
) -> list[RowStrip]:
    """The row strips of a picture from top to bottom.

    `height` is the number of rows.
    `readout_s` is the number of rows times the delay between adjacent rows; it is 0 for a global shutter.
    `t_ns` is the mid-exposure time of the middle row.
    `exposure_s` is the exposure time of each row.
    `strip_count` is the number of strips. For a global shutter there is always one strip.
    `sub_frames` is the number of sub-frames into which the exposure is divided.

    All rows of a strip are exposed at the time of its middle row, so the time of its outermost rows is wrong by up to
    readout_s / (2 · strip_count).
    Raises InputError if the exposure has fewer nanoseconds than sub-frames, if the picture has fewer rows than strips,
    or if a number is below 1.
    Source: Kalibr; row v is exposed v times the line delay after row 0.
    """
    exposure_ns = round(exposure_s * NS_PER_S)
    readout_ns = round(readout_s * NS_PER_S)
    if not 1 <= sub_frames <= exposure_ns:
        raise InputError(f"an exposure of {exposure_ns} ns cannot be divided into {sub_frames} sub-frames")
    if not 1 <= strip_count <= height:
        raise InputError(f"{height} rows cannot be divided into {strip_count} strips")

    border_offsets_ns = _sub_frame_borders_ns(exposure_ns, sub_frames)
    strips = []
    is_global_shutter = readout_ns == 0
    strip_rows = _strip_rows(height, 1 if is_global_shutter else strip_count)
    for rows in strip_rows:
        mid_ns = t_ns + _delay_ns(rows, height, readout_ns)
        start_ns = mid_ns - exposure_ns // 2
        borders_ns = start_ns + border_offsets_ns
        strips.append(RowStrip(rows, borders_ns[:-1], borders_ns[1:]))
    return strips


def row_stamps(height: int, *, readout_s: float, t_ns: int) -> Stamps:
    """The mid-exposure time (height,) of each row.

    `height` is the number of rows.
    `readout_s` is the number of rows times the delay between adjacent rows.
    `t_ns` is the mid-exposure time of the middle row.
    """
    readout_ns = round(readout_s * NS_PER_S)
    stamps = []
    for row in range(height):
        delay_ns = _delay_ns(slice(row, row + 1), height, readout_ns)
        stamps.append(t_ns + delay_ns)
    return np.array(stamps, np.int64)


def _strip_rows(height: int, strip_count: int) -> list[slice]:
    """The rows of each strip. The numbers of rows of two strips differ by at most 1."""
    borders = [height * index // strip_count for index in range(strip_count + 1)]
    return [slice(first, end) for first, end in pairwise(borders)]


def _sub_frame_borders_ns(exposure_ns: int, sub_frames: int) -> Stamps:
    """The borders (sub_frames + 1,) between sub-frames, relative to the start of the exposure."""
    borders_ns: Stamps = np.arange(sub_frames + 1, dtype=np.int64) * exposure_ns // sub_frames
    return borders_ns


def _delay_ns(rows: slice, height: int, readout_ns: int) -> int:
    """The delay of the middle of adjacent rows relative to the middle of the picture.

    It is negative in the upper half of the picture. Half a nanosecond is rounded away from 0, so two rows at the same
    distance above and below the middle have exactly opposite delays.
    """
    doubled_offset = rows.start + rows.stop - height  # twice the distance in rows between the two middles: an integer
    magnitude_ns = (abs(doubled_offset) * readout_ns + height) // (2 * height)
    return int(magnitude_ns if doubled_offset >= 0 else -magnitude_ns)
