"""Recordings in TartanAir's two layouts: simulated pinholes without stamps, axes north-east-down."""

from pathlib import Path

import numpy as np

from vobench.dataset.kalibr import chain_rig
from vobench.dataset.layout import Layout
from vobench.dataset.picture import unread
from vobench.dataset.recording import Notes, ReadOptions, Recording, assemble, numbered, picture_files, truth_file
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, looking, side_by_side

RATE_HZ = 25.0
MOST_HZ = 1e6
BASELINE_M = 0.25
FOCAL_PX = 320.0  # 90° across 640 pixels; the centre is half the size, as its authors give it
SIZES_PX = ((640, 480), (640, 640))
FLIP = se3.transform(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # ahead-right-down to ahead-left-up, and back
TRUTH = "of the left camera; world and body were turned from x ahead, y right, z down (NED) to x ahead, y left, z up."


VERSIONS = (  # what they call the left pictures, the right ones and the poses
    ("image_left", "image_right", "pose_left.txt"),
    ("image_lcam_front", "image_rcam_front", "pose_lcam_front.txt"),
)


def read_tartanair(folder: Path, options: ReadOptions) -> Recording:
    """A folder such as P000; the body is the left camera, its axes ahead, left, up. Raises InputError."""
    names = next((names for names in VERSIONS if (folder / names[0]).is_dir()), None)
    if names is None:
        raise InputError(f"no folder {' or '.join(left for left, _, _ in VERSIONS)} with pictures in {folder}")
    *sides, poses = names
    eyes = numbered(*(folder / name for name in sides if (folder / name).is_dir()))
    rate_hz = RATE_HZ if options.rate_hz is None else options.rate_hz
    if not 0 < rate_hz <= MOST_HZ:
        raise InputError(f"rate_hz should be above 0 and at most {MOST_HZ:g}, got {rate_hz:g}")
    t_ns = np.array([round(index * 1e9 / rate_hz) for index in range(len(eyes[0]))], np.int64)
    stream = picture_files(t_ns, *eyes)
    rig, calibration, lens_notes = _rig(folder, stream.size_px, len(eyes), options)
    truth, truth_notes = truth_file(options, [folder / poses], t_ns, TRUTH, FLIP)
    notes = [f"There are no stamps: pictures were taken to come at {rate_hz:g} Hz from 0.", *lens_notes, *truth_notes]
    notes += unread(folder, *names)
    if len(eyes) == 1:
        notes.append(f"There is one camera: no folder {sides[1]}.")
    return assemble("tartanair", rig, stream, t_ns, truth=truth, notes=notes, calibration=calibration)


def _rig(folder: Path, size_px: tuple[int, int], count: int, options: ReadOptions) -> tuple[Rig, str, Notes]:
    T_body_left = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))
    if options.calibration is not None:
        rig, notes = chain_rig(options.calibration, count, T_body_left)
        return rig, str(options.calibration), notes
    if size_px not in SIZES_PX:
        raise InputError(
            f"TartanAir's pictures have {' or '.join(f'{w} x {h}' for w, h in SIZES_PX)} pixels, these have "
            f"{size_px[0]} x {size_px[1]}: name their camchain.yaml for {folder}"
        )
    camera = Pinhole(*size_px, FOCAL_PX, FOCAL_PX, size_px[0] / 2, size_px[1] / 2)
    known = f"The calibration is the simulator's: f {FOCAL_PX:g} px, centre {camera.cx_px:g} {camera.cy_px:g}"
    if count == 1:
        return Rig(camera, None, T_body_left, None), "TartanAir's own", (f"{known}.",)
    rig = Rig(camera, camera, T_body_left, T_body_left @ side_by_side(BASELINE_M))
    return rig, "TartanAir's own", (f"{known}, baseline {BASELINE_M:g} m.",)


LAYOUTS = (
    Layout(
        "tartanair",
        "TartanAir: image_left/ or image_lcam_front/",
        lambda path: any((path / left).is_dir() for left, _, _ in VERSIONS),
        read_tartanair,
        frozenset({"calibration", "truth", "rate_hz"}),
    ),
)
