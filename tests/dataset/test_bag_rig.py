from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.dataset.bag_rig import (
    FramedInfo,
    Info,
    find_transform,
    frame_name,
    info_rig,
    static_transforms,
    stereo_transform_from_projection,
)
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Pinhole


def pose(*rotvec: float, t: tuple[float, float, float] = (0.1, 0.2, 0.3)) -> np.ndarray:
    return se3.transform(Rotation.from_rotvec(rotvec).as_matrix(), t)


A_B = pose(0.1, 0.2, 0.3)
B_C = pose(-0.4, 0.1, 0.2)
D_C = pose(0.3, 0.3, -0.1)
TREE = {("a", "b"): A_B, ("b", "c"): B_C, ("d", "c"): D_C, ("x", "y"): A_B}


def test_a_pose_between_frames_is_the_product_along_the_tree_and_its_inverse_backwards() -> None:
    np.testing.assert_allclose(find_transform(TREE, "a", "d"), A_B @ B_C @ se3.inverse(D_C), atol=1e-12)
    np.testing.assert_allclose(find_transform(TREE, "d", "a"), D_C @ se3.inverse(B_C) @ se3.inverse(A_B), atol=1e-12)
    np.testing.assert_array_equal(find_transform(TREE, "a", "a"), np.eye(4))
    np.testing.assert_array_equal(find_transform({}, "q", "q"), np.eye(4))
    assert find_transform(TREE, "a", "y") is None
    assert find_transform(TREE, "a", "nowhere") is None


def test_a_circle_of_frames_ends() -> None:
    tree = {("a", "b"): A_B, ("b", "a"): se3.inverse(A_B)}
    assert find_transform(tree, "a", "c") is None
    np.testing.assert_allclose(find_transform(tree, "a", "b"), A_B)


def transform(parent: str, child: str, T: np.ndarray, scale: float = 1.0) -> SimpleNamespace:
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat() * scale
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=T[0, 3], y=T[1, 3], z=T[2, 3]), rotation=SimpleNamespace(x=x, y=y, z=z, w=w)
        ),
    )


def test_transforms_are_read_without_slashes_and_with_exact_rotations() -> None:
    message = SimpleNamespace(transforms=[transform("/a", "b", A_B, 1.0009), transform("b", "/c", B_C, 0.9991)])
    tree = static_transforms([message], "x.bag")
    assert list(tree) == [("a", "b"), ("b", "c")]
    np.testing.assert_allclose(tree["a", "b"], A_B, atol=1e-12)
    assert frame_name("//a/b") == "a/b"


@pytest.mark.parametrize("scale", [1.0011, 0.9989, 0.0, np.nan, np.inf])
def test_a_quaternion_that_is_none_is_refused(scale: float) -> None:
    message = SimpleNamespace(transforms=[transform("a", "b", A_B, scale)])
    with pytest.raises(InputError, match=r"^/tf_static: a to b should be finite with a unit quaternion in x\.bag$"):
        static_transforms([message], "x.bag")


def info(*, rectified: bool = False, upper: bool = False, **changes: Any) -> Info:
    fields = {
        "k": np.array([40.0, 0, 31, 0, 41, 23, 0, 0, 1]),
        "r": np.eye(3).ravel(),
        "p": np.array([50.0, 0, 30, -5.0, 0, 50, 22, 0, 0, 0, 1, 0]),
        "d": np.array([0.1, -0.02, 1e-3, 2e-3]),
        **changes,
    }
    named = {key.upper() if upper else key: value for key, value in fields.items()}
    return Info("/info", SimpleNamespace(width=64, height=48, distortion_model="plumb_bob", **named), rectified)


@pytest.mark.parametrize("upper", [False, True])
def test_raw_pictures_have_k_and_d_and_rectified_ones_p(upper: bool) -> None:
    assert info(upper=upper).camera == BrownConrady(64, 48, 40.0, 41.0, 31.0, 23.0, 0.1, -0.02, 1e-3, 2e-3)
    assert info(upper=upper, rectified=True).camera == Pinhole(64, 48, 50.0, 50.0, 30.0, 22.0)


