import numpy as np
import pytest

from vobench.geometry.vector import cross, cross_2d, unit

RNG = np.random.default_rng(4)
A = RNG.normal(size=(5, 7, 3))
B = RNG.normal(size=(5, 7, 3))


def test_a_direction_has_length_one_and_points_along_its_vector() -> None:
    directions = unit(A)

    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, rtol=1e-15)
    np.testing.assert_allclose(np.cross(directions, A), 0.0, atol=1e-15)
    assert (np.sum(directions * A, axis=-1) > 0).all()


@pytest.mark.parametrize("factor", [1e-100, 0.5, 3.0, 1e100])
def test_a_direction_does_not_change_with_the_length_of_its_vector(factor: float) -> None:
    np.testing.assert_allclose(unit(factor * A), unit(A), rtol=1e-15)


def test_a_zero_vector_has_no_direction_and_stays_zero() -> None:
    np.testing.assert_array_equal(unit([[0.0, 0.0, 0.0], [0.0, -2.0, 0.0]]), [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def test_a_vector_with_one_unknown_component_has_no_known_direction() -> None:
    assert np.isnan(unit([1.0, np.nan, 0.0])).all()


def test_directions_have_any_number_of_components() -> None:
    np.testing.assert_allclose(unit([3, 4]), [0.6, 0.8], rtol=1e-15)
    np.testing.assert_allclose(unit([1, 1, 1, 1]), [0.5, 0.5, 0.5, 0.5], rtol=1e-15)


def test_a_cross_product_is_bit_equal_to_numpys() -> None:
    np.testing.assert_array_equal(cross(A, B), np.cross(A, B))


def test_a_cross_product_broadcasts() -> None:
    np.testing.assert_array_equal(cross(A, B[0, 0]), np.cross(A, B[0, 0]))


def test_a_plane_cross_product_is_the_z_of_the_one_in_space() -> None:
    a = np.concatenate([A[..., :2], np.zeros((5, 7, 1))], -1)
    b = np.concatenate([B[..., :2], np.zeros((5, 7, 1))], -1)

    np.testing.assert_array_equal(cross_2d(A[..., :2], B[..., :2]), np.cross(a, b)[..., 2])


def test_a_plane_cross_product_is_positive_to_the_left() -> None:
    ahead = np.array([2.0, 0.0])

    assert cross_2d(ahead, np.array([0.0, 3.0])) == 6.0
    assert cross_2d(ahead, np.array([0.0, -3.0])) == -6.0
