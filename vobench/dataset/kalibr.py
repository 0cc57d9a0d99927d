"""Calibration files: Kalibr's camera chains and IMUs, and YAML values checked."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent

from vobench.dataset.picture import listed, read_text
from vobench.dataset.recording import ReadOptions
from vobench.errors import InputError, SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Camera, DoubleSphere, Equirectangular, KannalaBrandt, Pinhole
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array

MOST_CHARACTERS = 1 << 16  # calibrations have a thousand or two
OPENCV_HEAD = re.compile(r"\A%YAML:1\.0[^\n]*")  # what OpenCV wants first, and no YAML allows
MOST_BRACKETS = 500  # a camera has a dozen; the parser takes time by the square of their depth
SKEW_TOLERANCE = 1e-3  # of a mount as people print it


@dataclass(frozen=True, slots=True)
class Values:
    """A YAML file as a tree; keys lead to what it says."""

    path: Path
    tree: Any

    def has(self, *keys: str) -> bool:
        """Whether there is something at a place."""
        return self._find(keys) is not None

    def at(self, *keys: str) -> Any:
        """What stands at a place. Raises InputError where nothing does."""
        found = self._find(keys)
        if found is None:
            raise InputError(f"{self.path}: the key {'.'.join(keys)} is missing")
        return found

    def text(self, *keys: str) -> str:
        """A text. Raises InputError."""
        return str(self._checked(keys, "text", lambda found: isinstance(found, str)))

    def number(self, *keys: str) -> float:
        """A finite number. Raises InputError."""
        return float(self._checked(keys, "a finite number", _is_number))

    def positive(self, *keys: str, or_zero: bool = False) -> float:
        """A finite number above 0, or from 0 on. Raises InputError."""
        found = self.number(*keys)
        if found < 0 or not (found or or_zero):
            raise self._wrong(keys, "0 or more" if or_zero else "above 0", found)
        return found

    def numbers(self, *keys: str) -> list[float]:
        """A list of finite numbers. Raises InputError."""
        wanted = "a list of finite numbers"
        found = self._checked(keys, wanted, lambda found: isinstance(found, list) and all(map(_is_number, found)))
        return [float(value) for value in found]

    def size(self, *keys: str) -> tuple[int, int]:
        """Width and height in pixels. Raises InputError."""
        found = self.numbers(*keys)
        if len(found) != 2 or any(value < 1 or value % 1 or value > 1e5 for value in found):
            raise self._wrong(keys, "a width and a height in pixels", found)
        return int(found[0]), int(found[1])

    def transform(self, *keys: str) -> Array:
        """A rigid transform (4, 4), as rows or as EuRoC's data; its rotation is made exact. Raises InputError."""
        found = self.at(*keys)
        flat = found.get("data") if isinstance(found, dict) else found
        rows = flat if isinstance(flat, list) else []
        cells = [cell for row in rows for cell in (row if isinstance(row, list) else [row])]
        if len(cells) != 16 or not all(map(_is_number, cells)):
            raise self._wrong(keys, "a 4 x 4 matrix of finite numbers", found)
        T = np.array(cells, float).reshape(4, 4)
        if not se3.is_rotation(T[:3, :3], tolerance=SKEW_TOLERANCE) or T[3].tolist() != [0, 0, 0, 1]:
            raise self._wrong(keys, "a rigid transform with the last row 0 0 0 1", T.tolist())
        return se3.transform(se3.nearest_rotation(T[:3, :3]), T[:3, 3])

    def _checked(self, keys: tuple[str, ...], wanted: str, is_right: Callable[[Any], bool]) -> Any:
        found = self.at(*keys)
        if not is_right(found):
            raise self._wrong(keys, wanted, found)
        return found

    def _find(self, keys: tuple[str, ...]) -> Any:
        tree = self.tree
        for key in keys:
            tree = tree.get(key) if isinstance(tree, dict) else None
        return tree

    def _wrong(self, keys: tuple[str, ...], wanted: str, found: Any) -> InputError:
        return InputError(f"{self.path}: {'.'.join(keys)} should be {wanted}, but is {_short(found)}")


