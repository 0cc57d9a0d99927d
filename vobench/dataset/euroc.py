"""Recordings in the ASL layout: EuRoC's, and TUM-VI's, whose folders are alike."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vobench.dataset.assemble import assemble
from vobench.dataset.calibration import chain_rig, find_chain, find_imu, no_calibration
from vobench.dataset.euroc_sensor import read_imu_csv, sensor_camera, sensor_imu, sensor_place
from vobench.dataset.files import unread
from vobench.dataset.kalibr import read_imu
from vobench.dataset.options import Options
from vobench.dataset.picture_list import PictureList, paired, present, read_list, shots_of
from vobench.dataset.recording import Recording
from vobench.dataset.stream import PictureStream
from vobench.dataset.truth import read_truth_file
from vobench.dataset.yaml_values import read_yaml
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.trajectory.trajectory import Stamps, Trajectory

CAMERAS, SENSOR, DATA = ("cam0", "cam1"), "sensor.yaml", "data.csv"
# In order of trust: the batch estimate, TUM-VI's poses of the IMU, and a tracker's of its marker.
TRUTHS = ("state_groundtruth_estimate0", "mocap0", "vicon0")
POSITIONS = "leica0"
BASE = "base_link"  # of our own export: where our body sits on the IMU

Notes = tuple[str, ...]


def read_euroc(folder: Path, options: Options, *, form: str = "euroc") -> Recording:
    """A folder with mav0/, or that folder itself; the body is the IMU.

    Raises InputError, one sentence, naming the file that is missing or wrong.
    """
    root = folder / "mav0" if (folder / "mav0").is_dir() else folder
    eyes, pairing = _pictures(root, options)
    stream = PictureStream.open(shots_of(eyes[0].t_ns, *(eye.paths for eye in eyes)))
    rig, calibration, lens_notes = _rig(root, folder, len(eyes), options)
    imu, imu_calibration, imu_notes = _imu(root, folder, options)
    truth, truth_notes = _truth(root, eyes[0].t_ns, options)
    rig, truth, body = _on_body(replace(rig, imu=imu_calibration), truth, sensor_place(root / BASE))
    source = next((name for name in TRUTHS if (root / name / DATA).is_file()), POSITIONS)
    others = unread(root, *CAMERAS, "imu0", BASE, source, "body.yaml")
    notes = (body, *pairing, *lens_notes, *imu_notes, *truth_notes, *others)
    return assemble(form, rig, stream, eyes[0].t_ns, truth=truth, imu=imu, notes=notes, calibration=str(calibration))


def _pictures(root: Path, options: Options) -> tuple[list[PictureList], Notes]:
    """The pictures of the one or two cameras that are there, in step."""
    if not (root / CAMERAS[0]).is_dir():
        raise InputError(f"no folder {CAMERAS[0]} with pictures in {root}")
    folders = [root / name for name in CAMERAS if (root / name).is_dir()]
    eyes = [read_list(folder / DATA, folder / "data", separator=",", unit="ns") for folder in folders]
    if len(eyes) == 1:
        notes: Notes = (f"There is one camera: no folder {CAMERAS[1]}.",)
    else:
        *eyes, notes = paired(eyes[0], eyes[1], options.within_ns)
    found, missing = present(*eyes)
    return found, (*notes, *missing)


def _rig(root: Path, folder: Path, count: int, options: Options) -> tuple[Rig, Path, Notes]:
    """The cameras on the IMU, by Kalibr's chain where one is given, by their sensor.yaml, or by a chain that is there.

    The path is that of the calibration.
    """
    sensors = [root / name / SENSOR for name in CAMERAS[:count]]
    chain = options.calibration or (None if all(path.is_file() for path in sensors) else find_chain(folder, options))
    if chain is not None:
        rig, notes = chain_rig(chain, count, "imu")
        return rig, chain, (f"The calibration is that of {chain.name}.", *notes)
    missing = next((path for path in sensors if not path.is_file()), None)
    if missing is not None:
        raise no_calibration(missing)
    cameras = [sensor_camera(read_yaml(path)) for path in sensors]
    (left, T_body_left), (right, T_body_right) = cameras[0], cameras[1] if count > 1 else (None, None)
    note = "Pictures stay as they are, not rectified; the lens is in the calibration (sensor.yaml)."
    return Rig(left, right, T_body_left, T_body_right), sensors[0], (note,)


def _imu(root: Path, folder: Path, options: Options) -> tuple[ImuReadings | None, ImuCalibration | None, Notes]:
    """Readings and calibration; neither where one is missing."""
    data, sensor = root / "imu0" / DATA, root / "imu0" / SENSOR
    if not data.is_file():
        return None, None, ("There are no readings of an IMU.",)
    noise = options.imu or (None if sensor.is_file() else find_imu(folder, options))
    if noise is not None:
        return read_imu_csv(data), read_imu(noise, np.eye(4)), (f"The IMU's noise is that of {noise.name}.",)
    if not sensor.is_file():
        return None, None, (f"The IMU was dropped: nothing says how noisy it is ({sensor} or Kalibr's imu.yaml).",)
    return read_imu_csv(data), sensor_imu(read_yaml(sensor)), ()


def _truth(root: Path, frames_ns: Stamps, options: Options) -> tuple[Trajectory | None, Notes]:
    """The body's path by the best source there is."""
    if options.truth is not None:
        truth, notes = read_truth_file(options.truth, frames_ns)
        return truth, (f"The truth is {options.truth.name}, taken to be of the body.", *notes)
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
        truth, how = truth.of_mounted(se3.inverse(T_body_tracked)), "moved to the body by its T_BS"
    rest = ("Velocities and biases beside the true poses were not read.",) if folder.name == TRUTHS[0] else ()
    return truth, (f"The truth is {folder.name}, {how}.", *rest, *notes)


def _on_body(rig: Rig, truth: Trajectory | None, T_imu_base: Array | None) -> tuple[Rig, Trajectory | None, str]:
    """Rig and truth on the body that a recording of our own had before it was exported, or on the IMU."""
    if T_imu_base is None:
        return rig, truth, "The body is the IMU."
    T_base_imu = se3.inverse(T_imu_base)
    moved = Rig(
        rig.left,
        rig.right,
        T_base_imu @ rig.T_body_left,
        None if rig.T_body_right is None else T_base_imu @ rig.T_body_right,
        imu=replace(rig.imu, T_body_imu=T_base_imu @ rig.imu.T_body_imu) if rig.imu else None,
    )
    return moved, truth.of_mounted(T_imu_base) if truth else None, f"The body is {BASE}, as its sensor.yaml places it."
