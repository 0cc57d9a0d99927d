"""Reads and writes recordings in the ASL layout of EuRoC and TUM-VI."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.body import MountedCamera, mounted_rig, on_body
from vobench.dataset.calibration_file import read_yaml
from vobench.dataset.calibration_value import AboveZero, Numbers, Resolution, RigidTransform, Text
from vobench.dataset.distortion import focal_camera
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.picture_list import PictureList, listed_pictures, picture_files
from vobench.dataset.png_frame import png_frames
from vobench.dataset.recording import CalibratedImu, CalibratedRig, Notes, ReadOptions, Recording, assemble
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource
from vobench.dataset.truth_file import read_truth_file, truth_file
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, DoubleSphere
from vobench.geometry.rig import ImuCalibration
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.trajectory.euroc import csv_rows, format_euroc
from vobench.trajectory.stamp_text import stamps_ns
from vobench.trajectory.text_table import NUMBER, content_lines, read_table
from vobench.trajectory.trajectory import Stamps, Trajectory, mean_rate_hz

MAV = "mav0"
CAMERAS = ("cam0", "cam1")
IMU = "imu0"
SENSOR = "sensor.yaml"
DATA = "data.csv"
# By decreasing accuracy: the batch estimate, TUM-VI's poses of the IMU, and a motion tracker's poses of its marker.
TRUTHS = ("state_groundtruth_estimate0", "mocap0", "vicon0")
POSITIONS = "leica0"
BASE = "base_link"  # the folder in an export of vobench with the pose of its body on the IMU
IMU_COLUMNS = ("t", "wx", "wy", "wz", "ax", "ay", "az")


@dataclass(frozen=True, slots=True)
class SensorYamlCamera:
    """The keys of a camera's sensor.yaml."""

    camera_model: Text
    resolution: Resolution
    intrinsics: Numbers
    T_BS: RigidTransform
    distortion_model: Text | None = None
    distortion_coefficients: Numbers | None = None


@dataclass(frozen=True, slots=True)
class SensorYamlImu:
    """The keys of an IMU's sensor.yaml, except the noise densities."""

    rate_hz: AboveZero
    T_BS: RigidTransform


@dataclass(frozen=True, slots=True)
class SensorYamlMount:
    """The key of a sensor.yaml with the pose of the sensor on the body; None if it is missing."""

    T_BS: RigidTransform | None = None


def sensor_camera(path: Path) -> MountedCamera:
    """The camera that a sensor.yaml describes. Raises InputError."""
    file = read_yaml(path)
    sensor = file.checked(SensorYamlCamera)
    width, height = sensor.resolution
    size_px = (int(width), int(height))
    if sensor.camera_model == kalibr.DOUBLE_SPHERE and len(sensor.intrinsics) == 6:
        xi, alpha, fx, fy, cx, cy = sensor.intrinsics
        return MountedCamera(DoubleSphere(*size_px, fx, fy, cx, cy, xi, alpha), sensor.T_BS)
    if sensor.camera_model != kalibr.PINHOLE:
        raise InputError(
            f"{path}: camera_model should be pinhole (with 4 intrinsics) or ds (with 6), "
            f"but is {sensor.camera_model!r} with {len(sensor.intrinsics)}"
        )
    if sensor.distortion_model is None:
        raise file.missing_key_error("distortion_model", file.tree)
    coefficients = sensor.distortion_coefficients or ()
    camera = focal_camera(size_px, sensor.intrinsics, sensor.distortion_model, coefficients, place=str(path))
    return MountedCamera(camera, sensor.T_BS)


def read_imu_csv(path: Path) -> ImuReadings:
    """The IMU readings in a csv file with rows `t, wx, wy, wz, ax, ay, az`, in ns, rad/s and m/s².

    Raises TrajectoryError with file and line.
    """
    lines = content_lines(read_text(path))
    if lines:
        first_cell = lines[0].text.partition(",")[0].strip()
        has_header = not NUMBER.fullmatch(first_cell)  # a header that does not begin with #
        if has_header:
            lines = lines[1:]
    if not lines:
        raise InputError(f"no reading of the IMU: {path}")
    table = read_table(
        lines,
        name=str(path),
        columns=IMU_COLUMNS,
        separator=",",
        row="a reading",
    )
    gyro_radps = table.values[:, 1:4].copy()
    accel_mps2 = table.values[:, 4:7].copy()
    return ImuReadings(stamps_ns(table, "ns"), gyro_radps, accel_mps2)


