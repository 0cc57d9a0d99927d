"""Rays and projection undo each other, and the camera matrix says the same as both."""

import numpy as np

from vobench.geometry.camera import Pinhole

LENS = Pinhole(72, 48, 65.83, 54.51, 35.2, 23.9)  # neither square pixels nor a central axis


def test_a_ray_through_a_pixel_projects_to_that_pixel_from_any_depth() -> None:
    rng = np.random.default_rng(1)
    uv = rng.uniform(-20, 100, (500, 2))
    depth = 10 ** rng.uniform(-3, 3, (500, 1))
    np.testing.assert_allclose(LENS.project(LENS.rays(uv) * depth), uv, atol=1e-11)
    np.testing.assert_array_equal(LENS.rays(uv)[:, 2], 1.0)


def test_a_point_lies_on_the_ray_through_its_pixel() -> None:
    points = np.random.default_rng(2).uniform([-2, -2, 0.1], [2, 2, 5], (500, 3))
    np.testing.assert_allclose(LENS.rays(LENS.project(points)) * points[:, 2:], points, atol=1e-13)


def test_projection_is_the_camera_matrix_and_a_division_by_depth() -> None:
    points = np.random.default_rng(3).uniform([-2, -2, 0.1], [2, 2, 5], (50, 3))
    homogeneous = points @ LENS.K.T
    np.testing.assert_allclose(LENS.project(points), homogeneous[:, :2] / homogeneous[:, 2:], atol=1e-12)


def test_what_is_not_in_front_of_the_camera_has_no_pixel() -> None:
    assert np.isnan(LENS.project([[0.1, 0.2, 0.0], [0.1, 0.2, -1.0]])).all()


def test_right_in_the_world_is_right_in_the_picture_and_down_is_down() -> None:
    axis, right, down = LENS.project([[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]])
    np.testing.assert_allclose(axis, [LENS.cx_px, LENS.cy_px])
    assert right[0] > axis[0]
    assert right[1] == axis[1]
    assert down[1] > axis[1]
    assert down[0] == axis[0]


def test_the_grid_holds_every_pixels_column_and_row() -> None:
    grid = LENS.pixel_grid()
    assert grid.shape == (48, 72, 2)
    np.testing.assert_array_equal(grid[0, 0], [0, 0])
    np.testing.assert_array_equal(grid[47, 3], [3, 47])
