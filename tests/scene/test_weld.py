"""Points that coincide are one, and closed bodies are told from open ones."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trimesh import Trimesh

from vobench.asset.shape import block
from vobench.scene.mesh import as_arrays, flipped, two_sided
from vobench.scene.weld import WELD_M, distinct_rows, is_closed_body, open_edges, welded


@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(-2, 2)), max_size=12))
def test_distinct_rows_are_those_of_numpy(pairs: list[tuple[int, int]]) -> None:
    rows = np.array(pairs, np.int64).reshape(-1, 2)
    expected, first_index, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    distinct = distinct_rows(rows)
    np.testing.assert_array_equal(rows[distinct.first_index], expected)
    np.testing.assert_array_equal(distinct.first_index, first_index)
    np.testing.assert_array_equal(distinct.inverse, inverse.ravel())


def test_points_within_the_weld_tolerance_are_one_and_others_are_not() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [WELD_M / 10, 0, 0], [1 + 3 * WELD_M, 0, 0]])
    first, index = welded(points)
    assert len(first) == 3
    assert index[0] == index[2]
    assert index[1] != index[3]
    np.testing.assert_allclose(points[first][index], points, atol=WELD_M)


def test_a_closed_body_has_no_open_edges_and_one_that_lacks_a_face_has_three() -> None:
    mesh = block((1.0, 2.0, 3.0))
    point = welded(as_arrays(mesh).vertices_m).inverse
    faces = point[mesh.faces]
    assert len(open_edges(faces)) == 0
    assert len(open_edges(faces[1:])) == 3
    assert set(open_edges(faces[1:]).ravel()) == set(faces[0])


@pytest.mark.parametrize(("change", "is_closed"), [(lambda m: m, True), (flipped, False), (two_sided, False)])
def test_a_body_is_closed_where_it_is_seen_from_outside(change: Callable[[Trimesh], Trimesh], is_closed: bool) -> None:
    assert is_closed_body(as_arrays(change(block((1.0, 2.0, 3.0))))) is is_closed


def test_a_body_that_lacks_a_face_is_open() -> None:
    whole = as_arrays(block((1.0, 2.0, 3.0)))
    assert not is_closed_body(replace(whole, faces=whole.faces[1:]))
