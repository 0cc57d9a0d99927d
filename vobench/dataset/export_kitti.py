"""KITTI's layout for odometry: two rectified pinholes, times, and the left camera's poses since the first picture.

Source: Geiger, Lenz and Urtasun (2012), the devkit's readme.
"""

from pathlib import Path

import numpy as np

from vobench.dataset.source import Source, png_frames
from vobench.dataset.views import Views
from vobench.geometry import se3
from vobench.geometry.rectify import projection
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.trajectory.interpolate import poses_at
from vobench.trajectory.trajectory import Stamps, Trajectory
from vobench.trajectory.unstamped import format_kitti, format_times


def write_kitti(source: Source, views: Views, folder: Path) -> list[str]:
    """Fill `folder` and say what was converted."""
    stamps = source.sequence.frame_stamps()
    kept = covered(source.truth, stamps)
    for index in range(len(views.rig.sides)):
        (folder / f"image_{index}").mkdir()
    frames = (frame for frame in png_frames(source.sequence, views) if kept[frame.index])
    for number, frame in enumerate(frames):
        for index, picture in enumerate(frame.pictures.values()):
            (folder / f"image_{index}" / f"{number:06d}.png").write_bytes(picture)
    (folder / "calib.txt").write_text(_calibration(views.rig), encoding="utf-8")
    (folder / "times.txt").write_text(format_times(stamps[kept]), encoding="utf-8")
    notes = _picture_notes(source, views)
    if not kept.all():
        notes.append(f"{np.sum(~kept)} of {len(kept)} frames lie before or after the truth and were left out.")
    return notes + _write_poses(source, views, stamps[kept], folder)


def covered(truth: Trajectory | None, stamps: Stamps) -> np.ndarray:
    """Which frames (N,) the layout can have: those within the truth's time; all where there is no truth for any."""
    everything = np.ones(len(stamps), bool)
    if truth is None:
        return everything
    within = (stamps >= truth.t_ns[0]) & (stamps <= truth.t_ns[-1])
    return within if within.any() else everything


def kitti_path(truth: Trajectory, rig: Rig, stamps: Stamps) -> Trajectory | None:
    """The left camera's poses at some stamps, since the first of them, as KITTI counts; None outside the truth."""
    if stamps[-1] < truth.t_ns[0] or stamps[0] > truth.t_ns[-1]:
        return None
    T_world_left = poses_at(truth, stamps) @ rig.T_body_left
    return Trajectory(stamps, se3.inverse(T_world_left[:1]) @ T_world_left)


def _calibration(rig: Rig) -> str:
    """P0 and P1, each (3, 4) in a row: what sends points in the left camera's axes to pixels."""
    shifts_m = [0.0, rig.baseline_m] if rig.right else [0.0]
    matrices = [projection(rig.left.K, shift_m) for shift_m in shifts_m]
    return "".join(f"P{index}: {_row(P)}\n" for index, P in enumerate(matrices))


def _row(values: Array) -> str:
    return " ".join(repr(value + 0.0) for value in values.ravel().tolist())  # no -0.0


def _picture_notes(source: Source, views: Views) -> list[str]:
    if views.source_px is None:
        return ["The pair is rectified as it was recorded, so its pixels are unchanged."] if views.rig.right else []
    dark = max(views.dark_share(side, source.rig.camera(side)) for side in views.rig.sides)
    rest = f"; up to {dark:.1%} of a picture shows nothing and is black" if dark else ""
    return [f"KITTI means rectified pictures: these were resampled, linear between pixels, which loses detail{rest}."]


def _write_poses(source: Source, views: Views, stamps: Stamps, folder: Path) -> list[str]:
    truth = source.truth
    if truth is None:
        return ["No truth was recorded, so there is no poses.txt."]
    path = kitti_path(truth, views.rig, stamps)
    if path is None:
        return ["The truth shares no time with the pictures, so there is no poses.txt."]
    (folder / "poses.txt").write_text(format_kitti(path.T_world_frame), encoding="utf-8")
    notes = ["The poses are those of the left camera since the first picture, as KITTI counts: no world, no gravity."]
    between = int(np.sum(~np.isin(stamps, truth.t_ns)))
    if between:
        gap_ms = np.diff(truth.t_ns).max() / 1e6
        notes.append(f"{between} poses lie between true ones, which are at most {gap_ms:.3g} ms apart: interpolated.")
    return notes
