"""Sequence to estimate: an estimator is fed frame by frame, and what it says is kept as files."""

import csv
import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from vobench.estimator.process import Answer, EstimatorFailure, EstimatorProcess, Limits
from vobench.estimator.protocol import EncoderReadings, Frame, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.pipeline.workshop import Workshop
from vobench.results import estimate_file
from vobench.results.estimate_file import FINISHED, FrameRow, Outcome
from vobench.results.run_folder import write_json
from vobench.results.store import code_digest, folder_digest, library_versions
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, StereoFrame
from vobench.suite.expand import Run
from vobench.trajectory.text import format_tum
from vobench.trajectory.trajectory import Trajectory

LIMITS = Limits()
Readings = TypeVar("Readings", EncoderReadings, ImuReadings)


def estimate(run: Run, sequence: Path, shop: Workshop) -> Path:
    """The folder of a run's estimate on its case's sequence; made where the store has none of these inputs.

    A failure is tried again: it may have been the machine's, or a library's that is there by now.
    """
    inputs = _inputs(run, sequence)
    held = shop.store.path("estimates", inputs)
    if held.is_dir() and estimate_file.read_outcome(held).kind != FINISHED:
        shop.store.forget("estimates", inputs)
    return shop.store.get("estimates", inputs, lambda folder: _run(run, sequence, folder, shop))


def _inputs(run: Run, sequence: Path) -> dict[str, Any]:
    entrant = run.entrant
    return {
        "sequence": sequence.name,
        "params": entrant.params,
        "repeat": run.repeat,
        "limits": repr(LIMITS),
        "code": folder_digest(entrant.folder),
        "vobench": code_digest("geometry", "trajectory", "estimator", "sequence", "results", "pipeline"),
        "libraries": library_versions("numpy", "scipy", "opencv-python-headless"),
    }


def _run(run: Run, recording: Path, folder: Path, shop: Workshop) -> None:
    """Feed the sequence to the estimator; whatever happens, the folder is complete afterwards."""
    sequence, outcome = Sequence.open(recording), Outcome(kind=FINISHED, reason="")
    log = folder / estimate_file.LOG
    log.touch()
    with _Keeper(folder, sequence.rig, run.entrant.manifest.pose_of) as keeper:
        try:
            _check_needs(run.entrant.manifest.needs, sequence)
            _feed(run, sequence, keeper, log, shop)
        except EstimatorFailure as failure:
            outcome = Outcome(kind=failure.kind, reason=failure.reason)
    write_json(folder / estimate_file.OUTCOME, outcome.model_dump())


def _check_needs(needs: tuple[str, ...], sequence: Sequence) -> None:
    """Refuse, with a sentence, an estimator that this recording cannot serve."""
    rig = sequence.rig
    has = {
        "stereo": "" if rig.right else "one camera",
        "encoders": "" if rig.wheels else "no wheels",
        "imu": "" if rig.imu else "no IMU",
    }
    for need in needs:
        if short := has.get(need):
            raise EstimatorFailure("refused", f"it needs {need!r}, but this recording has {short}")


def _feed(run: Run, sequence: Sequence, keeper: "_Keeper", log: Path, shop: Workshop) -> None:
    """Start the estimator, hand it frame after frame, and keep what it says. Raises EstimatorFailure."""
    entrant, manifest = run.entrant, run.entrant.manifest
    with EstimatorProcess(entrant.folder, manifest.class_path, name=manifest.name, log=log, limits=LIMITS) as process:
        process.start(sequence.rig, entrant.params, run.repeat)
        for frame in shop.progress.track(_frames(sequence, manifest.needs), run.name, total=len(sequence)):
            keeper.keep(frame, process.process(frame))


def _frames(sequence: Sequence, needs: tuple[str, ...]) -> Iterator[Frame]:
    """What the estimator asked for, one instant at a time."""
    encoders = EncoderReadings(*sequence.encoders()) if "encoders" in needs else None
    imu = sequence.imu() if "imu" in needs else None
    last_ns = np.iinfo(np.int64).min
    # Pictures that nobody asked for are not decoded.
    looks, stereo = "stereo" in needs or "mono" in needs, "stereo" in needs
    for f in sequence.frames(right=stereo) if looks else sequence.encoded_frames():
        left, right = (f.left, f.right) if isinstance(f, StereoFrame) else (None, None)
        yield Frame(f.index, f.t_ns, left, right, _between(encoders, last_ns, f.t_ns), _between(imu, last_ns, f.t_ns))
        last_ns = f.t_ns


def _between(readings: Readings | None, last_ns: int, now_ns: int) -> Readings | None:
    """The readings after one frame, up to and including the next."""
    if readings is None:
        return None
    first, end = np.searchsorted(readings.t_ns, [last_ns, now_ns], side="right")
    return type(readings)(*(getattr(readings, field.name)[first:end] for field in fields(readings)))


class _Keeper:
    """Writes what an estimator says as it says it: memory does not grow with the sequence's length."""

    def __init__(self, folder: Path, rig: Rig, pose_of: str) -> None:
        self._folder = folder
        # An estimate file holds poses of the left camera, in the left camera's frame at the start.
        self._T_frame_left = np.eye(4) if pose_of == "left_camera" else rig.T_body_left
        self._poses: list[tuple[int, Array]] = []

    def keep(self, frame: Frame, answer: Answer) -> None:
        """Add one frame."""
        r = answer.result
        if r.T_odom_frame is not None and r.status is not Status.LOST:
            T = se3.inverse(self._T_frame_left) @ r.T_odom_frame @ self._T_frame_left
            self._poses.append((frame.t_ns, T))
        stats = json.dumps({key: float(f"{value:.6g}") for key, value in sorted(r.stats.items())})
        row = FrameRow(frame.index, frame.t_ns, str(r.status), r.reason, stats, answer.wall_ms, answer.cpu_ms)
        self._rows.writerow(row.as_text())
        if r.tracks is not None:
            self._tracks.writestr(_member(frame.index), _table(r.tracks))

    def __enter__(self) -> "_Keeper":
        self._file = (self._folder / estimate_file.FRAMES).open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file)
        self._rows.writerow(FrameRow.columns())
        self._tracks = zipfile.ZipFile(self._folder / estimate_file.TRACKS, "w", zipfile.ZIP_DEFLATED)
        return self

    def __exit__(self, *_: object) -> None:
        self._tracks.close()
        self._file.close()
        text = ""
        if self._poses:
            stamps = np.array([t for t, _ in self._poses], np.int64)
            text = format_tum(Trajectory(stamps, np.stack([T for _, T in self._poses])))
        (self._folder / estimate_file.ESTIMATE).write_text(text, encoding="utf-8")


def _member(index: int) -> zipfile.ZipInfo:
    """A fixed date, so that equal tracks are equal bytes."""
    info = zipfile.ZipInfo(estimate_file.tracks_member(index), date_time=(1980, 1, 1, 0, 0, 0))
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _table(tracks: Tracks) -> bytes:
    """Columns u, v before, u, v now, inlier as .npy (N, 5) float32."""
    buffer = io.BytesIO()
    np.save(buffer, np.column_stack([tracks.uv_last_px, tracks.uv_px, tracks.inlier]).astype(np.float32))
    return buffer.getvalue()