def read_yaml(path: Path) -> Values:
    """A YAML 1.2 file with keys and values. Raises InputError, with line and column where there are some."""
    text = OPENCV_HEAD.sub("", read_text(path), count=1)
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"{len(text)} characters are no calibration (at most {MOST_CHARACTERS}): {path}")
    if text.count("[") + text.count("{") > MOST_BRACKETS:
        raise InputError(f"{path}: no YAML of a calibration has more than {MOST_BRACKETS} brackets")
    try:
        _refuse_aliases(text, path)
        tree = YAML(typ="safe", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
        raise InputError(f"{place}: no YAML: {_one_line(error.problem or error)}") from None
    except InputError:
        raise
    except Exception as error:  # odd text makes the parser raise errors of many kinds
        raise InputError(f"{path}: no YAML: {type(error).__name__} {_one_line(error)}") from None
    if not isinstance(tree, dict):
        raise InputError(f"{path}: should be keys with values, but is {_short(tree)}")
    return Values(path, tree)


def _refuse_aliases(text: str, path: Path) -> None:
    """No calibration has an alias, and a few nested ones stand for more than fits in memory."""
    for event in YAML(typ="safe", pure=True).parse(text):
        if isinstance(event, AliasEvent):
            raise InputError(f"{path}:{event.start_mark.line + 1}: an alias (*{event.anchor}) has no place here")


def _is_number(value: Any) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) < 1e300 and math.isfinite(value)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())[:200]


def _short(value: Any) -> str:
    shown = "nothing" if value is None else repr(value)
    return shown if len(shown) <= 120 else f"{shown[:117]}..."


RADTAN = ("radtan", "radial-tangential", "plumb_bob", "rational_polynomial")
EQUIDISTANT = ("equidistant", "equi", "fisheye", "kannala_brandt")
NONE = ("none", "")


def focal_camera(
    size_px: tuple[int, int], focal_px: list[float], model: str, coefficients: list[float], *, place: str
) -> Camera:
    """The camera of fx, fy, cx, cy and a distortion model by any of its names. Raises InputError naming `place`."""
    if len(focal_px) != 4 or not all(value > 0 for value in focal_px[:2]):
        raise InputError(f"{place}: a camera should have fx, fy, cx, cy with fx and fy above 0, but has {focal_px}")
    name = model.strip().lower()
    if name in (*NONE, *RADTAN) and not any(coefficients):
        return Pinhole(*size_px, *focal_px)
    if name in RADTAN and len(coefficients) in (4, 5, 8, 12, 14) and not any(coefficients[5:]):
        return BrownConrady(*size_px, *focal_px, *coefficients[:5])
    if name in EQUIDISTANT and len(coefficients) == 4:
        return KannalaBrandt(*size_px, *focal_px, *coefficients)
    raise InputError(
        f"{place}: no lens here has the distortion model '{model}' with the coefficients {coefficients}. "
        f"Known: radtan or plumb_bob (4 or 5), equidistant (4), none (0)"
    )


KALIBR_RADTAN = "radtan"
EQUI = "equidistant"
NO_BEND = "none"
PINHOLE = "pinhole"
SPHERES = "ds"
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
    """Kalibr's camera_model, intrinsics, distortion_model and _coeffs, k3 last if not 0. Raises SequenceError."""
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
            bend = KALIBR_RADTAN, np.array([getattr(camera, name) for name in names])
        case _:
            bend = KALIBR_RADTAN, np.zeros(len(RADTAN_TERMS))  # "none" is a word that OpenVINS lacks
    return PINHOLE, camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], *bend


def camchain(rig: Rig, topics: tuple[str, ...] = ("/cam0/image_raw", "/cam1/image_raw")) -> str:
    """The camchain.yaml of a rig. Raises SequenceError for a camera that sees all around."""
    return "".join(_entry(rig, index, topic) for index, topic in enumerate(topics[: len(rig.sides)]))


def _entry(rig: Rig, index: int, topic: str) -> str:
    side = rig.sides[index]
    camera = rig.camera(side)
    others = [other for other in range(len(rig.sides)) if other != index]
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
    """The imu.yaml of an IMU, without its place. Raises InputError for a number that Kalibr refuses, 0 or less."""
    found = {"update_rate": imu.rate_hz, **{name: getattr(imu, field) for field, name in DENSITIES.items()}}
    for name, value in found.items():
        if not 0 < value < np.inf:
            raise InputError(f"Kalibr reads no IMU whose {name} is {value:g}; it must be more than 0")
    return "".join([f"rostopic: {topic}\n", *(f"{name}: {number(value)}\n" for name, value in found.items())])


