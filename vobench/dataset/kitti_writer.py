"""Writes sequences in the layout of KITTI's odometry benchmark."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.kitti_calibration import format_calibration
from vobench.dataset.kitti_folder import CALIBRATION, POSES, T_BODY_GREY, TIMES
from vobench.dataset.png_frame import png_frames
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.trajectory.kitti import format_kitti, format_times
from vobench.trajectory.nanoseconds import NS_PER_MS
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at


def write_kitti(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Write pictures, calibration, times and poses to a folder, and return notes on what was converted."""
    is_exported = _is_exported(source)
    stamps = source.sequence.frame_stamps()[is_exported]
    _write_pictures(source, views, is_exported, folder)
    (folder / CALIBRATION).write_text(format_calibration(views.rig), encoding="utf-8")
    (folder / TIMES).write_text(format_times(stamps), encoding="utf-8")
    pose_notes = _write_poses(source, views.rig, stamps, folder)

    notes = _picture_notes(source, views)
    omitted = np.sum(~is_exported)
    if omitted:
        notes.append(f"{omitted} of {len(is_exported)} frames lie before or after the truth and were left out.")
    return notes + pose_notes


def exported_stamps(source: ExportSource) -> Stamps:
    """The stamps of the frames that are exported."""
    return source.sequence.frame_stamps()[_is_exported(source)]


def _is_exported(source: ExportSource) -> NDArray[np.bool_]:
    """Which frames (N,) are exported: those within the time span of the truth, or all frames if none is within it."""
    stamps = source.sequence.frame_stamps()
    all_frames = np.ones(len(stamps), bool)
    if source.truth is None:
        return all_frames
    is_within = _is_within(source.truth, stamps)
    return is_within if is_within.any() else all_frames


def _is_within(truth: Trajectory, stamps: Stamps) -> NDArray[np.bool_]:
    """Which stamps (N,) are neither before the first true pose nor after the last one."""
    is_within: NDArray[np.bool_] = (stamps >= truth.t_ns[0]) & (stamps <= truth.t_ns[-1])
    return is_within


def _write_pictures(source: ExportSource, views: Views, is_exported: NDArray[np.bool_], folder: Path) -> None:
    """Write the pictures of the exported frames (N,) to image_0 and image_1, numbered from 0."""
    for index in range(len(views.rig.sides)):
        (folder / f"image_{index}").mkdir()
    frames = (frame for frame in png_frames(source.sequence, views) if is_exported[frame.index])
    for number, frame in enumerate(frames):
        for index, picture in enumerate(frame.pictures.values()):
            path = folder / f"image_{index}" / f"{number:06d}.png"
            path.write_bytes(picture)


def _picture_notes(source: ExportSource, views: Views) -> list[str]:
    """Notes on how the exported pictures differ from the recorded ones."""
    is_pair = views.rig.right is not None
    if views.source_px is None:
        return ["The pair was recorded rectified, so its pixels are unchanged."] if is_pair else []
    dark_shares = [views.dark_share(side, source.rig.camera(side)) for side in views.rig.sides]
    dark = max(dark_shares)
    dark_note = f"; up to {dark:.1%} of an image is black, because it was not recorded" if dark else ""
    return [
        "KITTI needs rectified images: these were resampled, with linear interpolation between pixels, "
        f"which loses detail{dark_note}."
    ]


def _write_poses(source: ExportSource, rig: Rig, stamps: Stamps, folder: Path) -> list[str]:
    """Write the poses at stamps (N,) to poses.txt if there is a truth, and return notes on them."""
    truth = source.truth
    if truth is None:
        return ["No truth was recorded, so there is no poses.txt."]
    trajectory = left_camera_trajectory(truth, rig, stamps)
    if trajectory is None:
        return ["No image lies within the time span of the truth, so there is no poses.txt."]
    (folder / POSES).write_text(format_kitti(trajectory.T_world_frame), encoding="utf-8")

    notes = [
        "As in KITTI, the poses are those of the left camera relative to its first pose; the world frame and the "
        "direction of gravity are not exported."
    ]
    is_between = ~np.isin(stamps, truth.t_ns)
    interpolated = int(np.sum(is_between))
    if interpolated:
        gap_ms = np.diff(truth.t_ns).max() / NS_PER_MS
        notes.append(
            f"{interpolated} poses were interpolated between true poses that are at most {gap_ms:.3g} ms apart."
        )
    return notes


def left_camera_trajectory(truth: Trajectory, rig: Rig, stamps: Stamps) -> Trajectory | None:
    """The poses of the left camera at stamps (N,) in the frame of the first of them, as in KITTI.

    None if no stamp is within the time span of the truth.
    """
    if not _is_within(truth, stamps).any():
        return None
    T_world_left = poses_at(truth, stamps) @ rig.T_body_left
    T_first_left = se3.inverse(T_world_left[:1]) @ T_world_left
    return Trajectory(stamps, T_first_left)


def trajectory_read_back(source: ExportSource, rig: Rig, stamps: Stamps) -> Trajectory | None:
    """The trajectory of the left camera in the world that `read_kitti` defines; None if no poses are exported."""
    if source.truth is None:
        return None
    trajectory = left_camera_trajectory(source.truth, rig, stamps)
    if trajectory is None:
        return None
    return Trajectory(trajectory.t_ns, T_BODY_GREY @ trajectory.T_world_frame)
