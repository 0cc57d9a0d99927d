"""Reads and writes calib.txt, the calibration in KITTI's odometry benchmark."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vobench.dataset.body import MountedCamera, mounted_rig
from vobench.dataset.kitti_folder import PAIRS, matrix_name
from vobench.dataset.picture import read_text
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, focal_and_center_px
from vobench.geometry.rig import Rig, projection
from vobench.geometry.se3 import Array
from vobench.trajectory.text_table import Line, content_lines, read_table

FIRST_SIZE_PX = (1241, 376)  # the pictures of sequences 00 to 02
LARGEST_OFFSET = 0.1  # of the principal point from the picture's center, as a share of the picture's size
SKEW_TOLERANCE = 1e-6  # the largest error of an element of K that should be 0 or 1; KITTI prints seven digits


def read_pair(path: Path, size_px: tuple[int, int] | None = None) -> Rig:
    """The stereo pair in a calib.txt: P0 and P1 if it has both, otherwise P2 and P3. The body is the camera of P0.

    Without `size_px`, pictures have the size of KITTI's first sequences.
    Raises InputError if the file is not valid, or if its principal point does not fit the assumed size.
    """
    matrices = read_calibration(path)
    names = _preferred_pair(path, matrices)
    rig = rig_of_matrices(path, matrices, names, size_px or FIRST_SIZE_PX)
    if size_px is None:
        _require_centered(rig, f"{path}: {names[0]}")
    return rig


def _preferred_pair(path: Path, matrices: dict[str, Array]) -> list[str]:
    """The names of the matrices of the preferred pair. Raises InputError if there is no pair."""
    for pair in PAIRS:
        names = [matrix_name(camera_folder) for camera_folder in pair]
        if matrices.keys() >= set(names):
            return names
    present = ", ".join(matrices) or "none"
    raise InputError(f"{path}: a pair needs P0 and P1, or P2 and P3; the file has {present}")


def _require_centered(rig: Rig, place: str) -> None:
    """Raise InputError if the principal point is far from the center of a picture of the size FIRST_SIZE_PX."""
    center_px = rig.left.K[:2, 2]
    offset = np.abs(center_px / FIRST_SIZE_PX - 0.5).max()
    if offset > LARGEST_OFFSET:
        width, height = FIRST_SIZE_PX
        raise InputError(
            f"{place} has its principal point at {center_px.tolist()}, so images do not have "
            f"KITTI's size of {width} x {height}; pass size_px"
        )


def rig_of_matrices(
    path: Path,
    matrices: dict[str, Array],
    names: Sequence[str],
    size_px: tuple[int, int],
) -> Rig:
    """The rig of one or two cameras, given the matrices (3, 4) of a calib.txt and the names of those to use.

    Raises InputError for a matrix that is not that of a rectified camera.
    """
    cameras = [_camera(matrices[name], size_px, f"{path}: {name}") for name in names]
    return mounted_rig(*cameras)


def _camera(P: Array, size_px: tuple[int, int], place: str) -> MountedCamera:
    """The camera with the projection matrix P = K [1 | t] (3, 4), which projects points in the frame of the body."""
    K = P[:, :3]
    below_diagonal = [*K[1:, 0], K[2, 1]]
    deviations = np.abs([K[0, 1], *below_diagonal, K[2, 2] - 1])  # from the form fx 0 cx / 0 fy cy / 0 0 1
    is_rectified = deviations.max() <= SKEW_TOLERANCE
    has_focal_lengths = K[0, 0] > 0 and K[1, 1] > 0
    if not (is_rectified and has_focal_lengths):
        raise InputError(f"{place} should be a rectified camera, fx 0 cx / 0 fy cy / 0 0 1, but is {K.tolist()}")
    position_m = -np.linalg.solve(K, P[:, 3])
    return MountedCamera(Pinhole(*size_px, *focal_and_center_px(K)), se3.transform(np.eye(3), position_m))


def read_calibration(path: Path) -> dict[str, Array]:
    """The matrices (3, 4) of a calib.txt by name. Raises InputError with the number of an invalid line."""
    matrix_lines: dict[str, Line] = {}
    for line in content_lines(read_text(path)):
        place = f"{path}:{line.number}"
        label, colon, numbers = line.text.partition(":")
        if not colon:
            example = "`P0: 718.9 0 607.2 ...`"
            raise InputError(f"{place}: a line should be a name, a colon and a matrix, as in {example}")
        name = label.strip()
        if name in matrix_lines:
            raise InputError(f"{place}: {name} should occur once, but is also in line {matrix_lines[name].number}")
        if name.startswith(("P", "T")):
            matrix_lines[name] = Line(line.number, numbers)
    columns = [f"{row}{column}" for row in range(3) for column in range(4)]
    table = read_table(list(matrix_lines.values()), name=str(path), columns=columns, row="a matrix")
    matrices = table.values.reshape(-1, 3, 4)
    return dict(zip(matrix_lines, matrices, strict=True))


def format_calibration(rig: Rig) -> str:
    """The text of calib.txt: a line for each of P0 and P1 (3, 4), which project points in the left camera's frame."""
    positions_m = [0.0, rig.baseline_m] if rig.right else [0.0]
    lines = []
    for index, position_m in enumerate(positions_m):
        P = projection(rig.left.K, position_m) + 0.0  # turns -0.0 into 0.0
        numbers = " ".join(map(repr, P.ravel().tolist()))
        lines.append(f"P{index}: {numbers}\n")
    return "".join(lines)
