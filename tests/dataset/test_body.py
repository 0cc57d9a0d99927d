from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from vobench.dataset.body import MountedCamera, mounted_rig, on_body
from vobench.dataset.read_back import pixel_difference
from vobench.geometry import se3
from vobench.geometry.rig import Rig

T = se3.transform(Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix(), [0.1, 0.2, -0.3])


def test_another_body_and_back_is_the_same_rig_and_what_is_seen_never_changes(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(imu=True)
    moved = on_body(rig, T)
    back = on_body(moved, se3.inverse(T))
    np.testing.assert_allclose(moved.T_body_left, T @ rig.T_body_left)
    assert pixel_difference(rig, moved) < 1e-9
    for side in rig.sides:
        np.testing.assert_allclose(back.T_body_camera(side), rig.T_body_camera(side), atol=1e-12)
    assert rig.imu
    assert moved.imu
    np.testing.assert_allclose(moved.imu.T_body_imu, T @ rig.imu.T_body_imu)
    assert moved.wheels is None


def test_one_camera_without_an_imu_stays_that(rig_of: Callable[..., Rig]) -> None:
    moved = on_body(rig_of(stereo=False), T)
    assert moved.right is None
    assert moved.T_body_right is None
    assert moved.imu is None


def test_mounted_cameras_are_the_rig_s(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    left = MountedCamera(rig.left, rig.T_body_left)
    right = MountedCamera(rig.camera("right"), rig.T_body_camera("right"))
    pair = mounted_rig(left, right)
    assert pair.right is rig.right
    np.testing.assert_array_equal(pair.T_body_camera("right"), rig.T_body_camera("right"))
    single = mounted_rig(left)
    assert single.right is None
    assert single.T_body_left is rig.T_body_left
