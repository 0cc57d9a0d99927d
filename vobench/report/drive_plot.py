"""Plots of drives: the path of each in top view, and its speeds against those that the controller requests."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.geometry.se3 import Array
from vobench.motion.course import Unled
from vobench.motion.drive import Waypoints
from vobench.motion.wheeled import Wheeled
from vobench.report.figure_style import DPI, NEUTRAL, SETTINGS, check_ending, undated
from vobench.runner.drive import TrajectoryDrive
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

ROW_INCHES = (9.0, 3.6)
CELL_INCHES = 2.3
# Okabe and Ito (2008): colours that colour-blind readers tell apart.
BODY = "#0072B2"
POINT = "#009E73"
REFERENCE = "#D55E00"
FLOORS = {"wet": "#56B4E9", "carpet": "#CC79A7", "seam": "#E69F00"}
ARROWS = 24
LEAST_SPAN_M = 0.1
LEAST_SPAN_S = 1e-3
LEVEL = 1e-6  # metres or radians of a body on a level floor


@dataclass(frozen=True, slots=True)
class DriveLog:
    """The motion of a body at the times t_s (N,): its poses (N, 4, 4), and twist (N, 6) in the body frame.

    A robot with the controller also has point_m (N, 2), the position of the point h; references (N, 2), the requested
    speed and yaw rate; targets_m (K, 2) and reached_s (K,), the end of the leg to each. Patches of floor have a
    surface and corners (4, 2).
    """

    title: str
    t_s: Array
    T_world_body: Array
    twist: Array
    point_m: Array | None = None
    references: Array | None = None
    targets_m: Array | None = None
    reached_s: Array | None = None
    patches: tuple[tuple[str, Array], ...] = ()

    @property
    def to_target_m(self) -> Array | None:
        """The vector (N, 2) from the point h to the target of the current leg, or the last target after all legs.

        None without targets.
        """
        if self.targets_m is None or self.point_m is None or self.reached_s is None:
            return None
        leg = np.searchsorted(self.reached_s, self.t_s, side="right")
        last_leg = len(self.targets_m) - 1
        target_m = self.targets_m[np.minimum(leg, last_leg)]
        error_m: Array = target_m - self.point_m
        return error_m

    @property
    def leaves_the_floor(self) -> bool:
        """Whether the body rises, rolls or pitches, which a robot on a level floor cannot do."""
        tilt = np.abs(self.T_world_body[:, 2, :2]).max()
        rise_m = np.ptp(self.T_world_body[:, 2, 3])
        return bool(rise_m > LEVEL or tilt > LEVEL)


def drive_log(drive: TrajectoryDrive) -> DriveLog:
    """The log of a driven trajectory."""
    spec = drive.case.trajectory
    simulated = drive.motion.drive
    point_m = None
    if simulated is not None and not isinstance(spec, Unled):
        point_m = simulated.state[drive.frames, :2]
    patches: tuple[tuple[str, Array], ...] = ()
    if isinstance(spec, Wheeled):
        patches = tuple((patch.surface, patch.corners_m) for patch in spec.floor)
    return DriveLog(
        title=drive.kind if drive.name == spec.kind else f"{drive.name}: {drive.kind}",
        t_s=drive.motion.t_ns / NS_PER_S,
        T_world_body=drive.body.T_world_body,
        twist=drive.body.twist,
        point_m=point_m,
        references=drive.references,
        targets_m=np.array(spec.targets_m) if isinstance(spec, Waypoints) else None,
        reached_s=drive.reached_s,
        patches=patches,
    )


def save_drive_plot(path: Path, logs: Sequence[DriveLog]) -> None:
    """Draw one row per log, as SVG, PNG or PDF by the ending of the path. Raises InputError for another ending."""
    check_ending(path)
    import matplotlib as mpl

    with mpl.rc_context(SETTINGS):
        width, height = ROW_INCHES
        figure = _figure(width, height * len(logs))
        rows = figure.subfigures(len(logs), 1, squeeze=False)[:, 0]
        for row, log in zip(rows, logs, strict=True):
            _draw(row, log)
        figure.savefig(path, dpi=DPI, metadata=undated(path.suffix))


def save_sheet(path: Path, logs: Sequence[DriveLog], *, columns: int = 5) -> None:
    """Draw the paths alone, in a grid, in the same formats. Raises InputError as `save_plot`."""
    check_ending(path)
    import matplotlib as mpl

    with mpl.rc_context(SETTINGS):
        rows = -(-len(logs) // columns)
        figure = _figure(CELL_INCHES * columns, CELL_INCHES * rows)
        for place, log in enumerate(logs, 1):
            axes = figure.add_subplot(rows, columns, place)
            _path(axes, log, legend=False)
            axes.set_title(log.title, fontsize=8, fontweight="bold")
        figure.savefig(path, dpi=DPI, metadata=undated(path.suffix))


def _figure(width: float, height: float) -> "Figure":
    """An empty figure, size in inches, whose gaps do not grow with it."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.05, hspace=0, wspace=0)
    return Figure(figsize=(width, height), layout=layout)


