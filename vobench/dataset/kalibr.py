"""Calibration as Kalibr writes it: chains of cameras, and the IMU.

T_cam_imu takes points in the IMU's axes to the camera's, T_cn_cnm1 those of the camera before to this one's.
Source: the Kalibr wiki's pages "Yaml formats" and "Supported models".
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vobench.dataset.lens import focal_camera
from vobench.dataset.yaml_values import Values, read_yaml
from vobench.errors import InputError, SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.lens import BrownConrady, KannalaBrandt
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array
from vobench.geometry.sphere import DoubleSphere, Equirectangular

RADTAN, EQUI, NO_BEND = "radtan", "equidistant", "none"
PINHOLE, SPHERES = "pinhole", "ds"
RADTAN_TERMS = ("k1", "k2", "p1", "p2")
ALL_AROUND = "neither Kalibr nor EuRoC has words for a camera that sees all around (ros2 keeps it)"
DENSITIES = {
    "accel_noise": "accelerometer_noise_density",
    "accel_walk": "accelerometer_random_walk",
    "gyro_noise": "gyroscope_noise_density",
    "gyro_walk": "gyroscope_random_walk",
}


def remarks(rig: Rig) -> list[str]:
    """Sentences on what Kalibr itself would not read in a rig's camchain."""
    fifths = [camera.k3 for side in rig.sides if isinstance(camera := rig.camera(side), BrownConrady)]
    if not any(fifths):
        return []
    return [f"Kalibr's radtan ends at k1 k2 p1 p2; the fifth number of these lenses is k3 = {max(fifths, key=abs):g}."]


def number(value: float) -> str:
    """Every digit, with a decimal point: PyYAML, which Kalibr reads with, takes 1e-05 for text and 1.0e-05 not."""
    text = repr(float(value))
    mantissa, e, exponent = text.partition("e")
    return text if not e or "." in mantissa else f"{mantissa}.0e{exponent}"


def numbers(values: ArrayLike) -> str:
    """A list of numbers in one line of YAML."""
    return f"[{', '.join(map(number, np.asarray(values, float).ravel().tolist()))}]"


def intrinsics(camera: Camera) -> tuple[str, Array, str, Array]:
    """Kalibr's camera_model, intrinsics, distortion_model and distortion_coeffs, k3 last where it is not 0.

    Raises SequenceError for a camera that sees all around.
    """
    match camera:
        case Equirectangular():
            raise SequenceError(ALL_AROUND)
        case DoubleSphere():
            linear = [camera.xi, camera.alpha, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]
            return SPHERES, np.array(linear), NO_BEND, np.array([])
        case KannalaBrandt():
            bend = EQUI, np.array([getattr(camera, name) for name in camera.coefficients])
        case BrownConrady():
            names = camera.coefficients if camera.k3 else RADTAN_TERMS
            bend = RADTAN, np.array([getattr(camera, name) for name in names])
        case _:
            bend = RADTAN, np.zeros(len(RADTAN_TERMS))  # "none" is a word that OpenVINS lacks
    return PINHOLE, camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], *bend


def camchain(rig: Rig, topics: tuple[str, ...] = ("/cam0/image_raw", "/cam1/image_raw")) -> str:
    """The camchain.yaml of a rig. Raises SequenceError for a camera that sees all around."""
    return "".join(_entry(rig, index, topic) for index, topic in enumerate(topics[: len(rig.sides)]))


def _entry(rig: Rig, index: int, topic: str) -> str:
    side = rig.sides[index]
    camera, others = rig.camera(side), [other for other in range(len(rig.sides)) if other != index]
    model, linear, bend, coefficients = intrinsics(camera)
    T_cam_body = se3.inverse(rig.T_body_camera(side))
    lines = [
        f"cam{index}:",
        *(_matrix("T_cam_imu", T_cam_body @ rig.imu.T_body_imu) if rig.imu else []),
        *(_matrix("T_cn_cnm1", T_cam_body @ rig.T_body_left) if index else []),
        f"  cam_overlaps: {others}",
        f"  camera_model: {model}",
        f"  distortion_coeffs: {numbers(coefficients)}",
        f"  distortion_model: {bend}",
        f"  intrinsics: {numbers(linear)}",
        f"  resolution: [{camera.width_px}, {camera.height_px}]",
        f"  rostopic: {topic}",
        *(["  timeshift_cam_imu: 0.0"] if rig.imu else []),
    ]
    return "\n".join(lines) + "\n"


def _matrix(name: str, T: Array) -> list[str]:
    return [f"  {name}:", *(f"    - {numbers(row)}" for row in T)]


def imu_yaml(imu: ImuCalibration, *, topic: str) -> str:
    """The imu.yaml of an IMU, without its place, which Kalibr finds out.

    Raises InputError where one of the numbers is not positive, which Kalibr refuses.
    """
    found = {"update_rate": imu.rate_hz, **{name: getattr(imu, field) for field, name in DENSITIES.items()}}
    for name, value in found.items():
        if not 0 < value < np.inf:
            raise InputError(f"Kalibr reads no IMU whose {name} is {value:g}; it must be more than 0")
    return "".join([f"rostopic: {topic}\n", *(f"{name}: {number(value)}\n" for name, value in found.items())])


def read_camchain(path: Path) -> Rig:
    """The rig of a camchain.yaml, cam0 on the left; the body is the IMU, or cam0 where the chain says nothing of one.

    Raises InputError.
    """
    chain = read_yaml(path)
    left, placed = _camera(chain, "cam0"), chain.has("cam0", "T_cam_imu")
    T_body_left = se3.inverse(chain.transform("cam0", "T_cam_imu")) if placed else np.eye(4)
    if not chain.has("cam1"):
        return Rig(left, None, T_body_left, None)
    T_body_right = T_body_left @ se3.inverse(chain.transform("cam1", "T_cn_cnm1"))
    return Rig(left, _camera(chain, "cam1"), T_body_left, T_body_right)


def read_imu(path: Path, T_body_imu: Array) -> ImuCalibration:
    """The IMU of an imu.yaml, flat as Kalibr takes it or under `imu0` as it gives it. Raises InputError."""
    entries = read_yaml(path)
    keys = ("imu0",) if entries.has("imu0") else ()
    return imu_numbers(entries, T_body_imu, (*keys, "update_rate"), keys)


def imu_numbers(entries: Values, T_body_imu: Array, rate: tuple[str, ...], within: tuple[str, ...]) -> ImuCalibration:
    """The IMU with its rate at one place of a file and its four densities within another. Raises InputError."""
    densities = {field: entries.positive(*within, name, or_zero=True) for field, name in DENSITIES.items()}
    return ImuCalibration(T_body_imu, entries.positive(*rate), **densities)


def _camera(chain: Values, name: str) -> Camera:
    """One camera of a chain. Raises InputError for a model that is not known here."""
    model, linear = chain.text(name, "camera_model"), chain.numbers(name, "intrinsics")
    size = chain.size(name, "resolution")
    if model == SPHERES and len(linear) == 6:
        return DoubleSphere(*size, *linear[2:], *linear[:2])
    if model != PINHOLE:
        known = f"{PINHOLE} (4 numbers) and {SPHERES} (6)"
        raise InputError(f"{chain.path}: {name} is {model} with {len(linear)} numbers, and {known} are known here")
    d = chain.numbers(name, "distortion_coeffs")
    return focal_camera(size, linear, chain.text(name, "distortion_model"), d, place=f"{chain.path}: {name}")
