"""Runs an estimator on a sequence, frame by frame, and writes its poses, statuses and tracks to files."""

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
from vobench.runner.frames import (
    ANSWER_COLUMNS,
    ANSWERS,
    COST_COLUMNS,
    GROUND_TRUTH,
    TIME_COLUMNS,
    TIMES,
    TableWriter,
    new_table,
)
from vobench.runner.visible_truth import visible_truth
from vobench.sensor.imu import ImuReadings
from vobench.sequence import EncodedFrame, Sequence, StereoFrame
from vobench.sequence.picture import grey, rgb
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

if TYPE_CHECKING:
    from vobench.dataset.rectified_view import Views
    from vobench.runner.store import Progress
    from vobench.suite.plan import Trial

ESTIMATE = "estimate.tum"
REVISED = "revised.tum"
TRACKS = "tracks.zip"
POINTS = "points/"
OUTCOME = "outcome.json"
LOG = "log.txt"
FINISHED = "finished"
DROPPED = "dropped"  # the status of a frame that arrived while the estimator was busy
EARLIEST_NS = np.iinfo(np.int64).min
ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # constant, so that equal tracks give equal files


class EstimatorOutcome(BaseModel):
    """The outcome of an estimate: FINISHED, or the kind of failure and the reason; and what the estimator could see.

    `sandbox` is None if no process was started.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: str
    reason: str
    sandbox: Sandbox | None = None


def read_outcome(folder: Path) -> EstimatorOutcome:
    """The outcome of the estimate in a folder."""
    return EstimatorOutcome(**json.loads((folder / OUTCOME).read_text(encoding="utf-8")))


def read_tracks(folder: Path, *, of: str = "") -> Iterator[tuple[int, NDArray[np.float32]]]:
    """The index and the table of each frame: tracks (N, 5) as last u, last v, u, v and inlier, by default.

    With `of` POINTS, the tables are points (N, 3) in odom, in m.
    """
    is_in_folder = bool(of)
    with zipfile.ZipFile(folder / TRACKS) as archive:
        for name in archive.namelist():
            if name.startswith(of) and ("/" in name) == is_in_folder:
                table = np.load(io.BytesIO(archive.read(name)))
                yield int(Path(name).stem), table


Readings = TypeVar("Readings", EncoderReadings, ImuReadings)


# A running estimator of any kind. Its methods start, process and finish raise EstimatorFailure.
Running = EstimatorProcess | CommandProgram | NoisyTruth


def estimate(trial: "Trial", recording: Path, folder: Path, progress: "Progress") -> None:
    """Run the estimator of a trial on a sequence. The folder is complete afterwards, even if the estimator fails."""
    sequence = Sequence.open(recording)
    kind = FINISHED
    reason = ""
    running: Running | None = None
    (folder / LOG).touch()
    with _keeper(folder) as keeper:
        try:
            keeper.T_frame_left = _T_frame_left(sequence.rig, trial.estimator_entry.manifest)
            _check_needs(trial.estimator_entry.manifest.needs, sequence)
            running = _running(trial, recording, folder / LOG)
            _feed(trial, sequence, keeper, progress, running)
        except EstimatorFailure as failure:
            kind = failure.kind
            reason = failure.reason
        except SequenceError as error:  # the layout cannot represent this recording
            kind = "refused"
            reason = str(error)
    sandbox = None
    if isinstance(running, EstimatorProcess | CommandProgram):
        sandbox = running.sandbox
    outcome = EstimatorOutcome(kind=kind, reason=reason, sandbox=sandbox)
    (folder / OUTCOME).write_text(outcome.model_dump_json(), encoding="utf-8")


def _running(trial: "Trial", recording: Path, log: Path) -> Running:
    """The estimator of a trial, which is run as its manifest specifies."""
    estimator_entry = trial.estimator_entry
    manifest = estimator_entry.manifest
    limits = estimator_entry.limits
    hidden = _hidden(trial, recording)
    if manifest.oracle:
        return NoisyTruth(read_tum(recording / GROUND_TRUTH))
    if manifest.class_path:
        return EstimatorProcess.of_class(
            estimator_entry.folder,
            manifest.class_path,
            name=manifest.name,
            log=log,
            limits=limits,
            hidden=hidden,
        )
    t_ns = Sequence.open(recording).frame_stamps()
    if manifest.stream:
        return EstimatorProcess.of_stream(
            manifest.stream,
            estimator_entry.folder,
            log=log,
            limits=limits,
            rate_hz=rate_hz(t_ns),
            hidden=hidden,
        )
    if estimator_entry.mode == "real_time":
        raise EstimatorFailure("refused", "it takes the whole recording at once, so it cannot go at the camera's pace")
    return CommandProgram(
        manifest.command,
        estimator_entry.folder,
        log=log,
        limits=limits,
        out=manifest.out,
        t_ns=t_ns,
        write_dataset=partial(_write_blind, recording, manifest),
        hidden=hidden,
    )


def _hidden(trial: "Trial", recording: Path) -> list[Path]:
    """The files and folders that are hidden from an estimator, even inside of folders that it may read.

    They are the store with the sequence, the runs and recordings that the plan knows, and other ground truth. Raises
    EstimatorFailure if the folders are too large to be searched for ground truth.
    """
    store = recording.resolve().parents[1]
    known = [store, Path("runs").resolve(), *trial.hidden]
    return [*known, *visible_truth(trial.estimator_entry.folder, known)]


def _write_blind(recording: Path, manifest: Manifest, folder: Path) -> None:
    """Write a recording in the layout of a manifest, with the required sensors and Kalibr files, but without truth."""
    from vobench.dataset.export import write_calibration
    from vobench.dataset.layout import writable
    from vobench.dataset.source import ExportSource

    sequence = Sequence.open(recording)
    layout = writable()[manifest.dataset]
    imu = sequence.imu() if "imu" in manifest.needs else None
    source = ExportSource(recording, sequence, sequence.rig, imu=imu)
    views = _views(manifest, source.rig)
    layout.write(source, views, folder)
    write_calibration(views.rig, layout, folder)


def _views(manifest: Manifest, rig: Rig) -> "Views":
    """The views in which a program gets the pictures of a recording."""
    from vobench.dataset.layout import writable

    layout = writable()[manifest.dataset]
    if "stereo" in manifest.needs:
        return layout.views(rig)
    mono_rig = replace(rig, right=None, T_body_right=None)
    return layout.views(mono_rig)


def _T_frame_left(rig: Rig, manifest: Manifest) -> Array:
    """The pose of the left camera in the frame of the estimator's poses. A program may get rectified pictures."""
    if manifest.pose_of == "left_camera":
        if not manifest.command:
            return np.eye(4)
        T_body_view = _views(manifest, rig).rig.T_body_left
        return se3.inverse(T_body_view) @ rig.T_body_left
    if manifest.pose_of == "imu" and rig.imu:
        return se3.inverse(rig.imu.T_body_imu) @ rig.T_body_left
    return rig.T_body_left


