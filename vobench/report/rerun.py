"""A trial as a Rerun recording: pictures, tracks, both paths and the error on one time line."""

import json
import re
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as Rows
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import InputError, UnknownNameError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.report import blueprint as bp
from vobench.report.blueprint import FRAME_TIMELINE, truth_entity
from vobench.run.estimate import ESTIMATE, POINTS, read_tracks
from vobench.run.folder import SEQUENCE, STATUSES, SURVIVED, RunFolder, TrialScore, read_tum
from vobench.run.frames import FrameRow, read_frames
from vobench.run.ground_truth import GROUND_TRUTH
from vobench.sensor.pixel_truth import CHANNELS, TruthNames, picture
from vobench.sequence import EncodedFrame, Sequence, StereoTruth, read_truth_frames, read_truth_names, truth_channels
from vobench.sequence.picture import BAYER, RGB, decode, encode, rgb
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Stamps, Trajectory


def time_columns(frames: NDArray[np.int64], t_ns: Stamps) -> list[rr.TimeColumn]:
    """The frame's number, and seconds since the start."""
    seconds = rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))
    return [rr.TimeColumn(FRAME_TIMELINE, sequence=frames), seconds]


UNSET, SET = (0, 0, 0, 0), (255, 255, 255, 160)


@dataclass(frozen=True, slots=True)
class TruthView:
    """The channels that were recorded, what their ids mean, and a fresh pass over the frames."""

    channels: tuple[str, ...]
    names: TruthNames
    frames: Callable[[], Iterable[StereoTruth]]


def log_truth(stream: rr.RecordingStream, view: TruthView) -> None:
    """Log all channels of both cameras, one frame in memory at a time."""
    for side in ("left", "right"):
        for channel in view.channels:
            if classes := _classes(channel, view.names):
                stream.log(truth_entity(side, channel), rr.AnnotationContext(classes), static=True)
    for frame in view.frames():
        times = time_columns(np.array([frame.index]), np.array([frame.t_ns]))
        for side, truth in (("left", frame.left), ("right", frame.right)):
            for channel, values in truth.channels().items() if truth else ():
                stream.send_columns(truth_entity(side, channel), times, _columns(channel, values))


def _columns(channel: str, values: NDArray[np.generic]) -> Any:
    """Depth as depth, ids, counts and masks as classes, directions as colours."""
    if channel == "depth":
        return rr.DepthImage.columns(buffer=[_bytes(values)], format=[_format(values, "F32")], meter=[1.0])
    if CHANNELS[channel].depth == 1:
        classes = values.astype(np.uint16)
        return rr.SegmentationImage.columns(buffer=[_bytes(classes)], format=[_format(classes, "U16")])
    colors = picture(channel, values)
    return rr.Image.columns(buffer=[_bytes(colors)], format=[_format(colors, "U8", rr.ColorModel.RGB)])


def _format(values: NDArray[np.generic], kind: str, colors: rr.ColorModel | None = None) -> rr.components.ImageFormat:
    height, width = values.shape[:2]
    datatype = getattr(rr.ChannelDatatype, kind)
    return rr.components.ImageFormat(width, height, color_model=colors, channel_datatype=datatype)


def _bytes(values: NDArray[np.generic]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8)


def _classes(channel: str, names: TruthNames) -> list[rr.AnnotationInfo]:
    """What an id, a count or a mask's value is called, and its colour; none for other channels."""
    if channel in {"instance", "material"}:
        table = names.instance if channel == "instance" else names.material
        colors = picture(channel, np.arange(len(table), dtype=np.uint16)[None])[0]
        return [rr.AnnotationInfo(i, name, tuple(colors[i].tolist())) for i, name in enumerate(table)]
    if CHANNELS[channel].dtype is np.bool_:
        return [rr.AnnotationInfo(0, "", UNSET), rr.AnnotationInfo(1, channel, SET)]
    if channel == "shadow":
        return [rr.AnnotationInfo(0, "lit", UNSET), rr.AnnotationInfo(1, "one light hidden", SET)]
    return []


Color = tuple[int, int, int]
Tracks = tuple[Array, NDArray[np.bool_]]

