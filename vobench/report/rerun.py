"""A trial as a Rerun recording: pictures, tracks, both paths and the error on one time line."""

import json
import re
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as Rows
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from statistics import fmean
from typing import Any, Literal

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from pydantic import ValidationError

from vobench import stop
from vobench.errors import InputError, UnknownNameError, VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.rendering.bake import load_baked
from vobench.rendering.illumination import Illumination
from vobench.report import blueprint as bp
from vobench.report.blueprint import FRAME_TIMELINE, truth_entity
from vobench.runner.estimate import ESTIMATE, POINTS, read_tracks
from vobench.runner.folder import (
    CASE,
    SEQUENCE,
    STATUSES,
    SURVIVED,
    RunFolder,
    TrialScore,
    read_tum,
    with_sequence,
)
from vobench.runner.frames import GROUND_TRUTH, FrameRow, read_frames
from vobench.scene.material import Material, linear_texture, srgb
from vobench.scene.scene import Way
from vobench.sensor.pixel_truth import CHANNELS, TruthNames, picture
from vobench.sequence import EncodedFrame, Sequence, StereoTruth, read_truth_frames, read_truth_names, truth_channels
from vobench.sequence.picture import BAYER, RGB, decode, encode, rgb
from vobench.suite.scene_build import build
from vobench.suite.scene_spec import LightOverride, SceneFile
from vobench.suite.yaml_file import checked
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Stamps, Trajectory


def time_columns(frames: NDArray[np.int64], t_ns: Stamps) -> list[rr.TimeColumn]:
    """The frame's number, and seconds since the start."""
    seconds = rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))
    return [rr.TimeColumn(FRAME_TIMELINE, sequence=frames), seconds]


UNSET = (0, 0, 0, 0)
SET = (255, 255, 255, 160)


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


Unit = tuple[float, str]
Color = tuple[int, int, int]
Tracks = tuple[Array, NDArray[np.bool_]]

GREEN = (60, 200, 90)
ORANGE = (255, 150, 40)
RED = (235, 60, 60)
COLORS = (ORANGE, (80, 160, 255), (200, 110, 230), (240, 220, 90), (120, 220, 220))  # of estimators
EPIPOLAR = (255, 255, 255, 70)
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
PATH_RADIUS = rr.Radius.ui_points(1.8)
TAIL_FRAMES = 5
MOST_TAILS = 200
MOST_LINES = 40  # of epipolar lines in a picture
AWAY_M = np.geomspace(0.3, 100.0, 12)  # points of such a line, by their distance from the last place

PictureForm = Literal["jpeg", "png"]
FRAME_BYTES = 45_000  # of 60,000 with tracks
BEST_QUALITY = 85
WORST_QUALITY = 10


@dataclass(frozen=True, slots=True)
class SceneMesh:
    """A scene's faces: corners (F, 3, 3), their places on the map of light (H, W, 3) uint8, colours (F, 3) uint8.

    mover (F,) is -1 for what stands still; the others are in the frame of that mover, which goes one of the ways.
    """

    corners_m: Array
    light_uv: Array
    light: NDArray[np.uint8]
    colors: NDArray[np.uint8]
    mover: NDArray[np.int32]
    ways: tuple[Way, ...] = ()

    def shown(self, some: NDArray[np.bool_]) -> rr.Mesh3D:
        """Some of the faces (F,)."""
        return rr.Mesh3D(
            vertex_positions=self.corners_m[some].reshape(-1, 3),
            triangle_indices=np.arange(3 * np.count_nonzero(some), dtype=np.uint32).reshape(-1, 3),
            vertex_texcoords=self.light_uv[some].reshape(-1, 2),
            vertex_colors=np.repeat(self.colors[some], 3, axis=0),
            albedo_texture=self.light,
            face_rendering=rr.components.MeshFaceRendering.Front,
        )