def sensor_mount(folder: Path) -> Array | None:
    """T_body_sensor from the sensor.yaml in a folder; None if it does not contain the pose. Raises InputError."""
    path = folder / SENSOR
    if not path.is_file():
        return None
    return read_yaml(path).checked(SensorYamlMount).T_BS


def _is_asl(folder: Path) -> bool:
    if (folder / MAV).is_dir():
        return True
    camera = folder / CAMERAS[0]
    return (camera / DATA).is_file() or (camera / "data").is_dir()


def _has_dso(folder: Path) -> bool:
    if (folder / "dso").is_dir():
        return True
    return folder.name == MAV and (folder.parent / "dso").is_dir()


def _is_tumvi(folder: Path) -> bool:
    return _is_asl(folder) and _has_dso(folder)


def _is_euroc(folder: Path) -> bool:
    return _is_asl(folder) and not _has_dso(folder)


def read_euroc(
    folder: Path,
    options: ReadOptions,
    *,
    form: str = "euroc",
) -> Recording:
    """The recording in a folder mav0, or in the folder that contains it. The body is the IMU. Raises InputError."""
    root = folder / MAV if (folder / MAV).is_dir() else folder
    cameras, picture_notes = _pictures(root, options)
    t_ns = cameras[0].t_ns
    stream = picture_files(t_ns, *(camera.paths for camera in cameras))
    calibration = _cameras_on_imu(root, folder, len(cameras), options)
    imu = _imu(root, folder, options)
    truth, truth_notes = _truth(root, t_ns, options)

    rig = replace(calibration.rig, imu=imu.calibration)
    T_imu_base = sensor_mount(root / BASE)
    body_note = "The body is the IMU."
    if T_imu_base is not None:
        # The recording was exported by vobench, so the original body is restored.
        rig = on_body(rig, se3.inverse(T_imu_base))
        truth = truth.of_mounted(T_imu_base) if truth else None
        body_note = f"The body is {BASE}, as its sensor.yaml places it."

    truth_folder = next((name for name in TRUTHS if (root / name / DATA).is_file()), POSITIONS)
    unread_notes = unread(root, *CAMERAS, IMU, BASE, truth_folder, "body.yaml")
    notes = [body_note, *picture_notes, *calibration.notes, *imu.notes, *truth_notes, *unread_notes]
    return assemble(
        form,
        rig,
        stream,
        t_ns,
        truth=truth,
        imu=imu.readings,
        notes=notes,
        calibration=calibration.source,
    )


def _pictures(root: Path, options: ReadOptions) -> tuple[list[PictureList], Notes]:
    if not (root / CAMERAS[0]).is_dir():
        raise InputError(f"no folder {CAMERAS[0]} with images in {root}")
    folders = [root / name for name in CAMERAS if (root / name).is_dir()]
    lists = [(folder / DATA, folder / "data") for folder in folders]
    cameras, notes = listed_pictures(*lists, separator=",", unit="ns", within_ns=options.within_ns)
    if len(cameras) == 1:
        notes = (f"There is one camera: no folder {CAMERAS[1]}.", *notes)
    return cameras, notes


def _cameras_on_imu(
    root: Path,
    folder: Path,
    count: int,
    options: ReadOptions,
) -> CalibratedRig:
    """The cameras on the IMU, from the Kalibr file in the options, the sensor.yaml files, or a Kalibr file there."""
    sensors = [root / name / SENSOR for name in CAMERAS[:count]]
    missing = [path for path in sensors if not path.is_file()]
    chain = options.calibration
    if chain is None and missing:
        chain = kalibr.find_chain(folder, options)
    if chain is not None:
        rig, notes = kalibr.chain_rig(chain, count, None)
        return CalibratedRig(rig, str(chain), notes)
    if missing:
        raise kalibr.no_calibration(missing[0])
    rig = mounted_rig(*(sensor_camera(path) for path in sensors))
    note = "The images are not rectified; the distortion of the lens is in the calibration (sensor.yaml)."
    return CalibratedRig(rig, str(sensors[0]), (note,))


