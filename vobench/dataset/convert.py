"""A recording of any form into a sequence: streamed, one pair of pictures in memory."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.sensor.imu import ImuReadings
from vobench.sequence import SequenceWriter
from vobench.trajectory.trajectory import Stamps

IMU, ENCODERS = 0, 1


def convert(recording: Recording, folder: Path, *, provenance: Mapping[str, str] | None = None) -> None:
    """Write a recording as a sequence: stamps exactly, 8-bit grey pictures bit for bit, notes beside the truth.

    Raises VobenchError, and leaves no file that reads as a whole one, where a picture is wrong.
    """
    notes = {"form": recording.form, **{f"note_{index:02d}": note for index, note in enumerate(recording.notes, 1)}}
    exposures = _exposures(recording)
    readings, done, count = _merged(recording), 0, 0
    with SequenceWriter(
        folder, recording.rig, case_json=None, start_ns=recording.start_ns, notes=notes, provenance=provenance
    ) as writer:
        _write_truth(writer, recording)
        for frame in recording.encoded_frames():
            until = int(np.searchsorted(readings.t_ns, frame.t_ns, side="right"))
            _write_readings(writer, recording, readings, done, until)
            writer.write_encoded_frame(frame.t_ns, frame.left, frame.right, frame.form)
            if frame.t_ns in exposures:
                writer.write_exposure(frame.t_ns, *exposures[frame.t_ns])
            done, count = until, count + 1
        _write_readings(writer, recording, readings, done, len(readings.t_ns))
        if count != recording.frame_count:
            raise InputError(f"{count} pictures came, but the recording should have {recording.frame_count}: {folder}")


def _write_truth(writer: SequenceWriter, recording: Recording) -> None:
    """The true path; how fast the body was is not known of somebody else's recording."""
    if recording.truth is not None:
        for t_ns, T_world_body in zip(recording.truth.t_ns.tolist(), recording.truth.T_world_frame, strict=True):
            writer.write_truth(t_ns, T_world_body, None)


def _exposures(recording: Recording) -> dict[int, tuple[float, float]]:
    """Time in s and gain in dB by the stamp of the picture."""
    if recording.exposures is None:
        return {}
    t_ns, values = recording.exposures
    return {t: (time_s, gain_db) for t, (time_s, gain_db) in zip(t_ns.tolist(), values.tolist(), strict=True)}


@dataclass(frozen=True, slots=True)
class _Readings:
    """All readings in order of time: stamps, which sensor's, and which of its own (M,)."""

    t_ns: Stamps
    sensor: NDArray[np.int64]
    number: NDArray[np.int64]


def _merged(recording: Recording) -> _Readings:
    nothing = np.zeros(0, np.int64)
    imu = nothing if recording.imu is None else recording.imu.t_ns
    encoders = nothing if recording.encoders is None else recording.encoders[0]
    t_ns = np.concatenate([imu, encoders])
    sensor = np.repeat([IMU, ENCODERS], [len(imu), len(encoders)])
    number = np.concatenate([np.arange(len(imu)), np.arange(len(encoders))])
    order = np.argsort(t_ns, kind="stable")
    return _Readings(t_ns[order], sensor[order], number[order])


def _write_readings(writer: SequenceWriter, recording: Recording, readings: _Readings, begin: int, end: int) -> None:
    """The readings from `begin` to before `end`, in runs of one sensor."""
    changes = np.flatnonzero(np.diff(readings.sensor[begin:end])) + 1
    for run in np.split(np.arange(begin, end), changes):
        if not len(run):
            continue
        own = slice(int(readings.number[run[0]]), int(readings.number[run[-1]]) + 1)
        if readings.sensor[run[0]] == IMU and recording.imu is not None:
            imu = recording.imu
            writer.write_imu(ImuReadings(imu.t_ns[own], imu.gyro_radps[own], imu.accel_mps2[own]))
        elif recording.encoders is not None:
            writer.write_encoders(recording.encoders[0][own], recording.encoders[1][own])