@dataclass(frozen=True, slots=True)
class TrialView:
    """All that is shown of a trial; both trajectories are of the left camera, in the same world.

    `frames` starts a fresh pass over the N pictures. `error_m` (N,) is NaN for frames without a pose, and
    `statuses` has one word for each. `tracks` maps a frame's index to points (K, 2) in the left picture and
    which are inliers (K,), `points` to what it took the scene to be (K, 3), in the world; `stats` has (N,) numbers by
    name, NaN for none. `truth` is None where nothing was recorded of the pixels. `steps` has where each track was in
    the frame before (K, 2); `costs` what a frame was exposed for and cost, as `stats`. `wrong_at` is where an estimate
    goes wrong that is never lost; `first` is the number of the first frame that is shown.
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
    label: str = "estimate"
    rotation_deg: Array = field(default_factory=lambda: np.zeros(0))
    steps: Mapping[int, Array] = field(default_factory=dict)
    costs: Mapping[str, Array] = field(default_factory=dict)
    scene: SceneMesh | None = None
    wrong_at: int | None = None
    first: int = 0


@dataclass(frozen=True, slots=True)
class _Log:
    """A Rerun stream, and the frames' stamps (N,) that place anything stamped on the `frame` time line.

    `first` is the number of the first of them.
    """

    stream: rr.RecordingStream
    t_ns: Stamps
    first: int = 0

    def static(self, entity: str, *what: Any) -> None:
        self.stream.log(entity, *what, static=True)

    def columns(self, entity: str, frames: NDArray[np.int64], columns: Any) -> None:
        """Send rows for some frames, on the time lines `frame` and `t`."""
        if len(frames):
            self.stream.send_columns(entity, time_columns(frames + self.first, self.t_ns[frames]), columns)

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


def save_trial(path: Path, trial: TrialView, *others: TrialView, form: PictureForm = "jpeg") -> None:
    """Write a trial to an .rrd file that opens in Rerun with its own layout; `others` are of the same case.

    Pictures are JPEG of FRAME_BYTES a frame at most, or PNG as they are.
    """
    part = path.with_name(path.name + ".part")
    title = ", ".join(each.title for each in (trial, *others))
    with (
        stop.undone(lambda: part.unlink(missing_ok=True)),
        rr.RecordingStream(application_id(title), recording_id=title, send_properties=False) as stream,
    ):
        stream.save(part)
        stream.send_recording_name(title)
        log = _Log(stream, _log_pictures(stream, trial.frames(), form), trial.first)
        _log_truth_path(log, trial)
        _log_scene(log, trial.scene)
        trials = (trial, *others)
        unit = _unit([trial, *others])
        for each, color in zip(trials, COLORS, strict=False):
            _log_trial(log, each, color, unit)
        if trial.truth is not None:
            log_truth(stream, trial.truth)
        stream.send_blueprint(
            bp.layout(
                trial.ground_truth.positions_m,
                np.concatenate([each.estimate.positions_m for each in trials]),
                focus=_focus(trials),
                labels=[each.label for each in trials],
                channels=trial.truth.channels if trial.truth else (),
                has_stats=any(each.stats for each in trials),
                has_costs=any(each.costs for each in trials),
            )
        )
        stream.disconnect()
        part.replace(path)


def _focus(trials: Rows[TrialView]) -> tuple[int, int] | None:
    """The frames around the first failure of any."""
    for trial in trials:
        if found := first_failure(trial.statuses):
            return found[0] + trial.first, found[1] + trial.first
    wrong = [trial.wrong_at for trial in trials if trial.wrong_at is not None]
    count = len(trials[0].statuses)
    around = bp.FRAMES_AROUND_FOCUS
    if not wrong:
        return None
    return max(0, wrong[0] - around) + trials[0].first, min(count - 1, wrong[0] + around) + trials[0].first


def _log_trial(log: _Log, trial: TrialView, color: Color, unit: Unit) -> None:
    """All that is one estimator's."""
    of = bp.Entities(trial.label)
    _log_estimate(log, trial, of, color)
    _log_error(log, trial, of, color, unit)
    _log_tracks(log, trial, of)
    _log_points(log, trial.points, of, color)
    for origin, numbers in ((bp.STATS, trial.stats), (bp.COSTS, trial.costs)):
        for name, values in numbers.items():
            known = np.flatnonzero(np.isfinite(values))
            log.columns(f"{origin}/{trial.label}/{name}", known, rr.Scalars.columns(scalars=values[known]))
    _log_statuses(log, trial.statuses, of)
    log.static(of.summary, rr.TextDocument(trial.summary_md, media_type=rr.MediaType.MARKDOWN))


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