def _draw(row: "SubFigure", log: DriveLog) -> None:
    panels = row.subplot_mosaic([["path", "speed"], ["path", "turn"], ["path", "rest"]], width_ratios=[1, 1.25])
    row.suptitle(log.title, fontweight="bold", x=0.01, ha="left")
    _path(panels["path"], log)
    times = [panels["speed"], panels["turn"], panels["rest"]]
    _speeds(panels["speed"], panels["turn"], log)
    _last_panel(panels["rest"], log)
    leg_ends_s = [] if log.reached_s is None else log.reached_s.tolist()
    last_s = max(log.t_s[-1], log.t_s[0] + LEAST_SPAN_S)
    for axes in times:
        axes.set_xlim(log.t_s[0], last_s)
        for leg_end_s in leg_ends_s:
            axes.axvline(leg_end_s, color="black", lw=0.6, ls=":")
    for axes in times[:2]:
        axes.tick_params(labelbottom=False)
    times[-1].set_xlabel("time (s)" if log.reached_s is None else "time (s); dotted: end of a leg")


def _path(axes: "Axes", log: DriveLog, *, legend: bool = True) -> None:
    """The path in top view, with headings, targets and patches of floor."""
    x, y = log.T_world_body[:, :2, 3].T
    for surface, corners_m in log.patches:
        color = FLOORS.get(surface, NEUTRAL)
        axes.fill(*corners_m.T, color=color, alpha=0.25, lw=0, label=surface)
    axes.plot(x, y, color=BODY, lw=1.4, label="body B")
    if log.point_m is not None:
        axes.plot(*log.point_m.T, color=POINT, lw=0.9, label="point h")
    axes.plot(x[:1], y[:1], "o", color=BODY, ms=5, label="start")
    _headings(axes, log, length=1.0 if legend else 2.0)
    if log.targets_m is not None:
        axes.plot(*log.targets_m.T, "x", color="black", ms=6, mew=1.4, ls="none", label="targets of h")
        for number, target in enumerate(log.targets_m.tolist(), 1):
            axes.annotate(str(number), target, xytext=(4, 4), textcoords="offset points")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    _widen(axes, log.T_world_body[0, :2, 3])
    axes.set_aspect("equal", adjustable="datalim")
    if legend:
        handles, labels = axes.get_legend_handles_labels()
        handle_of = dict(zip(labels, handles, strict=True))  # two patches of one surface have one entry
        axes.legend(handle_of.values(), handle_of.keys(), loc="best")


def _headings(axes: "Axes", log: DriveLog, *, length: float) -> None:
    """Arrows along the body's x axis, at even times; `length` is relative to that in a large plot."""
    last = len(log.t_s) - 1
    chosen = np.unique(np.linspace(0, last, ARROWS).astype(int))
    positions_m = log.T_world_body[chosen, :2, 3]
    directions = log.T_world_body[chosen, :2, 0]
    axes.quiver(
        *positions_m.T,
        *directions.T,
        color=NEUTRAL,
        scale=18 / length,
        width=0.004 * length,
        headwidth=4,
        label="heading",
    )


def _widen(axes: "Axes", middle_m: Array) -> None:
    """Widen the range of axes so that a body in one place, or on a line, is drawn at a sensible scale."""
    axes.update_datalim([middle_m - LEAST_SPAN_M / 2, middle_m + LEAST_SPAN_M / 2])
    axes.margins(0.1)


def _speeds(speed: "Axes", turn: "Axes", log: DriveLog) -> None:
    """Linear and angular velocity: of a body on the floor its forward speed and yaw rate, or else their magnitudes."""
    references = [None, None] if log.references is None else list(log.references.T)
    if log.leaves_the_floor:
        magnitude_mps = np.linalg.norm(log.twist[:, :3], axis=1)
        magnitude_radps = np.linalg.norm(log.twist[:, 3:], axis=1)
        _speed(speed, log.t_s, magnitude_mps, references[0], name="|v|", unit="m/s")
        _speed(turn, log.t_s, magnitude_radps, references[1], name="|ω|", unit="rad/s")
    else:
        _speed(speed, log.t_s, log.twist[:, 0], references[0], name="u", unit="m/s")
        _speed(turn, log.t_s, log.twist[:, 5], references[1], name="ω", unit="rad/s")


def _speed(axes: "Axes", t_s: Array, values: Array, reference: Array | None, *, name: str, unit: str) -> None:
    """One speed over time, with its reference if there is one."""
    if reference is not None:
        axes.plot(t_s, reference, color=REFERENCE, lw=0.8, label=f"{name} requested")
    axes.plot(t_s, values, color=BODY, lw=1.2, label=name)
    axes.set_ylabel(f"{name} ({unit})")
    if reference is not None:
        _legend_above(axes)


def _last_panel(axes: "Axes", log: DriveLog) -> None:
    """The distance to the next target as in the paper's Fig. 11, or else the height, or else the heading."""
    if log.to_target_m is not None:
        x, y = log.to_target_m.T
        axes.plot(log.t_s, x, color=BODY, lw=1.2, label="x")
        axes.plot(log.t_s, y, color=POINT, lw=1.2, label="y")
        axes.set_ylabel("to target (m)")
        _legend_above(axes)
    elif log.leaves_the_floor:
        axes.plot(log.t_s, log.T_world_body[:, 2, 3], color=BODY, lw=1.2)
        axes.set_ylabel("height z (m)")
    else:
        forward = log.T_world_body[:, :2, 0]  # (N, 2), world
        heading_rad = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
        axes.plot(log.t_s, np.rad2deg(heading_rad), color=BODY, lw=1.2)
        axes.set_ylabel("heading (°)")


def _legend_above(axes: "Axes") -> None:
    """A legend in one line above the curves, where it hides none of them."""
    axes.legend(loc="lower right", bbox_to_anchor=(1, 0.96), ncols=2, frameon=False, borderpad=0)