GREEN, ORANGE, RED = (60, 200, 90), (255, 150, 40), (235, 60, 60)
STATUS_COLORS = {
    "init": (90, 140, 220),
    "ok": GREEN,
    "stationary": (70, 180, 190),
    "degraded": (235, 205, 70),
    "lost": RED,
    "no output": (150, 40, 110),
}
NO_OUTPUT = "no output"
NS_PER_S = 1_000_000_000
FAILED = ("lost", NO_OUTPUT)
PIXEL_CENTRE = 0.5  # Rerun puts the corner of the top-left pixel at (0, 0), we its centre
FRUSTUM_LINE = -1.5  # negative: in screen points, whatever the zoom
TRACK_RADIUS = rr.Radius.ui_points(3.5)


@dataclass(frozen=True, slots=True)
class TrialView:
    """All that is shown of a trial; both trajectories are of the left camera, in the same world.

    `frames` starts a fresh pass over the N pictures. `error_m` (N,) is NaN for frames without a pose, and
    `statuses` has one word for each. `tracks` maps a frame's index to points (K, 2) in the left picture and
    which are inliers (K,), `points` to what it took the scene to be (K, 3), in the world; `stats` has (N,) numbers by
    name, NaN for none. `truth` is None where nothing was recorded of the pixels.
    """

    title: str
    rig: Rig
    frames: Callable[[], Iterable[EncodedFrame]]
    ground_truth: Trajectory
    estimate: Trajectory
    error_m: Array
    statuses: Rows[str]
    tracks: Mapping[int, Tracks]
    summary_md: str
    truth: TruthView | None = None
    points: Mapping[int, Array] = field(default_factory=dict)
    stats: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Log:
    """A Rerun stream, and the frames' stamps (N,) that place anything stamped on the `frame` time line."""

    stream: rr.RecordingStream
    t_ns: Stamps

    def static(self, entity: str, *what: Any) -> None:
        self.stream.log(entity, *what, static=True)

    def columns(self, entity: str, frames: NDArray[np.int64], columns: Any) -> None:
        """Send rows for some frames, on the time lines `frame` and `t`."""
        if len(frames):
            self.stream.send_columns(entity, time_columns(frames, self.t_ns[frames]), columns)

    def frames_of(self, t_ns: Stamps) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The frames that have a sample closer than half the time between frames, and which sample it is."""
        if not len(t_ns):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        after = np.searchsorted(t_ns, self.t_ns).clip(max=len(t_ns) - 1)
        before = (after - 1).clip(min=0)
        nearest = np.where(self.t_ns - t_ns[before] < t_ns[after] - self.t_ns, before, after)
        step_ns = np.diff(self.t_ns).min(initial=NS_PER_S)
        frames = np.flatnonzero(2 * np.abs(t_ns[nearest] - self.t_ns) < step_ns)
        return frames, nearest[frames]


def save_trial(path: Path, trial: TrialView) -> None:
    """Write a trial to an .rrd file that opens in Rerun with its own layout."""
    part = path.with_name(path.name + ".part")
    with (
        stop.undone(lambda: part.unlink(missing_ok=True)),
        rr.RecordingStream(application_id(trial.title), recording_id=trial.title, send_properties=False) as stream,
    ):
        stream.save(part)
        stream.send_recording_name(trial.title)
        log = _Log(stream, _log_pictures(stream, trial.frames()))
        _log_paths(log, trial)
        _log_cameras(log, trial)
        _log_error(log, trial)
        _log_tracks(log, trial.tracks)
        _log_points(log, trial.points)
        for name, numbers in trial.stats.items():
            known = np.flatnonzero(np.isfinite(numbers))
            log.columns(f"{bp.STATS}/{name}", known, rr.Scalars.columns(scalars=numbers[known]))
        _log_statuses(log, trial.statuses)
        log.static(bp.SUMMARY, rr.TextDocument(trial.summary_md, media_type=rr.MediaType.MARKDOWN))
        if trial.truth is not None:
            log_truth(stream, trial.truth)
        channels, focus = trial.truth.channels if trial.truth else (), first_failure(trial.statuses)
        paths_m = (trial.ground_truth.positions_m, trial.estimate.positions_m)
        stream.send_blueprint(bp.layout(*paths_m, focus=focus, channels=channels, has_stats=bool(trial.stats)))
        stream.disconnect()
        part.replace(path)


def application_id(title: str) -> str:
    """One for each trial, since Rerun keeps one layout per application; it takes few characters in them."""
    return "vobench-" + re.sub(r"[^A-Za-z0-9_]+", "-", title).strip("-")


def first_failure(statuses: Rows[str]) -> tuple[int, int] | None:
    """The frames around the first failed one, or None where all went well."""
    failed = [i for i, status in enumerate(statuses) if status in FAILED]
    if not failed:
        return None
    around = bp.FRAMES_AROUND_FOCUS
    return max(0, failed[0] - around), min(len(statuses) - 1, failed[0] + around)


def _log_pictures(stream: rr.RecordingStream, frames: Iterable[EncodedFrame]) -> Stamps:
    """Log both pictures as they are encoded, one frame in memory at a time; return the stamps."""
    stamps = []
    for frame in frames:
        times = time_columns(np.array([frame.index]), np.array([frame.t_ns]))
        pictures = ((bp.TRUTH_LEFT, frame.left), (bp.TRUTH_RIGHT, frame.right))
        for entity, encoded in ((entity, encoded) for entity, encoded in pictures if encoded is not None):
            columns = rr.EncodedImage.columns(blob=[_shown(encoded, frame)], media_type=[f"image/{frame.form}"])
            stream.send_columns(f"{entity}/image", times, columns)
        stamps.append(frame.t_ns)
    return np.array(stamps, np.int64)


def _shown(encoded: bytes, frame: EncodedFrame) -> bytes:
    """The picture as people look at it: a mosaic interpolated."""
    if frame.colour != BAYER:
        return encoded
    picture = rgb(decode(encoded, None, f"frame {frame.index}"), BAYER)
    return encode(picture, None, f"frame {frame.index}", jpeg_quality=None if frame.form == "png" else 95, colour=RGB)


def _log_paths(log: _Log, trial: TrialView) -> None:
    """Both whole paths; the estimate is broken where frames have no pose."""
    log.static(bp.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    width = rr.Radius.ui_points(1.8)
    truth_m, estimate_m = trial.ground_truth.positions_m, trial.estimate.positions_m
    log.static(bp.TRUTH_PATH, rr.LineStrips3D([truth_m], colors=GREEN, radii=width))
    frames, samples = log.frames_of(trial.estimate.t_ns)
    strips = np.split(estimate_m[samples], np.flatnonzero(np.diff(frames) > 1) + 1)
    log.static(bp.ESTIMATE_PATH, rr.LineStrips3D(strips, colors=ORANGE, radii=width))


def _log_cameras(log: _Log, trial: TrialView) -> None:
    """True left and right camera, and the estimated left one, which vanishes while there is no pose."""
    length_m = bp.frustum_m(trial.ground_truth.positions_m)
    _log_camera(log, bp.TRUTH_LEFT, trial.rig.left, trial.ground_truth, length_m=length_m, color=GREEN)
    if trial.rig.right:
        right = trial.ground_truth.of_mounted(trial.rig.T_left_right)
        _log_camera(log, bp.TRUTH_RIGHT, trial.rig.right, right, length_m=length_m, color=GREEN)
    _log_camera(log, bp.ESTIMATE_LEFT, trial.rig.left, trial.estimate, length_m=length_m, color=ORANGE)
    frames, _ = log.frames_of(trial.estimate.t_ns)
    absent = np.setdiff1d(np.arange(len(log.t_ns)), frames)
    log.columns(bp.ESTIMATE_LEFT, absent, rr.Clear.columns(is_recursive=[False] * len(absent)))


def _log_camera(log: _Log, entity: str, camera: Camera, path: Trajectory, *, length_m: float, color: Color) -> None:
    frames, samples = log.frames_of(path.t_ns)
    poses, count = path.T_world_frame[samples], len(frames)
    log.columns(entity, frames, rr.Transform3D.columns(translation=poses[:, :3, 3], mat3x3=poses[:, :3, :3]))
    pinhole = rr.Pinhole.columns(
        image_from_camera=[rerun_matrix(camera)] * count,
        resolution=[[camera.width_px, camera.height_px]] * count,
        camera_xyz=[rr.components.ViewCoordinates.RDF] * count,
        image_plane_distance=[length_m] * count,
        color=[color] * count,
        line_width=[FRUSTUM_LINE] * count,
    )
    log.columns(entity, frames, pinhole)


def rerun_matrix(camera: Camera) -> Array:
    """The camera matrix (3, 3) for Rerun's pixels, whose centres lie at halves."""
    K = camera.K
    K[:2, 2] += PIXEL_CENTRE
    return K


