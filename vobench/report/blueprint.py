"""The initial layout of a recording in Rerun: its views, and the viewpoint of the 3-D view."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from vobench.geometry.se3 import Array

FRAME_TIMELINE = "frame"

# The paths of entities in a recording.
WORLD = "world"
TRUTH_PATH = f"{WORLD}/ground_truth/path"
SCENE = f"{WORLD}/scene"
TRUTH_LEFT = f"{WORLD}/ground_truth/left"
TRUTH_RIGHT = f"{WORLD}/ground_truth/right"
ERROR = f"{WORLD}/error"
TRACKS = f"{TRUTH_LEFT}/tracks"
POSITION_ERROR = "position_error"
ROTATION_ERROR = "rotation_error"
STATUS = "status"
SUMMARY = "summary"
STATS = "stats"
COSTS = "costs"


class Colour(NamedTuple):
    """The colour of an estimator, with its name in the legend."""

    name: str
    rgb: tuple[int, int, int]


# The first estimator has the first colour. Further estimators have the same colours again.
ESTIMATOR_COLOURS = (
    Colour("orange", (255, 150, 40)),
    Colour("blue", (80, 160, 255)),
    Colour("violet", (200, 110, 230)),
    Colour("yellow", (240, 220, 90)),
    Colour("cyan", (120, 220, 220)),
)
GRID_COLOUR = (255, 255, 255, 24)
EYE_PITCH_DEG = 38.0
EYE_DISTANCE_PER_RADIUS = 1.6  # paths and camera frusta fill Rerun's default field of view
FRUSTUM_PER_RADIUS = 0.16
LEAST_RADIUS_M = 0.25
FRAMES_AROUND_FOCUS = 15
REPLAY_FPS = 5.0  # slow enough to see each frame

# Relative heights of views in a column, and relative widths of columns.
SPACE_SHARE = 6.0
PLOT_SHARE = 2.2
STATUS_SHARE = 1.2
STATUS_SHARE_PER_ESTIMATOR = 0.4
NUMBERS_SHARE = 2.0
PICTURE_SHARE = 3.0
SUMMARY_SHARE = 2.6
COLUMN_SHARES = [3, 2]


@dataclass(frozen=True, slots=True)
class Entities:
    """The paths of the entities of one estimator; `label` is the estimator's name in the recording."""

    label: str

    @property
    def path(self) -> str:
        """The estimated path."""
        return f"{WORLD}/{self.label}/path"

    @property
    def left(self) -> str:
        """The estimated left camera."""
        return f"{WORLD}/{self.label}/left"

    @property
    def points(self) -> str:
        """The estimator's 3-D points."""
        return f"{WORLD}/{self.label}/points"

    @property
    def error_line(self) -> str:
        """The line between the true and the estimated position."""
        return f"{ERROR}/{self.label}"

    @property
    def tracks(self) -> str:
        """The tracked points in the left picture."""
        return f"{TRACKS}/{self.label}"

    @property
    def tails(self) -> str:
        """The lines from each tracked point to where it was in earlier frames."""
        return f"{self.tracks}/tails"

    @property
    def epipolar_lines(self) -> str:
        """The true epipolar lines of the tracks."""
        return f"{self.tracks}/epipolar_lines"

    @property
    def position_error(self) -> str:
        """The curve of the position error."""
        return f"{POSITION_ERROR}/{self.label}"

    @property
    def rotation_error(self) -> str:
        """The curve of the rotation error."""
        return f"{ROTATION_ERROR}/{self.label}"

    @property
    def status(self) -> str:
        """The status of each frame."""
        return f"{STATUS}/{self.label}"

    @property
    def summary(self) -> str:
        """The text with the score."""
        return f"{SUMMARY}/{self.label}"


def truth_entity(side: str, channel: str) -> str:
    """The entity of a channel of per-pixel ground truth from one camera.

    It is outside of WORLD, because a depth image in the 3-D view would hide the paths.
    """
    return f"truth/{side}/{channel}"


