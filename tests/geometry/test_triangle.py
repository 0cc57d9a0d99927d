"""Normals and areas of triangles follow from the cross product of two edges."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.triangle import areas_m2, face_normals

CORNERS_M = np.random.default_rng(0).normal(size=(50, 3, 3))


def test_a_normal_is_a_unit_vector_square_to_both_edges_on_the_counter_clockwise_side() -> None:
    normals = face_normals(CORNERS_M)
    edges_m = CORNERS_M[:, 1:] - CORNERS_M[:, :1]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    np.testing.assert_allclose(np.einsum("fi,fei->fe", normals, edges_m), 0, atol=1e-12)
    np.testing.assert_allclose(face_normals(np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], float)), [[0, 0, 1]])


def test_the_order_of_corners_turns_the_normal_but_leaves_the_area() -> None:
    np.testing.assert_allclose(face_normals(CORNERS_M[:, ::-1]), -face_normals(CORNERS_M), atol=1e-12)
    np.testing.assert_allclose(face_normals(np.roll(CORNERS_M, 1, axis=1)), face_normals(CORNERS_M), atol=1e-12)
    np.testing.assert_allclose(areas_m2(CORNERS_M[:, ::-1]), areas_m2(CORNERS_M))


def test_areas_do_not_change_with_the_pose_and_grow_with_the_square_of_the_scale() -> None:
    T = se3.transform(se3.rotation_z(0.7), np.array([1.0, -2.0, 3.0]))
    np.testing.assert_allclose(areas_m2(se3.apply(T, CORNERS_M)), areas_m2(CORNERS_M))
    np.testing.assert_allclose(areas_m2(3 * CORNERS_M), 9 * areas_m2(CORNERS_M))


def test_the_area_is_half_of_base_times_height_and_0_for_points_on_a_line() -> None:
    triangle = np.array([[0, 0, 0], [4, 0, 0], [1, 0, 3]], float)
    line = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], float)
    assert areas_m2(np.stack([triangle, line])) == pytest.approx([6, 0])
    assert face_normals(line[None]).tolist() == [[0, 0, 0]]