def _log_error(log: _Log, trial: TrialView) -> None:
    """The error of each frame as a plot with gaps, and in 3-D as a line from truth to estimate."""
    error_mm = 1e3 * trial.error_m
    log.static(bp.ERROR_PLOT, rr.SeriesLines(colors=RED, widths=1.5, names="position error (mm)"))
    log.columns(bp.ERROR_PLOT, np.arange(len(error_mm)), rr.Scalars.columns(scalars=error_mm))
    truth, estimate = (
        dict(zip(*log.frames_of(path.t_ns), strict=True)) for path in (trial.ground_truth, trial.estimate)
    )
    both = sorted(truth.keys() & estimate.keys())
    truth_m = trial.ground_truth.positions_m[[truth[i] for i in both]]
    estimate_m = trial.estimate.positions_m[[estimate[i] for i in both]]
    lengths = np.isin(np.arange(len(log.t_ns)), both).astype(int)  # no line, where there is no pose
    lines = rr.LineStrips3D.columns(strips=np.stack([truth_m, estimate_m], 1)).partition(lengths)
    log.static(bp.ERROR_LINE, rr.LineStrips3D.from_fields(colors=RED, radii=rr.Radius.ui_points(1.5)))
    log.columns(bp.ERROR_LINE, np.arange(len(lengths)), lines)


