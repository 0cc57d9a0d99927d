"""Sequence to estimate: an estimator is fed frame by frame; poses, frames and tracks are kept as files."""

import csv
import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from vobench.errors import TrajectoryError
from vobench.estimator.process import Answer, EstimatorFailure, EstimatorProcess, Limits
from vobench.estimator.protocol import EncoderReadings, Frame, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.run.folder import write_json
from vobench.run.store import Context, code_digest, folder_digest, library_versions
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, StereoFrame
from vobench.suite.suite import Trial
from vobench.trajectory.formats import format_tum, parse_tum
from vobench.trajectory.trajectory import Trajectory

ESTIMATE = "estimate.tum"
FRAMES = "frames.csv"
TRACKS = "tracks.zip"
OUTCOME = "outcome.json"
LOG = "log.txt"
FINISHED = "finished"


class Outcome(BaseModel):
    """How an estimator's process ended: FINISHED, or the kind of its failure and why."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class FrameRow:
    """What an estimator said of one frame, and what it cost; `stats` is a JSON object."""

    frame: int
    t_ns: int
    status: str
    reason: str
    stats: str
    wall_ms: float
    cpu_ms: float

    @classmethod
    def columns(cls) -> list[str]:
        """The header of the file."""
        return [field.name for field in fields(cls)]

    def as_text(self) -> list[str]:
        """The cells of one line."""
        cells = [str(self.frame), str(self.t_ns), self.status, self.reason, self.stats]
        return [*cells, f"{self.wall_ms:.3f}", f"{self.cpu_ms:.3f}"]


def read_outcome(folder: Path) -> Outcome:
    """How the estimate ended."""
    return Outcome(**json.loads((folder / OUTCOME).read_text(encoding="utf-8")))


def read_frames(folder: Path) -> list[FrameRow]:
    """One row per frame that the estimator answered."""
    with (folder / FRAMES).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [
        FrameRow(
            int(r["frame"]),
            int(r["t_ns"]),
            r["status"],
            r["reason"],
            r["stats"],
            float(r["wall_ms"]),
            float(r["cpu_ms"]),
        )
        for r in rows
    ]


def read_tum(path: Path) -> Trajectory:
    """The trajectory in a TUM file of a run; empty where an estimator gave no pose at all.

    Raises TrajectoryError where the file is none.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"not a text file in UTF-8 (byte {error.start}): {path}") from None
    return parse_tum(text, name=str(path))


def tracks_member(index: int) -> str:
    """The name of a frame's table in the archive of tracks."""
    return f"{index:08d}.npy"


def read_tracks(folder: Path) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Frame index and its table (N, 5): u, v before, u, v now, inlier."""
    with zipfile.ZipFile(folder / TRACKS) as archive:
        for name in archive.namelist():
            yield int(name.removesuffix(".npy")), np.load(io.BytesIO(archive.read(name)))


LIMITS = Limits()
Readings = TypeVar("Readings", EncoderReadings, ImuReadings)


def estimate(run: Trial, sequence: Path, shop: Context) -> Path:
    """The folder of a run's estimate on its case's sequence; made where the store has none of these inputs.

    A failure is tried again: it may have been the machine's, or a library's that is there by now.
    """
    inputs = _inputs(run, sequence)
    held = shop.store.path("estimates", inputs)
    if held.is_dir() and read_outcome(held).kind != FINISHED:
        shop.store.forget("estimates", inputs)
    return shop.store.get("estimates", inputs, lambda folder: _run(run, sequence, folder, shop))


def _inputs(run: Trial, sequence: Path) -> dict[str, Any]:
    entrant = run.entrant
    return {
        "sequence": sequence.name,
        "params": entrant.params,
        "repeat": run.repeat,
        "limits": repr(LIMITS),
        "code": folder_digest(entrant.folder),
        "vobench": code_digest("geometry", "trajectory", "estimator", "sequence", "run"),
        "libraries": library_versions("numpy", "scipy", "opencv-python-headless"),
    }


def _run(run: Trial, recording: Path, folder: Path, shop: Context) -> None:
    """Feed the sequence to the estimator; whatever happens, the folder is complete afterwards."""
    sequence, outcome = Sequence.open(recording), Outcome(kind=FINISHED, reason="")
    log = folder / LOG
    log.touch()
    with _Keeper(folder, sequence.rig, run.entrant.manifest.pose_of) as keeper:
        try:
            _check_needs(run.entrant.manifest.needs, sequence)
            _feed(run, sequence, keeper, log, shop)
        except EstimatorFailure as failure:
            outcome = Outcome(kind=failure.kind, reason=failure.reason)
    write_json(folder / OUTCOME, outcome.model_dump())


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


def _feed(run: Trial, sequence: Sequence, keeper: "_Keeper", log: Path, shop: Context) -> None:
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
        self._file = (self._folder / FRAMES).open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file)
        self._rows.writerow(FrameRow.columns())
        self._tracks = zipfile.ZipFile(self._folder / TRACKS, "w", zipfile.ZIP_DEFLATED)
        return self

    def __exit__(self, *_: object) -> None:
        self._tracks.close()
        self._file.close()
        text = ""
        if self._poses:
            stamps = np.array([t for t, _ in self._poses], np.int64)
            text = format_tum(Trajectory(stamps, np.stack([T for _, T in self._poses])))
        (self._folder / ESTIMATE).write_text(text, encoding="utf-8")


def _member(index: int) -> zipfile.ZipInfo:
    """A fixed date, so that equal tracks are equal bytes."""
    info = zipfile.ZipInfo(tracks_member(index), date_time=(1980, 1, 1, 0, 0, 0))
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _table(tracks: Tracks) -> bytes:
    """Columns u, v before, u, v now, inlier as .npy (N, 5) float32."""
    buffer = io.BytesIO()
    np.save(buffer, np.column_stack([tracks.uv_last_px, tracks.uv_px, tracks.inlier]).astype(np.float32))
    return buffer.getvalue()
