"""The initial layout of a recording in Rerun: its views and panels."""

from collections.abc import Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from vobench.geometry.se3 import Array
from vobench.report.entity import (
    COSTS,
    POSITION_ERROR,
    ROTATION_ERROR,
    STATS,
    STATUS,
    TRACKS,
    TRUTH_LEFT,
    TRUTH_RIGHT,
    WORLD,
    EstimatorEntities,
    truth_entity,
)
from vobench.report.viewpoint import eye_and_target, grid_spacing_m, near_truth, radius_m

FRAME_TIMELINE = "frame"

# The names and RGB values of the estimators' colours, by the position in the run. They are like those of figures
# (figure_style.COLOURS), but light, since Rerun's background is dark, and without green and red, the colours of truth
# and errors.
ESTIMATOR_COLORS = {
    "blue": (80, 160, 255),
    "orange": (255, 150, 40),
    "cyan": (120, 220, 220),
    "violet": (200, 110, 230),
    "yellow": (240, 220, 90),
}
GRID_COLOR = (255, 255, 255, 24)
REPLAY_FPS = 5.0  # slow enough to see each frame

# Relative heights of views in a column, and relative widths of columns.
PATHS_SHARE = 6.0
PLOT_SHARE = 2.2
STATUS_SHARE = 1.2
STATUS_SHARE_PER_ESTIMATOR = 0.4
PLOT_TABS_SHARE = 2.0
PICTURE_SHARE = 3.0
SUMMARY_SHARE = 2.6
PATHS_COLUMN_SHARE = 3.0
PICTURES_COLUMN_SHARE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutOptions:
    """What a recording shows besides paths and errors.

    `replayed_frames` are the first and last frame of the initial replay; without them, the recording starts paused.
    `labels` are the names of the estimators. Each has a picture with its tracks. `colors` are the names of their
    colours.
    `channels` are the channels of per-pixel ground truth. They are shown in one tab per camera.
    `has_stats` and `has_costs` add a plot of the numbers that an estimator reports, and of the cost of each frame.
    """

    replayed_frames: tuple[int, int] | None
    labels: Sequence[str] = ("estimate",)
    colors: Sequence[str] = ("blue",)
    channels: Sequence[str] = ()
    has_stats: bool = False
    has_costs: bool = False


def estimator_colors(positions: Sequence[int]) -> list[str]:
    """The names of the colours of the estimators at these positions of a run, all different.

    An estimator whose colour another one has already gets the next free one. Raises ValueError if there are more
    estimators than colours.
    """
    names = list(ESTIMATOR_COLORS)
    if len(positions) > len(names):
        raise ValueError(f"Rerun shows at most {len(names)} estimators, got {len(positions)}")
    chosen: list[str] = []
    for position in positions:
        by_preference = [names[(position + step) % len(names)] for step in range(len(names))]
        free = [name for name in by_preference if name not in chosen]
        chosen.append(free[0])
    return chosen


