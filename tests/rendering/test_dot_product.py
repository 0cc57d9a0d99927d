"""Dot products of rows."""

import numpy as np

from vobench.rendering.dot_product import dot


def test_each_row_is_multiplied_by_the_row_of_the_same_index() -> None:
    rng = np.random.default_rng(0)
    a = rng.normal(size=(7, 3))
    b = rng.normal(size=(7, 3))
    np.testing.assert_allclose(dot(a, b), np.diag(a @ b.T), rtol=1e-12)
    np.testing.assert_array_equal(dot(np.eye(3), np.roll(np.eye(3), 1, axis=0)), [0, 0, 0])
