"""The first view of a recording in Rerun: which panels, where, and where the 3-D eye stands."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from vobench.geometry.se3 import Array

FRAME_TIMELINE = "frame"

# Entities: what a recording holds and the views below show.
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

EYE_PITCH_DEG = 38.0
EYE_DISTANCE_PER_RADIUS = 1.6  # fills the view with Rerun's default field of view, with a margin for frusta
FRAMES_AROUND_FOCUS = 15
REPLAY_FPS = 5.0  # slow enough to see single frames


class Entities:
    """Where a recording holds what is one estimator's."""

    def __init__(self, label: str) -> None:
        self.path, self.left, self.points = (f"{WORLD}/{label}/{part}" for part in ("path", "left", "points"))
        self.error_line = f"{ERROR}/{label}"
        self.tracks = f"{TRACKS}/{label}"
        self.tails = f"{self.tracks}/tails"
        self.epipolar = f"{self.tracks}/epipolar_lines"
        self.position_error = f"{POSITION_ERROR}/{label}"
        self.rotation_error = f"{ROTATION_ERROR}/{label}"
        self.status = f"{STATUS}/{label}"
        self.summary = f"{SUMMARY}/{label}"


def truth_entity(side: str, channel: str) -> str:
    """Where one camera's truth channel is; apart from the world, for a depth map there hides the paths."""
    return f"truth/{side}/{channel}"


def layout(
    truth_m: Array,
    estimate_m: Array,
    *,
    focus: tuple[int, int] | None,
    labels: Sequence[str] = ("estimate",),
    channels: Sequence[str] = (),
    has_stats: bool = False,
    has_costs: bool = False,
) -> rrb.Blueprint:
    """The default blueprint for paths (N, 3) and (M, 3); `focus` is a range of frames to start at.

    Several estimators have a left picture each, side by side. Truth channels, where there are any, have tabs of their
    own, and what an estimator counted and a frame cost a plot.
    """
    seen_m = _near(truth_m, estimate_m)
    is_one = len(labels) == 1
    said = [rrb.TimeSeriesView(origin=STATS, name="What the estimator says")] if has_stats else []
    said += [rrb.TimeSeriesView(origin=COSTS, name="Latency (ms), exposure (ms), gain (dB)")] if has_costs else []
    paths = rrb.Vertical(
        _space(truth_m, seen_m, labels),
        rrb.Horizontal(_plot(POSITION_ERROR, "Position error"), _plot(ROTATION_ERROR, "Rotation error")),
        rrb.StateTimelineView(origin=STATUS, name="Status of each frame"),
        *([rrb.Tabs(*said, active_tab=0)] if said else []),
        row_shares=[6, 2.2, 1.2 + 0.4 * (len(labels) - 1), *([2.0] if said else [])],
    )
    summaries = [rrb.TextDocumentView(origin=Entities(label).summary, name=f"Score of {label}") for label in labels]
    right = [rrb.Spatial2DView(origin=TRUTH_RIGHT, name="Right")] if is_one else []
    pictures = rrb.Vertical(
        *(_left(label, labels) for label in labels),
        *right,
        rrb.Tabs(*summaries, active_tab=0),
        row_shares=[3] * (len(labels) + len(right)) + [2.6],
    )
    columns = rrb.Horizontal(paths, pictures, column_shares=[3, 2])
    run = rrb.Tabs(rrb.Horizontal(columns, name="Run"), *_truth(channels), active_tab=0) if channels else columns
    return rrb.Blueprint(
        run, _time_panel(focus), rrb.SelectionPanel(state="hidden"), rrb.BlueprintPanel(state="hidden")
    )


def _plot(origin: str, name: str) -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_y=rrb.ScalarAxis(zoom_lock=True), plot_legend=legend)


