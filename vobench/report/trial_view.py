"""Everything that is shown of a trial: its sequence, ground truth, estimate, errors and tracks."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.report.cell_notes import disparity_offset_sentence
from vobench.report.frame_statistics import summarize_frames
from vobench.report.rerun_scene import SceneMesh, scene_mesh
from vobench.report.rerun_tracks import Tracks
from vobench.report.rerun_truth import TruthView
from vobench.runner.estimate import ESTIMATE, POINTS, read_tracks
from vobench.runner.folder import SEQUENCE, SURVIVED, RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH, FrameRow, read_frames
from vobench.sequence import EncodedFrame, read_truth_frames, read_truth_names, truth_channels
from vobench.sequence import Sequence as Recording
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Trajectory

Table = NDArray[np.float32]

NO_OUTPUT = "no output"
MS_PER_S = 1e3


@dataclass(frozen=True, slots=True)
class TrialView:
    """Everything that is shown of a trial; both trajectories are of the left camera, in the same world.

    `frames` iterates over the N pictures from the first one. `error_m` and `rotation_deg` (N,) are NaN for frames
    without a pose, and `statuses` has one word for each. `tracks` maps a frame's index to points in the left picture
    (K, 2) and which of them are inliers (K,); `steps` to where each was in the frame before (K, 2); `points` to the
    scene as the estimator reconstructs it (K, 3), in the world. `stats` and `costs` have numbers (N,) by name, NaN for
    none: those that the estimator reports, and latency and exposure. `truth` is None if nothing was recorded of the
    pixels. `wrong_at` is the frame at which a failed estimate that never lost track goes wrong; `first` is the number
    of the first frame that is shown. `position` is that of the estimator in its run, which determines its colour.
    """

    title: str
    rig: Rig
    frames: Callable[[], Iterable[EncodedFrame]]
    ground_truth: Trajectory
    estimate: Trajectory
    error_m: Array
    statuses: Sequence[str]
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
    position: int = 0


def trial_view(folder: RunFolder, trial: TrialScore, *, window: slice = slice(None), position: int = 0) -> TrialView:
    """Everything that is shown of a trial, or of a window of its frames.

    `position` is that of its estimator in the run.

    Raises InputError if its sequence is no longer in the cache, or the window holds no frame.
    """
    link = folder.case(trial.case) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is no longer in the cache; run the suite again to recreate it: {link}")
    sequence = Recording.open(link)
    first, end, _ = window.indices(len(sequence))
    place = folder.estimate(trial.case, trial.estimator, trial.repeat)
    rows = read_frames(place)
    shown = rows[window]
    if rows and not shown:
        raise InputError(f"--frames {first}:{end} holds none of the {len(rows)} frames of {trial.case}")

    alignment = Alignment.from_dict(trial.score["alignment"]) if trial.score else None
    tables = _in_window(read_tracks(place), first, end)
    error_m = _column(shown, "position_error_m")
    return TrialView(
        title=f"{trial.estimator} on {trial.case}",
        label=trial.estimator,
        rig=sequence.rig,
        frames=lambda: islice(sequence.encoded_frames(), first, end),
        ground_truth=_between(read_tum(folder.case(trial.case) / GROUND_TRUTH), shown),
        estimate=_between(_aligned(read_tum(place / ESTIMATE), alignment), shown),
        error_m=error_m,
        rotation_deg=_column(shown, "rotation_error_deg"),
        statuses=[row.status or NO_OUTPUT for row in shown],
        tracks={index: _tracks(table) for index, table in tables.items()},
        steps={index: table[:, :2].astype(float) for index, table in tables.items()},
        points=_points(place, alignment, first, end),
        stats=_stats(shown),
        costs=_costs(shown),
        summary_md=summary(trial, disparity_offset_sentence(summarize_frames([rows]).offset_px)),
        truth=_truth_view(link),
        scene=scene_mesh(folder, trial.case),
        wrong_at=None if trial.status in SURVIVED else _largest_jump(error_m),
        first=first,
        position=position,
    )


def _in_window(tables: Iterable[tuple[int, Table]], first: int, end: int) -> dict[int, Table]:
    """The tables of the frames from `first` up to `end`, by their index in that window."""
    return {index - first: table for index, table in tables if first <= index < end}


def _tracks(table: Table) -> Tracks:
    """The points of a frame's tracks, and which of them are inliers."""
    return table[:, 2:4].astype(float), table[:, 4] > 0


