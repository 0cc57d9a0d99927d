"""Sequence to estimate: an estimator is fed frame by frame; poses, frames and tracks are kept as files."""

import csv
import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from vobench.errors import SequenceError
from vobench.estimator.command import CommandProgram, rate_hz
from vobench.estimator.manifest import Manifest
from vobench.estimator.oracle import NoisyTruth
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import Answer, EstimatorFailure
from vobench.estimator.protocol import EncoderReadings, Frame, Status
from vobench.estimator.sandbox import Sandbox
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.runner.consistency import COVARIANCE, format_covariances
from vobench.runner.folder import NOT_APPLICABLE, read_tum
from vobench.runner.frames import ANSWER_COLUMNS, ANSWERS, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, StereoFrame
from vobench.sequence.picture import grey, rgb
from vobench.trajectory.formats import format_tum
from vobench.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vobench.dataset.source import Views
    from vobench.runner.store import Progress
    from vobench.suite.suite import Trial

ESTIMATE = "estimate.tum"
REVISED = "revised.tum"
TRACKS = "tracks.zip"
POINTS = "points/"
OUTCOME = "outcome.json"
LOG = "log.txt"
FINISHED = "finished"
DROPPED = "dropped"  # a frame that came while the estimator was busy with another


class Outcome(BaseModel):
    """How an estimator's process ended: FINISHED, or the kind of its failure and why; and what it could see.

    `sandbox` is None where no process was started.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: str
    reason: str
    sandbox: Sandbox | None = None


def read_outcome(folder: Path) -> Outcome:
    """How the estimate ended."""
    return Outcome(**json.loads((folder / OUTCOME).read_text(encoding="utf-8")))


def read_tracks(folder: Path, *, of: str = "") -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Frame index and its table (N, 5): u, v before, u, v now, inlier; or `of` POINTS (N, 3), in odom, in m."""
    with zipfile.ZipFile(folder / TRACKS) as archive:
        for name in archive.namelist():
            if name.startswith(of) and ("/" in name) == bool(of):
                yield int(Path(name).stem), np.load(io.BytesIO(archive.read(name)))


Readings = TypeVar("Readings", EncoderReadings, ImuReadings)


# An estimator that runs, by whichever door it came: start, process, finish, each of which raises EstimatorFailure.
Running = EstimatorProcess | CommandProgram | NoisyTruth


def estimate(trial: "Trial", recording: Path, folder: Path, progress: "Progress") -> None:
    """Feed a sequence to a trial's estimator; whatever happens, the folder is complete afterwards."""
    sequence = Sequence.open(recording)
    kind = FINISHED
    reason = ""
    running: Running | None = None
    (folder / LOG).touch()
    with _keeper(folder) as keeper:
        try:
            keeper.T_frame_left = _T_frame_left(sequence.rig, trial.entrant.manifest)
            _check_needs(trial.entrant.manifest.needs, sequence)
            running = _running(trial, recording, folder / LOG)
            _feed(trial, sequence, keeper, progress, running)
        except EstimatorFailure as failure:
            kind = failure.kind
            reason = failure.reason
        except SequenceError as error:  # a layout that cannot have this recording
            kind = "refused"
            reason = str(error)
    saw = None if running is None or isinstance(running, NoisyTruth) else running.sandbox
    outcome = Outcome(kind=kind, reason=reason, sandbox=saw)
    (folder / OUTCOME).write_text(outcome.model_dump_json(), encoding="utf-8")


def _running(trial: "Trial", recording: Path, log: Path) -> Running:
    """The trial's estimator as its manifest says that it is run."""
    entrant = trial.entrant
    manifest = trial.entrant.manifest
    hidden = _hidden(trial, recording)
    if manifest.oracle:
        return NoisyTruth(read_tum(recording / GROUND_TRUTH))
    if manifest.class_path:
        return EstimatorProcess.of_class(
            entrant.folder, manifest.class_path, name=manifest.name, log=log, limits=entrant.limits, hidden=hidden
        )
    t_ns = Sequence.open(recording).frame_stamps()
    limits = entrant.limits
    if manifest.stream:
        rate = rate_hz(t_ns)
        return EstimatorProcess.of_stream(
            manifest.stream, entrant.folder, log=log, limits=limits, rate_hz=rate, hidden=hidden
        )
    if entrant.mode == "real_time":
        raise EstimatorFailure("refused", "it takes the whole recording at once, so it cannot go at the camera's pace")
    write = partial(_write_blind, recording, manifest)
    return CommandProgram(
        manifest.command, entrant.folder, log=log, limits=limits, out=manifest.out, t_ns=t_ns, write_dataset=write,
        hidden=hidden,
    )  # fmt: skip