def layout(
    truth_m: Array,
    estimate_m: Array,
    *,
    replayed_frames: tuple[int, int] | None,
    labels: Sequence[str] = ("estimate",),
    channels: Sequence[str] = (),
    has_stats: bool = False,
    has_costs: bool = False,
) -> rrb.Blueprint:
    """The default blueprint for a true path (N, 3) and the points (M, 3) of all estimated paths.

    `replayed_frames` are the first and the last frame that are replayed at first. Without them, the recording starts
    paused.
    `labels` are the names of the estimators. Each has a picture with its tracks.
    `channels` are the channels of per-pixel ground truth. They are shown in one tab per camera.
    `has_stats` and `has_costs` add a plot of the numbers that an estimator reports, and of the cost of each frame.
    """
    views: rrb.Container = rrb.Horizontal(
        _paths_column(truth_m, estimate_m, labels, has_stats=has_stats, has_costs=has_costs),
        _pictures_column(labels),
        column_shares=COLUMN_SHARES,
    )
    if channels:
        truth_tabs = [_truth_tab(side, channels) for side in ("left", "right")]
        views = rrb.Tabs(rrb.Horizontal(views, name="Run"), *truth_tabs, active_tab=0)
    return rrb.Blueprint(
        views, _time_panel(replayed_frames), rrb.SelectionPanel(state="hidden"), rrb.BlueprintPanel(state="hidden")
    )


def _paths_column(
    truth_m: Array, estimate_m: Array, labels: Sequence[str], *, has_stats: bool, has_costs: bool
) -> rrb.Vertical:
    """The 3-D view of the paths, with plots of errors, statuses and numbers below it."""
    shown_m = _near_truth(truth_m, estimate_m)
    status_share = STATUS_SHARE + STATUS_SHARE_PER_ESTIMATOR * (len(labels) - 1)
    views: list[rrb.View | rrb.Container] = [
        _paths_view(truth_m, shown_m, labels),
        rrb.Horizontal(_plot(POSITION_ERROR, "Position error"), _plot(ROTATION_ERROR, "Rotation error")),
        rrb.StateTimelineView(origin=STATUS, name="Status of each frame"),
    ]
    shares = [SPACE_SHARE, PLOT_SHARE, status_share]
    plots = []
    if has_stats:
        plots.append(rrb.TimeSeriesView(origin=STATS, name="Numbers reported by the estimator"))
    if has_costs:
        plots.append(rrb.TimeSeriesView(origin=COSTS, name="Latency (ms), exposure (ms), gain (dB)"))
    if plots:
        views.append(rrb.Tabs(*plots, active_tab=0))
        shares.append(NUMBERS_SHARE)
    return rrb.Vertical(*views, row_shares=shares)


def _pictures_column(labels: Sequence[str]) -> rrb.Vertical:
    """The pictures with tracks, with the scores below them."""
    pictures = [_left_picture(label, labels) for label in labels]
    if len(labels) == 1:
        pictures.append(rrb.Spatial2DView(origin=TRUTH_RIGHT, name="Right"))
    summaries = [rrb.TextDocumentView(origin=Entities(label).summary, name=f"Score of {label}") for label in labels]
    shares = [PICTURE_SHARE] * len(pictures) + [SUMMARY_SHARE]
    return rrb.Vertical(*pictures, rrb.Tabs(*summaries, active_tab=0), row_shares=shares)


def _plot(origin: str, name: str) -> rrb.TimeSeriesView:
    """A plot of the entities below `origin` over time."""
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    axis = rrb.ScalarAxis(zoom_lock=True)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_y=axis, plot_legend=legend)


def _left_picture(label: str, labels: Sequence[str]) -> rrb.Spatial2DView:
    """The left picture with the tracks of one of the estimators."""
    hidden = [f"- {Entities(other).tracks}/**" for other in labels if other != label]
    owner = f" of {label}" if len(labels) > 1 else ""
    name = f"Left, tracks{owner}: inliers green, outliers red, true epipolar lines white"
    return rrb.Spatial2DView(origin=TRUTH_LEFT, name=name, contents=["$origin/**", *hidden])