def _check_needs(needs: tuple[str, ...], sequence: Sequence) -> None:
    """Raise EstimatorFailure if the recording lacks a sensor that the estimator needs."""
    rig = sequence.rig
    lacks = {}
    if not rig.right:
        lacks["stereo"] = "one camera"
    if not rig.wheels:
        lacks["encoders"] = "no wheels"
    if not rig.imu:
        lacks["imu"] = "no IMU"
    for need in needs:
        if need in lacks:
            raise EstimatorFailure(NOT_APPLICABLE, f"it needs {need!r}, but this recording has {lacks[need]}")


def _feed(trial: "Trial", sequence: Sequence, keeper: "_Keeper", progress: "Progress", estimator: Running) -> None:
    """Start the estimator, send it all frames, and write its answers. Raises EstimatorFailure."""
    estimator_entry = trial.estimator_entry
    with estimator as running:
        running.start(sequence.rig, estimator_entry.params, trial.repeat)
        pace = _Pace(keeper, is_real_time=estimator_entry.mode == "real_time")
        frames = frames_of(sequence, estimator_entry.manifest.needs, pace)
        for frame in progress.track(frames, trial.name, total=len(sequence)):
            answer = running.process(frame)
            keeper.keep(frame, answer)
            pace.free_ns = frame.t_ns + int(answer.wall_ms * 1e6)
        keeper.revised.update(running.finish())