def _hidden(trial: "Trial", recording: Path) -> list[Path]:
    """What is hidden should it lie in a folder that the estimator may read.

    That is the store that the sequence is in, the recording that it was read from, and earlier runs.
    """
    hidden = [recording.resolve().parents[1], Path("runs").absolute()]
    source = getattr(trial.case, "source", None)
    if source:
        hidden.append(Path(source.path).resolve())
    return hidden


def _write_blind(recording: Path, manifest: Manifest, folder: Path) -> None:
    """Write a recording in the manifest's layout: what it needs and Kalibr's calibration, and nothing of the truth."""
    from vobench.dataset.export import write_calibration
    from vobench.dataset.layout import writable
    from vobench.dataset.source import ExportSource

    sequence = Sequence.open(recording)
    layout = writable()[manifest.dataset]
    source = ExportSource(recording, sequence, sequence.rig, imu=sequence.imu() if "imu" in manifest.needs else None)
    views = _views(manifest, source.rig)
    layout.write(source, views, folder)
    write_calibration(views.rig, layout, folder)


def _views(manifest: Manifest, rig: Rig) -> "Views":
    """The pictures of a recording as a program finds them in its files."""
    from vobench.dataset.layout import writable

    one = replace(rig, right=None, T_body_right=None)
    return writable()[manifest.dataset].views(rig if "stereo" in manifest.needs else one)


def _T_frame_left(rig: Rig, manifest: Manifest) -> Array:
    """The left camera in the frame whose poses the estimator gives; a program's pictures may be rectified ones."""
    if manifest.pose_of == "left_camera":
        return se3.inverse(_views(manifest, rig).rig.T_body_left) @ rig.T_body_left if manifest.command else np.eye(4)
    return (
        se3.inverse(rig.imu.T_body_imu) @ rig.T_body_left if manifest.pose_of == "imu" and rig.imu else rig.T_body_left
    )


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
            raise EstimatorFailure(NOT_APPLICABLE, f"it needs {need!r}, but this recording has {short}")


def _feed(trial: "Trial", sequence: Sequence, keeper: "_Keeper", progress: "Progress", door: Running) -> None:
    """Start the estimator, hand it frame after frame, and keep what it says. Raises EstimatorFailure."""
    entrant = trial.entrant
    with door as running:
        running.start(sequence.rig, entrant.params, trial.repeat)
        pace = _Pace(keeper, is_real_time=entrant.mode == "real_time")
        frames = frames_of(sequence, entrant.manifest.needs, pace)
        for frame in progress.track(frames, trial.name, total=len(sequence)):
            answer = running.process(frame)
            keeper.keep(frame, answer)
            pace.free_ns = frame.t_ns + int(answer.wall_ms * 1e6)
        keeper.revised.update(running.finish())


@dataclass(slots=True)
class _Pace:
    """The camera's pace, by the clock of its stamps and of what answers took: nobody sleeps.

    An estimator is free again at `free_ns`. In real time, a frame that comes earlier is dropped.
    """

    keeper: "_Keeper"
    is_real_time: bool
    free_ns: int = np.iinfo(np.int64).min

    def drops(self, index: int, t_ns: int) -> bool:
        """Whether this frame is lost to the estimator, which the table of frames then says."""
        is_lost = self.is_real_time and t_ns < self.free_ns
        if is_lost:
            self.keeper.answers.writerow({"frame": index, "status": DROPPED})
        return is_lost


def frames_of(sequence: Sequence, needs: tuple[str, ...], pace: _Pace | None = None) -> Iterator[Frame]:
    """What the estimator asked for, one instant at a time, but for the frames that it is too late for."""
    encoders = EncoderReadings(*sequence.encoders()) if "encoders" in needs else None
    imu = sequence.imu() if "imu" in needs else None
    last_ns = np.iinfo(np.int64).min
    # Pictures that nobody asked for are not decoded.
    looks = "stereo" in needs or "mono" in needs
    stereo = "stereo" in needs
    shown = rgb if "colour" in needs else grey
    for f in sequence.frames(right=stereo) if looks else sequence.encoded_frames():
        if pace and pace.drops(f.index, f.t_ns):
            continue
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