def _aligned(estimate: Trajectory, alignment: Alignment | None) -> Trajectory:
    if alignment is None:
        return estimate
    return Trajectory(estimate.t_ns, alignment.apply(estimate.T_world_frame))


def _points(place: Path, alignment: Alignment | None, first: int, end: int) -> dict[int, Array]:
    """The points that the estimator reconstructs in each frame of a window (K, 3), aligned like its poses."""
    points = {}
    for index, table in _in_window(read_tracks(place, of=POINTS), first, end).items():
        points_m = table.astype(float)
        if alignment is not None:
            poses = se3.transform(np.eye(3), points_m)  # (K, 4, 4), as an alignment applies to poses
            points_m = alignment.apply(poses)[:, :3, 3]
        points[index] = points_m
    return points


def _truth_view(link: Path) -> TruthView | None:
    """The ground truth of pixels of a sequence, None if none was recorded."""
    channels = truth_channels(link)
    if not channels:
        return None
    return TruthView(channels, read_truth_names(link), lambda: read_truth_frames(link))


def _between(path: Trajectory, rows: Sequence[FrameRow]) -> Trajectory:
    """The poses of a path from the first to the last of these frames, all of them if there are no frames."""
    if not rows:
        return path
    is_not_before = path.t_ns >= rows[0].t_ns
    is_not_after = path.t_ns <= rows[-1].t_ns
    is_shown = is_not_before & is_not_after
    return Trajectory(path.t_ns[is_shown], path.T_world_frame[is_shown])


def _column(rows: Sequence[FrameRow], name: str) -> Array:
    """A column of the frames' table (N,), NaN for no value."""
    return np.array([getattr(row, name) for row in rows], float)


def _stats(rows: Sequence[FrameRow]) -> dict[str, Array]:
    """The numbers that the estimator reports, (N,) by name, NaN for frames without one."""
    reported = [json.loads(row.stats or "{}") for row in rows]
    names = sorted({name for numbers in reported for name in numbers})
    stats = {}
    for name in names:
        stats[name] = np.array([numbers.get(name, np.nan) for numbers in reported], float)
    return stats


def _costs(rows: Sequence[FrameRow]) -> dict[str, Array]:
    """Latency and exposure of each frame, (N,) by name."""
    return {
        "latency_ms": _column(rows, "wall_ms"),
        "exposure_ms": MS_PER_S * _column(rows, "exposure_s"),
        "gain_db": _column(rows, "gain_db"),
    }


def _largest_jump(error_m: Array) -> int | None:
    """The frame at which the error grows most, None if it never grows."""
    growth_m = np.diff(np.nan_to_num(error_m))
    if growth_m.max(initial=0.0) <= 0:
        return None
    return int(np.argmax(growth_m)) + 1


def summary(trial: TrialScore, note: str = "") -> str:
    """The score of a trial in Markdown, with a note on its stereo pair if there is one."""
    reason = f" — {trial.reason}" if trial.reason else ""
    lines = [
        f"# {trial.estimator} on {trial.case}",
        "",
        f"**{trial.status}**{reason}",
        "",
        f"{trial.frames} frames, {trial.path_m:.2f} m, coverage {trial.coverage:.1%}",
        "",
    ]
    if note:
        lines += [note[0].upper() + note[1:], ""]
    if trial.score:
        lines += ["| metric | rmse | mean | max |", "|---|---|---|---|"]
        for metric in trial.score["metrics"]:
            name = f"{metric['name']} ({metric['unit']})"
            lines.append(f"| {name} | {metric['rmse']:.4g} | {metric['mean']:.4g} | {metric['max']:.4g} |")
    return "\n".join(lines)