def test_numbers_that_are_none_are_refused_by_topic_and_name() -> None:
    with pytest.raises(InputError, match=r"^/info: K should be finite numbers, but is \[nan"):
        _ = info(k=np.full(9, np.nan)).camera
    with pytest.raises(InputError, match=r"^/info: K should be finite numbers, but is \[1\.0, 1\.0\]"):
        _ = info(k=np.ones(2)).camera
    with pytest.raises(InputError, match=r"^/info: D should be finite numbers, but is \[inf"):
        _ = info(d=np.array([np.inf])).camera
    with pytest.raises(InputError, match=r"^/info: R should be a rotation, but is"):
        _ = info(r=2 * np.eye(3)).R_rectified_camera
    np.testing.assert_array_equal(info(r=np.zeros(9)).R_rectified_camera, np.eye(3))


def test_a_projection_says_where_the_right_camera_is() -> None:
    np.testing.assert_allclose(
        stereo_transform_from_projection(info(), info()), se3.transform(np.eye(3), [0.1, 0.0, 0.0])
    )
    R_left = Rotation.from_rotvec([0.01, 0.02, 0.03]).as_matrix()
    R_right = Rotation.from_rotvec([-0.02, 0.01, 0.01]).as_matrix()
    T = stereo_transform_from_projection(info(r=R_left.ravel()), info(r=R_right.ravel()))
    np.testing.assert_allclose(T[:3, :3], R_left.T @ R_right, atol=1e-12)
    np.testing.assert_allclose(R_left @ T[:3, 3], [0.1, 0, 0], atol=1e-12)
    flat = stereo_transform_from_projection(
        info(r=R_left.ravel(), rectified=True), info(r=R_right.ravel(), rectified=True)
    )
    np.testing.assert_allclose(flat, se3.transform(np.eye(3), [0.1, 0.0, 0.0]))
    for shift, focal in ((0.0, 50.0), (5.0, 50.0), (-5.0, 0.0), (-5.0, -50.0)):
        P = np.array([focal, 0, 30, shift, 0, 50, 22, 0, 0, 0, 1, 0])
        with pytest.raises(InputError, match="neither /tf_static nor P of /info says where the right camera is"):
            stereo_transform_from_projection(info(), info(p=P))


def test_a_rig_is_by_the_tree_where_the_frames_are_two_and_by_projection_where_they_are_one() -> None:
    left, right = FramedInfo(info(), "b"), FramedInfo(info(), "c")
    rig, notes = info_rig([left, right], TREE, "a")
    np.testing.assert_allclose(rig.T_body_left, A_B)
    np.testing.assert_allclose(rig.T_left_right, B_C, atol=1e-12)
    assert notes == ()
    rig, notes = info_rig([left, FramedInfo(info(), "b")], TREE, None)
    np.testing.assert_array_equal(rig.T_body_left, np.eye(4))
    np.testing.assert_allclose(rig.T_left_right, se3.transform(np.eye(3), [0.1, 0.0, 0.0]), atol=1e-12)
    assert notes == ("The position of the right camera was derived from R and P of /info and /info.",)
    assert info_rig([left], TREE, "nowhere")[0].right is None


def test_a_rectified_left_camera_is_turned_on_its_body() -> None:
    R = Rotation.from_rotvec([0.01, 0.02, 0.03]).as_matrix()
    rectified = FramedInfo(info(r=R.ravel(), rectified=True), "b")
    rig, notes = info_rig([rectified, FramedInfo(info(rectified=True), "c")], TREE, "a")
    np.testing.assert_allclose(rig.T_body_left, A_B @ se3.transform(R.T, np.zeros(3)), atol=1e-12)
    assert len(notes) == 1
    raw_left = FramedInfo(info(), "b")
    assert len(info_rig([raw_left, FramedInfo(info(rectified=True), "c")], TREE, "a")[1]) == 1