def _imu(root: Path, folder: Path, options: ReadOptions) -> CalibratedImu:
    data = root / IMU / DATA
    sensor = root / IMU / SENSOR
    if not data.is_file():
        return CalibratedImu(None, None, ("There are no readings of an IMU.",))

    noise = options.imu
    if noise is None and not sensor.is_file():
        noise = kalibr.find_imu(folder, options)
    if noise is not None:
        readings = read_imu_csv(data)
        calibration = kalibr.read_imu(noise, np.eye(4))
        return CalibratedImu(readings, calibration, (f"The IMU's noise is that of {noise.name}.",))
    if not sensor.is_file():
        why = f"its noise is not known (no {sensor} and no imu.yaml of Kalibr's)"
        return CalibratedImu(None, None, (f"The IMU was dropped: {why}.",))

    readings = read_imu_csv(data)
    file = read_yaml(sensor)
    densities = file.checked(kalibr.ImuDensities)
    imu = file.checked(SensorYamlImu)
    return CalibratedImu(readings, densities.calibration(imu.T_BS, imu.rate_hz), ())


def _truth(
    root: Path,
    frames_ns: Stamps,
    options: ReadOptions,
) -> tuple[Trajectory | None, Notes]:
    if options.truth is not None:
        return truth_file(options, (), frames_ns, "assumed to be of the body.")
    for name in TRUTHS:
        if (root / name / DATA).is_file():
            return _tracked(root / name, frames_ns)
    if (root / POSITIONS / DATA).is_file():
        return None, (f"{POSITIONS} was dropped: it has positions without rotations.",)
    return None, ()


def _tracked(folder: Path, frames_ns: Stamps) -> tuple[Trajectory, Notes]:
    """The poses of a motion tracker, and notes. They are moved from its marker to the body if its pose is known."""
    truth, file_notes = read_truth_file(folder / DATA, frames_ns)
    T_body_tracked = sensor_mount(folder)
    if T_body_tracked is None:
        how = "assumed to be of the body, as there is no sensor.yaml with T_BS"
    elif (T_body_tracked == np.eye(4)).all():
        how = "which is that of the body"
    else:
        truth = truth.of_mounted(se3.inverse(T_body_tracked))
        how = "moved to the body by its T_BS"

    notes = [f"The truth is {folder.name}, {how}."]
    if folder.name == TRUTHS[0]:
        notes.append("Velocities and biases beside the true poses were not read.")
    return truth, (*notes, *file_notes)


# The names in EuRoC of Kalibr's distortion models.
DISTORTION_MODELS = {
    kalibr.RADTAN: "radial-tangential",
    kalibr.EQUIDISTANT: "equidistant",
    kalibr.NO_DISTORTION: "none",
}
IMU_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)


