"""A trial as a Rerun recording: pictures, tracks, both paths and the errors on one time line."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from vobench import stop
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.report import blueprint
from vobench.report.blueprint import ESTIMATOR_COLORS, LayoutOptions
from vobench.report.entity import COSTS, STATS, TRUTH_LEFT, TRUTH_PATH, TRUTH_RIGHT, WORLD, EstimatorEntities
from vobench.report.rerun_scene import log_scene
from vobench.report.rerun_stream import (
    GREEN,
    LINE_RADIUS,
    PATH_RADIUS,
    PIXEL_CENTRE,
    RED,
    Color,
    FrameStream,
    time_columns,
)
from vobench.report.rerun_tracks import log_epipolar_lines, log_tails, log_tracks
from vobench.report.rerun_truth import log_truth
from vobench.report.trial_view import NO_OUTPUT, TrialView
from vobench.report.viewpoint import frustum_m
from vobench.sequence import EncodedFrame
from vobench.sequence.picture import BAYER, RGB, decode, encode, rgb
from vobench.trajectory.trajectory import Stamps, Trajectory

PictureForm = Literal["jpeg", "png"]
FrameRange = tuple[int, int]
Unit = tuple[float, str]  # how many of it are a metre, and its name

STATUS_COLORS: dict[str, Color] = {
    "init": (90, 140, 220),
    "ok": GREEN,
    "stationary": (70, 180, 190),
    "degraded": (235, 205, 70),
    "lost": RED,
    NO_OUTPUT: (150, 40, 110),
}
OTHER_STATUS_COLOR = (128, 128, 128)
FAILED = ("lost", NO_OUTPUT)
FRAMES_AROUND_REPLAY = 15  # before and after the frame that is replayed
FRUSTUM_LINE = -1.5  # negative: in points of the screen, whatever the zoom
FRAME_BYTES = 45_000  # of both pictures of a frame, out of 60,000 with tracks
BEST_QUALITY = 85
WORST_QUALITY = 10
QUALITY_STEP = 5


def save_trial(path: Path, trial: TrialView, *others: TrialView, form: PictureForm = "jpeg") -> None:
    """Write a trial to an .rrd file that opens in Rerun with a layout of its own; `others` are on the same case.

    Pictures are JPEG of at most FRAME_BYTES a frame, or the PNG of the sequence.
    """
    trials = (trial, *others)
    title = ", ".join(view.title for view in trials)
    part = path.with_name(path.name + ".part")
    with (
        stop.cleanup_after(lambda: part.unlink(missing_ok=True)),
        rr.RecordingStream(application_id(title), recording_id=title, send_properties=False) as stream,
    ):
        stream.save(part)
        stream.send_recording_name(title)
        log = FrameStream(stream, _log_pictures(stream, trial.frames(), form), trial.first)
        _log_truth_path(log, trial)
        if trial.scene is not None:
            log_scene(log, trial.scene)
        unit = _unit(trials)
        colors = list(ESTIMATOR_COLORS.values())[: len(trials)]
        for view, color in zip(trials, colors, strict=True):
            _log_trial(log, view, color, unit)
        if trial.truth is not None:
            log_truth(stream, trial.truth)
        stream.send_blueprint(_layout(trials))
        stream.disconnect()
        part.replace(path)


def application_id(title: str) -> str:
    """The application of a trial, of the characters that Rerun accepts; one each, as Rerun keeps a layout for each."""
    return "vobench-" + re.sub(r"[^A-Za-z0-9_]+", "-", title).strip("-")


def _layout(trials: Sequence[TrialView]) -> rrb.Blueprint:
    first = trials[0]
    options = LayoutOptions(
        replayed_frames=_replayed_frames(trials),
        labels=[view.label for view in trials],
        channels=first.truth.channels if first.truth else (),
        has_stats=any(view.stats for view in trials),
        has_costs=any(view.costs for view in trials),
    )
    estimates_m = np.concatenate([view.estimate.positions_m for view in trials])
    return blueprint.layout(first.ground_truth.positions_m, estimates_m, options)


def _replayed_frames(trials: Sequence[TrialView]) -> FrameRange | None:
    """The numbers of the first and the last frame around the first failure of any trial, None if none failed."""
    for trial in trials:
        around_failure = first_failure(trial.statuses)
        if around_failure:
            return _numbered(around_failure, trial.first)
    first = trials[0]
    for trial in trials:
        if trial.wrong_at is not None:
            return _numbered(_around(trial.wrong_at, len(first.statuses)), first.first)
    return None


def first_failure(statuses: Sequence[str]) -> FrameRange | None:
    """The frames around the first failed one, None if no frame failed."""
    for index, status in enumerate(statuses):
        if status in FAILED:
            return _around(index, len(statuses))
    return None


def _around(index: int, count: int) -> FrameRange:
    """The first and the last of the frames around one of `count`."""
    reach = FRAMES_AROUND_REPLAY
    return max(0, index - reach), min(count - 1, index + reach)


def _numbered(frames: FrameRange, offset: int) -> FrameRange:
    first, last = frames
    return first + offset, last + offset


def _log_pictures(stream: rr.RecordingStream, frames: Iterable[EncodedFrame], form: PictureForm) -> Stamps:
    """Log both pictures of each frame, with one frame in memory at a time; the stamps of the frames."""
    stamps = []
    quality = BEST_QUALITY  # falls where frames would be too large, and stays there
    with ThreadPoolExecutor(2) as threads:
        for frame in frames:
            encoded = {TRUTH_LEFT: frame.left}
            if frame.right:
                encoded[TRUTH_RIGHT] = frame.right
            recode = partial(_recoded, frame=frame, form=form)
            pictures = list(threads.map(partial(recode, quality=quality), encoded.values()))
            while form == "jpeg" and quality > WORST_QUALITY and _bytes(pictures) > FRAME_BYTES:
                quality -= QUALITY_STEP
                pictures = [recode(picture, quality=quality) for picture in encoded.values()]

            times = time_columns(np.array([frame.index]), np.array([frame.t_ns]))
            kind = form if form == "jpeg" else frame.form
            for entity, picture in zip(encoded, pictures, strict=True):
                columns = rr.EncodedImage.columns(blob=[picture], media_type=[f"image/{kind}"])
                stream.send_columns(f"{entity}/image", times, columns)
            stamps.append(frame.t_ns)
    return np.array(stamps, np.int64)


def _bytes(pictures: Iterable[bytes]) -> int:
    return sum(len(picture) for picture in pictures)


def _recoded(encoded: bytes, *, frame: EncodedFrame, form: PictureForm, quality: int) -> bytes:
    """A picture of a frame in the form of the recording, with colours interpolated from a Bayer mosaic."""
    has_form = form == "png" or frame.form == "jpeg"
    if has_form and frame.colour != BAYER:
        return encoded
    name = f"frame {frame.index}"
    picture = decode(encoded, None, name, colour=frame.colour)
    colour = frame.colour
    if colour == BAYER:
        picture = rgb(picture, BAYER)
        colour = RGB
    jpeg_quality = quality if form == "jpeg" else None
    return encode(picture, None, name, jpeg_quality=jpeg_quality, colour=colour)


def _log_truth_path(log: FrameStream, trial: TrialView) -> None:
    """Log the true path and the true cameras."""
    truth = trial.ground_truth
    log.static(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    log.static(TRUTH_PATH, rr.LineStrips3D([truth.positions_m], colors=GREEN, radii=PATH_RADIUS))
    length_m = frustum_m(truth.positions_m)
    _log_camera(log, TRUTH_LEFT, trial.rig.left, truth, length_m=length_m, color=GREEN)
    if trial.rig.right:
        right = truth.of_mounted(trial.rig.T_left_right)
        _log_camera(log, TRUTH_RIGHT, trial.rig.right, right, length_m=length_m, color=GREEN)


def _log_trial(log: FrameStream, trial: TrialView, color: Color, unit: Unit) -> None:
    """Log everything that belongs to one estimator."""
    entities = EstimatorEntities(trial.label)
    _log_estimate(log, trial, entities, color)
    _log_errors(log, trial, entities, color, unit)
    _log_error_lines(log, trial, entities)
    log_tracks(log, trial.tracks, entities)
    if trial.steps:
        log_tails(log, trial.tracks, trial.steps, entities)
        log_epipolar_lines(log, trial.rig, trial.ground_truth, trial.steps, entities)
    _log_points(log, trial.points, entities, color)
    _log_numbers(log, f"{STATS}/{trial.label}", trial.stats)
    _log_numbers(log, f"{COSTS}/{trial.label}", trial.costs)
    _log_statuses(log, trial.statuses, entities)
    summary = rr.TextDocument(trial.summary_md, media_type=rr.MediaType.MARKDOWN)
    log.static(entities.summary, summary)


def _log_estimate(log: FrameStream, trial: TrialView, entities: EstimatorEntities, color: Color) -> None:
    """Log the estimated path, interrupted at frames without a pose, and the left camera, which vanishes there."""
    frames, samples = log.match(trial.estimate.t_ns)
    gaps = np.flatnonzero(np.diff(frames) > 1) + 1
    strips = np.split(trial.estimate.positions_m[samples], gaps)
    log.static(entities.path, rr.LineStrips3D(strips, colors=color, radii=PATH_RADIUS))
    length_m = frustum_m(trial.ground_truth.positions_m)
    _log_camera(log, entities.left, trial.rig.left, trial.estimate, length_m=length_m, color=color)
    without_pose = np.setdiff1d(np.arange(log.count), frames)
    clear = rr.Clear.columns(is_recursive=[False] * len(without_pose))
    log.columns(entities.left, without_pose, clear)


def _log_camera(
    log: FrameStream, entity: str, camera: Camera, path: Trajectory, *, length_m: float, color: Color
) -> None:
    """Log a camera along a path, drawn as a pyramid of a length."""
    frames, samples = log.match(path.t_ns)
    count = len(frames)
    log.poses(entity, frames, path.T_world_frame[samples])
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
    """The camera matrix (3, 3) for Rerun's pixel coordinates, in which the centres of pixels are at halves."""
    K = camera.K
    K[:2, 2] += PIXEL_CENTRE
    return K


