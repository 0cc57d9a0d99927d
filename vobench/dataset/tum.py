"""The layout of the TUM RGB-D benchmark, read and written."""

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.kalibr import chain_rig, find_chain, no_calibration
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.recording import (
    Notes,
    ReadOptions,
    Recording,
    assemble,
    listed_pictures,
    picture_files,
    truth_file,
)
from vobench.dataset.source import ExportSource, Views, png_frames
from vobench.geometry.camera import BrownConrady, Camera, Pinhole
from vobench.geometry.rig import Rig
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import Floats, Ids
from vobench.sequence import read_truth_frames
from vobench.sequence.picture import write_png
from vobench.trajectory.formats import format_tum, seconds

LIST = "rgb.txt"
TRUTH = "groundtruth.txt"
DEPTH = "depth.txt"
# The colour cameras of the three robots, 640 x 480. Source: the benchmark's page "File Formats".
CAMERAS: dict[str, Camera] = {
    "freiburg1": BrownConrady(640, 480, 517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
    "freiburg2": BrownConrady(640, 480, 520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
    "freiburg3": Pinhole(640, 480, 535.4, 539.2, 320.1, 247.6),
}
WHICH = re.compile(r"(?:freiburg|fr)_?([123])(?![0-9])", re.IGNORECASE)


def read_tum(folder: Path, options: ReadOptions) -> Recording:
    """A folder with rgb.txt; the body is its camera. Raises InputError, one sentence, naming the file."""
    (pictures,), missing = listed_pictures((folder / LIST, folder), separator=None, unit="s")
    stream = picture_files(pictures.t_ns, pictures.paths)
    rig, calibration, lens_notes = _rig(folder, options)
    truth, truth_notes = truth_file(options, [folder / TRUTH], pictures.t_ns, "of the camera.")
    notes = ["There is one camera, and it is the body: x right, y down, z ahead."]
    notes += [*missing, *lens_notes, *truth_notes]
    if (folder / DEPTH).exists():
        notes.append("Depth pictures were dropped.")
    notes += unread(folder, LIST, TRUTH, "rgb", DEPTH, "depth", Path(calibration).name)
    return assemble("tum", rig, stream, pictures.t_ns, truth=truth, notes=notes, calibration=calibration)


def _rig(folder: Path, options: ReadOptions) -> tuple[Rig, str, Notes]:
    chain = find_chain(folder, options)
    if chain is not None:
        rig, notes = chain_rig(chain, 1, np.eye(4))
        return rig, str(chain), notes
    title = [line for line in read_text(folder / LIST).splitlines()[:3] if line.startswith("#")]  # names its bag
    found = WHICH.search(folder.resolve().name) or WHICH.search(" ".join(title))
    if found is None:
        raise no_calibration(folder / "camchain.yaml")
    robot = f"freiburg{found[1]}"
    rig = Rig(CAMERAS[robot], None, np.eye(4), None)
    return rig, f"{robot}'s published one", (f"The calibration is the benchmark's own of {robot}'s colour camera.",)


DEPTH_PER_M = 5000  # grey values of 16 bits; 0 is unknown
FARTHEST_M = 65535 / DEPTH_PER_M
DEPTH_TOPIC = "depth"


def write_tum(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Fill `folder` and say what was converted. Raises SequenceError for a camera that sees all around."""
    kalibr.intrinsics(views.rig.left)  # camchain.yaml is the only place that the layout has for a lens
    notes = ["TUM's layout has one camera: the right one was left out."] if source.rig.right else []
    (folder / "rgb").mkdir()
    stamps = []
    for frame in png_frames(source.sequence, views):
        (folder / "rgb" / f"{seconds(frame.t_ns)}.png").write_bytes(frame.pictures["left"])
        stamps.append(frame.t_ns)
    paths = (f"rgb/{seconds(t)}.png" for t in stamps)
    _write_table(folder / "rgb.txt", "color images", "filename", stamps, paths)
    notes.append("The pictures are grey. Stamps have 9 decimals, where TUM's own have 6, so that none is rounded.")
    notes += _write_depth(source, folder)
    if source.imu:
        notes += _write_imu(source.imu, folder)
    if source.truth is None:
        return [*notes, "No truth was recorded, so there is no groundtruth.txt."]
    path = source.truth.of_mounted(views.rig.T_body_left)
    text = "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n" + format_tum(path)
    (folder / "groundtruth.txt").write_text(text, encoding="utf-8")
    return [*notes, "groundtruth.txt is the path of the left camera in the world, as TUM has it."]


def _write_depth(source: ExportSource, folder: Path) -> list[str]:
    """depth/ and depth.txt from the truth of every pixel, where that was recorded."""
    if DEPTH_TOPIC not in source.channels:
        return []
    if source.true_rig.left.depth_along != "axis":
        return ["The depth along rays was dropped, for TUM's is along the optical axis."]
    (folder / DEPTH_TOPIC).mkdir()
    stamps = []
    beyond = 0
    known = 0
    for frame in read_truth_frames(source.folder, (DEPTH_TOPIC,)):
        depth_m = frame.left.depth
        if depth_m is None:
            continue
        write_png(folder / DEPTH_TOPIC / f"{seconds(frame.t_ns)}.png", depth_values(depth_m))
        stamps.append(frame.t_ns)
        beyond += int(np.sum(depth_m > FARTHEST_M))
        known += int(np.isfinite(depth_m).sum())
    paths = (f"{DEPTH_TOPIC}/{seconds(t)}.png" for t in stamps)
    _write_table(folder / "depth.txt", "depth maps", "filename", stamps, paths)
    return [
        f"Depth is the true one in steps of {1e3 / DEPTH_PER_M:g} mm ({DEPTH_PER_M} values a metre) up to "
        f"{FARTHEST_M:.3f} m; {beyond / max(known, 1):.1%} of it lies farther away and is 0, unknown."
    ]


def depth_values(depth_m: Floats) -> Ids:
    """Depth (H, W) in metres as TUM's 16-bit values; 0 where there is none or too much."""
    within = np.isfinite(depth_m) & (depth_m > 0) & (depth_m <= FARTHEST_M)
    values: Ids = np.rint(np.where(within, depth_m, 0.0).astype(float) * DEPTH_PER_M).astype(np.uint16)
    return values


def _write_imu(imu: ImuReadings, folder: Path) -> list[str]:
    both = np.hstack([imu.gyro_radps, imu.accel_mps2]).tolist()
    rows = [[repr(value) for value in row] for row in both]
    t_ns = imu.t_ns.tolist()
    accel = (" ".join(row[3:]) for row in rows)
    _write_table(folder / "accelerometer.txt", "accelerometer data", "ax ay az", t_ns, accel)
    _write_table(folder / "imu.txt", "IMU data", "wx wy wz ax ay az", t_ns, map(" ".join, rows))
    return ["accelerometer.txt is in the IMU's axes. TUM has no file for a gyroscope: imu.txt, with both, is our own."]


def _write_table(path: Path, what: str, columns: str, t_ns: Iterable[int], rows: Iterable[str]) -> None:
    text = "".join(f"{seconds(t)} {row}\n" for t, row in zip(t_ns, rows, strict=True))
    path.write_text(f"# {what}\n# file: vobench\n# timestamp {columns}\n{text}", encoding="utf-8")


LAYOUTS = (
    Layout(
        "tum",
        "TUM RGB-D: rgb.txt",
        lambda path: (path / LIST).is_file(),
        read_tum,
        frozenset({"calibration", "truth"}),
        Writing(write_tum, lambda rig: Views(replace(rig, right=None, T_body_right=None)), keeps=("imu", DEPTH_TOPIC)),
    ),
)