def _log_pictures(stream: rr.RecordingStream, frames: Iterable[EncodedFrame], form: PictureForm) -> Stamps:
    """Log both pictures, one frame in memory at a time; return the stamps."""
    stamps = []
    quality = BEST_QUALITY
    with ThreadPoolExecutor(2) as eyes:
        for frame in frames:
            times = time_columns(np.array([frame.index]), np.array([frame.t_ns]))
            pictures = {bp.TRUTH_LEFT: frame.left} | ({bp.TRUTH_RIGHT: frame.right} if frame.right else {})
            shown = list(eyes.map(lambda each, of=frame, q=quality: _shown(each, of, form, q), pictures.values()))
            while form == "jpeg" and sum(map(len, shown)) > FRAME_BYTES and quality > WORST_QUALITY:
                quality -= 5
                shown = [_shown(each, frame, form, quality) for each in pictures.values()]
            kind = form if form == "jpeg" else frame.form
            for entity, blob in zip(pictures, shown, strict=True):
                columns = rr.EncodedImage.columns(blob=[blob], media_type=[f"image/{kind}"])
                stream.send_columns(f"{entity}/image", times, columns)
            stamps.append(frame.t_ns)
    return np.array(stamps, np.int64)


def _shown(encoded: bytes, frame: EncodedFrame, form: PictureForm, quality: int) -> bytes:
    """The picture as people look at it: a mosaic interpolated."""
    if frame.colour != BAYER and (form == "png" or frame.form == "jpeg"):
        return encoded
    name = f"frame {frame.index}"
    picture = decode(encoded, None, name, colour=frame.colour)
    colour = frame.colour
    if colour == BAYER:
        picture = rgb(picture, BAYER)
        colour = RGB
    return encode(picture, None, name, jpeg_quality=quality if form == "jpeg" else None, colour=colour)


def _log_scene(log: _Log, scene: SceneMesh | None) -> None:
    """The scene in its own light, seen through walls from outside; what moves goes its way."""
    if scene is None:
        return
    log.static(bp.SCENE, scene.shown(scene.mover < 0))
    for nth, way in enumerate(scene.ways):
        entity = f"{bp.SCENE}/mover_{nth}"
        poses = np.stack([way.pose(t_ns) for t_ns in log.t_ns.tolist()])
        log.static(entity, scene.shown(scene.mover == nth))
        columns = rr.Transform3D.columns(translation=poses[:, :3, 3], mat3x3=poses[:, :3, :3])
        log.columns(entity, np.arange(len(poses)), columns)