@dataclass(slots=True)
class _Keeper:
    """Writes what an estimator says as it says it: memory does not grow with the sequence's length."""

    answers: "csv.DictWriter[str]"
    times: "csv.DictWriter[str]"
    tracks: zipfile.ZipFile
    T_frame_left: Array = field(default_factory=lambda: np.eye(4))
    stamps: dict[int, int] = field(default_factory=dict)
    poses: dict[int, Array] = field(default_factory=dict)
    covariances: dict[int, Array] = field(default_factory=dict)
    revised: dict[int, Array] = field(default_factory=dict)

    def keep(self, frame: Frame, answer: Answer) -> None:
        """Add one frame."""
        r = answer.result
        self.stamps[frame.index] = frame.t_ns
        if r.T_odom_frame is not None and r.status is not Status.LOST:
            self.poses[frame.index] = r.T_odom_frame
            if r.covariance is not None:
                self.covariances[frame.index] = self._of_left(r.T_odom_frame[:3, :3], r.covariance)
        if r.points is not None:
            points = se3.apply(se3.inverse(self.T_frame_left), r.points)
            self.tracks.writestr(_member(frame.index, POINTS), _npy(points))
        stats = json.dumps({key: float(f"{value:.6g}") for key, value in sorted(r.stats.items())})
        answered = {"frame": frame.index, "status": str(r.status), "reason": r.reason, "stats": stats}
        self.times.writerow(
            {"frame": frame.index, **{name: f"{getattr(answer, name):.3f}" for name in TIME_COLUMNS[1:]}}
        )
        if r.tracks is None:
            self.answers.writerow(answered)
        else:
            inlier = r.tracks.inlier
            table = np.column_stack([r.tracks.uv_last_px, r.tracks.uv_px, r.tracks.inlier])
            self.answers.writerow({**answered, "tracks": len(inlier), "inliers": int(inlier.sum())})
            self.tracks.writestr(_member(frame.index), _npy(table))

    def _of_left(self, R_odom_frame: Array, P: Array) -> Array:
        """The covariance (6, 6) of the left camera's pose, where P is that of the frame that it is mounted on.

        A rotation of the frame by δ about odom's axes moves the camera by δ × r, with r its place in the frame.
        """
        x, y, z = R_odom_frame @ self.T_frame_left[:3, 3]
        J = np.eye(6)
        J[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        J = np.kron(np.eye(2), self.T_frame_left[:3, :3].T) @ J
        return np.asarray(J @ P @ J.T)

    def write(self, folder: Path) -> None:
        """The files of poses: the left camera's, in its frame at the start."""
        (folder / ESTIMATE).write_text(self._tum(self.poses), encoding="utf-8")
        if self.covariances:
            rows = ((self.stamps[index], P) for index, P in self.covariances.items())
            (folder / COVARIANCE).write_text(format_covariances(rows), encoding="utf-8")
        if self.revised:
            (folder / REVISED).write_text(self._tum(self.revised), encoding="utf-8")

    def _tum(self, poses: Mapping[int, Array]) -> str:
        at = sorted(poses.keys() & self.stamps.keys())
        if not at:
            return ""
        T_odom_frame = np.stack([poses[index] for index in at])
        T = se3.inverse(self.T_frame_left) @ T_odom_frame @ self.T_frame_left
        return format_tum(Trajectory(np.array([self.stamps[index] for index in at], np.int64), T))


@contextmanager
def _keeper(folder: Path) -> Iterator[_Keeper]:
    """A keeper while an estimator runs; then its files of poses."""
    with (
        new_table(folder / ANSWERS, ANSWER_COLUMNS) as answers,
        new_table(folder / TIMES, TIME_COLUMNS) as times,
        zipfile.ZipFile(folder / TRACKS, "w", zipfile.ZIP_DEFLATED) as tracks,
    ):
        keeper = _Keeper(answers, times, tracks)
        yield keeper
    keeper.write(folder)


def _member(index: int, of: str = "") -> zipfile.ZipInfo:
    """A fixed date, so that equal tracks are equal bytes."""
    info = zipfile.ZipInfo(f"{of}{index:08d}.npy", date_time=(1980, 1, 1, 0, 0, 0))
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _npy(table: Array) -> bytes:
    """Numbers as .npy in float32."""
    buffer = io.BytesIO()
    np.save(buffer, table.astype(np.float32))
    return buffer.getvalue()
