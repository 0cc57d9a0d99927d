"""What lies in one sensor's folder of the ASL layout: its sensor.yaml, and an IMU's readings."""

from pathlib import Path

from vobench.dataset.files import read_text
from vobench.dataset.kalibr import imu_numbers
from vobench.dataset.lens import focal_camera
from vobench.dataset.yaml_values import Values, read_yaml
from vobench.errors import InputError
from vobench.geometry.camera import Camera
from vobench.geometry.rig import ImuCalibration
from vobench.geometry.se3 import Array
from vobench.geometry.sphere import DoubleSphere
from vobench.sensor.imu import ImuReadings
from vobench.trajectory.table import NUMBER, content, read_table, stamps_ns

IMU_COLUMNS = ("t", "wx", "wy", "wz", "ax", "ay", "az")


def sensor_camera(values: Values) -> tuple[Camera, Array]:
    """A camera and its place T_body_camera by its sensor.yaml. Raises InputError."""
    kind, size, numbers = values.text("camera_model"), values.size("resolution"), values.numbers("intrinsics")
    bends = values.numbers("distortion_coefficients") if values.has("distortion_coefficients") else []
    if kind == "ds" and len(numbers) == 6:
        return DoubleSphere(*size, *numbers[2:], *numbers[:2]), values.transform("T_BS")
    if kind != "pinhole":
        raise InputError(
            f"{values.path}: camera_model should be pinhole or ds, but is {kind!r} of {len(numbers)} numbers"
        )
    camera = focal_camera(size, numbers, values.text("distortion_model"), bends, place=str(values.path))
    return camera, values.transform("T_BS")


def sensor_imu(values: Values) -> ImuCalibration:
    """An IMU by its sensor.yaml. Raises InputError."""
    return imu_numbers(values, values.transform("T_BS"), ("rate_hz",), ())


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
    values = read_yaml(path)
    return values.transform("T_BS") if values.has("T_BS") else None
