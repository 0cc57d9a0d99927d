"""Sequence to estimate: an estimator is fed frame by frame; poses, frames and tracks are kept as files."""

import csv
import io
import json
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from vobench.estimator.process import Answer, EstimatorFailure, EstimatorProcess, Limits
from vobench.estimator.protocol import EncoderReadings, Frame, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.run.frames import ANSWER_COLUMNS, ANSWERS, TIME_COLUMNS, TIMES, new_table
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, StereoFrame
from vobench.sequence.picture import grey, rgb
from vobench.trajectory.formats import format_tum
from vobench.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vobench.run.store import Progress
    from vobench.suite.suite import Trial

ESTIMATE = "estimate.tum"
TRACKS = "tracks.zip"
OUTCOME = "outcome.json"
LOG = "log.txt"
FINISHED = "finished"


class Outcome(BaseModel):
    """How an estimator's process ended: FINISHED, or the kind of its failure and why."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: str
    reason: str


def read_outcome(folder: Path) -> Outcome:
    """How the estimate ended."""
    return Outcome(**json.loads((folder / OUTCOME).read_text(encoding="utf-8")))


def read_tracks(folder: Path) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Frame index and its table (N, 5): u, v before, u, v now, inlier."""
    with zipfile.ZipFile(folder / TRACKS) as archive:
        for name in archive.namelist():
            yield int(name.removesuffix(".npy")), np.load(io.BytesIO(archive.read(name)))


LIMITS = Limits()
Readings = TypeVar("Readings", EncoderReadings, ImuReadings)


def estimate(trial: "Trial", recording: Path, folder: Path, progress: "Progress") -> None:
    """Feed a sequence to a trial's estimator; whatever happens, the folder is complete afterwards."""
    sequence, outcome = Sequence.open(recording), Outcome(kind=FINISHED, reason="")
    (folder / LOG).touch()
    with _keeper(folder, sequence.rig, trial.entrant.manifest.pose_of) as keeper:
        try:
            _check_needs(trial.entrant.manifest.needs, sequence)
            _feed(trial, sequence, keeper, progress, folder / LOG)
        except EstimatorFailure as failure:
            outcome = Outcome(kind=failure.kind, reason=failure.reason)
    (folder / OUTCOME).write_text(outcome.model_dump_json(), encoding="utf-8")


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


def _feed(trial: "Trial", sequence: Sequence, keeper: "_Keeper", progress: "Progress", log: Path) -> None:
    """Start the estimator, hand it frame after frame, and keep what it says. Raises EstimatorFailure."""
    entrant, manifest = trial.entrant, trial.entrant.manifest
    with EstimatorProcess(entrant.folder, manifest.class_path, name=manifest.name, log=log, limits=LIMITS) as process:
        process.start(sequence.rig, entrant.params, trial.repeat)
        for frame in progress.track(_frames(sequence, manifest.needs), trial.name, total=len(sequence)):
            keeper.keep(frame, process.process(frame))


def _frames(sequence: Sequence, needs: tuple[str, ...]) -> Iterator[Frame]:
    """What the estimator asked for, one instant at a time."""
    encoders = EncoderReadings(*sequence.encoders()) if "encoders" in needs else None
    imu = sequence.imu() if "imu" in needs else None
    last_ns = np.iinfo(np.int64).min
    # Pictures that nobody asked for are not decoded.
    looks, stereo, shown = "stereo" in needs or "mono" in needs, "stereo" in needs, rgb if "colour" in needs else grey
    for f in sequence.frames(right=stereo) if looks else sequence.encoded_frames():
        seen = (f.left, f.right) if isinstance(f, StereoFrame) else (None, None)
        left, right = (image if image is None else shown(image, f.colour) for image in seen)
        yield Frame(f.index, f.t_ns, left, right, _between(encoders, last_ns, f.t_ns), _between(imu, last_ns, f.t_ns))
        last_ns = f.t_ns


def _between(readings: Readings | None, last_ns: int, now_ns: int) -> Readings | None:
    """The readings after one frame, up to and including the next."""
    if readings is None:
        return None
    first, end = np.searchsorted(readings.t_ns, [last_ns, now_ns], side="right")
    return type(readings)(*(getattr(readings, field.name)[first:end] for field in fields(readings)))


@dataclass(frozen=True, slots=True)
class _Keeper:
    """Writes what an estimator says as it says it: memory does not grow with the sequence's length."""

    T_frame_left: Array
    answers: "csv.DictWriter[str]"
    times: "csv.DictWriter[str]"
    tracks: zipfile.ZipFile
    poses: list[tuple[int, Array]] = field(default_factory=list)

    def keep(self, frame: Frame, answer: Answer) -> None:
        """Add one frame."""
        r = answer.result
        if r.T_odom_frame is not None and r.status is not Status.LOST:
            T = se3.inverse(self.T_frame_left) @ r.T_odom_frame @ self.T_frame_left
            self.poses.append((frame.t_ns, T))
        stats = json.dumps({key: float(f"{value:.6g}") for key, value in sorted(r.stats.items())})
        answered = {"frame": frame.index, "status": str(r.status), "reason": r.reason, "stats": stats}
        cost = {"wall_ms": f"{answer.wall_ms:.3f}", "cpu_ms": f"{answer.cpu_ms:.3f}"}
        self.times.writerow({"frame": frame.index, **cost})
        if r.tracks is None:
            self.answers.writerow(answered)
        else:
            inlier = r.tracks.inlier
            self.answers.writerow({**answered, "tracks": len(inlier), "inliers": int(inlier.sum())})
            self.tracks.writestr(_member(frame.index), _table(r.tracks))


@contextmanager
def _keeper(folder: Path, rig: Rig, pose_of: str) -> Iterator[_Keeper]:
    """A keeper while an estimator runs; then the file of poses: the left camera's, in its frame at the start."""
    with (
        new_table(folder / ANSWERS, ANSWER_COLUMNS) as answers,
        new_table(folder / TIMES, TIME_COLUMNS) as times,
        zipfile.ZipFile(folder / TRACKS, "w", zipfile.ZIP_DEFLATED) as tracks,
    ):
        T_frame_left = np.eye(4) if pose_of == "left_camera" else rig.T_body_left
        keeper = _Keeper(T_frame_left, answers, times, tracks)
        yield keeper
    stamps = np.array([t for t, _ in keeper.poses], np.int64)
    text = format_tum(Trajectory(stamps, np.stack([T for _, T in keeper.poses]))) if keeper.poses else ""
    (folder / ESTIMATE).write_text(text, encoding="utf-8")


def _member(index: int) -> zipfile.ZipInfo:
    """A fixed date, so that equal tracks are equal bytes."""
    info = zipfile.ZipInfo(f"{index:08d}.npy", date_time=(1980, 1, 1, 0, 0, 0))
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _table(tracks: Tracks) -> bytes:
    """Columns u, v before, u, v now, inlier as .npy (N, 5) float32."""
    buffer = io.BytesIO()
    np.save(buffer, np.column_stack([tracks.uv_last_px, tracks.uv_px, tracks.inlier]).astype(np.float32))
    return buffer.getvalue()
