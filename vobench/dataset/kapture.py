"""Reads recordings in the layout of kapture, version 1 (naver/kapture, kapture_format.adoc)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vobench.dataset.body import MountedCamera, mounted_rig
from vobench.dataset.distortion import focal_camera
from vobench.dataset.kalibr import chain_rig, find_chain, no_calibration
from vobench.dataset.layout import Layout
from vobench.dataset.picture import inside, read_text, unread
from vobench.dataset.picture_list import PictureList, paired_pictures, picture_files
from vobench.dataset.recording import CalibratedRig, Notes, ReadOptions, Recording, assemble
from vobench.dataset.truth_file import truth_file
from vobench.errors import InputError, enumerated
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.sequence.message import poses_from_fields
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.text_table import NUMBER, content_lines
from vobench.trajectory.trajectory import Stamps, Trajectory

FOLDER = "sensors"
SENSORS = "sensors.txt"
RIGS = "rigs.txt"
POSES = "trajectories.txt"
PICTURES = "records_camera.txt"
DATA = "records_data"
CAMERA = "camera"
UNKNOWN = "UNKNOWN_CAMERA"
# The units of times since 1970 and their length in ns, by the number of digits of a time between 2001 and 2286.
UNITS = {19: (1.0, "nanoseconds"), 16: (1e3, "microseconds"), 13: (1e6, "milliseconds")}
UNIT_TOLERANCE = 1e-3  # the largest difference of a quaternion's norm from 1
MOST_RATE_HZ = 10_000.0
MOST_NAMES_SHOWN = 8


class CameraModel(NamedTuple):
    """A camera model of COLMAP: the number of focal lengths, the name of its distortion, and its coefficients.

    `coefficients` are the positions of its parameters in OpenCV's order; None for a coefficient that it does not have.
    """

    focal_count: int
    distortion: str
    coefficients: tuple[int | None, ...]

    @property
    def parameter_count(self) -> int:
        """The number of parameters after the size of the picture."""
        used = [position for position in self.coefficients if position is not None]
        return self.focal_count + 2 + len(used)


MODELS = {
    "SIMPLE_PINHOLE": CameraModel(1, "none", ()),
    "PINHOLE": CameraModel(2, "none", ()),
    "SIMPLE_RADIAL": CameraModel(1, "radtan", (0, None, None, None)),
    "RADIAL": CameraModel(1, "radtan", (0, 1, None, None)),
    "OPENCV": CameraModel(2, "radtan", (0, 1, 2, 3)),
    "FULL_OPENCV": CameraModel(2, "radtan", (0, 1, 2, 3, 4, 5, 6, 7)),
    "OPENCV_FISHEYE": CameraModel(2, "equidistant", (0, 1, 2, 3)),
}


class Row(NamedTuple):
    """A row of a table: its file and line for messages, and its fields."""

    place: str
    fields: list[str]


@dataclass(frozen=True, slots=True)
class Pictures:
    """The pictures of one camera as they are listed: stamps of an unknown unit, and paths."""

    stamps: Sequence[int]
    paths: tuple[Path, ...]


def _is_kapture(folder: Path) -> bool:
    return (folder / FOLDER / SENSORS).is_file()


def read_kapture(folder: Path, options: ReadOptions) -> Recording:
    """The recording in a folder with sensors/sensors.txt. The body is the rig, or the only camera. Raises InputError.

    Stamps are integers whose unit the layout does not define. They are taken for nanoseconds, microseconds or
    milliseconds since 1970 by their size, and otherwise for numbers of pictures.
    """
    root = folder / FOLDER
    cameras = _camera_rows(root)
    listed = _pictures(root)
    mounts = _mounts(root)
    chosen = _chosen(cameras, listed, mounts, root)
    clock = _Clock.of(listed[chosen[0]].stamps, options.rate_hz, root / PICTURES)
    lists = [_in_order(listed[name], clock, root / PICTURES) for name in chosen]
    pictures, picture_notes = paired_pictures(lists, within_ns=options.within_ns)
    t_ns = pictures[0].t_ns
    stream = picture_files(t_ns, *(camera.paths for camera in pictures))

    calibration = _calibration(folder, {name: cameras[name] for name in chosen}, mounts, options)
    if options.truth is None:
        truth, truth_notes = _truth(root, chosen, mounts, clock)
    else:
        truth, truth_notes = truth_file(options, (), t_ns, "assumed to be of the body.")
    has_rig = chosen[0] in mounts.T_sensor_rig
    notes = [
        f"The images are those of {' and '.join(chosen)}.",
        "The body is the rig." if has_rig else "There is one camera, and it is the body: x right, y down, z ahead.",
        clock.note,
        *picture_notes,
        *calibration.notes,
        *truth_notes,
        *unread(root, SENSORS, RIGS, POSES, PICTURES, DATA),
    ]
    return assemble("kapture", calibration.rig, stream, t_ns, truth=truth, notes=notes, calibration=calibration.source)


# --- Tables ---


def _rows(path: Path, least: int, what: str) -> list[Row]:
    """The rows of a table. Raises InputError for a row with fewer than `least` fields."""
    rows = []
    for line in content_lines(read_text(path)):
        fields = [text.strip() for text in line.text.split(",")]
        place = f"{path}:{line.number}"
        if len(fields) < least:
            raise InputError(f"{place}: a row should have {what}, but is {line.text[:80]!r}")
        rows.append(Row(place, fields))
    return rows


def _numbers(row: Row, fields: Sequence[str]) -> list[float]:
    """The fields as numbers. Raises InputError."""
    for text in fields:
        if not NUMBER.fullmatch(text):
            raise InputError(f"{row.place}: should be a number, but is {text!r}")
    return [float(text) for text in fields]


def _stamp(row: Row) -> int:
    text = row.fields[0]
    if not text.isascii() or not text.isdigit():
        raise InputError(f"{row.place}: a stamp should be an integer, but is {text!r}")
    return int(text)


def _transform(row: Row) -> Array:
    """The transform (4, 4) of the last seven fields qw, qx, qy, qz, tx, ty, tz. Raises InputError."""
    qw, qx, qy, qz, tx, ty, tz = _numbers(row, row.fields[2:9])
    fields = np.array([tx, ty, tz, qx, qy, qz, qw])
    norm = float(np.linalg.norm(fields[3:]))
    if abs(norm - 1) > UNIT_TOLERANCE:
        raise InputError(f"{row.place}: the quaternion should have norm 1, but has {norm:.6g}")
    fields[3:] /= norm
    T: Array = poses_from_fields(fields)
    return T


# --- Cameras ---


def _camera_rows(root: Path) -> dict[str, Row]:
    """The rows of the cameras in sensors.txt by name. Raises InputError if there is none."""
    rows = _rows(root / SENSORS, 3, "an identifier, a name and a type")
    cameras = {row.fields[0]: row for row in rows if row.fields[2] == CAMERA}
    if not cameras:
        raise InputError(f"no sensor of the type '{CAMERA}' in {root / SENSORS}")
    return cameras


def _camera(row: Row) -> Camera | None:
    """The camera of a row; None if its parameters are unknown. Raises InputError for a model that vobench lacks."""
    model_name, *texts = row.fields[3:] or [UNKNOWN]
    if model_name == UNKNOWN:
        return None
    model = MODELS.get(model_name)
    if model is None:
        known = enumerated(list(MODELS), len(MODELS))
        raise InputError(f"{row.place}: no camera model {model_name!r} in vobench; known are {known}")
    if len(texts) != 2 + model.parameter_count:
        raise InputError(
            f"{row.place}: {model_name} has a size and {model.parameter_count} parameters, here {len(texts) - 2}"
        )
    width, height, *values = _numbers(row, texts)
    focals_px = values[: model.focal_count]
    center_px = values[model.focal_count : model.focal_count + 2]
    bends = values[model.focal_count + 2 :]
    coefficients = [0.0 if position is None else bends[position] for position in model.coefficients]
    focal_px = [focals_px[0], focals_px[-1], *center_px]
    size_px = (int(width), int(height))
    return focal_camera(size_px, focal_px, model.distortion, coefficients, place=row.place)


@dataclass(frozen=True, slots=True)
class Mounts:
    """The name of the rig, empty if there is none, and T_sensor_rig (4, 4) of the sensors on it by name."""

    rig: str
    T_sensor_rig: Mapping[str, Array]

    def T_rig_sensor(self, sensor: str) -> Array:
        """The pose (4, 4) of a sensor on the rig; the identity for one that is the body itself."""
        return se3.inverse(self.T_sensor_rig.get(sensor, np.eye(4)))


def _mounts(root: Path) -> Mounts:
    """Where the sensors are on the rig. Raises InputError if there is more than one rig."""
    path = root / RIGS
    rows = _rows(path, 9, "a rig, a sensor, qw, qx, qy, qz, tx, ty, tz") if path.is_file() else []
    rigs = sorted({row.fields[0] for row in rows})
    if len(rigs) > 1:
        named = enumerated(rigs, MOST_NAMES_SHOWN)
        raise InputError(f"one rig is read, and there are {len(rigs)} in {path}: {named}")
    return Mounts("".join(rigs), {row.fields[1]: _transform(row) for row in rows})


def _chosen(cameras: Mapping[str, Row], listed: Mapping[str, Pictures], mounts: Mounts, root: Path) -> list[str]:
    """The names of the left and the right camera, or of the only one.

    Raises InputError if there are three or more cameras with pictures, or two of which the rig says nothing.
    """
    names = [name for name in cameras if name in listed]
    if not names:
        raise InputError(f"{PICTURES} names no camera of {SENSORS} in {root}")
    if len(names) == 1:
        return names
    if len(names) > 2:
        raise InputError(
            f"one camera or a stereo pair is read, and there are {len(names)} cameras: "
            f"{enumerated(names, MOST_NAMES_SHOWN)}; keep the rows of two in {root / PICTURES}"
        )
    missing = [name for name in names if name not in mounts.T_sensor_rig]
    if missing:
        raise InputError(f"{RIGS} should say where {' and '.join(missing)} is on the rig: {root}")
    first, second = names
    T_first_second = mounts.T_sensor_rig[first] @ mounts.T_rig_sensor(second)
    is_second_right = T_first_second[0, 3] > 0  # x points to the right
    return [first, second] if is_second_right else [second, first]


def _calibration(folder: Path, chosen: Mapping[str, Row], mounts: Mounts, options: ReadOptions) -> CalibratedRig:
    """The rig by the Kalibr file of the options, or else by sensors.txt and rigs.txt, or a Kalibr file there.

    `chosen` are the rows of the left and the right camera.
    """
    sensors = folder / FOLDER / SENSORS
    chain = options.calibration
    mounted = []
    for name, row in chosen.items():
        camera = _camera(row)
        if camera is None:
            chain = chain or find_chain(folder, options)
            if chain is None:
                raise no_calibration(sensors)
        else:
            mounted.append(MountedCamera(camera, mounts.T_rig_sensor(name)))
    if chain is not None:
        left = next(iter(chosen))
        rig, notes = chain_rig(chain, len(chosen), mounts.T_rig_sensor(left))
        return CalibratedRig(rig, str(chain), notes)
    note = "The centre of the image is used as written; in COLMAP's convention it would be half a pixel less."
    return CalibratedRig(mounted_rig(*mounted), str(sensors), (note,))


# --- Pictures ---


def _pictures(root: Path) -> dict[str, Pictures]:
    """The listed pictures by camera. Raises InputError."""
    path = root / PICTURES
    if not path.is_file():
        raise InputError(f"no {PICTURES} with images in {root}")
    by_camera: dict[str, list[tuple[int, Path]]] = {}
    for row in _rows(path, 3, "a stamp, a camera and an image's path"):
        picture = inside(root / DATA, row.fields[2], row.place)
        by_camera.setdefault(row.fields[1], []).append((_stamp(row), picture))
    listed = {}
    for name, pictures in by_camera.items():
        pictures.sort()
        stamps, paths = zip(*pictures, strict=True)
        listed[name] = Pictures(stamps, paths)
    return listed


@dataclass(frozen=True, slots=True)
class _Clock:
    """Converts stamps to nanoseconds: `start` is subtracted first, `ns` is the length of their unit."""

    start: int
    ns: float
    note: str

    @classmethod
    def of(cls, stamps: Sequence[int], rate_hz: float | None, path: Path) -> "_Clock":
        """The clock of the stamps of a camera. `rate_hz` is the rate of pictures that are numbered.

        Raises InputError if the pictures are numbered and the rate is not known.
        """
        if rate_hz is not None:
            if not 0 < rate_hz <= MOST_RATE_HZ:
                raise InputError(f"rate_hz should be above 0 and at most {MOST_RATE_HZ:g}, got {rate_hz:g}")
            note = f"The stamps were taken for numbers of images, which were taken at {rate_hz:g} Hz from 0."
            return cls(stamps[0], NS_PER_S / rate_hz, note)
        unit = UNITS.get(len(str(stamps[0])))
        if unit is None:
            raise InputError(
                f"the stamps are no times since 1970 in ns, µs or ms (the first is {stamps[0]}): "
                f"give the rate of the images (--rate): {path}"
            )
        unit_ns, name = unit
        return cls(0, unit_ns, f"The stamps were taken for {name}, by their size.")

    def t_ns(self, stamps: Sequence[int]) -> Stamps:
        """The times (N,) of stamps."""
        if self.ns.is_integer():
            return np.array([(stamp - self.start) * int(self.ns) for stamp in stamps], np.int64)
        return np.array([round((stamp - self.start) * self.ns) for stamp in stamps], np.int64)


def _in_order(pictures: Pictures, clock: _Clock, path: Path) -> PictureList:
    """The pictures with their times. Raises InputError if two of one camera have the same."""
    t_ns = clock.t_ns(pictures.stamps)
    repeated = np.flatnonzero(np.diff(t_ns) <= 0)
    if len(repeated):
        raise InputError(f"two images of one camera have the stamp {pictures.stamps[int(repeated[0])]}: {path}")
    return PictureList(str(path), t_ns, pictures.paths)


# --- Truth ---


def _truth(root: Path, chosen: Sequence[str], mounts: Mounts, clock: _Clock) -> tuple[Trajectory | None, Notes]:
    """The poses of the body: those of the rig, or else of the left or right camera. Raises InputError."""
    path = root / POSES
    if not path.is_file():
        return None, ()
    by_device: dict[str, dict[int, Array]] = {}
    for row in _rows(path, 9, "a stamp, a device, qw, qx, qy, qz, tx, ty, tz"):
        by_device.setdefault(row.fields[1], {})[_stamp(row)] = _transform(row)

    device = next((name for name in (mounts.rig, *chosen) if name in by_device), None)
    if device is None:
        return None, (f"{POSES} has no poses of the rig or of {' or '.join(chosen)}, and was not read.",)
    poses = dict(sorted(by_device[device].items()))
    T_device_world = np.stack(list(poses.values()))
    T_device_body = mounts.T_sensor_rig.get(device, np.eye(4))
    T_world_body = se3.inverse(T_device_world) @ T_device_body
    note = f"The truth is that of {device}; {POSES} may be the result of a reconstruction."
    return Trajectory(clock.t_ns(list(poses)), T_world_body), (note,)


LAYOUTS = (
    Layout(
        "kapture",
        "kapture: sensors/sensors.txt",
        _is_kapture,
        read_kapture,
        frozenset({"calibration", "truth", "rate_hz", "within_ns"}),
        truth=r"sensors/trajectories\.txt",
    ),
)
