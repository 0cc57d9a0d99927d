"""Reads and writes the calibration files of Kalibr: camera chains (camchain.yaml) and IMUs (imu.yaml)."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vobench.dataset.calibration_file import CalibrationFile, read_yaml
from vobench.dataset.calibration_value import AboveZero, Number, Numbers, Resolution, RigidTransform, Text, ZeroOrMore
from vobench.dataset.distortion import focal_camera
from vobench.dataset.picture import listed
from vobench.dataset.recording import ReadOptions
from vobench.errors import InputError, SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import (
    BrownConrady,
    Camera,
    DoubleSphere,
    Equirectangular,
    KannalaBrandt,
    focal_and_center_px,
)
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array

# The names of camera and distortion models in Kalibr.
PINHOLE = "pinhole"
DOUBLE_SPHERE = "ds"
RADTAN = "radtan"
EQUIDISTANT = "equidistant"
NO_DISTORTION = "none"
RADTAN_TERMS = ("k1", "k2", "p1", "p2")

EQUIRECTANGULAR_UNSUPPORTED = (
    "neither Kalibr nor EuRoC has a camera model for a camera that sees all around (the form ros2 keeps it)"
)
# The keys of imu.yaml by the fields of ImuCalibration.
DENSITIES = {
    "accel_noise": "accelerometer_noise_density",
    "accel_walk": "accelerometer_random_walk",
    "gyro_noise": "gyroscope_noise_density",
    "gyro_walk": "gyroscope_random_walk",
}
DEFAULT_TOPICS = ("/cam0/image_raw", "/cam1/image_raw")


def remarks(rig: Rig) -> list[str]:
    """Notes on the parts of a rig's camchain.yaml that Kalibr itself cannot read."""
    cameras = [rig.camera(side) for side in rig.sides]
    k3 = [camera.k3 for camera in cameras if isinstance(camera, BrownConrady)]
    if not any(k3):
        return []
    largest = max(k3, key=abs)
    return [f"Kalibr's radtan ends at k1 k2 p1 p2; the fifth number of these lenses is k3 = {largest:g}."]


def number(value: float) -> str:
    """A float with all digits and a decimal point.

    Kalibr reads YAML with PyYAML, which reads 1e-05 as text and 1.0e-05 as a number.
    """
    text = repr(float(value))
    mantissa, e, exponent = text.partition("e")
    if not e or "." in mantissa:
        return text
    return f"{mantissa}.0e{exponent}"


