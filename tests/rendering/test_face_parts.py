"""Faces are divided along a grid into parts that cover them."""

import numpy as np
import pytest

from vobench.geometry.triangle import areas_m2
from vobench.rendering.face_parts import FaceParts, divided
from vobench.scene.mesh import quad
from vobench.scene.triangles import Thing, Triangles, triangle_table

FLOOR = Thing("floor", quad((0.0, 0, 0), (6.0, 0, 0), (0, 4.0, 0)), "grey")
SHEET = Thing("sheet", quad((1.0, 2.0, 0), (0, 0.5, 0), (0, 0, 0.5)), "grey")
FACES = triangle_table([FLOOR, SHEET], [-1, -1], [-1, -1])


def parts_of(side_m: float) -> tuple[FaceParts, Triangles]:
    parts = divided(FACES, np.arange(len(FACES)), np.full(len(FACES), side_m))
    return parts, parts.of(FACES)


@pytest.mark.parametrize("side_m", [0.7, 1.0, 2.5])
def test_parts_have_the_area_of_their_face_and_lie_in_one_cell(side_m: float) -> None:
    parts, table = parts_of(side_m)
    area_m2 = np.bincount(parts.parent, areas_m2(table.corners_m))
    np.testing.assert_allclose(area_m2, areas_m2(FACES.corners_m))
    extent_m = np.ptp(table.corners_m, axis=1)
    # Lines near the ends of a face are skipped, so that a part may be a quarter larger than a cell.
    assert extent_m.max() <= 1.25 * side_m + 1e-9


def test_a_face_smaller_than_a_cell_is_not_divided() -> None:
    parts, table = parts_of(100.0)
    np.testing.assert_array_equal(parts.parent, np.arange(len(FACES)))
    np.testing.assert_array_equal(table.corners_m, FACES.corners_m)


def test_parts_can_be_replaced_by_whole_faces() -> None:
    parts, _ = parts_of(1.0)
    is_whole = np.array([False, True, True, True])
    simplified, former = parts.with_whole(is_whole)
    assert simplified.parent.tolist() == sorted(simplified.parent)
    assert np.bincount(simplified.parent)[1:].tolist() == [1, 1, 1]
    np.testing.assert_array_equal(former < 0, is_whole[simplified.parent])
    kept = former[former >= 0]
    np.testing.assert_array_equal(simplified.weights[former >= 0], parts.weights[kept])