def _log_truth_path(log: _Log, trial: TrialView) -> None:
    """The true path and cameras."""
    log.static(bp.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    log.static(bp.TRUTH_PATH, rr.LineStrips3D([trial.ground_truth.positions_m], colors=GREEN, radii=PATH_RADIUS))
    length_m = bp.frustum_m(trial.ground_truth.positions_m)
    _log_camera(log, bp.TRUTH_LEFT, trial.rig.left, trial.ground_truth, length_m=length_m, color=GREEN)
    if trial.rig.right:
        right = trial.ground_truth.of_mounted(trial.rig.T_left_right)
        _log_camera(log, bp.TRUTH_RIGHT, trial.rig.right, right, length_m=length_m, color=GREEN)


def _log_estimate(log: _Log, trial: TrialView, of: bp.Entities, color: Color) -> None:
    """The estimated path, broken where frames have no pose, and the left camera, which vanishes there."""
    frames, samples = log.frames_of(trial.estimate.t_ns)
    strips = np.split(trial.estimate.positions_m[samples], np.flatnonzero(np.diff(frames) > 1) + 1)
    log.static(of.path, rr.LineStrips3D(strips, colors=color, radii=PATH_RADIUS))
    length_m = bp.frustum_m(trial.ground_truth.positions_m)
    _log_camera(log, of.left, trial.rig.left, trial.estimate, length_m=length_m, color=color)
    absent = np.setdiff1d(np.arange(len(log.t_ns)), frames)
    log.columns(of.left, absent, rr.Clear.columns(is_recursive=[False] * len(absent)))


def _log_camera(log: _Log, entity: str, camera: Camera, path: Trajectory, *, length_m: float, color: Color) -> None:
    frames, samples = log.frames_of(path.t_ns)
    poses = path.T_world_frame[samples]
    count = len(frames)
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


def _unit(trials: Rows[TrialView]) -> Unit:
    """How many of a unit a metre has, and its name: the one in which the largest error has few digits."""
    errors = np.concatenate([trial.error_m for trial in trials])
    largest_m = float(errors[np.isfinite(errors)].max(initial=0.0))
    if largest_m < 0.1:
        return (1e3, "mm")
    return (1e2, "cm") if largest_m < 5 else (1.0, "m")


def _log_error(log: _Log, trial: TrialView, of: bp.Entities, color: Color, unit: Unit) -> None:
    """The errors of each frame as plots with gaps, and in 3-D as a line from truth to estimate."""
    scale, name = unit
    shown = ((of.position_error, scale * trial.error_m, name), (of.rotation_error, trial.rotation_deg, "°"))
    for entity, error, in_unit in shown:
        log.static(entity, rr.SeriesLines(colors=color, widths=1.5, names=f"{trial.label} ({in_unit})"))
        log.columns(entity, np.arange(len(error)), rr.Scalars.columns(scalars=error))
    truth, estimate = (
        dict(zip(*log.frames_of(path.t_ns), strict=True)) for path in (trial.ground_truth, trial.estimate)
    )
    both = sorted(truth.keys() & estimate.keys())
    truth_m = trial.ground_truth.positions_m[[truth[i] for i in both]]
    estimate_m = trial.estimate.positions_m[[estimate[i] for i in both]]
    lengths = np.isin(np.arange(len(log.t_ns)), both).astype(int)  # no line, where there is no pose
    lines = rr.LineStrips3D.columns(strips=np.stack([truth_m, estimate_m], 1)).partition(lengths)
    log.static(of.error_line, rr.LineStrips3D.from_fields(colors=RED, radii=rr.Radius.ui_points(1.5)))
    log.columns(of.error_line, np.arange(len(lengths)), lines)


def _log_tracks(log: _Log, trial: TrialView, of: bp.Entities) -> None:
    """Points in the left picture with tails, and lines on which they would lie; a frame without any clears all."""
    count = len(log.t_ns)
    nothing = (np.zeros((0, 2)), np.zeros(0, bool))
    rows = [trial.tracks.get(index, nothing) for index in range(count)]
    colors = np.where(np.concatenate([is_in for _, is_in in rows])[:, None], GREEN, RED).astype(np.uint8)
    lengths = [len(uv) for uv, _ in rows]
    uv_px = np.concatenate([uv.reshape(-1, 2) for uv, _ in rows])
    columns = rr.Points2D.columns(positions=uv_px + PIXEL_CENTRE, colors=colors).partition(lengths)
    log.static(of.tracks, rr.Points2D.from_fields(radii=TRACK_RADIUS))
    log.columns(of.tracks, np.arange(count), columns)
    if not trial.steps:
        return
    shown = list(_tails(trial.tracks, trial.steps, count))
    tails = [tail + PIXEL_CENTRE for row, _ in shown for tail in row]
    of_tails = np.concatenate([rows[index][1][chosen] for index, (_, chosen) in enumerate(shown)])
    strips = rr.LineStrips2D.columns(strips=tails, colors=np.where(of_tails[:, None], GREEN, RED).astype(np.uint8))
    log.static(of.tails, rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.0)))
    log.columns(of.tails, np.arange(count), strips.partition([len(row) for row, _ in shown]))
    lines = [[line + PIXEL_CENTRE for line in _epipolar_lines(trial, index)] for index in range(count)]
    strips = rr.LineStrips2D.columns(strips=[line for of_frame in lines for line in of_frame])
    log.static(of.epipolar, rr.LineStrips2D.from_fields(colors=EPIPOLAR, radii=rr.Radius.ui_points(0.7)))
    log.columns(of.epipolar, np.arange(count), strips.partition([len(of_frame) for of_frame in lines]))


