"""The tracks of an estimator in a Rerun recording: points, their tails, and true epipolar lines."""

from collections.abc import Iterator, Mapping

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.report.entity import EstimatorEntities
from vobench.report.rerun_stream import GREEN, PIXEL_CENTRE, RED, FrameStream
from vobench.trajectory.trajectory import Trajectory

# Points in a picture (K, 2), and which of them are inliers (K,).
Tracks = tuple[Array, NDArray[np.bool_]]

EPIPOLAR = (255, 255, 255, 70)
TRACK_RADIUS = rr.Radius.ui_points(3.5)
TAIL_RADIUS = rr.Radius.ui_points(1.0)
EPIPOLAR_RADIUS = rr.Radius.ui_points(0.7)
TAIL_FRAMES = 5
MOST_TAILS = 200  # in a picture
MOST_LINES = 40  # epipolar lines in a picture
DISTANCES_M = np.geomspace(0.3, 100.0, 12)  # of the points of an epipolar line from the previous camera


def log_tracks(log: FrameStream, tracks: Mapping[int, Tracks], entities: EstimatorEntities) -> None:
    """Log the points of each frame; a frame without points clears those of the frame before."""
    rows = [_tracks_of(tracks, index) for index in range(log.count)]
    points_px = np.concatenate([points.reshape(-1, 2) for points, _ in rows])
    is_inlier = np.concatenate([inliers for _, inliers in rows])
    columns = rr.Points2D.columns(positions=points_px + PIXEL_CENTRE, colors=_colors(is_inlier))
    log.static(entities.tracks, rr.Points2D.from_fields(radii=TRACK_RADIUS))
    log.every(entities.tracks, columns.partition([len(points) for points, _ in rows]))


def _tracks_of(tracks: Mapping[int, Tracks], index: int) -> Tracks:
    return tracks.get(index, (np.zeros((0, 2)), np.zeros(0, bool)))


def _colors(is_inlier: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The colours (K, 3) of inliers and outliers."""
    return np.where(is_inlier[:, None], GREEN, RED).astype(np.uint8)


def log_tails(
    log: FrameStream, tracks: Mapping[int, Tracks], steps: Mapping[int, Array], entities: EstimatorEntities
) -> None:
    """Log the path of the tracks over the last frames; `steps` has each track's place in the frame before (K, 2)."""
    strips = []
    is_inlier = []
    lengths = []
    for index, (tails, chosen) in enumerate(track_tails(tracks, steps, log.count)):
        _, inliers = _tracks_of(tracks, index)
        strips += [tail + PIXEL_CENTRE for tail in tails]
        is_inlier.append(inliers[chosen])
        lengths.append(len(tails))
    columns = rr.LineStrips2D.columns(strips=strips, colors=_colors(np.concatenate(is_inlier)))
    style = rr.LineStrips2D.from_fields(radii=TAIL_RADIUS)
    log.static(entities.tails, style)
    log.every(entities.tails, columns.partition(lengths))


def log_epipolar_lines(
    log: FrameStream, rig: Rig, ground_truth: Trajectory, steps: Mapping[int, Array], entities: EstimatorEntities
) -> None:
    """Log the true epipolar lines of some tracks of each frame."""
    strips = []
    lengths = []
    for index in range(log.count):
        lines = epipolar_lines(rig, ground_truth, steps, index)
        strips += [line + PIXEL_CENTRE for line in lines]
        lengths.append(len(lines))
    columns = rr.LineStrips2D.columns(strips=strips)
    style = rr.LineStrips2D.from_fields(colors=EPIPOLAR, radii=EPIPOLAR_RADIUS)
    log.static(entities.epipolar, style)
    log.every(entities.epipolar, columns.partition(lengths))


def track_tails(
    tracks: Mapping[int, Tracks], steps: Mapping[int, Array], count: int
) -> Iterator[tuple[list[Array], NDArray[np.intp]]]:
    """For each frame the last places (T, 2) of some tracks, the oldest first, and the indices of these tracks."""
    history_px = np.zeros((0, TAIL_FRAMES + 1, 2))  # of each track, the oldest place first
    for index in range(count):
        current_px, _ = _tracks_of(tracks, index)
        previous_px = steps.get(index, np.zeros((0, 2)))
        history_px = _continued(history_px, previous_px, current_px)
        step = max(1, -(-len(current_px) // MOST_TAILS))
        chosen = np.arange(0, len(current_px), step)
        yield [tail[np.isfinite(tail[:, 0])] for tail in history_px[chosen]], chosen


def _continued(history_px: Array, previous_px: Array, current_px: Array) -> Array:
    """The history of tracks one frame later (K, TAIL_FRAMES + 1, 2), NaN before their start.

    A track continues the one whose last place is where it was in the previous frame, as estimators do not number
    tracks.
    """
    earlier_px = np.full((len(current_px), TAIL_FRAMES, 2), np.nan)
    earlier_px[:, -1] = previous_px
    ends = _place_keys(history_px[:, -1])
    starts = _place_keys(previous_px)
    if len(ends):
        order = np.argsort(ends)
        first_not_less = np.searchsorted(ends, starts, sorter=order).clip(max=len(ends) - 1)
        candidates = order[first_not_less]
        continues = np.flatnonzero(ends[candidates] == starts)
        earlier_px[continues] = history_px[candidates[continues], 1:]
    return np.concatenate([earlier_px, current_px[:, None]], 1)


def _place_keys(places_px: Array) -> NDArray[np.int64]:
    """One number for each place (K, 2) in single precision, equal for equal places."""
    return np.ascontiguousarray(places_px, np.float32).view(np.int64).reshape(-1)


def epipolar_lines(rig: Rig, ground_truth: Trajectory, steps: Mapping[int, Array], index: int) -> list[Array]:
    """The true epipolar lines (P, 2) of some tracks of a frame, as far as they are inside of the left picture.

    A line holds the places at which a stationary point may be seen that was seen in the previous frame.
    """
    is_tracked = index in steps and 0 < index < len(ground_truth)
    if not is_tracked:
        return []
    camera = rig.left
    step = max(1, len(steps[index]) // MOST_LINES)
    previous_px = steps[index][::step]
    points_m = camera.rays(previous_px)[:, None] * DISTANCES_M[:, None]  # (L, P, 3), previous camera
    T_current_world = se3.inverse(ground_truth.T_world_frame[index])
    T_current_previous = T_current_world @ ground_truth.T_world_frame[index - 1]
    lines_px = camera.project(se3.apply(T_current_previous, points_m.reshape(-1, 3)))
    lines_px = lines_px.reshape(*points_m.shape[:2], 2)

    upper_px = np.array([camera.width_px, camera.height_px]) - PIXEL_CENTRE
    with np.errstate(invalid="ignore"):  # points behind the camera have no place
        is_inside = ((lines_px > -PIXEL_CENTRE) & (lines_px < upper_px)).all(-1)
    lines = []
    for line_px, inside in zip(lines_px, np.asarray(is_inside), strict=True):
        if inside.sum() > 1:
            lines.append(line_px[inside])
    return lines
