"""Planes with large faces: which faces they contain, and which of their cells contains a point."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.receiver_plane import MIN_CELL_M, ReceiverPlane, large_planes

LIFT_M = 1e-4
UP = np.array([0.0, 0.0, 1.0])
SQUARE_M = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def square(*, size: float = 1.0, height_m: float = 0.0) -> Array:
    """The two triangles (2, 3, 3) of a horizontal square of 2 m times `size`."""
    return size * SQUARE_M[TRIANGLES] + height_m * UP


def planes_of(*squares: Array) -> tuple[list[ReceiverPlane], Array]:
    corners_m = np.concatenate(squares)
    normals = np.tile(UP, (len(corners_m), 1))
    return large_planes(corners_m, normals, np.ones(len(corners_m), bool), LIFT_M)


def test_faces_at_the_same_height_share_a_plane_and_others_do_not() -> None:
    planes, face_plane = planes_of(square(), square(height_m=1.0), square(size=0.5))
    assert len(planes) == 2
    assert face_plane.tolist() == [0, 0, 1, 1, 0, 0, -1]


def test_a_small_face_has_no_plane() -> None:
    planes, face_plane = planes_of(square(size=0.3))
    assert not planes
    assert (face_plane == -1).all()


def test_faces_that_are_not_selected_have_no_plane() -> None:
    planes, face_plane = large_planes(square(), np.tile(UP, (2, 1)), np.zeros(2, bool), LIFT_M)
    assert not planes
    assert (face_plane == -1).all()


def test_a_plane_is_in_front_of_its_faces_where_their_shadow_rays_start() -> None:
    [plane], _ = planes_of(square(height_m=0.7))
    np.testing.assert_allclose(plane.heights_m(square(height_m=0.7)), -LIFT_M, atol=1e-12)


def test_the_cell_of_a_point_follows_from_its_coordinates() -> None:
    [plane], _ = planes_of(square())
    points_m = np.random.default_rng(0).uniform([0, 0, 0], [2, 2, 0], (100, 3)).astype(np.float32)
    column, row = (plane.coordinates_m(points_m.astype(float)) // plane.cell_m).astype(int).T
    np.testing.assert_array_equal(plane.cell(points_m), row * plane.width + column)
    assert plane.cell_m == MIN_CELL_M


def test_points_beside_the_rectangle_are_in_the_cell_after_the_last() -> None:
    [plane], _ = planes_of(square())
    beside = np.array([[-1, 1, 0], [3, 1, 0], [1, -1, 0], [1, 3, 0]], np.float32)
    assert (plane.cell(beside) == plane.height * plane.width).all()