def _unit(trials: Sequence[TrialView]) -> Unit:
    """The unit in which the largest error has few digits."""
    errors_m = np.concatenate([trial.error_m for trial in trials])
    largest_m = float(errors_m[np.isfinite(errors_m)].max(initial=0.0))
    if largest_m < 0.1:
        return 1e3, "mm"
    if largest_m < 5:
        return 1e2, "cm"
    return 1.0, "m"


def _log_errors(log: FrameStream, trial: TrialView, entities: EstimatorEntities, color: Color, unit: Unit) -> None:
    """Log the errors of each frame as curves, which have gaps where there is no pose."""
    scale, unit_name = unit
    _log_curve(log, entities.position_error, scale * trial.error_m, f"{trial.label} ({unit_name})", color)
    _log_curve(log, entities.rotation_error, trial.rotation_deg, f"{trial.label} (°)", color)


def _log_curve(log: FrameStream, entity: str, values: Array, name: str, color: Color) -> None:
    log.static(entity, rr.SeriesLines(colors=color, widths=1.5, names=name))
    log.columns(entity, np.arange(len(values)), rr.Scalars.columns(scalars=values))


def _log_error_lines(log: FrameStream, trial: TrialView, entities: EstimatorEntities) -> None:
    """Log the error of each frame as a line from truth to estimate, none where there is no pose."""
    truth_frames, truth_samples = log.match(trial.ground_truth.t_ns)
    estimate_frames, estimate_samples = log.match(trial.estimate.t_ns)
    frames, truth_rows, estimate_rows = np.intersect1d(truth_frames, estimate_frames, return_indices=True)
    truth_m = trial.ground_truth.positions_m[truth_samples[truth_rows]]
    estimate_m = trial.estimate.positions_m[estimate_samples[estimate_rows]]
    lines_per_frame = np.isin(np.arange(log.count), frames).astype(int)
    lines_m = np.stack([truth_m, estimate_m], 1)  # (K, 2, 3), world
    columns = rr.LineStrips3D.columns(strips=list(lines_m)).partition(lines_per_frame)
    log.static(entities.error_line, rr.LineStrips3D.from_fields(colors=RED, radii=LINE_RADIUS))
    log.every(entities.error_line, columns)