@dataclass(slots=True)
class _Pace:
    """Decides which frames are dropped in real time, on a virtual clock of stamps and answer times.

    The estimator is busy until `free_ns`. In real time, earlier frames are dropped.
    """

    keeper: "_Keeper"
    is_real_time: bool
    free_ns: int = EARLIEST_NS

    def drops(self, index: int, t_ns: int) -> bool:
        """Whether a frame is dropped. A dropped frame is written to the table of frames."""
        is_dropped = self.is_real_time and t_ns < self.free_ns
        if is_dropped:
            self.keeper.answers.writerow({"frame": index, "status": DROPPED})
        return is_dropped


def frames_of(sequence: Sequence, needs: tuple[str, ...], pace: _Pace | None = None) -> Iterator[Frame]:
    """The frames of a sequence with the sensors that an estimator needs, without those that `pace` drops."""
    encoders = EncoderReadings(*sequence.encoders()) if "encoders" in needs else None
    imu = sequence.imu() if "imu" in needs else None
    convert = rgb if "colour" in needs else grey
    last_ns = EARLIEST_NS
    for recorded in _recorded_frames(sequence, needs):
        index = recorded.index
        t_ns = recorded.t_ns
        if pace and pace.drops(index, t_ns):
            continue
        left = None
        right = None
        if isinstance(recorded, StereoFrame):
            left = convert(recorded.left, recorded.colour)
            if recorded.right is not None:
                right = convert(recorded.right, recorded.colour)
        new_encoders = _between(encoders, last_ns, t_ns)
        new_imu = _between(imu, last_ns, t_ns)
        yield Frame(index, t_ns, left, right, new_encoders, new_imu)
        last_ns = t_ns


def _recorded_frames(sequence: Sequence, needs: tuple[str, ...]) -> Iterator[StereoFrame | EncodedFrame]:
    """The recorded frames. Pictures are decoded only if the estimator needs them."""
    if "stereo" in needs:
        return sequence.frames(right=True)
    if "mono" in needs:
        return sequence.frames(right=False)
    return sequence.encoded_frames()


def _between(readings: Readings | None, last_ns: int, now_ns: int) -> Readings | None:
    """The readings after a frame, up to and including the next frame."""
    if readings is None:
        return None
    first, end = np.searchsorted(readings.t_ns, [last_ns, now_ns], side="right")
    columns = [getattr(readings, column.name) for column in fields(readings)]
    return type(readings)(*(column[first:end] for column in columns))


