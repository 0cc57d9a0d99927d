"""Selects a part of a recording by the numbers of its frames, written as A:B."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.overlap import overlap, overlapping_imu, overlapping_truth
from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.sequence import EncodedFrame, StereoFrame
from vobench.trajectory.trajectory import Stamps

Frame = TypeVar("Frame", StereoFrame, EncodedFrame)
Number = TypeVar("Number", bound=np.generic)

FRAME_RANGE = re.compile(r"(?P<first>\d*):(?P<end>\d*)")  # A:B, in which both numbers are optional


def frame_slice(text: str, *, name: str = "frames") -> slice:
    """The frames from A to B - 1, written as A:B; both are optional.

    Raises InputError if the text of the option with a name is not like that.
    """
    match = FRAME_RANGE.fullmatch(text)
    if match is None:
        raise InputError(f"{name} should be A:B, two frame numbers, as in 40:80 (got {text!r})")
    first = int(match["first"]) if match["first"] else None
    end = int(match["end"]) if match["end"] else None
    return slice(first, end)


def with_frames(recording: Recording, text: str) -> Recording:
    """The part of a recording with the frames A:B, which are counted from 0 again; truth and readings are cut to it.

    Raises InputError if there is no such frame.
    """
    chosen = range(recording.frame_count)[frame_slice(text)]
    if not chosen:
        raise InputError(f"frames {text} should be some of the recording's, which has {recording.frame_count}")
    t_ns = recording.t_ns[chosen.start : chosen.stop]

    truth = None if recording.truth is None else overlapping_truth(recording.truth, t_ns)[0]
    imu = None if recording.imu is None else overlapping_imu(recording.imu, t_ns)[0]
    encoders = None if recording.encoders is None else _overlapping(*recording.encoders, t_ns)
    exposures = None if recording.exposures is None else _overlapping(*recording.exposures, t_ns)

    streams_ns = [t_ns]
    streams_ns += [stream.t_ns for stream in (truth, imu) if stream is not None]
    if encoders is not None:
        streams_ns.append(encoders[0])
    note = f"Of {recording.frame_count} frames, {chosen.start} to {chosen.stop - 1} were taken."
    return replace(
        recording,
        frames=_part(recording.frames, chosen),
        encoded_frames=_part(recording.encoded_frames, chosen),
        t_ns=t_ns,
        start_ns=min(int(stamps[0]) for stamps in streams_ns if len(stamps)),
        truth=truth,
        imu=imu,
        encoders=encoders,
        exposures=exposures,
        notes=(*recording.notes, note),
    )


def _part(frames: Callable[[], Iterator[Frame]], chosen: range) -> Callable[[], Iterator[Frame]]:
    """The iteration over the chosen ones of frames, counted from 0."""

    def chosen_frames() -> Iterator[Frame]:
        for index, frame in enumerate(islice(frames(), chosen.start, chosen.stop)):
            yield replace(frame, index=index)

    return chosen_frames


def _overlapping(t_ns: Stamps, values: NDArray[Number], frames_ns: Stamps) -> tuple[Stamps, NDArray[Number]]:
    """The stamps (M,) and values (M, ...) in the time of the frames, with one before and one after it."""
    rows = overlap(t_ns, frames_ns) or slice(0, 0)
    return t_ns[rows], values[rows]
