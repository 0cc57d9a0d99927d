"""Drives as pictures: each path from above, and its speeds against what the controller asked for."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.motion.course import Unled
from vobench.motion.drive import Waypoints
from vobench.motion.wheeled import Wheeled
from vobench.runner.drive import TrajectoryDrive
from vobench.runner.motion import NS_PER_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

ENDINGS = (".svg", ".png", ".pdf")
ROW_INCHES = (9.0, 3.6)
CELL_INCHES = 2.3
# Okabe and Ito (2008): colours that colour-blind readers tell apart.
BODY = "#0072B2"
POINT = "#009E73"
ASKED = "#D55E00"
QUIET = "#7f7f7f"
FLOORS = {"wet": "#56B4E9", "carpet": "#CC79A7", "seam": "#E69F00"}
# The same drive is the same file: no dates, and ids that come from content.
SETTINGS: Any = {
    "svg.hashsalt": "vobench",
    "font.size": 8,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.axisbelow": True,
    "legend.fontsize": 7,
    "legend.framealpha": 0.8,
}
ARROWS = 24
LEAST_SPAN_M = 0.1


@dataclass(frozen=True, slots=True)
class DriveLog:
    """What a body did at N instants t_s (N,): its poses (N, 4, 4) and twist (N, 6) in its own axes.

    A robot under the controller has more: point_m (N, 2), where the point h was; references (N, 2), the speed
    and the yaw rate asked for; targets_m (K, 2), and reached_s (K,), when the leg to each ended; patches of floor
    by their surface, with corners (4, 2).
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
        """The way (N, 2) from the point h to its leg's target, the last one's after it; None without targets."""
        if self.targets_m is None or self.point_m is None or self.reached_s is None:
            return None
        leg = np.searchsorted(self.reached_s, self.t_s, side="right")
        error_m: Array = self.targets_m[np.minimum(leg, len(self.targets_m) - 1)] - self.point_m
        return error_m

    @property
    def leaves_the_floor(self) -> bool:
        """Whether it does anything that a robot on a level floor cannot: rise, roll or pitch."""
        tilt = np.abs(self.T_world_body[:, 2, :2]).max()
        return bool(np.ptp(self.T_world_body[:, 2, 3]) > 1e-6 or tilt > 1e-6)


def log_of(drive: TrajectoryDrive) -> DriveLog:
    """Return what there is to draw of a driven trajectory."""
    spec = drive.case.trajectory
    whole = drive.motion.drive
    point_m = None
    if whole is not None and not isinstance(spec, Unled):
        point_m = whole.state[drive.frames, :2]
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


def save_plot(path: Path, logs: Sequence[DriveLog]) -> None:
    """Draw one row for each log, as SVG, PNG or PDF by the path's ending. Raises InputError for another ending."""
    check_ending(path)
    import matplotlib as mpl

    with mpl.rc_context(SETTINGS):
        width, height = ROW_INCHES
        figure = _figure(width, height * len(logs))
        rows = figure.subfigures(len(logs), 1, squeeze=False)[:, 0]
        for row, log in zip(rows, logs, strict=True):
            _draw(row, log)
        figure.savefig(path, dpi=110, metadata=undated(path.suffix))