def write_euroc(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Write the folder mav0, and return notes on what was converted.

    Raises SequenceError for an equirectangular camera.
    """
    mav = folder / MAV
    rig = views.rig
    T_base_body = rig.imu.T_body_imu if rig.imu else np.eye(4)  # base_link is vobench's body, and the IMU is EuRoC's
    T_body_base = se3.inverse(T_base_body)
    stamps = _write_pictures(source, views, mav)
    rate = mean_rate_hz(stamps)
    for index, side in enumerate(rig.sides):
        T_body_camera = T_body_base @ rig.T_body_camera(side)
        text = _camera_yaml(index, rig.camera(side), T_body_camera, rate)
        _write(mav / f"cam{index}" / SENSOR, text)

    notes = []
    if rig.imu:
        notes += _write_imu(source, rig.imu, mav)
        text = _sensor_yaml("body", "base_link of vobench, seen from the IMU", T_body_base)
        _write(mav / BASE / SENSOR, text)
    return notes + _write_truth(source, T_base_body, mav)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _write_pictures(source: ExportSource, views: Views, mav: Path) -> Stamps:
    folders = {side: mav / f"cam{index}" for index, side in enumerate(views.rig.sides)}
    for cam in folders.values():
        (cam / "data").mkdir(parents=True)
    stamps = []
    for frame in png_frames(source.sequence, views):
        stamps.append(frame.t_ns)
        for side, picture in frame.pictures.items():
            path = folders[side] / "data" / f"{frame.t_ns}.png"
            path.write_bytes(picture)

    rows = "".join(f"{t},{t}.png\n" for t in stamps)
    for cam in folders.values():
        _write(cam / DATA, f"#timestamp [ns],filename\n{rows}")
    return np.array(stamps, np.int64)


def _camera_yaml(
    index: int,
    camera: Camera,
    T_BS: Array,
    rate: float,
) -> str:
    model = kalibr.intrinsics(camera)
    return _sensor_yaml("camera", f"cam{index} of vobench", T_BS) + (
        f"rate_hz: {kalibr.number(rate)}\n"
        f"resolution: [{camera.width_px}, {camera.height_px}]\n"
        f"camera_model: {model.camera_model}\n"
        f"intrinsics: {kalibr.numbers(model.intrinsics)}\n"
        f"distortion_model: {DISTORTION_MODELS[model.distortion_model]}\n"
        f"distortion_coefficients: {kalibr.numbers(model.distortion_coeffs)}\n"
    )


def _sensor_yaml(kind: str, comment: str, T_BS: Array) -> str:
    return f"sensor_type: {kind}\ncomment: {comment}\nT_BS:\n  cols: 4\n  rows: 4\n  data: {kalibr.numbers(T_BS)}\n"


def _write_imu(source: ExportSource, imu: ImuCalibration, mav: Path) -> list[str]:
    lines = [f"rate_hz: {kalibr.number(imu.rate_hz)}\n"]
    for field, key in kalibr.DENSITIES.items():
        lines.append(f"{key}: {kalibr.number(getattr(imu, field))}\n")
    sensor = _sensor_yaml("imu", "imu0 of vobench", np.eye(4)) + "".join(lines)
    _write(mav / IMU / SENSOR, sensor)

    rows = ""
    readings = source.imu
    if readings:
        rows = csv_rows(readings.t_ns, np.hstack([readings.gyro_radps, readings.accel_mps2]))
    _write(mav / IMU / DATA, IMU_HEADER + rows)
    return ["The body of the folder is the IMU, as in EuRoC; mav0/base_link says where base_link is on it."]


def _write_truth(source: ExportSource, T_base_body: Array, mav: Path) -> list[str]:
    if source.truth is None:
        return ["No truth was recorded, so there is no state_groundtruth_estimate0."]
    columns = None  # the columns after the pose
    if source.twist is None:
        note = "No velocities were recorded, so the truth's rows end after the pose."
    else:
        velocity_mps = point_velocity(source.truth, source.twist, T_base_body[:3, 3])
        biases, note = _biases(source)
        columns = np.hstack([velocity_mps, *biases])

    state = mav / TRUTHS[0]
    truth = source.truth.of_mounted(T_base_body)
    _write(state / DATA, format_euroc(truth, columns))
    _write(state / SENSOR, _sensor_yaml("ground truth", "the body itself, exact", np.eye(4)))
    return [note]


def point_velocity(truth: Trajectory, twist: Array, lever_m: Array) -> Array:
    """The velocities (N, 3) in the world of the point `lever_m` (3,) on a body with twist (N, 6)."""
    linear_mps = twist[:, :3]
    angular_radps = twist[:, 3:]
    point_mps = linear_mps + np.cross(angular_radps, lever_m)  # in the axes of the body
    R_world_body = truth.T_world_frame[:, :3, :3]
    velocities_mps: Array = np.einsum("nij,nj->ni", R_world_body, point_mps)
    return velocities_mps


def _biases(source: ExportSource) -> tuple[list[Array], str]:
    """The biases (N, 6) at the stamps of the truth, if they were recorded, and a note on them."""
    bias = source.bias
    truth = source.truth
    if bias is None or truth is None:
        return [], "No biases of an IMU were recorded, so the truth's rows end after the velocity."
    values = np.hstack([bias.gyro_radps, bias.accel_mps2])
    start_ns = bias.t_ns[0]  # times are relative to it, because float64 would round absolute stamps
    truth_ns = truth.t_ns - start_ns
    bias_ns = bias.t_ns - start_ns
    columns = [np.interp(truth_ns, bias_ns, column) for column in values.T]
    note = "The biases in the truth are interpolated linearly between those recorded."
    if np.isin(truth.t_ns, bias.t_ns).all():
        note = "Velocity and biases in the truth are as recorded."
    return [np.stack(columns, -1)], note


HEEDS = frozenset({"calibration", "imu", "truth", "within_ns"})
TRUTH_FOLDERS = rf"[^/]*/(?:{'|'.join((*TRUTHS, POSITIONS))})"
LAYOUTS = (
    Layout(
        "tumvi",
        "TUM-VI: mav0/ and dso/",
        _is_tumvi,
        partial(read_euroc, form="tumvi"),
        HEEDS,
        truth=r"dso/gt_[^/]*",
    ),
    Layout(
        "euroc",
        "EuRoC or ASL: mav0/, or cam0/ with data.csv",
        _is_euroc,
        read_euroc,
        HEEDS,
        Writing(write_euroc, keeps=("imu",)),
        TRUTH_FOLDERS,
    ),
)