def _truth_tab(side: str, channels: Sequence[str]) -> rrb.Grid:
    """The channels of per-pixel ground truth from one camera, each in a view."""
    views = [rrb.Spatial2DView(origin=truth_entity(side, channel), name=channel) for channel in channels]
    return rrb.Grid(*views, name=f"Truth, {side}")


def _paths_view(truth_m: Array, shown_m: Array, labels: Sequence[str]) -> rrb.Spatial3DView:
    """The 3-D view of the paths, from a viewpoint at which the points `shown_m` (K, 3) fill it.

    Its name is a legend of the colours.
    """
    eye_m, target_m = eye_and_target(shown_m)
    colours = cycle(ESTIMATOR_COLOURS)
    estimates = [f"{label} {colour.name}" for label, colour in zip(labels, colours, strict=False)]
    grid = rrb.LineGrid3D(
        visible=True,
        spacing=grid_spacing_m(2 * _radius_m(truth_m)),
        plane=rr.components.Plane3D.XY,
        color=GRID_COLOUR,
    )
    return rrb.Spatial3DView(
        origin=WORLD,
        name=", ".join(["Truth green", *estimates, "error red"]),
        contents=["$origin/**", f"- {TRUTH_RIGHT}/**", f"- {TRACKS}/**"],
        eye_controls=rrb.EyeControls3D(position=eye_m, look_target=target_m, eye_up=(0, 0, 1)),
        line_grid=grid,
    )


def _time_panel(replayed_frames: tuple[int, int] | None) -> rrb.TimePanel:
    """The panel of the timeline `frame`, which is paused at its start or replays frames.

    A blueprint cannot set the time cursor. A loop that plays moves it to the loop's start.
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


def eye_and_target(points_m: Array) -> tuple[Array, Array]:
    """The position of the eye and the point that it looks at, so that points (N, 3) fill the view.

    The target is the centre of the points' bounding box.
    """
    target_m = (points_m.min(0) + points_m.max(0)) / 2
    distance_m = EYE_DISTANCE_PER_RADIUS * _radius_m(points_m)
    eye_m = target_m + distance_m * _direction_to_eye(points_m)
    return eye_m, target_m


def _direction_to_eye(points_m: Array) -> Array:
    """The unit vector (3,) from points (N, 3) to the eye.

    Seen from above, it is perpendicular to the points' principal axis and points towards -y.
    """
    covariance = np.cov(points_m[:, :2].T, bias=True)
    _, axes = np.linalg.eigh(covariance)  # columns, by increasing variance
    minor_axis = axes[:, 0]
    sign = -1.0 if minor_axis[1] > 0 else 1.0
    pitch_rad = np.deg2rad(EYE_PITCH_DEG)
    horizontal = np.cos(pitch_rad) * (minor_axis * sign)
    return np.array([*horizontal, np.sin(pitch_rad)])


def grid_spacing_m(extent_m: float) -> float:
    """The power of ten that divides `extent_m` into 3 to 30 parts."""
    return float(10.0 ** np.floor(np.log10(extent_m / 3)))


def frustum_m(truth_m: Array) -> float:
    """The length of a drawn camera frustum, in proportion to the size of the true path (N, 3)."""
    return FRUSTUM_PER_RADIUS * _radius_m(truth_m)


def _radius_m(points_m: Array) -> float:
    """Half the diagonal of the bounding box of points (N, 3), at least LEAST_RADIUS_M for a stationary robot."""
    diagonal_m = float(np.linalg.norm(np.ptp(points_m, axis=0)))
    return max(LEAST_RADIUS_M, diagonal_m / 2)


def _near_truth(truth_m: Array, estimate_m: Array) -> Array:
    """The true path (N, 3) and the nearby points of the estimated paths (M, 3), together (K, 3).

    Distant points are left out, so that a diverged estimate does not shrink the other paths in the view.
    """
    centre_m = (truth_m.min(0) + truth_m.max(0)) / 2
    reach_m = 2 * _radius_m(truth_m)
    is_near = np.linalg.norm(estimate_m - centre_m, axis=1) <= reach_m
    return np.concatenate([truth_m, estimate_m[is_near]])
