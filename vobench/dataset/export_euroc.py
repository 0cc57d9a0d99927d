"""The folder of EuRoC, which ASL's tools, OpenVINS, Basalt, ORB-SLAM3 and many more read.

Its body is the IMU where there is one, as in EuRoC itself, so that what tools take for the IMU's path is that;
mav0/base_link then says where our body sits on it. Source: Burri et al. (2016) and the data set's own files.
"""

from pathlib import Path

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.kalibr import number, numbers
from vobench.dataset.source import Source, png_frames, rate_hz
from vobench.dataset.views import Views
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import ImuCalibration
from vobench.geometry.se3 import Array
from vobench.trajectory.euroc import csv_rows, format_euroc
from vobench.trajectory.trajectory import Stamps, Trajectory

# EuRoC's words for Kalibr's.
BENDS = {kalibr.RADTAN: "radial-tangential", kalibr.EQUI: "equidistant", kalibr.NO_BEND: "none"}
IMU_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)


def write_euroc(source: Source, views: Views, folder: Path) -> list[str]:
    """Fill `folder` with mav0 and say what was converted. Raises SequenceError for a camera that sees all around."""
    mav, rig = folder / "mav0", views.rig
    T_base_body = rig.imu.T_body_imu if rig.imu else np.eye(4)  # from our body, base_link, to that of EuRoC
    T_body_base = se3.inverse(T_base_body)
    stamps = _write_pictures(source, views, mav)
    rate = rate_hz(stamps)
    for index, side in enumerate(rig.sides):
        text = _camera_yaml(index, rig.camera(side), T_body_base @ rig.T_body_camera(side), rate)
        _write(mav / f"cam{index}" / "sensor.yaml", text)
    notes = _write_imu(source, rig.imu, mav) if rig.imu else []
    if rig.imu:
        text = _sensor_yaml("body", "base_link of vobench, seen from the IMU", T_body_base)
        _write(mav / "base_link" / "sensor.yaml", text)
    return notes + _write_truth(source, T_base_body, mav)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _write_pictures(source: Source, views: Views, mav: Path) -> Stamps:
    """The pictures and their lists; the stamps of the frames (N,)."""
    folders = {side: mav / f"cam{index}" for index, side in enumerate(views.rig.sides)}
    for cam in folders.values():
        (cam / "data").mkdir(parents=True)
    stamps = []
    for frame in png_frames(source.sequence, views):
        stamps.append(frame.t_ns)
        for side, picture in frame.pictures.items():
            (folders[side] / "data" / f"{frame.t_ns}.png").write_bytes(picture)
    rows = "".join(f"{t},{t}.png\n" for t in stamps)
    for cam in folders.values():
        _write(cam / "data.csv", f"#timestamp [ns],filename\n{rows}")
    return np.array(stamps, np.int64)


def _camera_yaml(index: int, camera: Camera, T_BS: Array, rate: float) -> str:
    model, linear, bend, coefficients = kalibr.intrinsics(camera)
    return _sensor_yaml("camera", f"cam{index} of vobench", T_BS) + (
        f"rate_hz: {number(rate)}\n"
        f"resolution: [{camera.width_px}, {camera.height_px}]\n"
        f"camera_model: {model}\n"
        f"intrinsics: {numbers(linear)}\n"
        f"distortion_model: {BENDS[bend]}\n"
        f"distortion_coefficients: {numbers(coefficients)}\n"
    )


def _sensor_yaml(kind: str, comment: str, T_BS: Array) -> str:
    return f"sensor_type: {kind}\ncomment: {comment}\nT_BS:\n  cols: 4\n  rows: 4\n  data: {numbers(T_BS)}\n"


def _write_imu(source: Source, imu: ImuCalibration, mav: Path) -> list[str]:
    densities = "".join(f"{name}: {number(getattr(imu, field))}\n" for field, name in kalibr.DENSITIES.items())
    text = f"{_sensor_yaml('imu', 'imu0 of vobench', np.eye(4))}rate_hz: {number(imu.rate_hz)}\n{densities}"
    _write(mav / "imu0" / "sensor.yaml", text)
    readings = source.imu
    rows = csv_rows(readings.t_ns, np.hstack([readings.gyro_radps, readings.accel_mps2])) if readings else ""
    _write(mav / "imu0" / "data.csv", IMU_HEADER + rows)
    return ["The body of the folder is the IMU, as in EuRoC; mav0/base_link says where base_link is from there."]


def _write_truth(source: Source, T_base_body: Array, mav: Path) -> list[str]:
    if source.truth is None:
        return ["No truth was recorded, so there is no state_groundtruth_estimate0."]
    notes, columns = [], []
    if source.twist is None:
        notes.append("No velocities were recorded, so the truth's rows end after the pose.")
    else:
        columns.append(point_velocity(source.truth, source.twist, T_base_body[:3, 3]))
        bias, said = _biases(source)
        columns += bias
        notes.append(said)
    truth = source.truth.of_mounted(T_base_body)
    state = mav / "state_groundtruth_estimate0"
    _write(state / "data.csv", format_euroc(truth, np.hstack(columns) if columns else None))
    _write(state / "sensor.yaml", _sensor_yaml("ground truth", "the body itself, exact", np.eye(4)))
    return notes


def point_velocity(truth: Trajectory, twist: Array, lever_m: Array) -> Array:
    """Velocities (N, 3) in the world of the point at `lever_m` on the body."""
    of_point = twist[:, :3] + np.cross(twist[:, 3:], lever_m)
    velocities: Array = np.einsum("nij,nj->ni", truth.T_world_frame[:, :3, :3], of_point)
    return velocities


def _biases(source: Source) -> tuple[list[Array], str]:
    """Biases (N, 6) at the truth's stamps, where there are some, and the sentence on them."""
    bias, truth = source.bias, source.truth
    if bias is None or truth is None:
        return [], "No biases of an IMU were recorded, so the truth's rows end after the velocity."
    values = np.hstack([bias.gyro_radps, bias.accel_mps2])
    since = bias.t_ns[0]
    at = [np.interp(truth.t_ns - since, bias.t_ns - since, column) for column in values.T]
    if np.isin(truth.t_ns, bias.t_ns).all():
        return [np.stack(at, -1)], "Velocity and biases in the truth are as recorded."
    return [np.stack(at, -1)], "The biases in the truth lie on straight lines between those recorded."
