"""Arrays of a mesh are transformed like the mesh that they describe."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.triangle import face_normals
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

QUAD = quad_arrays([1, 2, 0.5], [2, 0, 0], [0, 0, 3])
T = se3.transform(se3.rotation_z(0.4), [0.3, -2.0, 1.0])


def assert_equal(first: MeshArrays, second: MeshArrays) -> None:
    np.testing.assert_allclose(first.corners_m, second.corners_m, atol=1e-12)
    np.testing.assert_allclose(first.uv, second.uv)
    np.testing.assert_allclose(first.normals, second.normals, atol=1e-12)


def test_moving_there_and_back_changes_nothing() -> None:
    assert_equal(QUAD.moved(T).moved(se3.inverse(T)), QUAD)


def test_moving_twice_is_moving_by_the_product() -> None:
    assert_equal(QUAD.moved(T).moved(T), QUAD.moved(T @ T))


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 1, 0.5), (-1, 1, 1), (-1, -2, -3)])
def test_normals_stay_those_of_the_faces_under_any_scale(scale: tuple[float, float, float]) -> None:
    scaled = QUAD.moved(T @ np.diag([*scale, 1.0]))
    expected = face_normals(scaled.corners_m)[:, None].repeat(3, axis=1)
    np.testing.assert_allclose(scaled.normals[scaled.faces], expected, atol=1e-12)


def test_flipping_turns_faces_and_normals_and_twice_is_nothing() -> None:
    np.testing.assert_allclose(face_normals(QUAD.flipped().corners_m), -face_normals(QUAD.corners_m), atol=1e-12)
    np.testing.assert_array_equal(QUAD.flipped().normals, -QUAD.normals)
    assert_equal(QUAD.flipped().flipped(), QUAD)


def test_joined_parts_have_the_corners_of_each_in_order() -> None:
    parts = [QUAD, QUAD.moved(T), QUAD.flipped()]
    expected = np.concatenate([part.corners_m for part in parts])
    np.testing.assert_array_equal(joined_arrays(parts).corners_m, expected)
    assert len(joined_arrays([]).faces) == 0
