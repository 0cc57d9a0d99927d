"""The ASL layout of EuRoC and TUM-VI, read and written."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.layout import Layout, Writing
from vobench.dataset.picture import read_text, unread
from vobench.dataset.recording import (
    Notes,
    PictureList,
    ReadOptions,
    Recording,
    assemble,
    listed_pictures,
    picture_files,
    read_truth_file,
    truth_file,
)
from vobench.dataset.source import ExportSource, Views, png_frames, rate_hz
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, DoubleSphere
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.trajectory.formats import NUMBER, content, csv_rows, format_euroc, read_table, stamps_ns
from vobench.trajectory.trajectory import Stamps, Trajectory

IMU_COLUMNS = ("t", "wx", "wy", "wz", "ax", "ay", "az")


def sensor_camera(values: kalibr.Values) -> tuple[Camera, Array]:
    """A camera and its place T_body_camera by its sensor.yaml. Raises InputError."""
    kind = values.text("camera_model")
    size = values.size("resolution")
    numbers = values.numbers("intrinsics")
    bends = values.numbers("distortion_coefficients") if values.has("distortion_coefficients") else []
    if kind == "ds" and len(numbers) == 6:
        return DoubleSphere(*size, *numbers[2:], *numbers[:2]), values.transform("T_BS")
    if kind != "pinhole":
        raise InputError(
            f"{values.path}: camera_model should be pinhole or ds, but is {kind!r} of {len(numbers)} numbers"
        )
    camera = kalibr.focal_camera(size, numbers, values.text("distortion_model"), bends, place=str(values.path))
    return camera, values.transform("T_BS")


def read_imu_csv(path: Path) -> ImuReadings:
    """An IMU's `t, wx, wy, wz, ax, ay, az` in ns, rad/s and m/s². Raises TrajectoryError naming file and line."""
    rows = content(read_text(path))
    if rows and not NUMBER.fullmatch(rows[0][1].partition(",")[0].strip()):
        rows = rows[1:]  # a header without its #
    if not rows:
        raise InputError(f"no reading of the IMU: {path}")
    table = read_table(rows, name=str(path), columns=IMU_COLUMNS, separator=",", row="a reading")
    return ImuReadings(stamps_ns(table, "ns"), table.values[:, 1:4].copy(), table.values[:, 4:7].copy())


def sensor_place(folder: Path) -> Array | None:
    """T_body_sensor by the sensor.yaml of a folder; None where that doesn't say. Raises InputError."""
    path = folder / "sensor.yaml"
    if not path.is_file():
        return None
    values = kalibr.read_yaml(path)
    return values.transform("T_BS") if values.has("T_BS") else None


CAMERAS = ("cam0", "cam1")
SENSOR = "sensor.yaml"
DATA = "data.csv"
# In order of trust: the batch estimate, TUM-VI's poses of the IMU, and a tracker's of its marker.
TRUTHS = ("state_groundtruth_estimate0", "mocap0", "vicon0")
POSITIONS = "leica0"
BASE = "base_link"  # of our own export: where our body sits on the IMU


def _is_asl(folder: Path) -> bool:
    return (folder / "mav0").is_dir() or (folder / "cam0" / DATA).is_file() or (folder / "cam0" / "data").is_dir()


def _has_dso(folder: Path) -> bool:
    return (folder / "dso").is_dir() or (folder.name == "mav0" and (folder.parent / "dso").is_dir())


def read_euroc(folder: Path, options: ReadOptions, *, form: str = "euroc") -> Recording:
    """A folder with mav0/, or that folder itself; the body is the IMU. Raises InputError naming the file."""
    root = folder / "mav0" if (folder / "mav0").is_dir() else folder
    eyes, pairing = _pictures(root, options)
    stream = picture_files(eyes[0].t_ns, *(eye.paths for eye in eyes))
    rig, calibration, lens_notes = _rig(root, folder, len(eyes), options)
    imu, imu_calibration, imu_notes = _imu(root, folder, options)
    truth, truth_notes = _truth(root, eyes[0].t_ns, options)
    rig, truth, body = _on_body(replace(rig, imu=imu_calibration), truth, sensor_place(root / BASE))
    source = next((name for name in TRUTHS if (root / name / DATA).is_file()), POSITIONS)
    others = unread(root, *CAMERAS, "imu0", BASE, source, "body.yaml")
    notes = (body, *pairing, *lens_notes, *imu_notes, *truth_notes, *others)
    return assemble(form, rig, stream, eyes[0].t_ns, truth=truth, imu=imu, notes=notes, calibration=str(calibration))