def read_camchain(path: Path) -> Rig:
    """The rig of a camchain.yaml; the body is the IMU, or cam0 where the chain knows none. Raises InputError."""
    chain = read_yaml(path)
    left = _camera(chain, "cam0")
    placed = chain.has("cam0", "T_cam_imu")
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


def read_pair(path: Path) -> Rig:
    """The pair of a camchain.yaml alone; the body is the left camera. Raises InputError."""
    return chain_rig(path, 2, np.eye(4))[0]


def _camera(chain: Values, name: str) -> Camera:
    model = chain.text(name, "camera_model")
    linear = chain.numbers(name, "intrinsics")
    size = chain.size(name, "resolution")
    if model == SPHERES and len(linear) == 6:
        return DoubleSphere(*size, *linear[2:], *linear[:2])
    if model != PINHOLE:
        known = f"{PINHOLE} (4 numbers) and {SPHERES} (6)"
        raise InputError(f"{chain.path}: {name} is {model} with {len(linear)} numbers, and {known} are known here")
    d = chain.numbers(name, "distortion_coeffs")
    return focal_camera(size, linear, chain.text(name, "distortion_model"), d, place=f"{chain.path}: {name}")


CHAIN_NAME = re.compile(r".*camchain.*\.ya?ml")
IMU_NAMES = ("imu.yaml", "imu_config.yaml", "imu0.yaml")
BESIDE = (".", "dso", "mav0")  # folders of a dataset that Kalibr's files may lie in


def find_chain(folder: Path, options: ReadOptions) -> Path | None:
    """The camera chain that the options name, or else the only one that lies in a dataset's folder."""
    if options.calibration is not None:
        return options.calibration
    found = [folder / at / name for at in BESIDE for name in listed(folder / at) if CHAIN_NAME.fullmatch(name)]
    if len(found) > 1:
        raise InputError(f"{len(found)} calibrations; name the one to use: {', '.join(map(str, found))}")
    return found[0] if found else None


def find_imu(folder: Path, options: ReadOptions) -> Path | None:
    """Kalibr's imu.yaml that the options name, or that lies in a dataset's folder."""
    if options.imu is not None:
        return options.imu
    return next((folder / at / name for at in BESIDE for name in IMU_NAMES if (folder / at / name).is_file()), None)


def chain_rig(path: Path, cameras: int, T_body_left: Array | None) -> tuple[Rig, tuple[str, ...]]:
    """The first cameras of Kalibr's chain, at T_body_left or on its IMU, and what to note. Raises InputError."""
    values = read_yaml(path)
    if cameras > 1 and not values.has("cam1"):
        raise InputError(f"a pair of cameras needs cam1, which is missing in {path}")
    if T_body_left is None and not values.has("cam0", "T_cam_imu"):
        raise InputError(f"the recording is about its IMU, so the chain should say cam0: T_cam_imu: {path}")
    rig = read_camchain(path)
    if cameras == 1:
        rig = replace(rig, right=None, T_body_right=None)
    if T_body_left is not None:
        T_body_right = T_body_left @ rig.T_left_right if rig.right else None
        rig = replace(rig, T_body_left=T_body_left, T_body_right=T_body_right)
    names = [name for name in ("cam0", "cam1")[:cameras] if values.has(name, "timeshift_cam_imu")]
    shifts_s = [(name, values.number(name, "timeshift_cam_imu")) for name in names]
    off = "By the calibration the clock of {} is {:g} s off the IMU's; stamps were left as they are."
    told = f"The calibration is that of {path.name}."
    return rig, (told, *(off.format(*shift) for shift in shifts_s if shift[1]))


def rig_of(left: tuple[Camera, Array], right: tuple[Camera, Array] | None = None) -> Rig:
    """The rig of one or two cameras, each with its T_body_camera."""
    return Rig(left[0], right and right[0], left[1], None if right is None else right[1])


def on_body(rig: Rig, T_body_old: Array) -> Rig:
    """A rig without wheels on another body, on which the old one sits so."""
    imu = rig.imu and replace(rig.imu, T_body_imu=T_body_old @ rig.imu.T_body_imu)
    T_body_right = None if rig.T_body_right is None else T_body_old @ rig.T_body_right
    return Rig(rig.left, rig.right, T_body_old @ rig.T_body_left, T_body_right, imu=imu)


def no_calibration(looked_for: Path) -> InputError:
    """The complaint that there is none, with the file that was looked for."""
    return InputError(f"the calibration is missing; name a camchain.yaml of Kalibr's or put it here: {looked_for}")
