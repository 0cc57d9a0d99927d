"""Selects a part of a recording by the numbers of its frames, written as A:B."""

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from vobench.dataset.overlap import overlap, overlapping_imu, overlapping_truth
from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.sequence import EncodedFrame, StereoFrame
from vobench.trajectory.trajectory import Stamps

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

    def frames() -> Iterator[StereoFrame]:
        for index, frame in enumerate(islice(recording.frames(), chosen.start, chosen.stop)):
            yield replace(frame, index=index)

    def encoded_frames() -> Iterator[EncodedFrame]:
        for index, frame in enumerate(islice(recording.encoded_frames(), chosen.start, chosen.stop)):
            yield replace(frame, index=index)

    truth = None if recording.truth is None else overlapping_truth(recording.truth, t_ns)[0]
    imu = None if recording.imu is None else overlapping_imu(recording.imu, t_ns)[0]
    encoders = recording.encoders
    if encoders is not None:
        rows = _rows(encoders[0], t_ns)
        encoders = (encoders[0][rows], encoders[1][rows])
    exposures = recording.exposures
    if exposures is not None:
        rows = _rows(exposures[0], t_ns)
        exposures = (exposures[0][rows], exposures[1][rows])

    streams_ns = [t_ns]
    streams_ns += [stream.t_ns for stream in (truth, imu) if stream is not None]
    if encoders is not None:
        streams_ns.append(encoders[0])
    note = f"Of {recording.frame_count} frames, {chosen.start} to {chosen.stop - 1} were taken."
    return replace(
        recording,
        frames=frames,
        encoded_frames=encoded_frames,
        t_ns=t_ns,
        start_ns=min(int(stamps[0]) for stamps in streams_ns if len(stamps)),
        truth=truth,
        imu=imu,
        encoders=encoders,
        exposures=exposures,
        notes=(*recording.notes, note),
    )


def _rows(t_ns: Stamps, frames_ns: Stamps) -> slice:
    """The rows of readings in the time of the frames, with one before and one after it."""
    return overlap(t_ns, frames_ns) or slice(0, 0)