def _log_tracks(log: _Log, tracks: Mapping[int, Tracks]) -> None:
    """Points in the left picture; a frame without any clears those of the frame before."""
    count = len(log.t_ns)
    nothing = (np.zeros((0, 2)), np.zeros(0, bool))
    rows = [tracks.get(index, nothing) for index in range(count)]
    uv_px = np.concatenate([uv.reshape(-1, 2) for uv, _ in rows])
    inlier = np.concatenate([inlier for _, inlier in rows])
    lengths = [len(uv) for uv, _ in rows]
    colors = np.where(inlier[:, None], np.array(GREEN, np.uint8), np.array(RED, np.uint8))
    columns = rr.Points2D.columns(positions=uv_px + PIXEL_CENTRE, colors=colors).partition(lengths)
    log.static(bp.LEFT_TRACKS, rr.Points2D.from_fields(radii=TRACK_RADIUS))
    log.columns(bp.LEFT_TRACKS, np.arange(count), columns)


def _log_statuses(log: _Log, statuses: Rows[str]) -> None:
    """A row where the status changes: Rerun draws it until the next one."""
    known = dict.fromkeys([*STATUS_COLORS, *statuses])
    colors = [STATUS_COLORS.get(status, (128, 128, 128)) for status in known]
    log.static(bp.STATUS, rr.StateConfiguration(values=list(known), colors=colors))
    changes = [i for i, status in enumerate(statuses) if i == 0 or status != statuses[i - 1]]
    states = rr.StateChange.columns(state=[statuses[i] for i in changes])
    log.columns(bp.STATUS, np.array(changes, np.int64), states)


