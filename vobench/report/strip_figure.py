"""The figure of a trial as a strip of pictures with tracks, above the error over time."""

import textwrap
from collections.abc import Mapping, Sequence
from itertools import islice

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.report.figure_style import COLOURS, LINE_WIDTH, NEUTRAL, line_style
from vobench.report.frame_moment import worst_moments
from vobench.report.inline_figure import new_figure
from vobench.report.trial_choice import sentence
from vobench.report.trial_view import NO_OUTPUT
from vobench.runner.estimate import read_tracks
from vobench.runner.folder import SEQUENCE, RunFolder, TrialScore
from vobench.runner.frames import FrameRow, read_frames
from vobench.sequence import Sequence as Recording
from vobench.trajectory.nanoseconds import NS_PER_S

PICTURES = 5
LEAST_PICTURE_INCHES = 1.2
ERROR_HEIGHT_INCHES = 1.15
HEAD_INCHES = 0.45  # of the titles above the pictures
LOST_COLOUR = "#4d4d4d"  # no estimator has a grey
INLIER_COLOUR = COLOURS[5]
OUTLIER_COLOUR = COLOURS[4]
LOST_STATUSES = ("lost", NO_OUTPUT, "")
TITLE_CHARACTERS_PER_INCH = 13
MM_PER_M = 1e3

Table = NDArray[np.float32]


def strip_figure(folder: RunFolder, trial: TrialScore, index: int, width_inches: float) -> Figure:
    """Pictures of a trial at its start, its end and its worst moments, and its position error over time.

    `index` chooses the colour of the estimator. Tracks are blue, and orange where the estimator rejected them. Frames
    without a pose are shaded.
    Raises InputError if the sequence of the trial is no longer in the cache, or the trial has no frames.
    """
    link = folder.case(trial.case) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is no longer in the cache; run the suite again to recreate it: {link}")
    rows = read_frames(folder.estimate(trial.case, trial.estimator, trial.repeat))
    if not rows:
        raise InputError(f"{trial.estimator} on {trial.case} has no frames to plot")
    count = max(2, min(PICTURES, int(width_inches / LEAST_PICTURE_INCHES)))
    shown = shown_frames(rows, count)
    tracks = dict(read_tracks(folder.estimate(trial.case, trial.estimator, trial.repeat)))

    recording = Recording.open(link)
    picture = recording.frame(0).left
    height, width = picture.shape[:2]
    picture_height_inches = width_inches / len(shown) * height / width + HEAD_INCHES
    with new_figure(width_inches, picture_height_inches + ERROR_HEIGHT_INCHES) as figure:
        heights = [picture_height_inches, ERROR_HEIGHT_INCHES]
        strip, plot = figure.subfigures(2, 1, height_ratios=heights, squeeze=False)[:, 0]
        figure.suptitle(textwrap.fill(sentence(trial), round(TITLE_CHARACTERS_PER_INCH * width_inches)))
        panels = np.atleast_1d(strip.subplots(1, len(shown)))
        for axes, row_index in zip(panels, shown, strict=True):
            _draw_picture(axes, recording, rows[row_index], row_index, tracks)
        _draw_errors(plot.subplots(), rows, shown, index)
    return figure


def shown_frames(rows: Sequence[FrameRow], count: int) -> list[int]:
    """The indices of at most `count` frames: the first, the last, the worst moments, and others between these."""
    last = len(rows) - 1
    errors_m = np.array([np.inf if row.position_error_m is None else row.position_error_m for row in rows])
    index_of = {row.frame: index for index, row in enumerate(rows)}
    chosen = {0, last}
    for moment in islice(worst_moments(rows, errors_m), max(count - 2, 0)):
        chosen.add(index_of[moment.frame])
    while len(chosen) < min(count, len(rows)):
        chosen.add(_middle_of_longest_gap(sorted(chosen)))
    return sorted(chosen)


def _middle_of_longest_gap(indices: Sequence[int]) -> int:
    """The middle of the longest distance between successive indices."""
    gaps = np.diff(indices)
    longest = int(np.argmax(gaps))
    return indices[longest] + int(gaps[longest]) // 2


def _draw_picture(axes: Axes, recording: Recording, row: FrameRow, index: int, tracks: Mapping[int, Table]) -> None:
    """Draw a frame with its tracks, framed if the estimator lost track there."""
    axes.imshow(recording.frame(index).left, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    if index in tracks:
        u_px, v_px = tracks[index][:, 2:4].T
        is_inlier = tracks[index][:, 4] > 0
        axes.scatter(u_px[is_inlier], v_px[is_inlier], s=1.5, color=INLIER_COLOUR, lw=0)
        axes.scatter(u_px[~is_inlier], v_px[~is_inlier], s=1.5, color=OUTLIER_COLOUR, lw=0)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(visible=False)
    is_lost = row.status in LOST_STATUSES
    axes.set_title(f"frame {row.frame}{', lost' if is_lost else ''}", fontsize=7, color=_title_colour(is_lost=is_lost))
    if is_lost:
        for spine in axes.spines.values():
            spine.set(color=LOST_COLOUR, linewidth=1.5)


def _title_colour(*, is_lost: bool) -> str:
    return LOST_COLOUR if is_lost else "black"


def _draw_errors(axes: Axes, rows: Sequence[FrameRow], shown: Sequence[int], index: int) -> None:
    """Draw the position error over time, the times of the pictures, and where there is no pose.

    `index` chooses the colour of the estimator.
    """
    time_s = np.array([(row.t_ns - rows[0].t_ns) / NS_PER_S for row in rows])
    errors_m = np.array([np.nan if row.position_error_m is None else row.position_error_m for row in rows])
    axes.plot(time_s, MM_PER_M * errors_m, lw=LINE_WIDTH, **line_style(index))
    is_lost = np.array([row.status in LOST_STATUSES for row in rows])
    for low_s, high_s in _lost_spans(time_s, is_lost):
        axes.axvspan(low_s, high_s, color=LOST_COLOUR, alpha=0.3, lw=0)
    for row_index in shown:
        axes.axvline(time_s[row_index], color=NEUTRAL, lw=0.6, ls=":")
    axes.set_xlim(time_s[0], time_s[-1] or 1.0)
    if np.isnan(errors_m).all():
        background = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 2}
        axes.text(0.5, 0.5, "no pose in any frame", transform=axes.transAxes, ha="center", va="center", bbox=background)
        axes.set_yticks([])
    else:
        axes.set_ylim(bottom=0)
    axes.set(xlabel="time (s)", ylabel="position\nerror (mm)")


def _lost_spans(time_s: Array, is_lost: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """The times in which track is lost, each from halfway after the last frame before to halfway before the next."""
    halfway_s = (time_s[1:] + time_s[:-1]) / 2
    borders_s = np.concatenate([time_s[:1], halfway_s, time_s[-1:]])
    changes = np.diff(np.concatenate([[0], is_lost.astype(int), [0]]))
    starts = np.flatnonzero(changes == 1)
    ends = np.flatnonzero(changes == -1)
    return [(float(borders_s[start]), float(borders_s[end])) for start, end in zip(starts, ends, strict=True)]