def _tails(
    tracks: Mapping[int, Tracks], steps: Mapping[int, Array], count: int
) -> Iterable[tuple[list[Array], NDArray[np.intp]]]:
    """Where some tracks of each frame were, their last places (T, 2) with the oldest first; and which tracks.

    A track goes on from the one that ended where it was: estimators number no tracks.
    """
    places = np.zeros((0, TAIL_FRAMES + 1, 2))
    for index in range(count):
        now = tracks[index][0] if index in tracks else np.zeros((0, 2))
        last = steps.get(index, np.zeros((0, 2)))
        began = np.full((len(now), TAIL_FRAMES, 2), np.nan)
        began[:, -1] = last
        ended = _keys(places[:, -1])
        starts = _keys(last)
        order = np.argsort(ended)
        found = np.searchsorted(ended, starts, sorter=order).clip(max=max(len(ended) - 1, 0))
        goes_on = np.flatnonzero(ended[order[found]] == starts) if len(ended) else np.zeros(0, np.intp)
        began[goes_on] = places[order[found[goes_on]], 1:] if len(goes_on) else 0
        places = np.concatenate([began, now[:, None]], 1)
        chosen = np.arange(0, len(now), max(1, -(-len(now) // MOST_TAILS)))
        yield [tail[np.isfinite(tail[:, 0])] for tail in places[chosen]], chosen


def _keys(places: Array) -> NDArray[np.int64]:
    """Places (K, 2) as single precision knows them, one number each."""
    return np.ascontiguousarray(places, np.float32).view(np.int64).reshape(-1)


def _epipolar_lines(trial: TrialView, index: int) -> list[Array]:
    """For some tracks of a frame, where in the picture what was seen in the last frame must be, (P, 2) each."""
    truth = trial.ground_truth
    left = trial.rig.left
    if not 0 < index < len(truth) or index not in trial.steps:
        return []
    last_px = trial.steps[index][:: max(1, len(trial.steps[index]) // MOST_LINES)]
    T_now_last = se3.inverse(truth.T_world_frame[index]) @ truth.T_world_frame[index - 1]
    points_m = left.rays(last_px)[:, None] * AWAY_M[:, None]
    lines = left.project(se3.apply(T_now_last, points_m.reshape(-1, 3))).reshape(*points_m.shape[:2], 2)
    with np.errstate(invalid="ignore"):
        near = ((lines > -PIXEL_CENTRE) & (lines < np.array([left.width_px, left.height_px]) - PIXEL_CENTRE)).all(-1)
    return [line[kept] for line, kept in zip(lines, np.asarray(near), strict=True) if kept.sum() > 1]


def _log_statuses(log: _Log, statuses: Rows[str], of: bp.Entities) -> None:
    """A row where the status changes: Rerun draws it until the next one."""
    known = dict.fromkeys([*STATUS_COLORS, *statuses])
    colors = [STATUS_COLORS.get(status, (128, 128, 128)) for status in known]
    log.static(of.status, rr.StateConfiguration(values=list(known), colors=colors))
    changes = [i for i, status in enumerate(statuses) if i == 0 or status != statuses[i - 1]]
    states = rr.StateChange.columns(state=[statuses[i] for i in changes])
    log.columns(of.status, np.array(changes, np.int64), states)


def ranked(scores: Rows[TrialScore], *, case: str | None, estimator: str | None) -> list[TrialScore]:
    """The trials asked for, the gravest failure first, then by error.

    Raises UnknownNameError where no trial is of that case or estimator, and InputError where its case has no sequence.
    """
    wanted = _wanted(scores, case, estimator)
    return sorted(wanted, key=lambda s: (s.status in SURVIVED, -STATUSES.index(s.status), -_error(s)))


def pick(scores: Rows[TrialScore], *, case: str | None, estimator: str | None) -> TrialScore:
    """The trial most worth a look among those asked for: the gravest failure, else the best estimator's worst case.

    Raises UnknownNameError where no trial is of that case or estimator, and InputError where its case has no sequence.
    """
    wanted = _wanted(scores, case, estimator)
    failed = [s for s in wanted if s.status not in SURVIVED]
    if failed:
        return max(failed, key=lambda s: STATUSES.index(s.status))
    of = {name: [s for s in wanted if s.estimator == name] for name in sorted({s.estimator for s in wanted})}
    return max(min(of.values(), key=lambda trials: fmean(map(_error, trials))), key=_error)


def _wanted(scores: Rows[TrialScore], case: str | None, estimator: str | None) -> list[TrialScore]:
    for kind, name, known in (
        ("case", case, {s.case for s in scores}),
        ("estimator", estimator, {s.estimator for s in scores}),
    ):
        if name is not None and name not in known:
            raise UnknownNameError(f"no {kind} '{name}' in this run. Known: {', '.join(sorted(known))}")
    asked_for = [s for s in scores if case in (None, s.case) and estimator in (None, s.estimator)]
    shown = with_sequence(asked_for)
    if asked_for and not shown:
        unmade = asked_for[0]
        raise InputError(f"'{unmade.case}' has no sequence to show, as it could not be made: {unmade.reason}")
    return shown


def _log_points(log: _Log, points: Mapping[int, Array], of: bp.Entities, color: Color) -> None:
    """The scene as the estimator takes it to be: the points of a frame stay until those of another."""
    frames = np.array(sorted(points), np.int64)
    if len(frames):
        columns = rr.Points3D.columns(positions=np.concatenate([points[index] for index in frames.tolist()]))
        log.static(of.points, rr.Points3D.from_fields(colors=color, radii=rr.Radius.ui_points(1.5)))
        log.columns(of.points, frames, columns.partition([len(points[index]) for index in frames.tolist()]))


def trial_view(folder: RunFolder, trial: TrialScore, *, window: slice = slice(None)) -> TrialView:
    """All that is shown of one trial, or of a window of its frames.

    Raises InputError where its sequence is no longer in the cache, or the window holds no frame.
    """
    link = folder.case(trial.case) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is gone from the cache; run the suite again to make it anew: {link}")
    sequence = Sequence.open(link)
    channels = truth_channels(link)
    place = folder.estimate(trial.case, trial.estimator, trial.repeat)
    est = read_tum(place / ESTIMATE)
    every = read_frames(place)
    frames = every[window]
    (first, end, _) = window.indices(len(sequence))
    if every and not frames:
        raise InputError(f"--frames {first}:{end} holds none of the {len(every)} frames of {trial.case}")
    shown = slice(frames[0].t_ns, frames[-1].t_ns) if frames else slice(None)
    points = {index - first: X.astype(float) for index, X in read_tracks(place, of=POINTS) if first <= index < end}
    if trial.score:
        alignment = Alignment.from_dict(trial.score["alignment"])
        placed = {index: alignment.apply(se3.transform(np.eye(3), X)) for index, X in points.items()}
        points = {index: T[:, :3, 3] for index, T in placed.items()}
        est = Trajectory(est.t_ns, alignment.apply(est.T_world_frame))
    tables = {index - first: table for index, table in read_tracks(place) if first <= index < end}
    error_m = _column(frames, "position_error_m")
    return TrialView(
        title=f"{trial.estimator} on {trial.case}",
        label=trial.estimator,
        rig=sequence.rig,
        frames=lambda: islice(sequence.encoded_frames(), first, end),
        ground_truth=_between(read_tum(folder.case(trial.case) / GROUND_TRUTH), shown),
        estimate=_between(est, shown),
        error_m=error_m,
        rotation_deg=_column(frames, "rotation_error_deg"),
        statuses=[row.status or NO_OUTPUT for row in frames],
        tracks={i: (table[:, 2:4].astype(float), table[:, 4] > 0) for i, table in tables.items()},
        steps={i: table[:, :2].astype(float) for i, table in tables.items()},
        points=points,
        stats=_stats(frames),
        costs=_costs(frames),
        summary_md=_summary(trial),
        truth=TruthView(channels, read_truth_names(link), lambda: read_truth_frames(link)) if channels else None,
        scene=scene_mesh(folder, trial.case),
        wrong_at=None if trial.status in SURVIVED else _leap(error_m),
        first=first,
    )


def _between(path: Trajectory, shown: slice) -> Trajectory:
    """The poses from one stamp up to another, both included."""
    if shown == slice(None):
        return path
    kept = (path.t_ns >= shown.start) & (path.t_ns <= shown.stop)
    return Trajectory(path.t_ns[kept], path.T_world_frame[kept])


def _column(frames: Rows[FrameRow], name: str) -> Array:
    return np.array([getattr(row, name) for row in frames], float)


def _costs(frames: Rows[FrameRow]) -> dict[str, Array]:
    """What a frame took and how it was exposed, (N,) by name."""
    held = {"latency_ms": "wall_ms", "exposure_ms": "exposure_s", "gain_db": "gain_db"}
    return {name: _column(frames, key) * (1e3 if key == "exposure_s" else 1) for name, key in held.items()}


def _leap(error_m: Array) -> int | None:
    """The frame at which the error grows most."""
    grown = np.diff(np.nan_to_num(error_m))
    return int(np.argmax(grown)) + 1 if len(grown) and grown.max() > 0 else None


MOST_TEXELS = 1024  # of a side of the map of light that is shown
BRIGHT = 98.0  # per cent of lit texels that are not burnt


def scene_mesh(folder: RunFolder, case: str) -> SceneMesh | None:
    """A case's scene in the light that its pictures were drawn with; None where it has none, or that is gone."""
    path = folder.case(case) / CASE
    link = (folder.case(case) / SEQUENCE).resolve()
    inputs = link / "inputs.json"
    said = json.loads(path.read_bytes()) if path.is_file() else {}
    needs = []
    if "scene" in said and inputs.is_file():
        needs = json.loads(inputs.read_bytes()).get("needs", [])
    baked = next((link.parents[1] / need for need in needs if (link.parents[1] / need).is_dir()), None)
    if baked is None:
        return None
    try:
        lighting = {name: checked(LightOverride, each) for name, each in said["lighting"].items()}
        light = load_baked(baked, build(checked(SceneFile, said["scene"]), lighting))
    except (VobenchError, ValidationError):
        return None
    picture = Illumination(light).at(0, 0)
    step = -(-max(picture.shape) // MOST_TEXELS)
    picture = picture[::step, ::step]
    lit = picture[picture > 0]
    shown = srgb(picture / max(float(np.percentile(lit, BRIGHT)) if lit.size else 1.0, 1e-9))
    looks = [light.scene.materials.get(thing.material) for thing in light.faces.things]
    tones = np.array([srgb(_tone(look)) if look else (128, 128, 128) for look in looks], np.uint8)
    ways = tuple(mover.path for mover in light.scene.movers)
    faces = light.faces
    return SceneMesh(faces.corners_m, light.light_uv, shown, tones[faces.thing], faces.mover, ways)


def _tone(look: Material) -> Array:
    """A material's mean reflectance (3,)."""
    return np.array(look.colour) * (linear_texture(look.texture).mean((0, 1)) if look.texture else 1)


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
