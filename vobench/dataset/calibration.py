"""Where a dataset's calibration lies, and the rig that Kalibr's files make of it."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from vobench.dataset.files import listed
from vobench.dataset.kalibr import read_camchain
from vobench.dataset.options import Options
from vobench.dataset.yaml_values import read_yaml
from vobench.errors import InputError
from vobench.geometry.rig import Rig

CHAIN_NAME = re.compile(r".*camchain.*\.ya?ml")
IMU_NAMES = ("imu.yaml", "imu_config.yaml", "imu0.yaml")
BESIDE = (".", "dso", "mav0")  # folders of a dataset that Kalibr's files may lie in


def find_chain(folder: Path, options: Options) -> Path | None:
    """The camera chain that the options name, or else the only one that lies in a dataset's folder."""
    if options.calibration is not None:
        return options.calibration
    found = [folder / at / name for at in BESIDE for name in listed(folder / at) if CHAIN_NAME.fullmatch(name)]
    if len(found) > 1:
        raise InputError(f"{len(found)} calibrations; name the one to use: {', '.join(map(str, found))}")
    return found[0] if found else None


def find_imu(folder: Path, options: Options) -> Path | None:
    """Kalibr's imu.yaml that the options name, or that lies in a dataset's folder."""
    if options.imu is not None:
        return options.imu
    return next((folder / at / name for at in BESIDE for name in IMU_NAMES if (folder / at / name).is_file()), None)


def chain_rig(path: Path, cameras: int, body: Literal["imu", "left"]) -> tuple[Rig, tuple[str, ...]]:
    """The first one or two cameras of Kalibr's chain on a body that is the IMU or the left camera, and what to note.

    Raises InputError where the chain has fewer cameras, or does not say where the IMU is.
    """
    values = read_yaml(path)
    if cameras > 1 and not values.has("cam1"):
        raise InputError(f"a recording with two cameras needs cam1, which is missing in {path}")
    if body == "imu" and not values.has("cam0", "T_cam_imu"):
        raise InputError(f"the recording is about its IMU, so the chain should say cam0: T_cam_imu: {path}")
    rig = read_camchain(path)
    if cameras == 1:
        rig = replace(rig, right=None, T_body_right=None)
    elif rig.right and body == "left":
        rig = replace(rig, T_body_right=rig.T_left_right)
    if body == "left":
        rig = replace(rig, T_body_left=np.eye(4))
    names = [name for name in ("cam0", "cam1")[:cameras] if values.has(name, "timeshift_cam_imu")]
    shifts_s = [(name, values.number(name, "timeshift_cam_imu")) for name in names]
    return rig, tuple(
        f"By the calibration the clock of {name} is {shift_s:g} s off the IMU's; stamps were left as they are."
        for name, shift_s in shifts_s
        if shift_s
    )


def no_calibration(looked_for: Path) -> InputError:
    """The complaint that there is none, with the file that was looked for."""
    return InputError(f"the calibration is missing; name a camchain.yaml of Kalibr's or put it here: {looked_for}")