def _log_points(log: FrameStream, points: Mapping[int, Array], entities: EstimatorEntities, color: Color) -> None:
    """Log the points of the scene as the estimator reconstructs it; those of a frame stay until the next ones."""
    if not points:
        return
    frames = sorted(points)
    points_m = [points[index] for index in frames]
    columns = rr.Points3D.columns(positions=np.concatenate(points_m))
    counts = [len(each) for each in points_m]
    log.static(entities.points, rr.Points3D.from_fields(colors=color, radii=LINE_RADIUS))
    log.columns(entities.points, np.array(frames), columns.partition(counts))


def _log_numbers(log: FrameStream, origin: str, numbers: Mapping[str, Array]) -> None:
    """Log each series of numbers (N,) at the frames that have one."""
    for name, values in numbers.items():
        known = np.flatnonzero(np.isfinite(values))
        log.columns(f"{origin}/{name}", known, rr.Scalars.columns(scalars=values[known]))


def _log_statuses(log: FrameStream, statuses: Sequence[str], entities: EstimatorEntities) -> None:
    """Log the status where it changes: Rerun draws it until the next one."""
    known = list(dict.fromkeys([*STATUS_COLORS, *statuses]))
    colors = [STATUS_COLORS.get(status, OTHER_STATUS_COLOR) for status in known]
    log.static(entities.status, rr.StateConfiguration(values=known, colors=colors))
    changes = list(_changes(statuses))
    states = rr.StateChange.columns(state=[statuses[index] for index in changes])
    log.columns(entities.status, np.array(changes, np.int64), states)


def _changes(statuses: Sequence[str]) -> Iterator[int]:
    """The frames whose status is not that of the frame before."""
    before = None
    for index, status in enumerate(statuses):
        if status != before:
            yield index
        before = status
