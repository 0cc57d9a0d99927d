"""Reads and writes recordings in the layout of KITTI's odometry benchmark."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.body import MountedCamera, mounted_rig, on_body
from vobench.dataset.kalibr import chain_rig, no_calibration
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.picture_list import numbered, picture_files
from vobench.dataset.recording import CalibratedRig, Notes, ReadOptions, Recording, assemble
from vobench.dataset.source import ExportSource, Views, png_frames, rectified
from vobench.dataset.truth_file import truth_file
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, looking, projection
from vobench.geometry.se3 import Array
from vobench.trajectory.kitti import format_kitti, format_times, parse_times
from vobench.trajectory.nanoseconds import NS_PER_MS
from vobench.trajectory.text_table import Line, content_lines, read_table
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

GREY_PAIR = ("image_0", "image_1")
COLOUR_PAIR = ("image_2", "image_3")
PAIRS = (GREY_PAIR, COLOUR_PAIR)  # in order of preference
CALIBRATION = "calib.txt"
TIMES = "times.txt"
POSES = "poses.txt"
T_BODY_GREY = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))
TRUTH = (
    "the trajectory of the left grey camera; its world is the first frame of this camera, with the axes rotated from "
    "x right, y down, z ahead to x ahead, y left, z up."
)
FIRST_SIZE_PX = (1241, 376)  # the pictures of sequences 00 to 02
MOST_OFF_CENTER = 0.1  # the largest offset of the principal point from the centre, as a share of the picture's size
SKEW_TOLERANCE = 1e-6  # the largest error of an element of K that should be 0 or 1; KITTI prints seven digits


def _is_kitti(folder: Path) -> bool:
    return any((folder / left).is_dir() for left, _ in PAIRS)


def read_kitti(folder: Path, options: ReadOptions) -> Recording:
    """Read a folder such as sequences/00. Raises InputError.

    The frame of the body has its origin in the camera of image_0; x points ahead, y left and z up.
    """
    names, pair_notes = _pair(folder)
    cameras = numbered(*(folder / name for name in names))
    times = folder / TIMES
    t_ns = parse_times(read_text(times), name=str(times))
    if len(t_ns) != len(cameras[0]):
        raise InputError(f"{len(t_ns)} times for {len(cameras[0])} pictures in {folder / names[0]}: {times}")
    stream = picture_files(t_ns, *cameras)
    calibration = _calibrated_rig(folder, names, stream.size_px, options)

    root = folder.absolute()
    poses_name = f"{root.name}.txt"
    truth_paths = [root / POSES, root / poses_name]
    truth_paths += [parent / "poses" / poses_name for parent in root.parents[:2]]
    truth, truth_notes = truth_file(options, truth_paths, t_ns, TRUTH, T_BODY_GREY)

    notes = ["The body is the left grey camera, x ahead, y left, z up."]
    notes += [*pair_notes, *calibration.notes, *truth_notes]
    notes += unread(folder, *GREY_PAIR, *COLOUR_PAIR, CALIBRATION, TIMES, POSES, poses_name)
    return assemble("kitti", calibration.rig, stream, t_ns, truth=truth, notes=notes, calibration=calibration.source)


def _pair(folder: Path) -> tuple[tuple[str, ...], Notes]:
    """The folders of the cameras that are used, and notes on them.

    A pair is preferred to a single camera, and grey cameras are preferred to colour cameras.
    """
    names = [*GREY_PAIR, *COLOUR_PAIR]
    present = [name for name in names if (folder / name).is_dir()]
    for pair in PAIRS:
        if set(pair) <= set(present):
            return pair, _note_on_unused(present, pair)
    for left, _ in PAIRS:
        if left in present:
            note = f"There is one camera: {left} has no partner."
            return (left,), (note, *_note_on_unused(present, (left,)))
    pair_phrases = [" and ".join(pair) for pair in PAIRS]
    raise InputError(f"no folders {' or '.join(pair_phrases)} with pictures in {folder}")


def _note_on_unused(present: list[str], used: tuple[str, ...]) -> Notes:
    """A note on the camera folders that are present but not used; empty if all are used."""
    unused = [name for name in present if name not in used]
    return (f"The pictures of {' and '.join(unused)} were dropped.",) if unused else ()


def _calibrated_rig(
    folder: Path,
    names: tuple[str, ...],
    size_px: tuple[int, int],
    options: ReadOptions,
) -> CalibratedRig:
    """The calibration of the cameras, from the Kalibr file that the options name or otherwise from calib.txt.

    `size_px` is the size of the pictures, which calib.txt does not contain.
    """
    if options.calibration is not None:
        rig, notes = chain_rig(options.calibration, len(names), T_BODY_GREY)
        return CalibratedRig(rig, str(options.calibration), notes)
    path = folder / CALIBRATION
    if not path.exists():
        raise no_calibration(path)

    matrices = read_calibration(path)
    matrix_names = [_matrix_name(folder_name) for folder_name in names]
    for matrix_name, folder_name in zip(matrix_names, names, strict=True):
        if matrix_name not in matrices:
            raise InputError(f"{path}: no matrix {matrix_name}, the projection matrix of {folder_name}")
    rig = on_body(_rig(path, matrices, matrix_names, size_px), T_BODY_GREY)
    unused = [name for name in matrices if name not in matrix_names]
    notes = (f"{', '.join(unused)} of {CALIBRATION} were not used.",) if unused else ()
    return CalibratedRig(rig, str(path), notes)


def _matrix_name(folder_name: str) -> str:
    """The name in calib.txt of the projection matrix of a camera; image_0 has P0."""
    return f"P{folder_name[-1]}"


def read_pair(path: Path, size_px: tuple[int, int] | None = None) -> Rig:
    """The stereo pair in a calib.txt: P0 and P1 if it has both, otherwise P2 and P3. The body is the camera of P0.

    Without `size_px`, pictures have the size of KITTI's first sequences.
    Raises InputError if the file is not valid, or if its principal point does not fit the assumed size.
    """
    matrices = read_calibration(path)
    matrix_names = _matrix_pair(path, matrices)
    rig = _rig(path, matrices, matrix_names, size_px or FIRST_SIZE_PX)
    if size_px is not None:
        return rig
    center_px = rig.left.K[:2, 2]
    off_center = np.abs(center_px / FIRST_SIZE_PX - 0.5).max()
    if off_center > MOST_OFF_CENTER:
        width, height = FIRST_SIZE_PX
        raise InputError(
            f"{path}: {matrix_names[0]} has its principal point at {center_px.tolist()}, so pictures do not have "
            f"KITTI's size of {width} x {height}; pass size_px"
        )
    return rig


def _matrix_pair(path: Path, matrices: dict[str, Array]) -> list[str]:
    """The names of the matrices of the preferred pair. Raises InputError if there is no pair."""
    for pair in PAIRS:
        matrix_names = [_matrix_name(folder_name) for folder_name in pair]
        if matrices.keys() >= set(matrix_names):
            return matrix_names
    present = ", ".join(matrices) or "none"
    raise InputError(f"{path}: a pair needs P0 and P1, or P2 and P3; the file has {present}")


def _rig(
    path: Path,
    matrices: dict[str, Array],
    names: list[str],
    size_px: tuple[int, int],
) -> Rig:
    cameras = [_camera(matrices[name], size_px, f"{path}: {name}") for name in names]
    return mounted_rig(*cameras)


def read_calibration(path: Path) -> dict[str, Array]:
    """The matrices (3, 4) of a calib.txt by name. Raises InputError with the number of an invalid line."""
    matrix_lines: dict[str, Line] = {}
    for line in content_lines(read_text(path)):
        place = f"{path}:{line.number}"
        label, colon, numbers = line.text.partition(":")
        if not colon:
            example = "`P0: 718.9 0 607.2 ...`"
            raise InputError(f"{place}: a line should be a name, a colon and a matrix, as in {example}")
        name = label.strip()
        if name in matrix_lines:
            raise InputError(f"{place}: {name} should occur once, but is also in line {matrix_lines[name].number}")
        if name.startswith(("P", "T")):
            matrix_lines[name] = Line(line.number, numbers)
    columns = [f"{row}{column}" for row in range(3) for column in range(4)]
    table = read_table(list(matrix_lines.values()), name=str(path), columns=columns, row="a matrix")
    matrices = table.values.reshape(-1, 3, 4)
    return dict(zip(matrix_lines, matrices, strict=True))


def _camera(
    P: Array,
    size_px: tuple[int, int],
    place: str,
) -> MountedCamera:
    """The camera with the projection matrix P = K [1 | t] (3, 4), which projects points in the frame of the body."""
    K = P[:, :3]
    below_diagonal = [*K[1:, 0], K[2, 1]]
    deviations = np.abs([K[0, 1], *below_diagonal, K[2, 2] - 1])  # from the form fx 0 cx / 0 fy cy / 0 0 1
    is_rectified = deviations.max() <= SKEW_TOLERANCE
    has_focal_lengths = K[0, 0] > 0 and K[1, 1] > 0
    if not (is_rectified and has_focal_lengths):
        raise InputError(f"{place} should be a rectified camera, fx 0 cx / 0 fy cy / 0 0 1, but is {K.tolist()}")
    fx, fy, cx, cy = K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    position_m = -np.linalg.solve(K, P[:, 3])
    return MountedCamera(Pinhole(*size_px, fx, fy, cx, cy), se3.transform(np.eye(3), position_m))


def write_kitti(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Write pictures, calibration, times and poses to a folder, and return notes on what was converted."""
    is_exported = _is_exported(source)
    stamps = _exported_stamps(source)
    for index in range(len(views.rig.sides)):
        (folder / f"image_{index}").mkdir()
    frames = (frame for frame in png_frames(source.sequence, views) if is_exported[frame.index])
    for number, frame in enumerate(frames):
        for index, picture in enumerate(frame.pictures.values()):
            path = folder / f"image_{index}" / f"{number:06d}.png"
            path.write_bytes(picture)
    (folder / CALIBRATION).write_text(_calibration_text(views.rig), encoding="utf-8")
    (folder / TIMES).write_text(format_times(stamps), encoding="utf-8")

    notes = _picture_notes(source, views)
    omitted = np.sum(~is_exported)
    if omitted:
        notes.append(f"{omitted} of {len(is_exported)} frames lie before or after the truth and were left out.")
    return notes + _write_poses(source, views, stamps, folder)


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


