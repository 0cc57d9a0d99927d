"""Reads sequences of vobench as recordings, and writes recordings as sequences."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from heapq import merge
from operator import itemgetter
from pathlib import Path

from vobench.dataset.layout import Layout
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, SequenceWriter, has_truth, read_truth
from vobench.sequence.mcap_file import part_of
from vobench.sequence.topic import SENSORS_FILE

LEFT_OUT = "The sequence's case, true rig, true velocities and per-pixel ground truth were not carried over."


def is_sequence(path: Path) -> bool:
    """Whether a path is a sensors.mcap or a folder that contains one. The file may be incomplete or damaged."""
    sensors = path / SENSORS_FILE if path.is_dir() else path
    if sensors.name != SENSORS_FILE:
        return False
    return sensors.is_file() or part_of(sensors).is_file()


def read_own(path: Path, _options: ReadOptions) -> Recording:
    """The sensor readings and the true trajectory of a sequence. Raises SequenceError."""
    folder = path.parent if path.is_file() else path
    sequence = Sequence.open(folder)
    frames_ns = sequence.frame_stamps()
    imu = sequence.imu()
    encoders = sequence.encoders()
    exposures = sequence.exposures()
    truth = read_truth(folder) if has_truth(folder) else None

    streams_ns = [frames_ns, imu.t_ns, encoders[0]]
    if truth is not None:
        streams_ns.append(truth.t_ns)
    start_ns = min(int(t_ns[0]) for t_ns in streams_ns if len(t_ns))
    return Recording(
        form="vobench",
        rig=sequence.rig,
        frames=sequence.frames,
        encoded_frames=sequence.encoded_frames,
        t_ns=frames_ns,
        start_ns=start_ns,
        truth=truth,
        imu=imu if len(imu.t_ns) else None,
        encoders=encoders if len(encoders[0]) else None,
        exposures=exposures if len(exposures[0]) else None,
        notes=(LEFT_OUT,),
    )


LAYOUTS = (
    Layout(
        "vobench",
        f"a sequence of vobench: {SENSORS_FILE}",
        is_sequence,
        read_own,
        truth=r"[^/]*/[^/]*\.mcap",
    ),
)


def convert(
    recording: Recording,
    folder: Path,
    *,
    provenance: Mapping[str, str] | None = None,
) -> None:
    """Write a recording as a sequence. Stamps and 8-bit grey pictures are not changed. Raises VobenchError."""
    notes = {"form": recording.form}
    for index, note in enumerate(recording.notes, 1):
        notes[f"note_{index:02d}"] = note

    with SequenceWriter(
        folder,
        recording.rig,
        case_json=None,
        start_ns=recording.start_ns,
        notes=notes,
        provenance=provenance,
    ) as writer:
        if truth := recording.truth:  # the twist is unknown
            for t_ns, T_world_body in zip(truth.t_ns.tolist(), truth.T_world_frame, strict=True):
                writer.write_truth(t_ns, T_world_body, None)
        # `merge` keeps the order of streams at equal stamps, so a reading comes before the picture with its stamp.
        streams = [*_reading_writes(writer, recording), _picture_writes(writer, recording)]
        for _, write in merge(*streams, key=itemgetter(0)):
            write()


Writes = Iterator[tuple[int, Callable[[], None]]]  # stamps in ns, and calls that write the data of the stamp


def _reading_writes(writer: SequenceWriter, recording: Recording) -> Iterator[Writes]:
    """The writes of the readings of the IMU and of the encoders."""
    if imu := recording.imu:
        yield ((int(t), partial(_write_imu, writer, imu, index)) for index, t in enumerate(imu.t_ns))
    if encoders := recording.encoders:
        yield ((int(t), partial(writer.write_encoders, [t], [ticks])) for t, ticks in zip(*encoders, strict=True))


def _write_imu(writer: SequenceWriter, imu: ImuReadings, index: int) -> None:
    row = slice(index, index + 1)
    reading = ImuReadings(imu.t_ns[row], imu.gyro_radps[row], imu.accel_mps2[row])
    writer.write_imu(reading)


def _picture_writes(writer: SequenceWriter, recording: Recording) -> Writes:
    """The writes of the pictures, each with its exposure. Raises InputError for a wrong number of pictures."""
    exposed_ns, settings = recording.exposures or ((), ())
    exposure_of = dict(zip(map(int, exposed_ns), settings, strict=True))
    count = 0
    for frame in recording.encoded_frames():
        yield frame.t_ns, partial(writer.write_encoded_frame, frame.t_ns, frame.left, frame.right, frame.form)
        if frame.t_ns in exposure_of:
            exposure = exposure_of[frame.t_ns].tolist()
            yield frame.t_ns, partial(writer.write_exposure, frame.t_ns, *exposure)
        count += 1
    if count != recording.frame_count:
        raise InputError(f"{count} images were read, but the recording should have {recording.frame_count}")
