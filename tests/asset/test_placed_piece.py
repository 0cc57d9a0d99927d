"""The vertices of a placed piece are those of all its parts."""

import numpy as np

from vobench.asset.furniture import WHITE, stood
from vobench.asset.placed_piece import vertices_of


def test_the_vertices_of_parts_span_all_of_them() -> None:
    vertices_m = vertices_of([stood((1, 1, 1), WHITE, bevel=0), stood((1, 1, 1), WHITE, 4, 0, 1, bevel=0)])
    np.testing.assert_allclose(vertices_m.min(axis=0), [-0.5, -0.5, 0])
    np.testing.assert_allclose(vertices_m.max(axis=0), [4.5, 0.5, 2])
