"""Recordings in the layout of the TUM RGB-D benchmark: a colour camera, its depth, and its tracked path."""

import re
from pathlib import Path

import numpy as np

from vobench.dataset.assemble import assemble
from vobench.dataset.calibration import chain_rig, find_chain, no_calibration
from vobench.dataset.files import read_text, unread
from vobench.dataset.options import Options
from vobench.dataset.picture_list import present, read_list, shots_of
from vobench.dataset.recording import Recording
from vobench.dataset.stream import PictureStream
from vobench.dataset.truth import read_truth_file
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.lens import BrownConrady
from vobench.geometry.rig import Rig
from vobench.trajectory.trajectory import Stamps, Trajectory

LIST, TRUTH, DEPTH = "rgb.txt", "groundtruth.txt", "depth.txt"
# The colour cameras of the three robots, 640 x 480. Source: the benchmark's page "File Formats".
CAMERAS: dict[str, Camera] = {
    "freiburg1": BrownConrady(640, 480, 517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
    "freiburg2": BrownConrady(640, 480, 520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
    "freiburg3": Pinhole(640, 480, 535.4, 539.2, 320.1, 247.6),
}
WHICH = re.compile(r"(?:freiburg|fr)_?([123])(?![0-9])", re.IGNORECASE)

Notes = tuple[str, ...]


def read_tum(folder: Path, options: Options) -> Recording:
    """A folder with rgb.txt; the body is its camera. Raises InputError, one sentence, naming the file."""
    (pictures,), missing = present(read_list(folder / LIST, folder, separator=None, unit="s"))
    stream = PictureStream.open(shots_of(pictures.t_ns, pictures.paths))
    rig, calibration, lens_notes = _rig(folder, options)
    truth, truth_notes = _truth(folder, pictures.t_ns, options)
    notes = ["There is one camera, and it is the body: x right, y down, z ahead."]
    notes += [*missing, *lens_notes, *truth_notes]
    if (folder / DEPTH).exists():
        notes.append("Depth pictures were dropped.")
    notes += unread(folder, LIST, TRUTH, "rgb", DEPTH, "depth", Path(calibration).name)
    return assemble("tum", rig, stream, pictures.t_ns, truth=truth, notes=notes, calibration=calibration)


def _rig(folder: Path, options: Options) -> tuple[Rig, str, Notes]:
    """The camera by Kalibr's chain, or that of the robot that the folder's name or its list speaks of."""
    chain = find_chain(folder, options)
    if chain is not None:
        rig, notes = chain_rig(chain, 1, "left")
        return rig, str(chain), (f"The calibration is that of {chain.name}.", *notes)
    found = WHICH.search(folder.resolve().name) or WHICH.search(_title(folder / LIST))
    if found is None:
        raise no_calibration(folder / "camchain.yaml")
    robot = f"freiburg{found[1]}"
    rig = Rig(CAMERAS[robot], None, np.eye(4), None)
    return rig, f"{robot}'s published one", (f"The calibration is the benchmark's own of {robot}'s colour camera.",)


def _title(path: Path) -> str:
    """The comments at a list's start, which name the bag that it came from."""
    lines = read_text(path).splitlines()[:3]
    return " ".join(line for line in lines if line.startswith("#"))


def _truth(folder: Path, t_ns: Stamps, options: Options) -> tuple[Trajectory | None, Notes]:
    path = options.truth or folder / TRUTH
    if options.truth is None and not path.exists():
        return None, ()
    truth, notes = read_truth_file(path, t_ns)
    return truth, (f"The truth is {path.name}, of the camera.", *notes)