@dataclass(slots=True)
class _Keeper:
    """Writes each answer of an estimator immediately, so that memory does not grow with the length of the sequence."""

    answers: TableWriter
    times: TableWriter
    tracks: zipfile.ZipFile
    T_frame_left: Array = field(default_factory=lambda: np.eye(4))
    stamps: dict[int, int] = field(default_factory=dict)
    poses: dict[int, Array] = field(default_factory=dict)
    covariances: dict[int, Array] = field(default_factory=dict)
    revised: dict[int, Array] = field(default_factory=dict)

    def keep(self, frame: Frame, answer: Answer) -> None:
        """Write the answer to one frame."""
        index = frame.index
        result = answer.result
        self.stamps[index] = frame.t_ns
        if result.T_odom_frame is not None and result.status is not Status.LOST:
            self.poses[index] = result.T_odom_frame
            if result.covariance is not None:
                R_odom_frame = result.T_odom_frame[:3, :3]
                self.covariances[index] = self._covariance_of_left(R_odom_frame, result.covariance)
        if result.points is not None:
            with np.errstate(invalid="ignore", over="ignore"):  # points may be infinite
                points = se3.apply(se3.inverse(self.T_frame_left), result.points)
            self.tracks.writestr(_member(index, POINTS), _npy(points))

        stats = {name: float(f"{value:.6g}") for name, value in sorted(result.stats.items())}
        row: dict[str, int | str] = {
            "frame": index,
            "status": str(result.status),
            "reason": result.reason,
            "stats": json.dumps(stats),
        }
        if result.tracks is not None:
            tracks = result.tracks
            row["tracks"] = len(tracks.inlier)
            row["inliers"] = int(tracks.inlier.sum())
            table = np.column_stack([tracks.uv_last_px, tracks.uv_px, tracks.inlier])
            self.tracks.writestr(_member(index), _npy(table))
        self.answers.writerow(row)
        costs = {name: f"{getattr(answer, name):.3f}" for name in COST_COLUMNS}
        self.times.writerow({"frame": index, **costs})

    def _covariance_of_left(self, R_odom_frame: Array, covariance: Array) -> Array:
        """The covariance (6, 6) of the left camera's pose, from that of the frame on which it is mounted.

        A rotation of the frame by δ about the axes of odom moves the camera by δ × r, where r is its position.
        """
        x, y, z = R_odom_frame @ self.T_frame_left[:3, 3]
        lever = np.eye(6)
        lever[0, 3:] = [0, z, -y]
        lever[1, 3:] = [-z, 0, x]
        lever[2, 3:] = [y, -x, 0]
        R_left_frame = self.T_frame_left[:3, :3].T
        jacobian = np.kron(np.eye(2), R_left_frame) @ lever
        return np.asarray(jacobian @ covariance @ jacobian.T)

    def write(self, folder: Path) -> None:
        """Write the files with the poses of the left camera, in its frame at the start."""
        (folder / ESTIMATE).write_text(self._tum(self.poses), encoding="utf-8")
        if self.covariances:
            rows = [(self.stamps[index], covariance) for index, covariance in self.covariances.items()]
            (folder / COVARIANCE).write_text(format_covariances(rows), encoding="utf-8")
        if self.revised:
            (folder / REVISED).write_text(self._tum(self.revised), encoding="utf-8")

    def _tum(self, poses: Mapping[int, Array]) -> str:
        """The poses of the frames that were sent, as the text of a TUM file."""
        indices = sorted(poses.keys() & self.stamps.keys())
        if not indices:
            return ""
        T_odom_frame = np.stack([poses[index] for index in indices])
        T_odom_left = se3.inverse(self.T_frame_left) @ T_odom_frame @ self.T_frame_left
        t_ns = np.array([self.stamps[index] for index in indices], np.int64)
        return format_tum(Trajectory(t_ns, T_odom_left))


@contextmanager
def _keeper(folder: Path) -> Iterator[_Keeper]:
    """A keeper for the duration of the block. The files of poses are written at its end."""
    with (
        new_table(folder / ANSWERS, ANSWER_COLUMNS) as answers,
        new_table(folder / TIMES, TIME_COLUMNS) as times,
        zipfile.ZipFile(folder / TRACKS, "w", zipfile.ZIP_DEFLATED) as tracks,
    ):
        keeper = _Keeper(answers, times, tracks)
        yield keeper
    keeper.write(folder)


def _member(index: int, of: str = "") -> zipfile.ZipInfo:
    """The archive entry of the table of a frame."""
    info = zipfile.ZipInfo(f"{of}{index:08d}.npy", date_time=ZIP_DATE)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _npy(table: Array) -> bytes:
    """A table as the bytes of a .npy file in float32."""
    buffer = io.BytesIO()
    with np.errstate(over="ignore"):  # a number beyond float32 becomes infinite
        np.save(buffer, table.astype(np.float32))
    return buffer.getvalue()