def _pictures(root: Path, options: ReadOptions) -> tuple[list[PictureList], Notes]:
    if not (root / CAMERAS[0]).is_dir():
        raise InputError(f"no folder {CAMERAS[0]} with pictures in {root}")
    folders = [root / name for name in CAMERAS if (root / name).is_dir()]
    lists = [(folder / DATA, folder / "data") for folder in folders]
    eyes, notes = listed_pictures(*lists, separator=",", unit="ns", within_ns=options.within_ns)
    return eyes, notes if len(eyes) > 1 else (f"There is one camera: no folder {CAMERAS[1]}.", *notes)


def _rig(root: Path, folder: Path, count: int, options: ReadOptions) -> tuple[Rig, Path, Notes]:
    """The cameras on the IMU, by the chain given, their sensor.yaml or a chain that is there; and the file's path."""
    sensors = [root / name / SENSOR for name in CAMERAS[:count]]
    chain = options.calibration or (
        None if all(path.is_file() for path in sensors) else kalibr.find_chain(folder, options)
    )
    if chain is not None:
        rig, notes = kalibr.chain_rig(chain, count, None)
        return rig, chain, notes
    missing = next((path for path in sensors if not path.is_file()), None)
    if missing is not None:
        raise kalibr.no_calibration(missing)
    rig = kalibr.rig_of(*(sensor_camera(kalibr.read_yaml(path)) for path in sensors))
    note = "Pictures stay as they are, not rectified; the lens is in the calibration (sensor.yaml)."
    return rig, sensors[0], (note,)


def _imu(root: Path, folder: Path, options: ReadOptions) -> tuple[ImuReadings | None, ImuCalibration | None, Notes]:
    data = root / "imu0" / DATA
    sensor = root / "imu0" / SENSOR
    if not data.is_file():
        return None, None, ("There are no readings of an IMU.",)
    noise = options.imu or (None if sensor.is_file() else kalibr.find_imu(folder, options))
    if noise is not None:
        return read_imu_csv(data), kalibr.read_imu(noise, np.eye(4)), (f"The IMU's noise is that of {noise.name}.",)
    if not sensor.is_file():
        return None, None, (f"The IMU was dropped: nothing says how noisy it is ({sensor} or Kalibr's imu.yaml).",)
    values = kalibr.read_yaml(sensor)
    return read_imu_csv(data), kalibr.imu_numbers(values, values.transform("T_BS"), ("rate_hz",), ()), ()


def _truth(root: Path, frames_ns: Stamps, options: ReadOptions) -> tuple[Trajectory | None, Notes]:
    if options.truth is not None:
        return truth_file(options, (), frames_ns, "taken to be of the body.")
    for name in TRUTHS:
        if (root / name / DATA).is_file():
            return _tracked(root / name, frames_ns)
    if (root / POSITIONS / DATA).is_file():
        return None, (f"{POSITIONS} has positions alone, without rotations, which are no truth; it was dropped.",)
    return None, ()


def _tracked(folder: Path, frames_ns: Stamps) -> tuple[Trajectory, Notes]:
    """A tracker's poses, moved from what it tracks to the body where its sensor.yaml says how."""
    truth, notes = read_truth_file(folder / DATA, frames_ns)
    T_body_tracked = sensor_place(folder)
    if T_body_tracked is None:
        how = "taken to be of the body, for no sensor.yaml says otherwise"
    elif (T_body_tracked == np.eye(4)).all():
        how = "which is that of the body"
    else:
        truth = truth.of_mounted(se3.inverse(T_body_tracked))
        how = "moved to the body by its T_BS"
    rest = ("Velocities and biases beside the true poses were not read.",) if folder.name == TRUTHS[0] else ()
    return truth, (f"The truth is {folder.name}, {how}.", *rest, *notes)