def save_sheet(path: Path, logs: Sequence[DriveLog], *, columns: int = 5) -> None:
    """Draw the paths alone, in a grid, to the same forms. Raises InputError as `save_plot`."""
    check_ending(path)
    import matplotlib as mpl

    with mpl.rc_context(SETTINGS):
        rows = -(-len(logs) // columns)
        figure = _figure(CELL_INCHES * columns, CELL_INCHES * rows)
        for place, log in enumerate(logs, 1):
            axes = figure.add_subplot(rows, columns, place)
            _path(axes, log, legend=False)
            axes.set_title(log.title, fontsize=8, fontweight="bold")
        figure.savefig(path, dpi=110, metadata=undated(path.suffix))


def check_ending(path: Path) -> None:
    """Raise InputError for a plot that is no SVG, PNG or PDF."""
    if path.suffix not in ENDINGS:
        raise InputError(f"a plot's name should end in {', '.join(ENDINGS)}, got {path}")


def _figure(width: float, height: float) -> "Figure":
    """An empty page in inches, its gaps the same however long it is."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    return Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.05, hspace=0, wspace=0))


def undated(suffix: str) -> dict[str, None]:
    """What keeps dates out of a plot of that suffix."""
    return {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix, {})


def _draw(row: "SubFigure", log: DriveLog) -> None:
    panels = row.subplot_mosaic([["path", "speed"], ["path", "turn"], ["path", "rest"]], width_ratios=[1, 1.25])
    row.suptitle(log.title, fontweight="bold", x=0.01, ha="left")
    _path(panels["path"], log)
    times = [panels[name] for name in ("speed", "turn", "rest")]
    _speeds(times[0], times[1], log)
    _rest(times[2], log)
    for axes in times:
        axes.set_xlim(log.t_s[0], max(log.t_s[-1], log.t_s[0] + 1e-3))
        for reached_s in () if log.reached_s is None else log.reached_s:
            axes.axvline(reached_s, color="black", lw=0.6, ls=":")
    for axes in times[:2]:
        axes.tick_params(labelbottom=False)
    times[-1].set_xlabel("time (s); dotted: end of a leg" if log.reached_s is not None else "time (s)")


def _path(axes: "Axes", log: DriveLog, *, legend: bool = True) -> None:
    x, y = log.T_world_body[:, :2, 3].T
    for surface, corners_m in log.patches:
        axes.fill(*corners_m.T, color=FLOORS.get(surface, QUIET), alpha=0.25, lw=0, label=surface)
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
        named = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        axes.legend(named.values(), named.keys(), loc="best")


def _headings(axes: "Axes", log: DriveLog, *, length: float) -> None:
    """Arrows along the body's x axis, at even times; `length` is against what suits a large plot."""
    chosen = np.unique(np.linspace(0, len(log.t_s) - 1, ARROWS).astype(int))
    at = log.T_world_body[chosen, :2, 3]
    ahead = log.T_world_body[chosen, :2, 0]
    axes.quiver(*at.T, *ahead.T, color=QUIET, scale=18 / length, width=0.004 * length, headwidth=4, label="heading")


def _widen(axes: "Axes", middle_m: Array) -> None:
    """See to it that a body that stays in place, or on a line, is drawn to a sensible scale."""
    axes.update_datalim([middle_m - LEAST_SPAN_M / 2, middle_m + LEAST_SPAN_M / 2])
    axes.margins(0.1)


def _speeds(speed: "Axes", turn: "Axes", log: DriveLog) -> None:
    free = log.leaves_the_floor
    values = [np.linalg.norm(log.twist[:, :3], axis=1), np.linalg.norm(log.twist[:, 3:], axis=1)]
    shown = values if free else [log.twist[:, 0], log.twist[:, 5]]
    names = ("|v|", "|ω|") if free else ("u", "ω")
    for column, (axes, name, unit) in enumerate(zip((speed, turn), names, ("m/s", "rad/s"), strict=True)):
        if log.references is not None:
            axes.plot(log.t_s, log.references[:, column], color=ASKED, lw=0.8, label=f"{name} asked for")
        axes.plot(log.t_s, shown[column], color=BODY, lw=1.2, label=name)
        axes.set_ylabel(f"{name} ({unit})")
        if log.references is not None:
            _legend_above(axes)


def _rest(axes: "Axes", log: DriveLog) -> None:
    """The error to the next target as in the paper's Fig. 11, else the height, else the heading."""
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
        heading = np.unwrap(np.arctan2(log.T_world_body[:, 1, 0], log.T_world_body[:, 0, 0]))
        axes.plot(log.t_s, np.rad2deg(heading), color=BODY, lw=1.2)
        axes.set_ylabel("heading (°)")


def _legend_above(axes: "Axes") -> None:
    """One line of names above the curves, where it hides none of them."""
    axes.legend(loc="lower right", bbox_to_anchor=(1, 0.96), ncols=2, frameon=False, borderpad=0)