def numbers(values: ArrayLike) -> str:
    """A list of numbers in one line of YAML."""
    flat = np.asarray(values, float).ravel().tolist()
    return f"[{', '.join(map(number, flat))}]"


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A camera in the terms of Kalibr: the names and the numbers of its camera and distortion models.

    k3 is the last coefficient, if it is not 0.
    """

    camera_model: str
    intrinsics: Array
    distortion_model: str
    distortion_coeffs: Array


def intrinsics(camera: Camera) -> Intrinsics:
    """A camera in the terms of Kalibr. Raises SequenceError for an equirectangular camera."""
    if isinstance(camera, Equirectangular):
        raise SequenceError(EQUIRECTANGULAR_UNSUPPORTED)
    if isinstance(camera, DoubleSphere):
        linear = [camera.xi, camera.alpha, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]
        return Intrinsics(DOUBLE_SPHERE, np.array(linear), NO_DISTORTION, np.array([]))

    focal_px = np.array(focal_and_center_px(camera.K))
    match camera:
        case KannalaBrandt():
            coefficients = [getattr(camera, name) for name in camera.coefficients]
            return Intrinsics(PINHOLE, focal_px, EQUIDISTANT, np.array(coefficients))
        case BrownConrady():
            names = camera.coefficients if camera.k3 else RADTAN_TERMS
            coefficients = [getattr(camera, name) for name in names]
            return Intrinsics(PINHOLE, focal_px, RADTAN, np.array(coefficients))
        case _:
            # OpenVINS does not know the distortion model "none".
            return Intrinsics(PINHOLE, focal_px, RADTAN, np.zeros(len(RADTAN_TERMS)))


def camchain(rig: Rig, topics: tuple[str, ...] = DEFAULT_TOPICS) -> str:
    """The camchain.yaml of a rig. Raises SequenceError for an equirectangular camera."""
    entries = [_chain_entry(rig, index, topics[index]) for index in range(len(rig.sides))]
    return "".join(entries)


def _chain_entry(rig: Rig, index: int, topic: str) -> str:
    side = rig.sides[index]
    camera = rig.camera(side)
    model = intrinsics(camera)
    overlaps = [other for other in range(len(rig.sides)) if other != index]
    T_cam_body = se3.inverse(rig.T_body_camera(side))

    lines = [f"cam{index}:"]
    if rig.imu:
        lines += _matrix_lines("T_cam_imu", T_cam_body @ rig.imu.T_body_imu)
    if index:
        lines += _matrix_lines("T_cn_cnm1", T_cam_body @ rig.T_body_left)
    lines += [
        f"  cam_overlaps: {overlaps}",
        f"  camera_model: {model.camera_model}",
        f"  distortion_coeffs: {numbers(model.distortion_coeffs)}",
        f"  distortion_model: {model.distortion_model}",
        f"  intrinsics: {numbers(model.intrinsics)}",
        f"  resolution: [{camera.width_px}, {camera.height_px}]",
        f"  rostopic: {topic}",
    ]
    if rig.imu:
        lines.append("  timeshift_cam_imu: 0.0")
    return "\n".join(lines) + "\n"


def _matrix_lines(name: str, T: Array) -> list[str]:
    rows = [f"    - {numbers(row)}" for row in T]
    return [f"  {name}:", *rows]


def imu_yaml(imu: ImuCalibration, *, topic: str) -> str:
    """The imu.yaml of an IMU, without its pose. Raises InputError for a number that is not positive."""
    entries = {"update_rate": imu.rate_hz}
    for field, key in DENSITIES.items():
        entries[key] = getattr(imu, field)
    for key, value in entries.items():
        if not 0 < value < np.inf:
            raise InputError(f"Kalibr reads no IMU whose {key} is {value:g}; it must be more than 0")
    lines = [f"{key}: {number(value)}\n" for key, value in entries.items()]
    return "".join([f"rostopic: {topic}\n", *lines])


@dataclass(frozen=True, slots=True)
class ChainCamera:
    """The section of a camera in a camchain.yaml: the keys that every camera model needs, and its pose."""

    camera_model: Text
    intrinsics: Numbers
    resolution: Resolution
    T_cam_imu: RigidTransform | None = None
    T_cn_cnm1: RigidTransform | None = None
    timeshift_cam_imu: Number | None = None


@dataclass(frozen=True, slots=True)
class ChainDistortion:
    """The additional keys in the section of a pinhole camera."""

    distortion_coeffs: Numbers
    distortion_model: Text


@dataclass(frozen=True, slots=True)
class ImuDensities:
    """The noise of an IMU, with the keys of Kalibr and EuRoC. The units are those of ImuCalibration."""

    accelerometer_noise_density: ZeroOrMore
    accelerometer_random_walk: ZeroOrMore
    gyroscope_noise_density: ZeroOrMore
    gyroscope_random_walk: ZeroOrMore

    def calibration(self, T_body_imu: Array, rate_hz: float) -> ImuCalibration:
        """The calibration of an IMU with this noise."""
        return ImuCalibration(
            T_body_imu,
            rate_hz,
            gyro_noise=self.gyroscope_noise_density,
            accel_noise=self.accelerometer_noise_density,
            gyro_walk=self.gyroscope_random_walk,
            accel_walk=self.accelerometer_random_walk,
        )


@dataclass(frozen=True, slots=True)
class ImuRate:
    """The rate of the IMU in an imu.yaml."""

    update_rate: AboveZero


def read_camchain(path: Path) -> Rig:
    """The rig in a camchain.yaml. The body is the IMU, or cam0 if the file has no IMU. Raises InputError."""
    file = read_yaml(path)
    return _chain_rig(file, cameras_of(file))


def cameras_of(file: CalibrationFile) -> Mapping[str, ChainCamera]:
    """The sections cam0 and, if it exists, cam1 of a camchain.yaml. Raises InputError."""
    names = ("cam0", "cam1") if file.has("cam1") else ("cam0",)
    return {name: file.checked(ChainCamera, name) for name in names}


def _chain_rig(file: CalibrationFile, cameras: Mapping[str, ChainCamera]) -> Rig:
    left = _camera(file, "cam0", cameras["cam0"])
    T_left_imu = cameras["cam0"].T_cam_imu
    T_body_left = np.eye(4) if T_left_imu is None else se3.inverse(T_left_imu)
    if "cam1" not in cameras:
        return Rig(left, None, T_body_left, None)

    T_right_left = cameras["cam1"].T_cn_cnm1
    if T_right_left is None:
        raise file.missing_key_error("cam1.T_cn_cnm1", file.tree["cam1"])
    right = _camera(file, "cam1", cameras["cam1"])
    T_body_right = T_body_left @ se3.inverse(T_right_left)
    return Rig(left, right, T_body_left, T_body_right)


def _camera(file: CalibrationFile, name: str, entry: ChainCamera) -> Camera:
    width, height = entry.resolution
    size_px = (int(width), int(height))
    if entry.camera_model == DOUBLE_SPHERE and len(entry.intrinsics) == 6:
        xi, alpha, fx, fy, cx, cy = entry.intrinsics
        return DoubleSphere(*size_px, fx, fy, cx, cy, xi, alpha)
    if entry.camera_model != PINHOLE:
        raise InputError(
            f"{file.path}: {name}.camera_model should be {PINHOLE} (with 4 intrinsics) or {DOUBLE_SPHERE} (with 6), "
            f"but is {entry.camera_model} with {len(entry.intrinsics)}"
        )

    distortion = file.checked(ChainDistortion, name)
    return focal_camera(
        size_px,
        entry.intrinsics,
        distortion.distortion_model,
        distortion.distortion_coeffs,
        place=f"{file.path}: {name}",
    )


def read_imu(path: Path, T_body_imu: Array) -> ImuCalibration:
    """The IMU in an imu.yaml: with top-level keys, as Kalibr reads it, or below `imu0`, as Kalibr writes it.

    Raises InputError.
    """
    file = read_yaml(path)
    section = "imu0" if file.has("imu0") else ""
    rate = file.checked(ImuRate, section)
    densities = file.checked(ImuDensities, section)
    return densities.calibration(T_body_imu, rate.update_rate)


def read_pair(path: Path) -> Rig:
    """The stereo pair in a camchain.yaml, without its IMU. The body is the left camera. Raises InputError."""
    rig, _ = chain_rig(path, 2, np.eye(4))
    return rig


CHAIN_NAME = re.compile(r".*camchain.*\.ya?ml")
IMU_NAMES = ("imu.yaml", "imu_config.yaml", "imu0.yaml")
SEARCHED_FOLDERS = (".", "dso", "mav0")  # the folders of a dataset that may contain Kalibr's files


def find_chain(folder: Path, options: ReadOptions) -> Path | None:
    """The camchain.yaml in the options, or otherwise the only one in the folder of a dataset. Raises InputError."""
    if options.calibration is not None:
        return options.calibration
    chains = []
    for name in SEARCHED_FOLDERS:
        searched = folder / name
        chains += [searched / file for file in listed(searched) if CHAIN_NAME.fullmatch(file)]
    if len(chains) > 1:
        raise InputError(f"there are {len(chains)} calibrations; name the one to use: {', '.join(map(str, chains))}")
    return chains[0] if chains else None


def find_imu(folder: Path, options: ReadOptions) -> Path | None:
    """The imu.yaml in the options, or otherwise the first one in the folder of a dataset."""
    if options.imu is not None:
        return options.imu
    for searched in SEARCHED_FOLDERS:
        for name in IMU_NAMES:
            path = folder / searched / name
            if path.is_file():
                return path
    return None


def chain_has_imu(path: Path) -> bool:
    """Whether a camchain.yaml contains the pose of the left camera relative to an IMU. Raises InputError."""
    cameras = cameras_of(read_yaml(path))
    return cameras["cam0"].T_cam_imu is not None


def chain_rig(
    path: Path,
    cameras: int,
    T_body_left: Array | None,
) -> tuple[Rig, tuple[str, ...]]:
    """The rig of the first one or two cameras in a camchain.yaml, and notes on it.

    T_body_left is the pose of the left camera. Without it, the body is the IMU of the file. Raises InputError.
    """
    file = read_yaml(path)
    if cameras > 1 and not file.has("cam1"):
        raise InputError(f"a pair of cameras needs cam1, which is missing in {path}")
    entries = cameras_of(file)
    if T_body_left is None and entries["cam0"].T_cam_imu is None:
        raise InputError(f"the body of the recording is its IMU, so the chain needs the key cam0.T_cam_imu: {path}")

    rig = _chain_rig(file, entries)
    if cameras == 1:
        rig = replace(rig, right=None, T_body_right=None)
    if T_body_left is not None:
        T_body_right = T_body_left @ rig.T_left_right if rig.right else None
        rig = replace(rig, T_body_left=T_body_left, T_body_right=T_body_right)

    notes = [f"The calibration is that of {path.name}."]
    for name, entry in list(entries.items())[:cameras]:
        if entry.timeshift_cam_imu:
            notes.append(
                f"According to the calibration, the clock of {name} is {entry.timeshift_cam_imu:g} s "
                f"off the IMU's; the stamps were not changed."
            )
    return rig, tuple(notes)


def no_calibration(expected: Path) -> InputError:
    """The error about a missing calibration, with the file that was expected."""
    return InputError(f"the calibration is missing; name a camchain.yaml of Kalibr's or put it here: {expected}")
