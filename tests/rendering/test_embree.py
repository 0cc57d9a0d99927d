"""A caster names triangles by their rows in the table, and interpolates between their corners."""

import numpy as np

from vobench.rendering.embree import TriangleCaster

# Three triangles that face up, at heights of 0, 1 and 2 m.
CORNERS_M = np.array([[[0, 0, z], [4, 0, z], [0, 4, z]] for z in range(3)], float)
ORIGINS_M = np.array([[1.0, 1.0, 5.0], [9.0, 9.0, 5.0]])  # the first is above the triangles
DOWN = np.tile([0.0, 0.0, -2.0], (2, 1))


def caster(*rows: int) -> TriangleCaster:
    return TriangleCaster(CORNERS_M, np.array(rows, int), robust=True)


def test_hits_name_the_nearest_triangle_by_its_row_and_measure_in_lengths_of_the_direction():
    hits = caster(0, 1).hits(ORIGINS_M, DOWN, 100.0)
    np.testing.assert_array_equal(hits.face, [1, -1])
    np.testing.assert_allclose(hits.distance, [2, np.nan])
    np.testing.assert_array_equal(caster(2, 0).nearest(ORIGINS_M, DOWN, 100.0), [2, -1])


def test_values_are_interpolated_between_corners():
    hits = caster(1).hits(ORIGINS_M, DOWN, 100.0).take([0])
    np.testing.assert_allclose(hits.at(CORNERS_M), [[1, 1, 1]], rtol=1e-6)
    np.testing.assert_allclose(hits.at(CORNERS_M[..., 0]), [1], rtol=1e-6)


def test_a_ray_is_blocked_within_its_reach_only():
    for reach, is_blocked in ((1.9, False), (2.1, True), (-1.0, False)):
        assert caster(1).stops(ORIGINS_M, DOWN, reach).tolist() == [is_blocked, False]
    assert caster(1).stops(ORIGINS_M[[0, 0]], DOWN, np.array([1.9, 2.1])).tolist() == [False, True]


def test_without_triangles_nothing_is_hit():
    nothing = caster()
    assert nothing.hits(ORIGINS_M, DOWN, 100.0).face.tolist() == [-1, -1]
    assert not nothing.stops(ORIGINS_M, DOWN, 100.0).any()
