"""Transforms of a shot: there and back, by row and at one instant."""

import numpy as np
import pytest

from tests.rendering.rectangles import box
from vobench.geometry import se3
from vobench.rendering.shot import CameraShot, at_rows, moved, of_rays, rays_in, shot_transforms, spanned, turn
from vobench.scene.scene import Mover, WaypointMotion

RNG = np.random.default_rng(0)
CART = Mover(
    "cart",
    tuple(box(np.zeros(3), (1, 1, 1), yaw_deg=0, material="a")),
    WaypointMotion(np.array([0.0, 2.0]), np.array([[0.0, 0, 0], [1.0, 2.0, 0]]), np.array([0.0, 90.0])),
)
POSE = se3.transform(se3.rotation_z(0.3), [1.0, 2.0, 3.0])


def test_transforms_there_and_back_are_inverse_and_agree_with_the_camera() -> None:
    shot = shot_transforms([CART], CameraShot(POSE, 500_000_000))
    assert len(shot.T_world_bodies) == 2
    for body in range(2):
        there = shot.T_world_bodies[body] @ shot.T_bodies_world[body]
        np.testing.assert_allclose(there, np.eye(4), atol=1e-12)
        camera = shot.T_world_bodies[body] @ shot.T_bodies_camera[body]
        np.testing.assert_allclose(camera, POSE, atol=1e-12)
        back = shot.T_bodies_camera[body] @ shot.T_camera_bodies[body]
        np.testing.assert_allclose(back, np.eye(4), atol=1e-12)
    np.testing.assert_array_equal(shot.T_world_bodies[0], np.eye(4))
    np.testing.assert_allclose(shot.T_world_bodies[1], CART.path.pose(500_000_000))
    assert not shot.by_row


def test_rows_have_poses_of_their_own_where_something_moves() -> None:
    t_ns = np.array([0, 500_000_000, 1_000_000_000])
    shot = shot_transforms([CART], CameraShot(np.tile(POSE, (3, 1, 1)), t_ns))
    assert shot.by_row
    for row, t in enumerate(t_ns.tolist()):
        np.testing.assert_allclose(shot.T_world_bodies[1][row], CART.path.pose(t))


def test_between_rows_transforms_are_interpolated_and_beyond_the_ends_constant() -> None:
    table = np.stack([np.eye(4), se3.transform(np.eye(3), [2.0, 0, 0]), se3.transform(np.eye(3), [2.0, 4.0, 0])])
    rows = np.array([-5.0, 0.0, 0.25, 1.0, 1.5, 2.0, 9.0, np.nan])
    places = at_rows([table], rows)[0][:, :3, 3]
    expected = [[0, 0], [0, 0], [0.5, 0], [2, 0], [2, 2], [2, 4], [2, 4], [0, 0]]
    np.testing.assert_allclose(places[:, :2], expected, atol=1e-12)
    single = at_rows([table[0]], rows)[0]
    assert single.shape == (4, 4)
    np.testing.assert_array_equal(of_rays(single, np.array([1, 2])), single)
    np.testing.assert_array_equal(of_rays(table, np.array([2, 0])), table[[2, 0]])


def test_transforms_at_rows_are_computed_for_some_rays_and_spanned_by_those_of_whole_rows() -> None:
    shot = shot_transforms([CART], CameraShot(np.tile(POSE, (5, 1, 1)), np.arange(5) * 100_000_000))
    rows = np.array([1.0, 2.5, 1.25])
    at = at_rows(shot.T_world_bodies, rows)
    rays = np.array([1, 2])
    np.testing.assert_array_equal(at.of_rays(rays)[1], at[1][rays])
    np.testing.assert_array_equal(at[1:][0], at[1])
    np.testing.assert_array_equal(at.spanned(1), shot.T_world_bodies[1][1:4])
    np.testing.assert_array_equal(spanned([POSE], 0), POSE[None])
    assert len(at) == 2


@pytest.mark.parametrize("many", [False, True])
def test_turned_and_moved_vectors_are_those_of_the_matrix(many: bool) -> None:
    points = RNG.normal(size=(5, 3))
    T = np.tile(POSE, (5, 1, 1)) if many else POSE
    np.testing.assert_allclose(moved(T, points), se3.apply(POSE, points), atol=1e-12)
    np.testing.assert_allclose(turn(T, points), points @ POSE[:3, :3].T, atol=1e-12)
    origins, directions = rays_in(T, points)
    np.testing.assert_allclose(origins, np.tile(POSE[:3, 3], (5, 1)))
    np.testing.assert_allclose(origins + directions, moved(T, points), atol=1e-12)
