"""Compares an export that was read back with the original sequence."""

import numpy as np

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import ImuCalibration, Rig, Side
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Trajectory

PIXEL_TOLERANCE = 1e-6
POSE_TOLERANCE = 1e-9  # for positions in m and elements of rotation matrices
DEPTHS_M = (0.3, 1.0, 5.0, 30.0, 1000.0)
GRID = 9  # the number of points across and down a picture
# What was read back is compared by `is_close = difference < tolerance`. This is false also for NaN and infinity.


def known_points(camera: Camera) -> Array:
    """Points (N, 3) in front of a camera, which are spread evenly over its picture and have several depths."""
    u = np.linspace(0, camera.width_px - 1, GRID)
    v = np.linspace(0, camera.height_px - 1, GRID)
    pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    rays = camera.rays(pixels)  # (81, 3), NaN outside of the lens's field of view
    visible = rays[np.isfinite(rays).all(1)]
    depths_m = np.array(DEPTHS_M)[:, None, None]
    points_m: Array = (visible * depths_m).reshape(-1, 3)
    return points_m


def pixel_difference(expected: Rig, actual: Rig) -> float:
    """The largest distance in px between the projections of known points by two rigs.

    It is infinite if the rigs have different cameras or picture sizes.
    """
    if expected.sides != actual.sides:
        return np.inf
    points_m = known_points(expected.left)
    largest_px = 0.0
    for side in expected.sides:
        if _size_px(expected.camera(side)) != _size_px(actual.camera(side)):
            return np.inf
        expected_px = _projected(expected, points_m, side)
        actual_px = _projected(actual, points_m, side)
        largest_px = max(largest_px, _largest_distance(expected_px, actual_px))
    return largest_px


def _size_px(camera: Camera) -> tuple[int, int]:
    return camera.width_px, camera.height_px


def _projected(rig: Rig, points_left_m: Array, side: Side) -> Array:
    """The pixels (N, 2) in one camera of points (N, 3) in the frame of the left camera."""
    if side == "left":
        return rig.left.project(points_left_m)
    points_right_m = se3.apply(se3.inverse(rig.T_left_right), points_left_m)
    return rig.camera("right").project(points_right_m)


def _largest_distance(expected_px: Array, actual_px: Array) -> float:
    is_visible = ~np.isnan(expected_px[:, 0])
    if not is_visible.any():
        return np.inf
    distances_px = np.linalg.norm(expected_px[is_visible] - actual_px[is_visible], axis=-1)
    if not np.isfinite(distances_px).all():
        return np.inf
    return float(distances_px.max())


def check_rig(name: str, expected: Rig, actual: Rig) -> None:
    """Raise SequenceError unless the rig that was read back projects known points like the original rig.

    `name` says in the message what was read back.
    """
    distance_px = pixel_difference(expected, actual)
    is_close = distance_px < PIXEL_TOLERANCE
    if not is_close:
        raise SequenceError(
            f"{name} differs from what was exported: known points are projected up to {distance_px:.3g} px "
            f"from their places, and less than {PIXEL_TOLERANCE:g} px would be right"
        )
    if expected.imu is None or actual.imu is None:
        return
    difference = _pose_difference(_T_left_imu(expected, expected.imu), _T_left_imu(actual, actual.imu))
    is_close = difference < POSE_TOLERANCE
    if not is_close:
        raise SequenceError(
            f"{name} puts the IMU {difference:.3g} from its place, and less than {POSE_TOLERANCE:g} would be right"
        )


def _T_left_imu(rig: Rig, imu: ImuCalibration) -> Array:
    return se3.inverse(rig.T_body_left) @ imu.T_body_imu


def check_path(name: str, expected: Trajectory, actual: Trajectory) -> None:
    """Raise SequenceError unless the trajectory that was read back has the original stamps and poses.

    `name` says in the message what was read back.
    """
    if not np.array_equal(expected.t_ns, actual.t_ns):
        raise SequenceError(f"{name} has other stamps than were exported: {_stamp_difference(expected, actual)}")
    difference = _pose_difference(expected.T_world_frame, actual.T_world_frame)
    is_close = difference < POSE_TOLERANCE
    if not is_close:
        raise SequenceError(
            f"{name} has poses that differ by {difference:.3g} from those exported, "
            f"and less than {POSE_TOLERANCE:g} would be right"
        )


def _pose_difference(expected: Array, actual: Array) -> float:
    return float(np.abs(expected - actual).max(initial=0.0))


def _stamp_difference(expected: Trajectory, actual: Trajectory) -> str:
    """The number of poses if it differs, as in "19 of 20 poses"; otherwise the first stamp that differs."""
    if len(expected) != len(actual):
        return f"{len(actual)} of {len(expected)} poses"
    first = int(np.flatnonzero(expected.t_ns != actual.t_ns)[0])
    return f"pose {first} is at {actual.t_ns[first]} ns and not at {expected.t_ns[first]} ns"
