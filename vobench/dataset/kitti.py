"""The layout of KITTI's odometry benchmark, read and written."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.kalibr import chain_rig, no_calibration, on_body, rig_of
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.recording import Notes, ReadOptions, Recording, assemble, numbered, picture_files, truth_file
from vobench.dataset.source import ExportSource, Views, png_frames, rectified
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, looking, projection
from vobench.geometry.se3 import Array
from vobench.trajectory.formats import content, format_kitti, format_times, parse_times, read_table
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

PAIRS = (("image_0", "image_1"), ("image_2", "image_3"))  # grey, colour
CALIBRATION = "calib.txt"
TIMES = "times.txt"
POSES = "poses.txt"
T_BODY_GREY = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))
TRUTH = (
    "of the left grey camera; its world is that camera at the start, turned from "
    "x right, y down, z ahead to x ahead, y left, z up."
)
# sequences 00 to 02; a share of the size
USUAL_PX = (1241, 376)
MOST_OFF_CENTER = 0.1
SKEW_TOLERANCE = 1e-6  # of KITTI's seven digits: K's lower triangle is zero


def read_kitti(folder: Path, options: ReadOptions) -> Recording:
    """A folder such as sequences/00; the body is the camera of image_0, its axes ahead, left, up. Raises InputError."""
    names, pair_notes = _pair(folder)
    eyes = numbered(*(folder / name for name in names))
    times = folder / TIMES
    t_ns = parse_times(read_text(times), name=str(times))
    if len(t_ns) != len(eyes[0]):
        raise InputError(f"{len(t_ns)} times for {len(eyes[0])} pictures in {folder / names[0]}: {times}")
    stream = picture_files(t_ns, *eyes)
    rig, calibration, lens_notes = _rig(folder, names, stream.size_px, options)
    named = f"{folder.absolute().name}.txt"
    root = folder.absolute()
    beside = (root / POSES, root / named, *(up / "poses" / named for up in root.parents[:2]))
    truth, truth_notes = truth_file(options, beside, t_ns, TRUTH, T_BODY_GREY)
    notes = ("The body is the left grey camera, x ahead, y left, z up.", *pair_notes, *lens_notes, *truth_notes)
    notes += unread(folder, *PAIRS[0], *PAIRS[1], CALIBRATION, TIMES, POSES, named)
    return assemble("kitti", rig, stream, t_ns, truth=truth, notes=notes, calibration=str(calibration))


def _pair(folder: Path) -> tuple[tuple[str, ...], Notes]:
    """The folders of the eyes: grey ones before colour ones, two before one."""
    there = [tuple(name for name in pair if (folder / name).is_dir()) for pair in PAIRS]
    whole = [pair for pair in PAIRS if pair in there]
    if whole:
        others = [name for pair in there for name in pair if name not in whole[0]]
        return whole[0], ((f"The pictures of {' and '.join(others)} were dropped.",) if others else ())
    single = next((pair[:1] for pair in PAIRS if pair[0] in there[0] + there[1]), None)
    if single is None:
        wanted = " or ".join(" and ".join(pair) for pair in PAIRS)
        raise InputError(f"no folders {wanted} with pictures in {folder}")
    return single, (f"There is one camera: {single[0]} has no partner.",)


def _rig(
    folder: Path, names: tuple[str, ...], size_px: tuple[int, int], options: ReadOptions
) -> tuple[Rig, Path, Notes]:
    """The cameras by calib.txt, which knows no picture's size, or by Kalibr's chain; and which file that was."""
    if options.calibration is not None:
        rig, notes = chain_rig(options.calibration, len(names), T_BODY_GREY)
        return rig, options.calibration, notes
    path = folder / CALIBRATION
    if not path.exists():
        raise no_calibration(path)
    matrices = read_calibration(path)
    needed = [f"P{name[-1]}" for name in names]
    missing = [name for name in needed if name not in matrices]
    if missing:
        raise InputError(f"{path}: no matrix {missing[0]}, which is that of {names[needed.index(missing[0])]}")
    rig = _of_matrices(path, matrices, needed, size_px)
    others = ", ".join(name for name in matrices if name not in needed)
    return on_body(rig, T_BODY_GREY), path, (f"{others} of {CALIBRATION} were not used.",) if others else ()


def read_pair(path: Path, size_px: tuple[int, int] | None = None) -> Rig:
    """The pair of calib.txt alone: P0 and P1 where they are there, else P2 and P3; the body is the first camera of all.

    Without a size the pictures are as KITTI's first ones. Raises InputError, also where they cannot be.
    """
    matrices = read_calibration(path)
    pairs = [[f"P{name[-1]}" for name in pair] for pair in PAIRS]
    needed = next((names for names in pairs if matrices.keys() >= set(names)), None)
    if needed is None:
        raise InputError(f"{path}: a pair is P0 and P1, or P2 and P3, and there is {', '.join(matrices) or 'none'}")
    rig = _of_matrices(path, matrices, needed, size_px or USUAL_PX)
    center_px = rig.left.K[:2, 2]
    if size_px is None and np.abs(center_px / USUAL_PX - 0.5).max() > MOST_OFF_CENTER:
        raise InputError(
            f"{path}: {needed[0]} has its centre at {center_px.tolist()}, so pictures are not {USUAL_PX[0]} x "
            f"{USUAL_PX[1]} as KITTI's are; give size_px"
        )
    return rig


def _of_matrices(path: Path, matrices: dict[str, Array], needed: list[str], size_px: tuple[int, int]) -> Rig:
    return rig_of(*(_camera(matrices[name], size_px, f"{path}: {name}") for name in needed))


def read_calibration(path: Path) -> dict[str, Array]:
    """The matrices (3, 4) of calib.txt by name. Raises TrajectoryError naming the line that is none."""
    rows = [(line, *body.partition(":")) for line, body in content(read_text(path))]
    odd = next((line for line, _, colon, _ in rows if not colon), None)
    if odd is not None:
        raise InputError(f"{path}:{odd}: a line should be a name, a colon and a matrix, as in `P0: 718.9 0 607.2 ...`")
    named = [(line, name.strip(), rest) for line, name, _, rest in rows if name.strip()[:1] in "PT"]
    columns = tuple(f"{row}{column}" for row in range(3) for column in range(4))
    table = read_table([(line, rest) for line, _, rest in named], name=str(path), columns=columns, row="a matrix")
    return {name: values.reshape(3, 4) for (_, name, _), values in zip(named, table.values, strict=True)}


def _camera(P: Array, size_px: tuple[int, int], place: str) -> tuple[Pinhole, Array]:
    """A pinhole K and its place T_body_camera, of P = K [1 | t] where the body is what P takes points from."""
    K = P[:, :3]
    upright = np.abs([K[0, 1], *K[1:, 0], K[2, 1], K[2, 2] - 1]).max() <= SKEW_TOLERANCE
    if not (upright and K[0, 0] > 0 and K[1, 1] > 0):
        raise InputError(f"{place} should be a rectified camera, fx 0 cx / 0 fy cy / 0 0 1, but is {K.tolist()}")
    camera = Pinhole(*size_px, float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))
    return camera, se3.transform(np.eye(3), -np.linalg.solve(K, P[:, 3]))


def write_kitti(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Fill `folder` and say what was converted."""
    stamps = source.sequence.frame_stamps()
    kept = _covered(source)
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