def pick(scores: Rows[TrialScore], *, case: str | None, estimator: str | None) -> TrialScore:
    """The trial most worth a look among those asked for: the gravest failure, else the best estimator's worst case.

    Raises UnknownNameError where no trial is of that case or estimator.
    """
    for kind, name, known in (
        ("case", case, {s.case for s in scores}),
        ("estimator", estimator, {s.estimator for s in scores}),
    ):
        if name is not None and name not in known:
            raise UnknownNameError(f"no {kind} '{name}' in this run. Known: {', '.join(sorted(known))}")
    wanted = [s for s in scores if case in (None, s.case) and estimator in (None, s.estimator)]
    failed = [s for s in wanted if s.status not in SURVIVED]
    if failed:
        return max(failed, key=lambda s: STATUSES.index(s.status))
    of = {name: [s for s in wanted if s.estimator == name] for name in sorted({s.estimator for s in wanted})}
    return max(min(of.values(), key=lambda trials: fmean(map(_error, trials))), key=_error)


def _log_points(log: _Log, points: Mapping[int, Array]) -> None:
    """The scene as the estimator takes it to be: the points of a frame stay until those of another."""
    frames = np.array(sorted(points), np.int64)
    if len(frames):
        columns = rr.Points3D.columns(positions=np.concatenate([points[index] for index in frames.tolist()]))
        log.static(bp.ESTIMATE_POINTS, rr.Points3D.from_fields(colors=ORANGE, radii=rr.Radius.ui_points(1.5)))
        log.columns(bp.ESTIMATE_POINTS, frames, columns.partition([len(points[index]) for index in frames.tolist()]))


def trial_view(folder: RunFolder, trial: TrialScore) -> TrialView:
    """All that is shown of one trial. Raises InputError where its sequence is no longer in the cache."""
    link = folder.case(trial.case) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is gone from the cache; run the suite again to make it anew: {link}")
    sequence, channels = Sequence.open(link), truth_channels(link)
    place = folder.estimate(trial.case, trial.estimator, trial.repeat)
    est, frames = read_tum(place / ESTIMATE), read_frames(place)
    points = {index: X.astype(float) for index, X in read_tracks(place, of=POINTS)}
    if trial.score:
        alignment = Alignment.from_dict(trial.score["alignment"])
        placed = {index: alignment.apply(se3.transform(np.eye(3), X)) for index, X in points.items()}
        points = {index: T[:, :3, 3] for index, T in placed.items()}
        est = Trajectory(est.t_ns, alignment.apply(est.T_world_frame))
    return TrialView(
        title=f"{trial.estimator} on {trial.case}",
        rig=sequence.rig,
        frames=sequence.encoded_frames,
        ground_truth=read_tum(folder.case(trial.case) / GROUND_TRUTH),
        estimate=est,
        error_m=np.array([row.position_error_m for row in frames], float),
        statuses=[row.status or NO_OUTPUT for row in frames],
        tracks={i: (table[:, 2:4].astype(float), table[:, 4] > 0) for i, table in read_tracks(place)},
        points=points,
        stats=_stats(frames),
        summary_md=_summary(trial),
        truth=TruthView(channels, read_truth_names(link), lambda: read_truth_frames(link)) if channels else None,
    )


def _stats(frames: Rows[FrameRow]) -> dict[str, Array]:
    """What the estimator said in numbers, (N,) by name, NaN where it did not."""
    rows = [json.loads(row.stats or "{}") for row in frames]
    names = sorted({name for row in rows for name in row})
    return {name: np.array([row.get(name, np.nan) for row in rows], float) for name in names}


def _error(trial: TrialScore) -> float:
    value = trial.value("ate_trans", "rmse")
    return float("inf") if value is None else value


def _summary(trial: TrialScore) -> str:
    """The trial's score in Markdown."""
    status = f"**{trial.status}**{f' — {trial.reason}' if trial.reason else ''}"
    lines = [f"# {trial.estimator} on {trial.case}", "", status, ""]
    lines += [f"{trial.frames} frames, {trial.path_m:.2f} m, coverage {trial.coverage:.1%}", ""]
    if trial.score:
        lines += ["| metric | rmse | mean | max |", "|---|---|---|---|"]
        for m in trial.score["metrics"]:
            lines.append(f"| {m['name']} ({m['unit']}) | {m['rmse']:.4g} | {m['mean']:.4g} | {m['max']:.4g} |")
    return "\n".join(lines)
