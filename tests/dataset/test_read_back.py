from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from vobench.dataset.read_back import (
    DEPTHS_M,
    GRID,
    PIXEL_TOLERANCE,
    POSE_TOLERANCE,
    check_path,
    check_rig,
    known_points,
    pixel_difference,
)
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import PRESETS, Rig, mounted_rig
from vobench.trajectory.trajectory import Trajectory


def preset_rig(name: str) -> Rig:
    pair = PRESETS[name]
    return mounted_rig(pair.left, pair.right, pair.T_left_right, pitch_deg=20.0)


@pytest.mark.parametrize("field", ["fx_px", "cy_px", "k1", "p2"])
def test_a_lens_off_by_little_is_found_by_the_points(field: str) -> None:
    rig = preset_rig("euroc")
    off: Camera = replace(rig.left, **{field: getattr(rig.left, field) * (1 + 1e-6) + 1e-6})  # type: ignore[type-var]
    assert PIXEL_TOLERANCE < pixel_difference(rig, replace(rig, left=off)) < 0.1
    with pytest.raises(SequenceError, match="known points are projected up to"):
        check_rig("the chain", rig, replace(rig, left=off))


def test_a_moved_right_camera_or_imu_or_a_missing_one_is_found(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(imu=True)
    assert rig.imu
    assert rig.T_body_right is not None
    nudge = se3.transform(np.eye(3), [0.0, 1e-6, 0.0])
    assert pixel_difference(rig, replace(rig, T_body_right=rig.T_body_right @ nudge)) > PIXEL_TOLERANCE
    assert pixel_difference(rig, rig_of(stereo=False)) == np.inf
    with pytest.raises(SequenceError, match="puts the IMU"):
        check_rig("the chain", rig, replace(rig, imu=replace(rig.imu, T_body_imu=rig.imu.T_body_imu @ nudge)))


def test_where_the_body_is_makes_no_difference_to_what_is_seen(rig_of: Callable[..., Rig]) -> None:
    rig, T = rig_of(), se3.transform(se3.rotation_z(np.array(0.7)), [1.0, 2.0, 3.0])
    assert rig.T_body_right is not None
    moved = replace(rig, T_body_left=T @ rig.T_body_left, T_body_right=T @ rig.T_body_right)
    assert pixel_difference(rig, moved) < 1e-9


def test_known_points_fill_the_picture_from_near_to_far() -> None:
    camera = preset_rig("fisheye").left
    points = known_points(camera)
    pixels = camera.project(points)
    assert np.isfinite(pixels).all()
    assert pixels.min() < 1
    assert pixels.max() > 510
    assert np.linalg.norm(points, axis=1).max() > 100 * np.linalg.norm(points, axis=1).min()


def test_known_points_are_a_grid_of_rays_at_every_depth(rig_of: Callable[..., Rig]) -> None:
    camera = rig_of().left
    points = known_points(camera)
    assert points.shape == (len(DEPTHS_M) * GRID * GRID, 3)
    pixels = camera.project(points).reshape(len(DEPTHS_M), GRID * GRID, 2)
    np.testing.assert_allclose(pixels[0], pixels[-1], atol=1e-9)
    np.testing.assert_allclose(pixels[0, [0, -1]], [[0, 0], [camera.width_px - 1, camera.height_px - 1]], atol=1e-9)


@pytest.mark.parametrize("size", [{"width_px": 65}, {"height_px": 49}])
def test_pictures_of_another_size_differ_without_end(size: dict[str, int], rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    assert pixel_difference(rig, replace(rig, left=replace(rig.left, **size))) == np.inf  # type: ignore[type-var]
    assert pixel_difference(rig, replace(rig, right=replace(rig.left, **size))) == np.inf  # type: ignore[type-var]
    assert pixel_difference(rig, rig) == 0


def test_a_difference_is_a_distance_in_pixels(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    moved = replace(rig.left, cx_px=rig.left.K[0, 2] + 3.0, cy_px=rig.left.K[1, 2] + 4.0)  # type: ignore[type-var]
    np.testing.assert_allclose(pixel_difference(rig, replace(rig, left=moved)), 5.0, atol=1e-9)


def test_an_imu_on_one_side_alone_is_not_compared(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(imu=True)
    check_rig("the chain", rig, replace(rig, imu=None))
    check_rig("the chain", replace(rig, imu=None), rig)


def test_a_path_has_the_same_stamps_and_poses() -> None:
    path = Trajectory(np.array([1, 2, 3]), np.tile(np.eye(4), (3, 1, 1)))
    check_path("it", path, path)
    shifted = path.T_world_frame.copy()
    shifted[1, 0, 3] = 0.9 * POSE_TOLERANCE
    check_path("it", path, Trajectory(path.t_ns, shifted))
    shifted[1, 0, 3] = -1.1 * POSE_TOLERANCE
    with pytest.raises(SequenceError, match=r"^it has poses that differ by 1\.1e-09 from those exported"):
        check_path("it", path, Trajectory(path.t_ns, shifted))
    with pytest.raises(SequenceError, match=r"^it has other stamps than were exported: 2 of 3 poses$"):
        check_path("it", path, Trajectory(path.t_ns[:2], path.T_world_frame[:2]))
    with pytest.raises(SequenceError, match=r"exported: pose 1 is at 4 ns and not at 2 ns$"):
        check_path("it", path, Trajectory(np.array([1, 4, 5]), path.T_world_frame))