def layout(truth_m: Array, estimates_m: Array, options: LayoutOptions) -> rrb.Blueprint:
    """The default blueprint for a true path (N, 3) and the points (M, 3) of all estimated paths."""
    views: rrb.Container = rrb.Horizontal(
        _paths_column(truth_m, estimates_m, options),
        _pictures_column(options.labels),
        column_shares=[PATHS_COLUMN_SHARE, PICTURES_COLUMN_SHARE],
    )
    if options.channels:
        truth_tabs = [_truth_tab(side, options.channels) for side in ("left", "right")]
        views = rrb.Tabs(rrb.Horizontal(views, name="Run"), *truth_tabs, active_tab=0)
    return rrb.Blueprint(
        views,
        _time_panel(options.replayed_frames),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _paths_column(truth_m: Array, estimates_m: Array, options: LayoutOptions) -> rrb.Vertical:
    """The 3-D view of the paths, with plots of errors, statuses and numbers below it."""
    shown_m = near_truth(truth_m, estimates_m)
    further_estimators = len(options.labels) - 1
    status_share = STATUS_SHARE + STATUS_SHARE_PER_ESTIMATOR * further_estimators
    views: list[rrb.View | rrb.Container] = [
        _paths_view(truth_m, shown_m, options),
        rrb.Horizontal(_plot(POSITION_ERROR, "Position error"), _plot(ROTATION_ERROR, "Rotation error")),
        rrb.StateTimelineView(origin=STATUS, name="Status of each frame"),
    ]
    shares = [PATHS_SHARE, PLOT_SHARE, status_share]
    plots = []
    if options.has_stats:
        plots.append(rrb.TimeSeriesView(origin=STATS, name="Numbers reported by the estimator"))
    if options.has_costs:
        plots.append(rrb.TimeSeriesView(origin=COSTS, name="Latency (ms), exposure (ms), gain (dB)"))
    if plots:
        views.append(rrb.Tabs(*plots, active_tab=0))
        shares.append(PLOT_TABS_SHARE)
    return rrb.Vertical(*views, row_shares=shares)


def _pictures_column(labels: Sequence[str]) -> rrb.Vertical:
    """The pictures with tracks, with the scores below them."""
    pictures = [_left_picture(label, labels) for label in labels]
    has_room_for_right = len(labels) == 1  # tracks are in the left pictures, of which each estimator has one
    if has_room_for_right:
        pictures.append(rrb.Spatial2DView(origin=TRUTH_RIGHT, name="Right"))
    summaries = [
        rrb.TextDocumentView(origin=EstimatorEntities(label).summary, name=f"Score of {label}") for label in labels
    ]
    shares = [PICTURE_SHARE] * len(pictures) + [SUMMARY_SHARE]
    return rrb.Vertical(*pictures, rrb.Tabs(*summaries, active_tab=0), row_shares=shares)


def _plot(origin: str, name: str) -> rrb.TimeSeriesView:
    """A plot of the entities below `origin` over time."""
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    axis = rrb.ScalarAxis(zoom_lock=True)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_y=axis, plot_legend=legend)


def _left_picture(label: str, labels: Sequence[str]) -> rrb.Spatial2DView:
    """The left picture with the tracks of one of the estimators."""
    hidden = [f"- {EstimatorEntities(other).tracks}/**" for other in labels if other != label]
    of_label = f" of {label}" if len(labels) > 1 else ""
    name = f"Left, tracks{of_label}: inliers green, outliers red, true epipolar lines white"
    return rrb.Spatial2DView(origin=TRUTH_LEFT, name=name, contents=["$origin/**", *hidden])


def _truth_tab(side: str, channels: Sequence[str]) -> rrb.Grid:
    """The channels of per-pixel ground truth from one camera, each in a view."""
    views = [rrb.Spatial2DView(origin=truth_entity(side, channel), name=channel) for channel in channels]
    return rrb.Grid(*views, name=f"Truth, {side}")


def _paths_view(truth_m: Array, shown_m: Array, options: LayoutOptions) -> rrb.Spatial3DView:
    """The 3-D view of the paths, from a viewpoint at which the points `shown_m` (K, 3) fill it.

    Its name is a legend of the colours.
    """
    eye_m, target_m = eye_and_target(shown_m)
    estimates = [f"{label} {color}" for label, color in zip(options.labels, options.colors, strict=True)]
    grid = rrb.LineGrid3D(
        visible=True,
        spacing=grid_spacing_m(2 * radius_m(truth_m)),
        plane=rr.components.Plane3D.XY,
        color=GRID_COLOR,
    )
    return rrb.Spatial3DView(
        origin=WORLD,
        name=", ".join(["Truth green", *estimates, "error red"]),
        contents=["$origin/**", f"- {TRUTH_RIGHT}/**", f"- {TRACKS}/**"],
        eye_controls=rrb.EyeControls3D(position=eye_m, look_target=target_m, eye_up=(0, 0, 1)),
        line_grid=grid,
    )


def _time_panel(replayed_frames: tuple[int, int] | None) -> rrb.TimePanel:
    """The panel of the timeline `frame`, which is paused at its start or replays some frames.

    A blueprint cannot move the time cursor. Only a replay of selected frames does; it begins at the first of them.
    """
    if replayed_frames is None:
        return rrb.TimePanel(timeline=FRAME_TIMELINE, play_state="paused", state="collapsed")
    first, last = replayed_frames
    return rrb.TimePanel(
        timeline=FRAME_TIMELINE,
        play_state="playing",
        state="collapsed",
        fps=REPLAY_FPS,
        loop_mode="selection",
        time_selection=rrb.components.AbsoluteTimeRange(min=first, max=last),
    )