def _exported_stamps(source: ExportSource) -> Stamps:
    """The stamps of the frames that are exported."""
    return source.sequence.frame_stamps()[_is_exported(source)]


def kitti_path(
    truth: Trajectory,
    rig: Rig,
    stamps: Stamps,
) -> Trajectory | None:
    """The poses of the left camera at stamps (N,) in the frame of the first of them, as in KITTI.

    None if no stamp is within the time span of the truth.
    """
    if not _is_within(truth, stamps).any():
        return None
    T_world_left = poses_at(truth, stamps) @ rig.T_body_left
    T_first_left = se3.inverse(T_world_left[:1]) @ T_world_left
    return Trajectory(stamps, T_first_left)


def _calibration_text(rig: Rig) -> str:
    """The text of calib.txt: a line for each of P0 and P1 (3, 4), which project points in the left camera's frame."""
    positions_m = [0.0, rig.baseline_m] if rig.right else [0.0]
    lines = []
    for index, position_m in enumerate(positions_m):
        P = projection(rig.left.K, position_m) + 0.0  # turns -0.0 into 0.0
        numbers = " ".join(map(repr, P.ravel().tolist()))
        lines.append(f"P{index}: {numbers}\n")
    return "".join(lines)


def _picture_notes(source: ExportSource, views: Views) -> list[str]:
    """Notes on how the exported pictures differ from the recorded ones."""
    is_pair = views.rig.right is not None
    if views.source_px is None:
        return ["The pair was recorded rectified, so its pixels are unchanged."] if is_pair else []
    dark_shares = [views.dark_share(side, source.rig.camera(side)) for side in views.rig.sides]
    dark = max(dark_shares)
    dark_note = f"; up to {dark:.1%} of a picture is black, because it was not recorded" if dark else ""
    return [
        "KITTI needs rectified pictures: these were resampled, with linear interpolation between pixels, "
        f"which loses detail{dark_note}."
    ]