def _on_body(rig: Rig, truth: Trajectory | None, T_imu_base: Array | None) -> tuple[Rig, Trajectory | None, str]:
    """Rig and truth on the body that a recording of our own had before it was exported, or on the IMU."""
    if T_imu_base is None:
        return rig, truth, "The body is the IMU."
    said = f"The body is {BASE}, as its sensor.yaml places it."
    return kalibr.on_body(rig, se3.inverse(T_imu_base)), truth.of_mounted(T_imu_base) if truth else None, said


# EuRoC's words for Kalibr's.
BENDS = {kalibr.KALIBR_RADTAN: "radial-tangential", kalibr.EQUI: "equidistant", kalibr.NO_BEND: "none"}
IMU_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)


def write_euroc(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Fill `folder` with mav0 and say what was converted. Raises SequenceError for a camera that sees all around."""
    mav = folder / "mav0"
    rig = views.rig
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


def _write_pictures(source: ExportSource, views: Views, mav: Path) -> Stamps:
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
        f"rate_hz: {kalibr.number(rate)}\n"
        f"resolution: [{camera.width_px}, {camera.height_px}]\n"
        f"camera_model: {model}\n"
        f"intrinsics: {kalibr.numbers(linear)}\n"
        f"distortion_model: {BENDS[bend]}\n"
        f"distortion_coefficients: {kalibr.numbers(coefficients)}\n"
    )


def _sensor_yaml(kind: str, comment: str, T_BS: Array) -> str:
    return f"sensor_type: {kind}\ncomment: {comment}\nT_BS:\n  cols: 4\n  rows: 4\n  data: {kalibr.numbers(T_BS)}\n"


def _write_imu(source: ExportSource, imu: ImuCalibration, mav: Path) -> list[str]:
    densities = "".join(f"{name}: {kalibr.number(getattr(imu, field))}\n" for field, name in kalibr.DENSITIES.items())
    text = f"{_sensor_yaml('imu', 'imu0 of vobench', np.eye(4))}rate_hz: {kalibr.number(imu.rate_hz)}\n{densities}"
    _write(mav / "imu0" / "sensor.yaml", text)
    readings = source.imu
    rows = csv_rows(readings.t_ns, np.hstack([readings.gyro_radps, readings.accel_mps2])) if readings else ""
    _write(mav / "imu0" / "data.csv", IMU_HEADER + rows)
    return ["The body of the folder is the IMU, as in EuRoC; mav0/base_link says where base_link is from there."]


def _write_truth(source: ExportSource, T_base_body: Array, mav: Path) -> list[str]:
    if source.truth is None:
        return ["No truth was recorded, so there is no state_groundtruth_estimate0."]
    notes = []
    columns = []
    if source.twist is None:
        notes.append("No velocities were recorded, so the truth's rows end after the pose.")
    else:
        bias, said = _biases(source)
        columns = [point_velocity(source.truth, source.twist, T_base_body[:3, 3]), *bias]
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


def _biases(source: ExportSource) -> tuple[list[Array], str]:
    """Biases (N, 6) at the truth's stamps, where there are some, and the sentence on them."""
    bias = source.bias
    truth = source.truth
    if bias is None or truth is None:
        return [], "No biases of an IMU were recorded, so the truth's rows end after the velocity."
    values = np.hstack([bias.gyro_radps, bias.accel_mps2])
    since = bias.t_ns[0]
    at = [np.interp(truth.t_ns - since, bias.t_ns - since, column) for column in values.T]
    if np.isin(truth.t_ns, bias.t_ns).all():
        return [np.stack(at, -1)], "Velocity and biases in the truth are as recorded."
    return [np.stack(at, -1)], "The biases in the truth lie on straight lines between those recorded."


HEEDS = frozenset({"calibration", "imu", "truth", "within_ns"})
LAYOUTS = (
    Layout(
        "tumvi",
        "TUM-VI: mav0/ and dso/",
        lambda path: _is_asl(path) and _has_dso(path),
        partial(read_euroc, form="tumvi"),
        HEEDS,
    ),
    Layout(
        "euroc",
        "EuRoC or ASL: mav0/, or cam0/ with data.csv",
        lambda path: _is_asl(path) and not _has_dso(path),
        read_euroc,
        HEEDS,
        Writing(write_euroc, keeps=("imu",)),
    ),
)