def _left(label: str, labels: Sequence[str]) -> rrb.Spatial2DView:
    """The left picture with the tracks of one estimator."""
    hidden = [f"- {Entities(other).tracks}/**" for other in labels if other != label]
    of = f" of {label}" if len(labels) > 1 else ""
    name = f"Left, tracks{of}: inliers green, outliers red, true epipolar lines white"
    return rrb.Spatial2DView(origin=TRUTH_LEFT, name=name, contents=["$origin/**", *hidden])


def _truth(channels: Sequence[str]) -> list[rrb.Grid]:
    """A tab for each camera, a view for each channel."""
    return [
        rrb.Grid(*(rrb.Spatial2DView(origin=truth_entity(s, c), name=c) for c in channels), name=f"Truth, {s}")
        for s in ("left", "right")
    ]


NAMES = ("orange", "blue", "violet", "yellow", "cyan")  # of report.rerun.COLORS


def _space(truth_m: Array, seen_m: Array, labels: Sequence[str]) -> rrb.Spatial3DView:
    eye, target = eye_and_target(seen_m)
    return rrb.Spatial3DView(
        origin=WORLD,
        name=", ".join(
            ["Truth green", *(f"{label} {color}" for label, color in zip(labels, NAMES, strict=False)), "error red"]
        ),
        contents=["$origin/**", f"- {TRUTH_RIGHT}/**", f"- {TRACKS}/**"],
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0, 0, 1)),
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=grid_spacing_m(2 * _radius_m(truth_m)),
            plane=rr.components.Plane3D.XY,
            color=(255, 255, 255, 24),
        ),
    )


def _time_panel(focus: tuple[int, int] | None) -> rrb.TimePanel:
    """The `frame` time line: at rest at its start, or replaying the frames around a failure.

    A blueprint cannot place the time cursor, but a playing loop pulls it to where the loop starts.
    """
    if focus is None:
        return rrb.TimePanel(timeline=FRAME_TIMELINE, play_state="paused", state="collapsed")
    first, last = focus
    return rrb.TimePanel(
        timeline=FRAME_TIMELINE,
        play_state="playing",
        state="collapsed",
        fps=REPLAY_FPS,
        loop_mode="selection",
        time_selection=rrb.components.AbsoluteTimeRange(min=first, max=last),
    )


def eye_and_target(points_m: Array) -> tuple[Array, Array]:
    """Where to stand and where to look so that points (N, 3) fill the view: beside their longer side."""
    target = (points_m.min(0) + points_m.max(0)) / 2
    _, axes = np.linalg.eigh(np.cov(points_m[:, :2].T, bias=True) if len(points_m) > 1 else np.eye(2))
    side = axes[:, 0] * (-1.0 if axes[1, 0] > 0 else 1.0)  # of the two sides, the one towards -y
    pitch = np.deg2rad(EYE_PITCH_DEG)
    direction = np.array([*(np.cos(pitch) * side), np.sin(pitch)])
    return target + EYE_DISTANCE_PER_RADIUS * _radius_m(points_m) * direction, target


def grid_spacing_m(extent_m: float) -> float:
    """A power of ten that cuts `extent_m` into 3 to 30 parts."""
    return float(10.0 ** np.floor(np.log10(extent_m / 3)))


def frustum_m(truth_m: Array) -> float:
    """How long to draw a camera so that it is seen, but does not hide a path (N, 3)."""
    return 0.16 * _radius_m(truth_m)


def _radius_m(points_m: Array) -> float:
    """Half the diagonal of the bounding box, at least 0.25 m so that a robot at rest is framed too."""
    return max(0.25, float(np.linalg.norm(np.ptp(points_m, axis=0))) / 2)


def _near(truth_m: Array, estimate_m: Array) -> Array:
    """The truth and what of the estimate stays near it: one that flies off must not shrink the rest."""
    centre = (truth_m.min(0) + truth_m.max(0)) / 2
    reach_m = 2 * _radius_m(truth_m)
    near = np.linalg.norm(estimate_m - centre, axis=1) <= reach_m
    return np.concatenate([truth_m, estimate_m[near]])