def _write_poses(
    source: ExportSource,
    views: Views,
    stamps: Stamps,
    folder: Path,
) -> list[str]:
    """Write the poses at stamps (N,) to poses.txt if there is a truth, and return notes on them."""
    truth = source.truth
    if truth is None:
        return ["No truth was recorded, so there is no poses.txt."]
    path = kitti_path(truth, views.rig, stamps)
    if path is None:
        return ["No picture lies within the truth's time, so there is no poses.txt."]
    (folder / POSES).write_text(format_kitti(path.T_world_frame), encoding="utf-8")

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


def _path_read_back(
    source: ExportSource,
    rig: Rig,
    stamps: Stamps,
) -> Trajectory | None:
    """The trajectory of the left camera in the world that `read_kitti` defines."""
    path = kitti_path(source.truth, rig, stamps) if source.truth else None
    if path is None:
        return None
    return Trajectory(path.t_ns, T_BODY_GREY @ path.T_world_frame)


# Truth beside the pictures, in a file of that name or of the name of its folder, or in the folder `poses`.
TRUTH_NAMES = r"[^/]*/poses\.txt|(?P<sequence>[^/]+)/(?P=sequence)\.txt|poses/[^/]*\.txt"
LAYOUTS = (
    Layout(
        "kitti",
        "KITTI odometry: image_0/ or image_2/",
        _is_kitti,
        read_kitti,
        frozenset({"calibration", "truth"}),
        Writing(write_kitti, rectified, _exported_stamps, _path_read_back),
        TRUTH_NAMES,
    ),
)
