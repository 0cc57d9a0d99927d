"""Reads and writes recordings in the layout of the TUM RGB-D benchmark."""

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.kalibr import chain_rig, find_chain, no_calibration
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.picture_list import listed_pictures, picture_files
from vobench.dataset.png_frame import png_frames
from vobench.dataset.recording import CalibratedRig, ReadOptions, Recording, assemble
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource
from vobench.dataset.truth_file import truth_file
from vobench.geometry.camera import BrownConrady, Camera, Pinhole
from vobench.geometry.rig import Rig
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import Floats, Ids
from vobench.sequence import read_truth_frames
from vobench.sequence.picture import write_png
from vobench.trajectory.stamp_text import format_seconds
from vobench.trajectory.tum import format_tum

LIST = "rgb.txt"
TRUTH = "groundtruth.txt"
DEPTH = "depth.txt"
# The colour cameras of the three robots, 640 x 480. Source: the benchmark's page "File Formats".
CAMERAS: dict[str, Camera] = {
    "freiburg1": BrownConrady(640, 480, 517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
    "freiburg2": BrownConrady(640, 480, 520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
    "freiburg3": Pinhole(640, 480, 535.4, 539.2, 320.1, 247.6),
}
ROBOT = re.compile(r"(?:freiburg|fr)_?([123])(?![0-9])", re.IGNORECASE)
TITLE_LINES = 3  # the number of comments at the start of rgb.txt, which name the original bag


def _is_tum(folder: Path) -> bool:
    return (folder / LIST).is_file()


def read_tum(folder: Path, options: ReadOptions) -> Recording:
    """Read a folder that contains rgb.txt. The body is the camera. Raises InputError with the file."""
    (pictures,), absence_notes = listed_pictures((folder / LIST, folder), separator=None, unit="s")
    stream = picture_files(pictures.t_ns, pictures.paths)
    calibration = _rig(folder, options)
    truth, truth_notes = truth_file(options, [folder / TRUTH], pictures.t_ns, "of the camera.")

    notes = ["There is one camera, and it is the body: x right, y down, z ahead."]
    notes += [*absence_notes, *calibration.notes, *truth_notes]
    if (folder / DEPTH).exists():
        notes.append("Depth images were dropped.")
    notes += unread(folder, LIST, TRUTH, "rgb", DEPTH, "depth", Path(calibration.source).name)
    return assemble(
        "tum", calibration.rig, stream, pictures.t_ns, truth=truth, notes=notes, calibration=calibration.source
    )


def _rig(folder: Path, options: ReadOptions) -> CalibratedRig:
    chain = find_chain(folder, options)
    if chain is not None:
        rig, notes = chain_rig(chain, 1, np.eye(4))
        return CalibratedRig(rig, str(chain), notes)

    first_lines = read_text(folder / LIST).splitlines()[:TITLE_LINES]
    title = " ".join(line for line in first_lines if line.startswith("#"))
    match = ROBOT.search(folder.resolve().name) or ROBOT.search(title)
    if match is None:
        raise no_calibration(folder / "camchain.yaml")
    robot = f"freiburg{match[1]}"
    rig = Rig(CAMERAS[robot], None, np.eye(4), None)
    note = f"The calibration is the one that the benchmark publishes for {robot}'s colour camera."
    return CalibratedRig(rig, f"{robot}'s published one", (note,))


DEPTH_PER_M = 5000  # 16-bit grey values; 0 is unknown
FARTHEST_M = 65535 / DEPTH_PER_M
DEPTH_TOPIC = "depth"


def _left_view(rig: Rig) -> Views:
    return Views(replace(rig, right=None, T_body_right=None))


def write_tum(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Write pictures, depth, readings and trajectory to a folder, and return notes on what was converted.

    Raises SequenceError for an equirectangular camera.
    """
    kalibr.intrinsics(views.rig.left)  # the layout can represent a lens only in camchain.yaml
    notes = ["TUM's layout has one camera: the right one was left out."] if source.rig.right else []
    (folder / "rgb").mkdir()
    stamps = []
    for frame in png_frames(source.sequence, views):
        path = folder / _picture_name("rgb", frame.t_ns)
        path.write_bytes(frame.pictures["left"])
        stamps.append(frame.t_ns)
    names = [_picture_name("rgb", t_ns) for t_ns in stamps]
    _write_table(folder / LIST, "color images", "filename", stamps, names)
    notes.append("The images are grey. Stamps have 9 decimals, where TUM's own have 6, so that none is rounded.")
    notes += _write_depth(source, folder)
    if source.imu:
        notes += _write_imu(source.imu, folder)

    if source.truth is None:
        return [*notes, "No truth was recorded, so there is no groundtruth.txt."]
    poses = format_tum(source.truth.of_mounted(views.rig.T_body_left))
    text = f"# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n{poses}"
    (folder / TRUTH).write_text(text, encoding="utf-8")
    return [*notes, "groundtruth.txt is the path of the left camera in the world, as in TUM's data sets."]


def _picture_name(folder_name: str, t_ns: int) -> str:
    return f"{folder_name}/{format_seconds(t_ns)}.png"


def _write_depth(source: ExportSource, folder: Path) -> list[str]:
    """Write depth/ and depth.txt if depth was recorded, and return notes."""
    if DEPTH_TOPIC not in source.channels:
        return []
    if source.true_rig.left.depth_along != "axis":
        return ["The depth along rays was dropped: TUM's is along the optical axis."]

    (folder / DEPTH_TOPIC).mkdir()
    stamps = []
    beyond = 0  # pixels
    known = 0  # pixels
    for frame in read_truth_frames(source.folder, (DEPTH_TOPIC,)):
        depth_m = frame.left.depth
        if depth_m is None:
            continue
        write_png(folder / _picture_name(DEPTH_TOPIC, frame.t_ns), depth_values(depth_m))
        stamps.append(frame.t_ns)
        beyond += int(np.sum(depth_m > FARTHEST_M))
        known += int(np.isfinite(depth_m).sum())

    names = [_picture_name(DEPTH_TOPIC, t_ns) for t_ns in stamps]
    _write_table(folder / DEPTH, "depth maps", "filename", stamps, names)
    step_mm = 1e3 / DEPTH_PER_M
    beyond_share = beyond / max(known, 1)
    return [
        f"Depth is the true one in steps of {step_mm:g} mm ({DEPTH_PER_M} values a metre) up to "
        f"{FARTHEST_M:.3f} m; {beyond_share:.1%} of it lies farther away and is 0, unknown."
    ]


def depth_values(depth_m: Floats) -> Ids:
    """The 16-bit values (H, W) of depths in metres; 0 if a depth is unknown, not positive or too large."""
    is_known = np.isfinite(depth_m) & (depth_m > 0) & (depth_m <= FARTHEST_M)
    known_m = np.where(is_known, depth_m, 0.0).astype(float)
    values: Ids = np.rint(known_m * DEPTH_PER_M).astype(np.uint16)
    return values


def _write_imu(imu: ImuReadings, folder: Path) -> list[str]:
    accel_rows = [_row(values) for values in imu.accel_mps2.tolist()]
    gyro_rows = [_row(values) for values in imu.gyro_radps.tolist()]
    rows = [f"{gyro} {accel}" for gyro, accel in zip(gyro_rows, accel_rows, strict=True)]
    t_ns = imu.t_ns.tolist()
    _write_table(folder / "accelerometer.txt", "accelerometer data", "ax ay az", t_ns, accel_rows)
    _write_table(folder / "imu.txt", "IMU data", "wx wy wz ax ay az", t_ns, rows)
    return [
        "accelerometer.txt is in the IMU's axes. TUM has no file for a gyroscope: imu.txt, with both, is an addition."
    ]


def _row(values: list[float]) -> str:
    return " ".join(map(repr, values))


def _write_table(
    path: Path,
    what: str,
    columns: str,
    t_ns: Iterable[int],
    rows: Iterable[str],
) -> None:
    lines = [f"{format_seconds(t)} {row}\n" for t, row in zip(t_ns, rows, strict=True)]
    header = f"# {what}\n# file: vobench\n# timestamp {columns}\n"
    path.write_text(header + "".join(lines), encoding="utf-8")


LAYOUTS = (
    Layout(
        "tum",
        "TUM RGB-D: rgb.txt",
        _is_tum,
        read_tum,
        frozenset({"calibration", "truth"}),
        Writing(write_tum, _left_view, keeps=("imu", DEPTH_TOPIC)),
        r"[^/]*/groundtruth[^/]*\.txt",
    ),
)
