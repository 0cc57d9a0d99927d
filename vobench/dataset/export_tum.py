"""TUM's layout for RGB-D: the left camera's pictures, depth where it is known, its path, and what an IMU felt.

Source: Sturm et al. (2012), the benchmark's page on file formats.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.source import Source, png_frames
from vobench.dataset.views import Views
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sensor.truth import Floats, Ids
from vobench.sequence import read_truth_frames
from vobench.sequence.picture import write_png
from vobench.trajectory.text import format_tum, seconds
from vobench.trajectory.trajectory import Stamps

DEPTH_PER_M = 5000  # grey values of 16 bits; 0 is unknown
FARTHEST_M = 65535 / DEPTH_PER_M
DEPTH = "depth"


def left_alone(rig: Rig) -> Views:
    """The left camera as it was recorded."""
    return Views(replace(rig, right=None, T_body_right=None))


def write_tum(source: Source, views: Views, folder: Path) -> list[str]:
    """Fill `folder` and say what was converted. Raises SequenceError for a camera that sees all around."""
    kalibr.intrinsics(views.rig.left)  # camchain.yaml is the only place that the layout has for a lens
    notes = ["TUM's layout has one camera: the right one was left out."] if source.rig.right else []
    (folder / "rgb").mkdir()
    stamps = []
    for frame in png_frames(source.sequence, views):
        (folder / "rgb" / f"{seconds(frame.t_ns)}.png").write_bytes(frame.pictures["left"])
        stamps.append(frame.t_ns)
    _write_list(folder / "rgb.txt", "color images", stamps, "rgb")
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


def _write_list(path: Path, what: str, stamps: list[int], subfolder: str) -> None:
    rows = "".join(f"{seconds(t)} {subfolder}/{seconds(t)}.png\n" for t in stamps)
    path.write_text(f"# {what}\n# file: vobench\n# timestamp filename\n{rows}", encoding="utf-8")


def _write_depth(source: Source, folder: Path) -> list[str]:
    """depth/ and depth.txt from the truth of every pixel, where that was recorded."""
    if DEPTH not in source.channels:
        return []
    if source.true_rig.left.depth_along != "axis":
        return ["The depth along rays was dropped, for TUM's is along the optical axis."]
    (folder / DEPTH).mkdir()
    stamps, beyond, known = [], 0, 0
    for frame in read_truth_frames(source.folder, (DEPTH,)):
        depth_m = frame.left.depth
        if depth_m is None:
            continue
        write_png(folder / DEPTH / f"{seconds(frame.t_ns)}.png", depth_values(depth_m))
        stamps.append(frame.t_ns)
        beyond += int(np.sum(depth_m > FARTHEST_M))
        known += int(np.isfinite(depth_m).sum())
    _write_list(folder / "depth.txt", "depth maps", stamps, DEPTH)
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
    _write_rows(folder / "accelerometer.txt", "accelerometer data", "ax ay az", imu.t_ns, imu.accel_mps2)
    both = np.hstack([imu.gyro_radps, imu.accel_mps2])
    _write_rows(folder / "imu.txt", "IMU data", "wx wy wz ax ay az", imu.t_ns, both)
    return ["accelerometer.txt is in the IMU's axes. TUM has no file for a gyroscope: imu.txt, with both, is our own."]


def _write_rows(path: Path, what: str, columns: str, t_ns: Stamps, values: Array) -> None:
    rows = zip(t_ns.tolist(), values.tolist(), strict=True)
    text = "".join(f"{seconds(t)} {' '.join(map(repr, row))}\n" for t, row in rows)
    path.write_text(f"# {what}\n# file: vobench\n# timestamp {columns}\n{text}", encoding="utf-8")