def _covered(source: ExportSource) -> NDArray[np.bool_]:
    """Which frames (N,) the layout can have: those within the truth's time; all where there is no truth for any."""
    stamps = source.sequence.frame_stamps()
    truth = source.truth
    within = np.zeros(len(stamps), bool)
    if truth is not None:
        within = (stamps >= truth.t_ns[0]) & (stamps <= truth.t_ns[-1])
    return within if within.any() else ~within


def kitti_path(truth: Trajectory, rig: Rig, stamps: Stamps) -> Trajectory | None:
    """The left camera's poses at some stamps, since the first of them, as KITTI counts; None outside the truth."""
    if stamps[-1] < truth.t_ns[0] or stamps[0] > truth.t_ns[-1]:
        return None
    T_world_left = poses_at(truth, stamps) @ rig.T_body_left
    return Trajectory(stamps, se3.inverse(T_world_left[:1]) @ T_world_left)


def _calibration(rig: Rig) -> str:
    """P0 and P1, each (3, 4) in a row: what sends points in the left camera's axes to pixels."""
    shifts_m = [0.0, rig.baseline_m] if rig.right else [0.0]
    rows = [(projection(rig.left.K, shift_m) + 0.0).ravel().tolist() for shift_m in shifts_m]  # no -0.0
    return "".join(f"P{index}: {' '.join(map(repr, row))}\n" for index, row in enumerate(rows))


def _picture_notes(source: ExportSource, views: Views) -> list[str]:
    if views.source_px is None:
        return ["The pair is rectified as it was recorded, so its pixels are unchanged."] if views.rig.right else []
    dark = max(views.dark_share(side, source.rig.camera(side)) for side in views.rig.sides)
    rest = f"; up to {dark:.1%} of a picture shows nothing and is black" if dark else ""
    return [f"KITTI means rectified pictures: these were resampled, linear between pixels, which loses detail{rest}."]


def _write_poses(source: ExportSource, views: Views, stamps: Stamps, folder: Path) -> list[str]:
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


def _path_read_back(source: ExportSource, rig: Rig, stamps: Stamps) -> Trajectory | None:
    path = kitti_path(source.truth, rig, stamps) if source.truth else None
    return path and Trajectory(path.t_ns, T_BODY_GREY @ path.T_world_frame)


LAYOUTS = (
    Layout(
        "kitti",
        "KITTI odometry: image_0/ or image_2/",
        lambda path: any((path / left).is_dir() for left, _ in PAIRS),
        read_kitti,
        frozenset({"calibration", "truth"}),
        Writing(write_kitti, rectified, lambda s: s.sequence.frame_stamps()[_covered(s)], _path_read_back),
    ),
)
