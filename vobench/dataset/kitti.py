"""The layout of KITTI's odometry benchmark."""

from pathlib import Path
from typing import NamedTuple

from vobench.dataset.body import on_body
from vobench.dataset.kalibr import chain_rig, no_calibration
from vobench.dataset.kitti_calibration import read_calibration, rig_of_matrices
from vobench.dataset.kitti_folder import (
    CALIBRATION,
    COLOUR_PAIR,
    GREY_PAIR,
    PAIRS,
    POSES,
    POSES_FOLDER,
    T_BODY_GREY,
    TIMES,
    matrix_name,
)
from vobench.dataset.kitti_writer import exported_stamps, trajectory_read_back, write_kitti
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.picture_list import numbered, picture_files
from vobench.dataset.recording import CalibratedRig, Notes, ReadOptions, Recording, assemble
from vobench.dataset.rectified_view import rectified
from vobench.dataset.truth_file import truth_file
from vobench.errors import InputError
from vobench.trajectory.kitti import parse_times

TRUTH_DESCRIPTION = (
    "the trajectory of the left grey camera; its world is the first frame of this camera, with the axes rotated from "
    "x right, y down, z ahead to x ahead, y left, z up."
)

# Where the ground truth can be, as regular expressions.
POSES_IN_SEQUENCE = r"[^/]*/poses\.txt"  # 00/poses.txt
NAMED_POSES_IN_SEQUENCE = r"(?P<sequence>[^/]+)/(?P=sequence)\.txt"  # 00/00.txt
POSES_IN_POSES_FOLDER = rf"{POSES_FOLDER}/[^/]*\.txt"  # poses/00.txt
TRUTH_NAMES = "|".join([POSES_IN_SEQUENCE, NAMED_POSES_IN_SEQUENCE, POSES_IN_POSES_FOLDER])


def _is_kitti(folder: Path) -> bool:
    """Whether a folder has pictures of a left camera."""
    return any((folder / left).is_dir() for left, _ in PAIRS)


def read_kitti(folder: Path, options: ReadOptions) -> Recording:
    """Read a folder such as sequences/00. Raises InputError.

    The frame of the body has its origin in the camera of image_0; x points ahead, y left and z up.
    """
    cameras = _camera_folders(folder)
    pictures = numbered(*[folder / name for name in cameras.names])
    times = folder / TIMES
    t_ns = parse_times(read_text(times), name=str(times))
    if len(t_ns) != len(pictures[0]):
        raise InputError(f"{len(t_ns)} times for {len(pictures[0])} images in {folder / cameras.names[0]}: {times}")
    stream = picture_files(t_ns, *pictures)
    calibration = _calibrated_rig(folder, cameras.names, stream.size_px, options)

    truth, truth_notes = truth_file(
        options,
        beside=_truth_paths(folder),
        frames_ns=t_ns,
        whose=TRUTH_DESCRIPTION,
        turn=T_BODY_GREY,
    )

    known_names = [*GREY_PAIR, *COLOUR_PAIR, CALIBRATION, TIMES, POSES, _named_poses(folder)]
    notes = [
        "The body is the left grey camera, x ahead, y left, z up.",
        *cameras.notes,
        *calibration.notes,
        *truth_notes,
        *unread(folder, *known_names),
    ]
    return assemble(
        form="kitti",
        rig=calibration.rig,
        stream=stream,
        t_ns=t_ns,
        truth=truth,
        notes=notes,
        calibration=calibration.source,
    )


def _named_poses(folder: Path) -> str:
    """The name of a file of poses that has the name of the sequence, such as 00.txt."""
    return f"{folder.absolute().name}.txt"


def _truth_paths(folder: Path) -> list[Path]:
    """The files that can hold the ground truth of a sequence, in order of preference; see TRUTH_NAMES."""
    root = folder.absolute()
    poses_name = _named_poses(folder)
    beside_pictures = [root / POSES, root / poses_name]
    in_poses_folder = [parent / POSES_FOLDER / poses_name for parent in root.parents[:2]]
    return [*beside_pictures, *in_poses_folder]


class _CameraFolders(NamedTuple):
    """The names of the folders of the one or two cameras that are used, and notes on those that are not."""

    names: tuple[str, ...]
    notes: Notes


def _camera_folders(folder: Path) -> _CameraFolders:
    """The cameras that are used: a pair rather than a single camera, and grey cameras rather than colour cameras."""
    names = [*GREY_PAIR, *COLOUR_PAIR]
    present = [name for name in names if (folder / name).is_dir()]
    for pair in PAIRS:
        if set(pair) <= set(present):
            return _CameraFolders(pair, _note_on_unused(present, pair))
    for left, _ in PAIRS:
        if left in present:
            note = f"There is one camera: {left} has no partner."
            return _CameraFolders((left,), (note, *_note_on_unused(present, (left,))))
    pair_phrases = [" and ".join(pair) for pair in PAIRS]
    raise InputError(f"no folders {' or '.join(pair_phrases)} with images in {folder}")


def _note_on_unused(present: list[str], used: tuple[str, ...]) -> Notes:
    """A note on the camera folders that are present but not used; empty if all are used."""
    unused = [name for name in present if name not in used]
    if not unused:
        return ()
    return (f"The images of {' and '.join(unused)} were not used.",)


def _calibrated_rig(
    folder: Path,
    camera_folders: tuple[str, ...],
    size_px: tuple[int, int],
    options: ReadOptions,
) -> CalibratedRig:
    """The calibration of the cameras, from the Kalibr file that the options name or otherwise from calib.txt.

    `size_px` is the size of the pictures, which calib.txt does not contain.
    """
    if options.calibration is not None:
        rig, notes = chain_rig(options.calibration, len(camera_folders), T_BODY_GREY)
        return CalibratedRig(rig, str(options.calibration), notes)
    path = folder / CALIBRATION
    if not path.exists():
        raise no_calibration(path)
    return _rig_of_calib_txt(path, camera_folders, size_px)


def _rig_of_calib_txt(path: Path, camera_folders: tuple[str, ...], size_px: tuple[int, int]) -> CalibratedRig:
    """The calibration of the cameras in calib.txt. Raises InputError if a camera has no matrix."""
    matrices = read_calibration(path)
    used = [matrix_name(camera_folder) for camera_folder in camera_folders]
    for name, camera_folder in zip(used, camera_folders, strict=True):
        if name not in matrices:
            raise InputError(f"{path}: no matrix {name}, the projection matrix of {camera_folder}")
    rig = on_body(rig_of_matrices(path, matrices, used, size_px), T_BODY_GREY)
    unused = [name for name in matrices if name not in used]
    if not unused:
        return CalibratedRig(rig, str(path), notes=())
    note = f"{', '.join(unused)} of {CALIBRATION} were not used."
    return CalibratedRig(rig, str(path), notes=(note,))


LAYOUTS = (
    Layout(
        name="kitti",
        known_by="KITTI odometry: image_0/ or image_2/",
        sniff=_is_kitti,
        read=read_kitti,
        heeds=frozenset({"calibration", "truth"}),
        writing=Writing(write_kitti, views=rectified, stamps=exported_stamps, path=trajectory_read_back),
        truth=TRUTH_NAMES,
    ),
)
