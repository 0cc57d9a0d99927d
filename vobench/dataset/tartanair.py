"""Reads recordings in the two layouts of TartanAir, which have no stamps and use axes north, east, down."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vobench.dataset.kalibr import chain_rig
from vobench.dataset.layout import Layout
from vobench.dataset.picture import unread
from vobench.dataset.picture_list import numbered, picture_files
from vobench.dataset.recording import CalibratedRig, ReadOptions, Recording, assemble
from vobench.dataset.truth_file import truth_file
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, looking, side_by_side
from vobench.trajectory.nanoseconds import NS_PER_S

RATE_HZ = 25.0
MOST_HZ = 1e6
BASELINE_M = 0.25
FOCAL_PX = 320.0  # 90° for 640 pixels; the principal point is at half the size, as specified by the authors
SIZES_PX = ((640, 480), (640, 640))
T_NED_FLU = se3.transform(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # equals its inverse
SIMULATED = "TartanAir's own"
TRUTH = "of the left camera; world and body were turned from x ahead, y right, z down (NED) to x ahead, y left, z up."


@dataclass(frozen=True, slots=True)
class Version:
    """The names in one version of the dataset: the folders of left and right pictures, and the file of poses."""

    left: str
    right: str
    poses: str


VERSIONS = (
    Version("image_left", "image_right", "pose_left.txt"),
    Version("image_lcam_front", "image_rcam_front", "pose_lcam_front.txt"),
)


def _version_of(folder: Path) -> Version | None:
    return next((version for version in VERSIONS if (folder / version.left).is_dir()), None)


def _is_tartanair(folder: Path) -> bool:
    return _version_of(folder) is not None


def read_tartanair(folder: Path, options: ReadOptions) -> Recording:
    """Read a folder such as P000. Raises InputError.

    The frame of the body has its origin in the left camera; x points ahead, y left and z up.
    """
    version = _version_of(folder)
    if version is None:
        names = " or ".join(version.left for version in VERSIONS)
        raise InputError(f"no folder {names} with images in {folder}")
    folders = [folder / name for name in (version.left, version.right) if (folder / name).is_dir()]
    cameras = numbered(*folders)
    rate_hz = RATE_HZ if options.rate_hz is None else options.rate_hz
    if not 0 < rate_hz <= MOST_HZ:
        raise InputError(f"rate_hz should be above 0 and at most {MOST_HZ:g}, got {rate_hz:g}")
    stamps_ns = [round(index * NS_PER_S / rate_hz) for index in range(len(cameras[0]))]
    t_ns = np.array(stamps_ns, np.int64)

    stream = picture_files(t_ns, *cameras)
    calibration = _rig(folder, stream.size_px, len(cameras), options)
    truth, truth_notes = truth_file(options, [folder / version.poses], t_ns, TRUTH, T_NED_FLU)
    notes = [f"There are no stamps: the images were assumed to be taken at {rate_hz:g} Hz from 0."]
    notes += [*calibration.notes, *truth_notes]
    notes += unread(folder, version.left, version.right, version.poses)
    if len(cameras) == 1:
        notes.append(f"There is one camera: no folder {version.right}.")
    return assemble(
        "tartanair", calibration.rig, stream, t_ns, truth=truth, notes=notes, calibration=calibration.source
    )


def _rig(
    folder: Path,
    size_px: tuple[int, int],
    count: int,
    options: ReadOptions,
) -> CalibratedRig:
    T_body_left = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))
    if options.calibration is not None:
        rig, notes = chain_rig(options.calibration, count, T_body_left)
        return CalibratedRig(rig, str(options.calibration), notes)
    width, height = size_px
    if size_px not in SIZES_PX:
        sizes = " or ".join(f"{w} x {h}" for w, h in SIZES_PX)
        raise InputError(
            f"TartanAir's images have {sizes} pixels, these have {width} x {height}: "
            f"name their camchain.yaml for {folder}"
        )

    camera = Pinhole(width, height, FOCAL_PX, FOCAL_PX, width / 2, height / 2)
    lens = f"The calibration is the simulator's: f {FOCAL_PX:g} px, centre {camera.cx_px:g} {camera.cy_px:g}"
    if count == 1:
        return CalibratedRig(Rig(camera, None, T_body_left, None), SIMULATED, (f"{lens}.",))
    T_body_right = T_body_left @ side_by_side(BASELINE_M)
    rig = Rig(camera, camera, T_body_left, T_body_right)
    return CalibratedRig(rig, SIMULATED, (f"{lens}, baseline {BASELINE_M:g} m.",))


LAYOUTS = (
    Layout(
        "tartanair",
        "TartanAir: image_left/ or image_lcam_front/",
        _is_tartanair,
        read_tartanair,
        frozenset({"calibration", "truth", "rate_hz"}),
        truth=r"[^/]*/pose_[^/]*\.txt",
    ),
)
