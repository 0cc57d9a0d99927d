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
from vobench.report.blueprint import ESTIMATOR_COLORS, LayoutOptions, estimator_colors
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
Unit = tuple[float, str]  # the number of units in a metre, and the name of the unit

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
FRAMES_AROUND_REPLAY = 15  # the number of frames that are replayed before a failure, and after it
FRUSTUM_LINE = -1.5  # the width of lines; negative widths are in points of the screen, independent of the zoom
FRAME_BYTES = 45_000  # the largest size of both pictures of a frame together; with its tracks a frame has 60,000 bytes
BEST_QUALITY = 85
WORST_QUALITY = 10
QUALITY_STEP = 5


def save_trial(path: Path, trial: TrialView, *others: TrialView, form: PictureForm = "jpeg") -> None:
    """Write trials of one case to an .rrd file, with the layout in which Rerun opens it.

    `others` are further trials of the same case, which are shown side by side.
    `form` is the format of the pictures: "jpeg" for JPEG with at most FRAME_BYTES per frame, or "png" for the PNG files
    of the sequence.
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
        stamps = _log_pictures(stream, trial.frames(), form)
        log = FrameStream(stream, stamps, trial.first)
        _log_truth_path(log, trial)
        if trial.scene is not None:
            log_scene(log, trial.scene)
        unit = _unit(trials)
        for view, color in zip(trials, _colors(trials), strict=True):
            _log_trial(log, view, ESTIMATOR_COLORS[color], unit)
        if trial.truth is not None:
            log_truth(stream, trial.truth)
        stream.send_blueprint(_layout(trials))
        stream.disconnect()
        part.replace(path)


def application_id(title: str) -> str:
    """The Rerun application id of a trial.

    Rerun stores one layout per application, so each trial has its own id. Characters that Rerun rejects are replaced.
    """
    accepted = re.sub(r"[^A-Za-z0-9_]+", "-", title).strip("-")
    return f"vobench-{accepted}"


def _colors(trials: Sequence[TrialView]) -> list[str]:
    """The names of the colours of the trials' estimators."""
    return estimator_colors([view.position for view in trials])


def _layout(trials: Sequence[TrialView]) -> rrb.Blueprint:
    first = trials[0]
    options = LayoutOptions(
        replayed_frames=_replayed_frames(trials),
        labels=[view.label for view in trials],
        colors=_colors(trials),
        channels=first.truth.channels if first.truth else (),
        has_stats=any(view.stats for view in trials),
        has_costs=any(view.costs for view in trials),
    )
    estimates_m = np.concatenate([view.estimate.positions_m for view in trials])
    return blueprint.layout(first.ground_truth.positions_m, estimates_m, options)


def _replayed_frames(trials: Sequence[TrialView]) -> FrameRange | None:
    """The numbers of the first and the last frame to replay, None if no trial has a failure.

    They are around the first failed frame of the first trial that has one. If no frame failed, they are around the
    frame at which the first wrong trial goes wrong.
    """
    for trial in trials:
        around_failure = first_failure(trial.statuses)
        if around_failure:
            return _numbered(around_failure, trial.first)
    first = trials[0]
    for trial in trials:
        if trial.wrong_at is not None:
            around_error = _around(trial.wrong_at, len(first.statuses))
            return _numbered(around_error, first.first)
    return None


def first_failure(statuses: Sequence[str]) -> FrameRange | None:
    """The first and the last frame around the first failed frame, None if no frame failed."""
    for index, status in enumerate(statuses):
        if status in FAILED:
            return _around(index, len(statuses))
    return None


def _around(index: int, count: int) -> FrameRange:
    """The first and the last frame around the frame `index`, of `count` frames."""
    first = max(0, index - FRAMES_AROUND_REPLAY)
    last = min(count - 1, index + FRAMES_AROUND_REPLAY)
    return first, last


def _numbered(frames: FrameRange, offset: int) -> FrameRange:
    """The frames with their numbers in the sequence, given the number of the first frame that is shown."""
    first, last = frames
    return first + offset, last + offset


def _log_pictures(stream: rr.RecordingStream, frames: Iterable[EncodedFrame], form: PictureForm) -> Stamps:
    """Log both pictures of each frame, and return the stamps of the frames.

    Only one frame is in memory at a time.
    """
    stamps = []
    quality = BEST_QUALITY  # it is reduced when a frame would be too large, and not increased again
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
    """Log the estimated path and the left camera.

    At frames without a pose, the path is interrupted, and the camera is not shown.
    """
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
    """Log a camera along a path. It is drawn as a pyramid with the length `length_m`."""
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
    """The unit of the errors: mm, cm or m, depending on the largest error of all trials."""
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
    """Log the error of each frame as a line from the true to the estimated position.

    A frame without a pose has no line.
    """
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
    """Log the points of the scene that the estimator reconstructs.

    The points of a frame are shown until those of a later frame replace them.
    """
    if not points:
        return
    frames = sorted(points)
    points_m = [points[index] for index in frames]
    columns = rr.Points3D.columns(positions=np.concatenate(points_m))
    counts = [len(frame_points_m) for frame_points_m in points_m]
    log.static(entities.points, rr.Points3D.from_fields(colors=color, radii=LINE_RADIUS))
    log.columns(entities.points, np.array(frames), columns.partition(counts))


def _log_numbers(log: FrameStream, origin: str, numbers: Mapping[str, Array]) -> None:
    """Log each series of numbers (N,) at the frames that have one."""
    for name, values in numbers.items():
        known = np.flatnonzero(np.isfinite(values))
        log.columns(f"{origin}/{name}", known, rr.Scalars.columns(scalars=values[known]))


def _log_statuses(log: FrameStream, statuses: Sequence[str], entities: EstimatorEntities) -> None:
    """Log the status at the frames where it changes. Rerun shows it until the next change."""
    known = list(dict.fromkeys([*STATUS_COLORS, *statuses]))
    colors = [STATUS_COLORS.get(status, OTHER_STATUS_COLOR) for status in known]
    log.static(entities.status, rr.StateConfiguration(values=known, colors=colors))
    changes = list(_changes(statuses))
    states = rr.StateChange.columns(state=[statuses[index] for index in changes])
    log.columns(entities.status, np.array(changes, np.int64), states)


def _changes(statuses: Sequence[str]) -> Iterator[int]:
    """The frames whose status differs from that of the previous frame."""
    before = None
    for index, status in enumerate(statuses):
        if status != before:
            yield index
        before = status
