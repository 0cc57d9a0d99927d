"""The test that every export must pass: points and poses go through the files as through the sequence."""

import numpy as np

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Trajectory

PIXEL_TOLERANCE = 1e-6
POSE_TOLERANCE = 1e-9  # metres, and entries of rotations
DEPTHS_M = (0.3, 1.0, 5.0, 30.0, 1000.0)
GRID = 9  # points across a picture and down it


def known_points(camera: Camera) -> Array:
    """Points (N, 3) before a camera, evenly over its picture and at several depths."""
    u, v = (np.linspace(0, size - 1, GRID) for size in (camera.width_px, camera.height_px))
    pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    rays = camera.rays(pixels)
    seen = rays[np.isfinite(rays).all(1)]
    points: Array = (seen * np.array(DEPTHS_M)[:, None, None]).reshape(-1, 3)
    return points


def pixel_difference(expected: Rig, found: Rig) -> float:
    """The largest distance in pixels between what two rigs make of the same points; infinite for other pictures.

    Points are given to both in the axes of their left camera.
    """
    if expected.sides != found.sides:
        return np.inf
    points, largest = known_points(expected.left), 0.0
    for side in expected.sides:
        cameras = expected.camera(side), found.camera(side)
        if len({(camera.width_px, camera.height_px) for camera in cameras}) > 1:
            return np.inf
        pixels = [_seen_from_left(rig, points, right=side == "right") for rig in (expected, found)]
        largest = max(largest, _largest(pixels[0], pixels[1]))
    return largest


def _seen_from_left(rig: Rig, points_left: Array, *, right: bool) -> Array:
    if not right:
        return rig.left.project(points_left)
    return rig.camera("right").project(se3.apply(se3.inverse(rig.T_left_right), points_left))


def _largest(expected: Array, found: Array) -> float:
    """The largest distance over all that the first one sees; infinite where the other one does not."""
    blind = np.isnan(expected[:, 0])
    if not (~blind).any():
        return np.inf
    off = np.linalg.norm(expected[~blind] - found[~blind], axis=-1)
    return float(off.max()) if np.isfinite(off).all() else np.inf


def check_rig(what: str, expected: Rig, found: Rig, *, tolerance_px: float = PIXEL_TOLERANCE) -> None:
    """Raises SequenceError unless a rig that was read back sends known points where the exported one does."""
    off = pixel_difference(expected, found)
    if not off < tolerance_px:
        raise SequenceError(
            f"{what} does not say what was exported: known points come to lie {off:.3g} px beside their place, "
            f"and {tolerance_px:g} px would be right"
        )
    if expected.imu and found.imu:
        off = _pose_difference(_T_left_imu(expected), _T_left_imu(found))
        if not off < POSE_TOLERANCE:
            raise SequenceError(
                f"{what} puts the IMU {off:.3g} beside its place, and {POSE_TOLERANCE:g} would be right"
            )


def _T_left_imu(rig: Rig) -> Array:
    T_body_imu = rig.imu.T_body_imu if rig.imu else np.eye(4)
    return se3.inverse(rig.T_body_left) @ T_body_imu


def check_path(what: str, expected: Trajectory, found: Trajectory) -> None:
    """Raises SequenceError unless a path that was read back has the same stamps, and poses to 1e-9."""
    if not np.array_equal(expected.t_ns, found.t_ns):
        raise SequenceError(f"{what} has other stamps than were exported: {_first_stamps(expected, found)}")
    off = _pose_difference(expected.T_world_frame, found.T_world_frame)
    if not off < POSE_TOLERANCE:
        raise SequenceError(f"{what} has poses {off:.3g} beside those exported, and {POSE_TOLERANCE:g} would be right")


def _pose_difference(expected: Array, found: Array) -> float:
    return float(np.abs(expected - found).max(initial=0.0))


def _first_stamps(expected: Trajectory, found: Trajectory) -> str:
    if len(expected) != len(found):
        return f"{len(found)} of {len(expected)}"
    at = int(np.flatnonzero(expected.t_ns != found.t_ns)[0])
    return f"pose {at} at {found.t_ns[at]} ns and not {expected.t_ns[at]} ns"
